r"""The natural gradient of each unit: a step of a given size in what a unit does, not in the numbers that describe it.

The Fisher matrix $F = \mathbb E[ss']$ of the score $s$ says how far a change of parameters changes a policy. The
natural gradient $F^{-1}\nabla\eta$ (Amari, 1998; Kakade, 2001) is the steepest ascent by that measure. Units that draw
their actions independently have scores that are uncorrelated, so the matrix of a pool falls apart in a block for each
unit.
"""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from motorgrad._errors import check
from motorgrad._groups import by_group, check_groups
from motorgrad.learning._choose import Flag, where
from motorgrad.learning._schedule import Annealed, check_schedule
from motorgrad.policies import Policy, trainable

P = TypeVar("P", bound=Policy)
Blocks = tuple[Float[Array, "units parameters parameters"], ...]


class FisherState(NamedTuple):
    """`fisher`: the running matrices, as `Policy.fisher` gives them; `damping`: what is added to their diagonals."""

    fisher: Blocks
    damping: tuple[Float[Array, "units parameters"], ...]


@dataclasses.dataclass(frozen=True)
class FisherMetric:
    r"""A running Fisher matrix of each unit's own parameters, by whose inverse a gradient is multiplied.

    After every decision $F \leftarrow F + \rho\,(\mathbb E[ss' \mid y_t] - F)$, the mean being over the unit's own
    action where that is cheap (see `Policy.fisher`). Every step of the parameters takes the direction
    $(F + \operatorname{diag}\,d)^{-1} g$ in place of $g$. Units, and pools of units, keep out of each other's matrices.

    $F$ starts as `initial` times the identity and forgets that as $(1 - \rho)^t$, so that the first steps are those of
    the plain gradient. The first estimates themselves would be singular, and their inverse without bounds.

    **Arguments:**

    - `rate` $\rho \in (0, 1]$: the matrix is a mean over some $1/\rho$ decisions.
    - `damping` $d \ge 0$: one number, or one for every group of parameters by the name of the policy's field (groups
      left out have 0), each a number or an array that broadcasts to the field. In the units of $F$, one over the square
      of the parameter's. It bounds the step along parameters that the actions hardly depend on.
    - `initial` $\ge 0$, in the same units.
    - `kl` $\ge 0$, in nats: `None`, or how far one step of the parameters may take the policy, all units together. A
      step $\Delta$ of larger $\frac12 \Delta' F \Delta$, which to second order is the mean Kullback-Leibler divergence
      of the old policy from the new, is shortened to it, after the ascent rule. A number, or one that is `Annealed`.

    A parameter with neither information nor damping does not move. A matrix that is singular otherwise is inverted with
    as much damping, relative to its own diagonal, as rounding errors are worth, so that nothing is infinite.

    **Raises:** `ValueError` for what is out of its range; from `init`, for a damping without a field, or one whose
    shape does not fit its field.
    """

    rate: float = 1e-3
    damping: float | Mapping[str, Any] = 0.01
    initial: float = 1.0
    kl: float | Annealed | None = None

    def __post_init__(self) -> None:
        check(0 < self.rate <= 1, "rate", self.rate, "in (0, 1]")
        check_groups("damping" if isinstance(self.damping, Mapping) else "", "damping", self.damping)
        check(0 <= self.initial < math.inf, "initial", self.initial, "a finite number of at least 0")
        if self.kl is not None:
            check_schedule("kl", self.kl)

    def init(self, policy: Policy) -> FisherState:
        """The state before any decision."""
        parameters = trainable(policy)
        given = by_group("damping", "of all", self.damping, parameters, default=0.0)
        damping = policy.blocks(jax.tree.map(lambda d, p: jnp.broadcast_to(d, p.shape), given, parameters))
        return FisherState(tuple(_identities(block, self.initial) for block in damping), damping)

    def update(
        self,
        state: FisherState,
        policy: Policy,
        observation: Float[Array, " inputs"],
        action: Array,
        dropped: Flag = False,
    ) -> FisherState:
        """Take in one decision, unless it is `dropped`: what was seen, and the action that was drawn."""
        now = policy.fisher(observation, action)
        distances = [x - f for f, x in zip(state.fisher, now, strict=True)]
        steps = where(dropped, [jnp.zeros_like(x) for x in distances], [self.rate * x for x in distances])
        return state._replace(fisher=tuple(f + step for f, step in zip(state.fisher, steps, strict=True)))

    def renew(self, state: FisherState, new: Bool[Array, " units"]) -> FisherState:
        """Begin anew for the units that are `new`, in a policy that is one pool: they know nothing yet."""
        parts = zip(state.fisher, state.damping, strict=True)
        fisher = tuple(jnp.where(new[:, None, None], _identities(d, self.initial), f) for f, d in parts)
        return state._replace(fisher=fisher)

    def precondition(self, state: FisherState, policy: P, gradient: P) -> P:
        r"""$(F + \operatorname{diag}\,d)^{-1} g$, in the structure of the gradient."""
        parts = zip(state.fisher, state.damping, policy.blocks(gradient), strict=True)
        return policy.from_blocks(tuple(_solve(f, d, g, 16 + 1 / self.rate) for f, d, g in parts))

    def bounded(self, state: FisherState, policy: P, step: P, limit: Float[Array, ""]) -> P:
        """A step of the parameters, shortened where its divergence would be above the `limit`, in nats."""
        blocks = policy.blocks(step)
        longest = jnp.max(jnp.stack([jnp.max(jnp.abs(block), initial=0) for block in blocks]))
        longest = jnp.where(longest > 0, longest, 1)  # in units of which no square overflows
        parts = zip(state.fisher, blocks, strict=True)
        terms = [jnp.sum((f * (s / longest)[:, None, :]).sum(-1) * (s / longest)) for f, s in parts]
        divergence = 0.5 * sum(terms, start=jnp.zeros(()))
        some = divergence > 0
        most = jnp.sqrt(limit / jnp.where(some, divergence, 1)) / longest
        factor = jnp.where(some, jnp.minimum(most, 1), 1)
        return jax.tree.map(lambda x: (factor * x).astype(x.dtype), step)


def _identities(block: Float[Array, "units parameters"], scale: float) -> Float[Array, "units parameters parameters"]:
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
    # The solver reads by columns. Handed the transpose, which is the same, it needs no copy of every matrix by columns;
    # that copy would be made at every decision, not only in the loop of `where_any`.
    factor = jax.lax.linalg.cholesky(jnp.swapaxes(scaled, 1, 2), symmetrize_input=False)
    return scale * jax.scipy.linalg.cho_solve((factor, True), right[:, :, None])[:, :, 0]
