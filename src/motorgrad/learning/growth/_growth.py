"""The constructive algorithm: a pool to which units are added one by one while it learns."""

import math
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PyTree, UInt32

from motorgrad._branching import where
from motorgrad._errors import check
from motorgrad.learning.growth._criteria import Clock, Criterion
from motorgrad.learning.growth._visited import Visited, VisitedState, hash_bits
from motorgrad.policies import LocalUnits, Masked, Policy
from motorgrad.schema import Part, Range, count, inner, number, static

LONG = 2**30  # where the count of decisions since an addition stands still


class GrowthState(NamedTuple):
    """The state of growth.

    - `unit`: the newest unit's index in the pool, −1 where none was added.
    - `age`: decisions since then.
    - `salt`: a random number of the seed's own.
    - `criterion`: the state of the criterion.
    - `visited`: the memory of observations, `None` without one.
    """

    unit: Int[Array, ""]
    age: Int[Array, ""]
    salt: UInt32[Array, ""]
    criterion: PyTree
    visited: VisitedState | None


class Growth(Part):
    r"""Adds the units of a `Masked` pool one by one (section 6.4.3 of the thesis).

    A new unit starts large, so that it has an effect everywhere, and shrinks: in the **adding phase** its width is
    multiplied by `shrink` after every decision, down to `cutoff`. Meanwhile its steps are multiplied by `boost` and
    those of the other units by `damp`. The phase lasts as many decisions as the width takes from `width` to `cutoff` by
    itself, 7,588 by default; the unit's own learning adds to that. In the **learning phase** all units learn alike,
    until the `criterion` asks for the next one. The first unit is there from the start.

    Units that are active when learning begins stay, and count. The pool's units are added in their order. The whole
    step of the optimizer is scaled, so for every optimizer it is as if the learning rates were; so is a weight decay.

    **Raises:** `ValueError` for a value out of range or for a clock quicker than the adding phase; from `init` for a
    policy that is no `Masked` pool of local units, for a pool smaller than `units`, or a centre of another length.
    """

    presets: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "clock": {"criterion": "clock"},
        "plateau": {"criterion": "plateau"},
    }
    """Growth by a named criterion, for configurations and the command line."""

    criterion: Criterion = inner(Clock(), help="`Clock(interval)` or `Plateau(window, confidence, patience)`")
    units: int | None = count(
        None, 1, help="the number of units at which growth is complete; by default all of the pool"
    )
    centre: float | tuple[float, ...] = number(
        0.5, groups=True, help="where a unit starts, one number for all inputs or one for each"
    )
    placement: Visited | None = inner(
        None,
        help="none to start there, or `Visited(slots, every)` to start at an observation drawn from the recent ones: "
        "a unit has an effect only where the learner goes (section 6.5.4). The first unit starts at `centre`",
    )
    width: float = static(
        1.0,
        allowed=Range(0, open_low=True),
        help=r"width of a new unit, in the units of the inputs: $\sigma$ of Gaussians, half the length of boxes, the "
        r"radius of spheres, in every input. With `cutoff` and `shrink` it sets the length of the adding phase",
    )
    cutoff: float = static(
        0.15, allowed=Range(0, open_low=True), help="the width at which the adding phase ends, at most `width`"
    )
    shrink: float = static(
        0.99975,
        allowed=Range(0, 1, open_low=True, open_high=True),
        help="the factor on the width at every decision of the adding phase",
    )
    boost: float = number(8.0, 0, help="the factor on the steps of the newest unit in the adding phase")
    damp: float = number(0.5, 0, help="the factor on the steps of the other units meanwhile")

    def validate(self) -> None:
        check(self.cutoff <= self.width, "cutoff", self.cutoff, f"at most the width, {self.width}")
        wanted = "such that the adding phase has fewer than 1,073,741,824 decisions"
        check(self.adding < LONG, "shrink", self.shrink, wanted)
        self.criterion.check(self.adding)

    @property
    def adding(self) -> int:
        """The length of the adding phase, in decisions."""
        return math.ceil(math.log(self.cutoff / self.width) / math.log(self.shrink))

    def adds(self, state: GrowthState) -> Bool[Array, ""]:
        """Whether the newest unit is in its adding phase."""
        return state.age < self.adding

    def init(self, policy: Policy, key: jax.Array) -> tuple[GrowthState, Masked]:
        """The state before the first decision, and the policy with its first unit."""
        pool = _masked(policy)
        size = pool.outputs
        check((self.units or 1) <= size, "growth.units", self.units, f"at most the pool's, {size}")
        shape = np.shape(self.centre)
        check(shape in ((), (pool.inputs,)), "growth.centre", self.centre, f"one number or {pool.inputs} of them")
        dtype = _size(pool)[1].dtype
        state = GrowthState(
            unit=jnp.int32(-1),
            age=jnp.int32(LONG),
            salt=jax.random.bits(key, dtype=jnp.uint32),
            criterion=self.criterion.init(dtype),
            visited=None if self.placement is None else self.placement.init(pool.inputs, dtype),
        )
        state, pool, _ = self._add(state, pool, jnp.ones((), bool))
        return state, pool

    def observe(self, state: GrowthState, observation: Float[Array, " inputs"]) -> GrowthState:
        """The state after an action was chosen on an observation."""
        if self.placement is None or state.visited is None:
            return state
        return state._replace(visited=self.placement.observe(state.visited, observation, state.salt))

    def add_reward(self, state: GrowthState, reward: Float[Array, ""]) -> GrowthState:
        """The state after a reward."""
        return state._replace(criterion=self.criterion.add_reward(state.criterion, reward, ~self.adds(state)))

    def scale_updates(self, state: GrowthState, step: PyTree[Array]) -> PyTree[Array]:
        """A step of the parameters, scaled for each unit by the phase."""

        def scaled(leaf: Array) -> Array:
            newest = jnp.arange(leaf.shape[0]) == state.unit
            factor = jnp.where(self.adds(state), jnp.where(newest, self.boost, self.damp), 1)
            return factor.reshape(-1, *(1,) * (leaf.ndim - 1)).astype(leaf.dtype) * leaf

        return jax.tree.map(scaled, step)

    def advance(self, state: GrowthState, policy: Policy) -> tuple[GrowthState, Masked, Bool[Array, " units"]]:
        """After a decision and its step: shrink the newest unit or add one. Also says which unit was added."""
        pool = _masked(policy)
        pool = self._shrunk(state, pool)
        state = state._replace(age=jnp.minimum(state.age + 1, LONG))
        return self._add(state, pool, self.criterion.due(state.criterion, state.age))

    def _shrunk(self, state: GrowthState, pool: Masked) -> Masked:
        name, size = _size(pool)
        least = math.log(self.cutoff)
        newest = jnp.arange(pool.outputs) == state.unit
        smaller = (newest & self.adds(state)).reshape(-1, *(1,) * (size.ndim - 1)) & (size > least)
        shrunk = jnp.where(smaller, jnp.maximum(size + math.log(self.shrink), least), size)
        return eqx.tree_at(lambda each: getattr(each.pool, name), pool, shrunk)

    def _add(
        self, state: GrowthState, pool: Masked, due: Bool[Array, ""]
    ) -> tuple[GrowthState, Masked, Bool[Array, " units"]]:
        """Where one is `due` and there is room, activate the next unit at its starting place."""
        room = jnp.sum(pool.active) < (pool.outputs if self.units is None else self.units)
        place = jnp.argmin(pool.active).astype(jnp.int32)
        new = (jnp.arange(pool.outputs) == place) & due & room
        name, size = _size(pool)
        centres = pool.pool.centre  # type: ignore[attr-defined]
        start = jnp.broadcast_to(jnp.asarray(self.centre, centres.dtype), (pool.inputs,))
        if self.placement is not None and state.visited is not None:
            start = self.placement.draw(state.visited, hash_bits(state.salt), start)
        column = new.reshape(-1, *(1,) * (size.ndim - 1))
        pool = eqx.tree_at(
            lambda each: (each.pool.centre, getattr(each.pool, name), each.active),
            pool,
            (jnp.where(new[:, None], start, centres), jnp.where(column, math.log(self.width), size), pool.active | new),
        )
        added = due & room
        fresh = state._replace(unit=place, age=jnp.int32(0), criterion=self.criterion.renew(state.criterion))
        return where(added, fresh, state), pool, new


def _masked(policy: Policy) -> Masked:
    kind = type(policy.pool).__name__ if isinstance(policy, Masked) else type(policy).__name__
    grows = isinstance(policy, Masked) and isinstance(policy.pool, LocalUnits) and policy.pool.resizable
    check(grows, "policy of a growing learner", kind, "a Masked pool of local units that keep their height")
    assert isinstance(policy, Masked)
    return policy


def _size(pool: Masked) -> tuple[str, Array]:
    """The name and the value of the field with the logarithm of the units' size."""
    name = pool.pool.size_field  # type: ignore[attr-defined]
    return name, getattr(pool.pool, name)
