r"""The natural gradient of networks: the whole Fisher matrix, by its products with vectors alone.

A network of 40,000 parameters has a Fisher matrix of 1.6 billion entries. Conjugate gradients (Hestenes & Stiefel,
1952) solve $Fx = g$ without it: they need $Fv$ for some five vectors $v$, and each takes as long as two scores of the
decisions in question (Martens, 2010; Schulman et al., 2015).
"""

from collections.abc import Callable
from functools import partial
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PyTree

from motorgrad._running import counted_round
from motorgrad.learning._baselines import Transition
from motorgrad.learning._branching import Flag, where, where_any
from motorgrad.learning._chain import Updates, inner
from motorgrad.learning._natural import LimitedMetric
from motorgrad.learning._schedules import Annealed, Steps
from motorgrad.learning._surrogate import empty_rows
from motorgrad.policies import Policy, abilities, split
from motorgrad.schema import count, number


class Recent(NamedTuple):
    """The last decisions, in a ring buffer. `seen` counts decisions, and so gives the next place and what is filled."""

    observations: Float[Array, "memory inputs"]
    actions: Array
    seen: Int[Array, ""]


class ConjugateGradient(LimitedMetric):
    r"""The Fisher matrix of all parameters over the last decisions, whose inverse multiplies the gradient.

    Every step of the parameters takes the direction $(F + dI)^{-1} g$ in place of $g$, where $F$ is the mean over the
    last decisions, with the present policy. Unlike `FisherMetric` it has no blocks: the parameters of all units and
    layers are correlated as they are. It takes any policy, and any module in a `Network`.

    The solution is that of some iterations of conjugate gradients, from 0. After few, it follows those directions along
    which the policy changes most, and leaves out those about which the decisions say little.

    **Raises:** `ValueError` for a value out of range.
    """

    needs_decision: ClassVar[bool] = True

    memory: int = count(
        1000,
        1,
        1_000_000,
        unit="decisions",
        help="over how many of the last decisions $F$ is a mean; of a learner that improves once a batch best its "
        "batch",
    )
    iterations: int = count(5, 1, 10_000, help="greatest number of iterations of conjugate gradients")
    damping: float = number(0.1, 0, help="$d$, in the units of $F$")
    kl: float | Annealed | None = number(
        None, 0, unit="nats", help="none, or how far one step may change the policy, as in `FisherMetric`"
    )

    def init(self, policy: Policy) -> Recent:
        return Recent(*empty_rows(policy, self.memory), jnp.zeros((), jnp.int32))

    def observe(self, state: Recent, policy: Policy, transition: Transition) -> Recent:
        place = state.seen % self.memory
        # What diverged is written, too, and overwritten by the next: it is not counted.
        observations = state.observations.at[place].set(transition.observation.astype(state.observations.dtype))
        actions = state.actions.at[place].set(transition.action.astype(state.actions.dtype))
        following = counted_round(state.seen + 1, self.memory)
        return Recent(observations, actions, where(transition.diverged, state.seen, following))

    def update(
        self, updates: Updates, state: Recent, policy: Policy, steps: Steps, due: Flag
    ) -> tuple[Updates, Recent]:
        def direction(g: Updates) -> Updates:
            # The barrier keeps the compiler from working ahead of the loop in `where_any`.
            return self.precondition(*jax.lax.optimization_barrier((state, policy, g)))

        return where_any(due, direction, updates), state

    def precondition(self, state: Recent, policy: Policy, gradient: PyTree) -> PyTree:
        r"""$(F + dI)^{-1} g$, in the structure of the gradient."""
        product = self._product(state, policy)

        def damped(vector: PyTree) -> PyTree:
            return jax.tree.map(lambda along, v: along + self.damping * v, product(vector), vector)

        found, _ = jax.scipy.sparse.linalg.cg(damped, gradient, maxiter=self.iterations)
        return jax.tree.map(lambda x, g: x.astype(g.dtype), found, gradient)

    def divergence(self, state: Recent, policy: Policy, step: PyTree) -> Float[Array, ""]:
        product = self._product(state, policy)(step)
        return 0.5 * inner(product, step)

    def _product(self, state: Recent, policy: Policy) -> Callable[[PyTree], PyTree]:
        r"""The function $v \mapsto Fv$."""
        learned, settings = split(policy)
        known = jnp.minimum(state.seen, self.memory)
        root = jax.lax.rsqrt(jnp.maximum(known, 1).astype(state.observations.dtype))
        share = jnp.where(jnp.arange(self.memory) < known, root, 0)

        def coordinates(parameters: PyTree) -> Float[Array, "memory coordinates"]:
            present = eqx.combine(parameters, settings)
            found = jax.vmap(partial(abilities.fisher_coordinates, present))(state.observations, state.actions)
            return share[:, None].astype(found.dtype) * found

        _, push = jax.linearize(coordinates, learned)
        pull = jax.linear_transpose(push, learned)
        return lambda vector: pull(push(vector))[0]
