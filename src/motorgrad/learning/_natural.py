r"""The natural gradient of each unit: steps of a given size in behaviour, not in parameters.

The Fisher matrix $F = \mathbb E[ss']$ of the score $s$ says how far a change of parameters changes a policy. The
natural gradient $F^{-1}\nabla\eta$ (Amari, 1998; Kakade, 2001) is the steepest ascent by that measure. Units that draw
their actions independently have uncorrelated scores, so the matrix of a pool consists of one block for each unit.
"""

import abc
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Int, PyTree

from motorgrad._branching import NEVER, Flag, Scalar, where, where_any
from motorgrad._errors import check
from motorgrad._groups import by_group
from motorgrad._linear_algebra import positive_solve
from motorgrad.learning._chain import Transformation, Updates
from motorgrad.learning._gradients import empty_rows
from motorgrad.learning._learner import Transition
from motorgrad.learning._schedules import Annealed, Steps, at
from motorgrad.policies import Policy, abilities, trainable
from motorgrad.schema import count, number

MAX_BLOCK_PARAMETERS = 4096
"""The matrix of a block has their square."""

Blocks = tuple[Float[Array, "units parameters parameters"], ...]
ShapedRows = Float[Array, "units parameters"] | jax.ShapeDtypeStruct


class Gathering(NamedTuple):
    """A running Fisher matrix, and the decisions that it has yet to take in; `waiting` is their number."""

    blocks: Blocks
    observations: Float[Array, "interval inputs"]
    actions: Array
    waiting: Int[Array, ""]


def _blocks(state: Blocks | Gathering) -> Blocks:
    return state.blocks if isinstance(state, Gathering) else state


class Metric(Transformation):
    """The measure of distance between policies by which a gradient is the steepest ascent."""

    reads_gradient: ClassVar[bool] = True
    """Whether a step depends on the gradient, and not on the scores that it observes alone."""


class LimitedMetric(Metric):
    """A metric that can limit how far a step changes the policy."""

    kl: eqx.AbstractVar[float | Annealed | None]

    @abc.abstractmethod
    def divergence(self, state: PyTree, policy: Policy, step: PyTree) -> Float[Array, ""]:
        r"""$\frac12 \Delta' F \Delta$ of a step of the parameters, in nats."""

    def constrain(self, updates: Updates, state: PyTree, policy: Policy, steps: Steps, due: Flag) -> Updates:
        if self.kl is None:
            return updates
        limit = at(self.kl, steps)

        def bounded(step: Updates) -> Updates:
            # The barrier keeps the compiler from working ahead of the loop in `where_any`.
            return self.bounded(*jax.lax.optimization_barrier((state, policy, step, limit)))

        return where_any(due, bounded, updates)

    def bounded(self, state: PyTree, policy: Policy, step: PyTree, limit: Float[Array, ""]) -> PyTree:
        """A step of the parameters, shortened where its divergence exceeds the `limit`, in nats."""
        longest = jnp.max(jnp.stack([jnp.max(jnp.abs(leaf), initial=0) for leaf in jax.tree.leaves(step)]))
        longest = jnp.where(longest > 0, longest, 1)  # in units of which no square overflows
        divergence = self.divergence(state, policy, jax.tree.map(lambda x: x / longest, step))
        some = divergence > 0
        most = jnp.sqrt(limit / jnp.where(some, divergence, 1)) / longest
        factor = jnp.where(some, jnp.minimum(most, 1), 1)
        return jax.tree.map(lambda x: (factor * x).astype(x.dtype), step)


class FisherMetric(LimitedMetric):
    r"""A running Fisher matrix of each unit's own parameters, whose inverse multiplies the gradient.

    After every decision $F \leftarrow F + \rho\,(\mathbb E[ss' \mid y_t] - F)$, where the expectation is over the
    unit's own action where that is cheap (see `abilities.fisher`). Every step of the parameters takes the direction
    $(F + \operatorname{diag}\,d)^{-1} g$ in place of $g$. Units, and pools of units, do not share matrices.

    $F$ starts as `initial` times the identity and forgets that as $(1 - \rho)^t$, so that the first steps are those of
    the plain gradient. The first estimates themselves would be singular, with unbounded inverses.

    A parameter with neither information nor damping does not move. A matrix that is singular otherwise is inverted with
    as much damping, relative to its own diagonal, as rounding errors are worth, so that nothing is infinite.

    **Raises:** `ValueError` for a value out of range; from `init`, for a damping without a field, or one whose shape
    does not fit its field, and for a policy with more than 4,096 parameters in a block.
    """

    rate: float = number(
        1e-3, 0, 1, open_low=True, help=r"rate of forgetting $\rho$; the matrix is a mean over about $1/\rho$ decisions"
    )
    damping: float | dict[str, Any] = number(
        0.01,
        0,
        groups=True,
        help="$d$, one number, or a mapping from names of the policy's fields to numbers or arrays that broadcast to "
        "the field (fields left out have 0). It has the units of $F$, one over the square of the parameter's, and "
        "bounds the step along parameters on which the actions hardly depend",
    )
    initial: float = number(1.0, 0, at_start=True, help="first diagonal of $F$, in the same units")
    interval: int = count(
        1,
        1,
        100_000,
        unit="decisions",
        help="how many decisions the matrix takes in at once, each with its own weight: more are faster for units "
        "with many parameters. A step of the parameters first takes in those that wait, with the policy of that "
        "moment, so the result is the same for a learner that improves once a batch",
    )
    kl: float | Annealed | None = number(
        None,
        0,
        unit="nats",
        help=r"none, or how far one step may change the policy, all units together. A step $\Delta$ of larger "
        r"$\frac12 \Delta' F \Delta$, to second order the mean Kullback-Leibler divergence of the old policy from the "
        r"new, is shortened to it after the optimizer",
    )

    @property
    def takes_batches(self) -> bool:
        return self.interval == 1

    def init(self, policy: Policy) -> Blocks | Gathering:
        blocks = first_blocks(policy, jax.eval_shape(self._dampings, policy), self.initial, "ConjugateGradient")
        if self.interval == 1:
            return blocks
        return Gathering(blocks, *empty_rows(policy, self.interval), jnp.zeros((), jnp.int32))

    def observe(self, state: Blocks | Gathering, policy: Policy, transition: Transition) -> Blocks | Gathering:
        if isinstance(state, Gathering):
            place = jnp.arange(self.interval) == state.waiting  # there is room: `solve` has emptied what was full
            dropped = transition.diverged
            now = [(state.observations, transition.observation), (state.actions, transition.action)]
            kept = [jnp.where(place.reshape(-1, *(1,) * row.ndim), row.astype(rows.dtype), rows) for rows, row in now]
            kept = where(dropped, [state.observations, state.actions], kept)
            return state._replace(
                observations=kept[0], actions=kept[1], waiting=where(dropped, state.waiting, state.waiting + 1)
            )
        now = abilities.fisher(policy, transition.observation, transition.action)
        distances = [x - f for f, x in zip(state, now, strict=True)]
        zeros = [jnp.zeros_like(x) for x in distances]
        steps = where(transition.diverged, zeros, [self.rate * x for x in distances])
        return tuple(f + step for f, step in zip(state, steps, strict=True))

    def solve(self, state: Blocks | Gathering, policy: Policy, due: Flag) -> Blocks | Gathering:
        """Take in the decisions that wait, if there is no room for more or a step is `due`."""
        if not isinstance(state, Gathering):
            return state
        # Without the blocks, which would be copied at every decision if they were in the loop twice.
        given = (state.observations, state.actions, policy)

        def take_in(old: tuple[Blocks, Array]) -> tuple[Blocks, Array]:
            # The barrier keeps the compiler from working ahead of the loop in `where_any`.
            (blocks, waiting) = old
            (observations, actions, policy) = jax.lax.optimization_barrier(given)
            return self._taken_in(blocks, policy, observations, actions, waiting), waiting * 0

        full = jnp.logical_or(due, self.decisions_until_due(state) < 0)
        blocks, waiting = where_any(full & (state.waiting > 0), take_in, (state.blocks, state.waiting))
        return state._replace(blocks=blocks, waiting=waiting)

    def observe_batch(self, state: Blocks, policy: Policy, observations: Array, actions: Array) -> Blocks:
        return self._taken_in(state, policy, observations, actions, jnp.asarray(len(observations)))

    def _taken_in(
        self, blocks: Blocks, policy: Policy, observations: Array, actions: Array, count: Int[Array, ""]
    ) -> Blocks:
        """The matrices after the first `count` of these decisions, each with its own weight."""
        rate = jnp.asarray(self.rate, observations.dtype)
        since = count - 1 - jnp.arange(len(observations))
        weights = jnp.where(since >= 0, rate * (1 - rate) ** jnp.maximum(since, 0), 0)
        added = abilities.fisher_sum(policy, observations, actions, weights)
        kept = (1 - rate) ** count
        return tuple(kept * f + more for f, more in zip(blocks, added, strict=True))

    def decisions_until_due(self, state: Blocks | Gathering) -> Int[Array, ""]:
        never = jnp.asarray(NEVER, jnp.int32)
        return self.interval - 1 - state.waiting if isinstance(state, Gathering) else never

    def update(
        self, updates: Updates, state: Blocks | Gathering, policy: Policy, steps: Steps, due: Flag
    ) -> tuple[Updates, Blocks | Gathering]:
        blocks = _blocks(state)

        def direction(g: Updates) -> Updates:
            # The barrier keeps the compiler from solving ahead of the loop in `where_any`.
            return self.precondition(*jax.lax.optimization_barrier((blocks, policy, g)))

        return where_any(due, direction, updates), state

    def constrain(
        self, updates: Updates, state: Blocks | Gathering, policy: Policy, steps: Steps, due: Flag
    ) -> Updates:
        return super().constrain(updates, _blocks(state), policy, steps, due)

    def after_growth(self, state: Blocks | Gathering, new: Bool[Array, " units"]) -> Blocks | Gathering:
        blocks = tuple(
            jnp.where(new[:, None, None], identities(block[:, 0], self.initial), block) for block in _blocks(state)
        )
        return state._replace(blocks=blocks) if isinstance(state, Gathering) else blocks

    def precondition(self, state: Blocks, policy: Policy, gradient: PyTree) -> PyTree:
        r"""$(F + \operatorname{diag}\,d)^{-1} g$, in the structure of the gradient."""
        parts = zip(state, self._dampings(policy), abilities.blocks(policy, gradient), strict=True)
        return abilities.from_blocks(policy, tuple(_solve(f, d, g, 16 + 1 / self.rate) for f, d, g in parts))

    def divergence(self, state: Blocks, policy: Policy, step: PyTree) -> Float[Array, ""]:
        parts = zip(state, abilities.blocks(policy, step), strict=True)
        return 0.5 * sum((jnp.sum((f * s[:, None, :]).sum(-1) * s) for f, s in parts), start=jnp.zeros(()))

    def _dampings(self, policy: Policy) -> tuple[Float[Array, "units parameters"], ...]:
        parameters = trainable(policy)
        given = by_group("damping", "of all", self.damping, parameters, default=0.0)
        return abilities.blocks(policy, jax.tree.map(lambda d, p: jnp.broadcast_to(d, p.shape), given, parameters))


def zeros_of(policy: Policy) -> Float[Array, " parameters"]:
    """A zero for each parameter of a policy, as one vector. **Raises** `ValueError` for more than 4,096."""
    zeros = jnp.zeros_like(ravel_pytree(trainable(policy))[0])
    few = f"one of at most {MAX_BLOCK_PARAMETERS:,} parameters; CompatibleWeights takes any"
    check(zeros.size <= MAX_BLOCK_PARAMETERS, "policy", f"{type(policy).__name__} of {zeros.size:,} parameters", few)
    return zeros


def first_blocks(policy: Policy, rows: tuple[ShapedRows, ...], scale: Scalar, other: str) -> Blocks:
    """`scale` times the identity matrix for each unit of a policy, whose blocks have these `rows`. **Raises**
    `ValueError` for more than 4,096 parameters in one, and names the `other` metric that takes them."""
    widest = max(row.shape[1] for row in rows)
    given = f"{type(policy).__name__} with a block of {widest:,} parameters"
    smaller = f"one whose blocks have at most {MAX_BLOCK_PARAMETERS:,} parameters; {other} takes any"
    check(widest <= MAX_BLOCK_PARAMETERS, "policy", given, smaller)
    return tuple(identities(row, scale) for row in rows)


def identities(block: ShapedRows, scale: Scalar) -> Float[Array, "units parameters parameters"]:
    """`scale` times the identity matrix, for each unit."""
    units, size = block.shape
    return jnp.broadcast_to(scale * jnp.eye(size, dtype=block.dtype), (units, size, size))


def _solve(
    fisher: Float[Array, "units parameters parameters"],
    damping: Float[Array, "units parameters"],
    gradient: Float[Array, "units parameters"],
    roundings: float,
) -> Float[Array, "units parameters"]:
    """Solve every unit's system, each parameter in units in which the diagonal is 1.

    So scaled, what is singular is so whatever the units of the parameters, and needs the same small damping: as much as
    the entries of a running mean may be wrong by, when so many `roundings` of them have added up.
    """
    size = gradient.shape[1]
    diagonal = jnp.diagonal(fisher, axis1=1, axis2=2) + damping
    informed = diagonal > 0
    scale = jnp.where(informed, jax.lax.rsqrt(jnp.where(informed, diagonal, 1)), 0)
    if size <= 1:
        return scale * (scale * gradient)
    one = 1 + roundings * size * jnp.finfo(gradient.dtype).eps
    right = scale * gradient
    if size == 2:
        across = (scale[:, 0] * fisher[:, 0, 1] * scale[:, 1])[:, None]
        factor = 1 / (one * one - across * across)
        return scale * factor * (one * right - across * right[:, ::-1])
    scaled = scale[:, :, None] * fisher * scale[:, None, :]
    scaled = jnp.where(jnp.eye(size, dtype=bool), one, scaled)
    return scale * jax.vmap(positive_solve)(scaled, right)
