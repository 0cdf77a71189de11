"""The constructive algorithm: a pool that gets its units one by one while it learns."""

import dataclasses
import math
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PyTree, UInt32

from motorgrad._errors import check
from motorgrad.learning._growth_criteria import Clock, Criterion
from motorgrad.learning._visited import Visited, VisitedState, mixed
from motorgrad.policies import LocalUnits, Masked, Policy

LONG = 2**30  # where the count of decisions since an addition stands still


class GrowthState(NamedTuple):
    """`unit`: the newest unit's place in the pool, −1 where none was added; `age`: decisions since; `salt`: a number of
    the seed's own; `criterion`: the criterion's state; `visited`: the memory of observations, `None` without one."""

    unit: Int[Array, ""]
    age: Int[Array, ""]
    salt: UInt32[Array, ""]
    criterion: Any
    visited: VisitedState | None


@dataclasses.dataclass(frozen=True)
class Growth:
    r"""Adds the units of a `Masked` pool one by one (section 6.4.3 of the thesis).

    A new unit starts large, so that it is felt everywhere, and shrinks: in the **adding phase** its width is
    multiplied by `shrink` after every decision, down to `cutoff`. Meanwhile its steps are `boost` times and those of
    the other units `damp` times as long. The phase has as many decisions as the width takes from `width` to `cutoff` by
    itself, 7,588 by default; the unit's own learning adds to that. In the **learning phase** all units learn alike,
    until the `criterion` wants the next one. The first is there from the start.

    Units that are there when learning begins stay, and count. The pool's units are taken in their order. The whole step
    of the ascent rule is scaled, so for every rule it is as if the step sizes were; so is a decay of parameters.

    **Arguments:**

    - `criterion`: `Clock(interval)` or `Plateau(window, confidence, patience)`.
    - `units`: with how many units growth is complete; by default all of the pool.
    - `centre`: where a unit starts, one number for all inputs or one for each.
    - `placement`: `None` to start there, or `Visited(slots, every)` to start at an observation drawn from those of
      late: a unit has an effect only where the learner goes (section 6.5.4). The first unit starts at `centre`.
    - `width` and `cutoff`, positive, in the units of the inputs, `cutoff` at most `width`: $\sigma$ of Gaussians, half
      the length of boxes, the radius of spheres, in every input.
    - `shrink` in (0, 1), per decision; `boost` and `damp`, at least 0.

    **Raises:** `ValueError` for what is out of its range or for a clock quicker than the adding phase; from `init` for
    a policy that is no `Masked` pool of local units, for a pool smaller than `units`, or a centre of another length.
    """

    criterion: Criterion = dataclasses.field(default_factory=Clock)
    units: int | None = None
    centre: float | tuple[float, ...] = 0.5
    placement: Visited | None = None
    width: float = 1.0
    cutoff: float = 0.15
    shrink: float = 0.99975
    boost: float = 8.0
    damp: float = 0.5

    def __post_init__(self) -> None:
        check(isinstance(self.criterion, Criterion), "criterion", self.criterion, "a criterion, such as Clock(10_000)")
        check(self.units is None or self.units >= 1, "units", self.units, "at least 1, or None for all of the pool")
        check(bool(np.all(np.isfinite(self.centre))), "centre", self.centre, "finite")
        known = self.placement is None or isinstance(self.placement, Visited)
        check(known, "placement", self.placement, "None or Visited()")
        check(0 < self.width < math.inf, "width", self.width, "positive")
        check(0 < self.cutoff <= self.width, "cutoff", self.cutoff, f"positive and at most the width, {self.width}")
        check(0 < self.shrink < 1, "shrink", self.shrink, "in (0, 1)")
        for name in ("boost", "damp"):
            check(0 <= getattr(self, name) < math.inf, name, getattr(self, name), "a finite number of at least 0")
        wanted = "such that the adding phase has fewer than 1,073,741,824 decisions"
        check(self.adding < LONG, "shrink", self.shrink, wanted)
        self.criterion.check(self.adding)

    @property
    def adding(self) -> int:
        """How many decisions the adding phase has."""
        return math.ceil(math.log(self.cutoff / self.width) / math.log(self.shrink))

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

    def see(self, state: GrowthState, observation: Float[Array, " inputs"]) -> GrowthState:
        """Take in an observation, as the action on it is taken."""
        if self.placement is None or state.visited is None:
            return state
        return state._replace(visited=self.placement.see(state.visited, observation, state.salt))

    def watch(self, state: GrowthState, reward: Float[Array, ""]) -> GrowthState:
        """Take in a reward."""
        return state._replace(criterion=self.criterion.watch(state.criterion, reward, state.age >= self.adding))

    def paced(self, state: GrowthState, step: PyTree[Array]) -> PyTree[Array]:
        """A step of the parameters, as long as the phase wants it for each unit."""

        def scaled(leaf: Array) -> Array:
            newest = jnp.arange(leaf.shape[0]) == state.unit
            factor = jnp.where(state.age < self.adding, jnp.where(newest, self.boost, self.damp), 1)
            return factor.reshape(-1, *(1,) * (leaf.ndim - 1)).astype(leaf.dtype) * leaf

        return jax.tree.map(scaled, step)

    def advance(self, state: GrowthState, policy: Policy) -> tuple[GrowthState, Masked, Bool[Array, " units"]]:
        """A decision is over, and its step made: shrink the newest unit or add one; also says which was added."""
        pool = _masked(policy)
        state, pool = state._replace(age=jnp.minimum(state.age + 1, LONG)), self._shrunk(state, pool)
        return self._add(state, pool, self.criterion.due(state.criterion, state.age))

    def _shrunk(self, state: GrowthState, pool: Masked) -> Masked:
        name, size = _size(pool)
        least = math.log(self.cutoff)
        newest = jnp.arange(pool.outputs) == state.unit
        smaller = (newest & (state.age < self.adding)).reshape(-1, *(1,) * (size.ndim - 1)) & (size > least)
        shrunk = jnp.where(smaller, jnp.maximum(size + math.log(self.shrink), least), size)
        return eqx.tree_at(lambda each: getattr(each.pool, name), pool, shrunk)

    def _add(
        self, state: GrowthState, pool: Masked, due: Bool[Array, ""]
    ) -> tuple[GrowthState, Masked, Bool[Array, " units"]]:
        """Where one is `due` and there is room, switch the next unit on at its start."""
        room = jnp.sum(pool.active) < (pool.outputs if self.units is None else self.units)
        place = jnp.argmin(pool.active).astype(jnp.int32)
        new = (jnp.arange(pool.outputs) == place) & due & room
        name, size = _size(pool)
        centres = pool.pool.centre  # type: ignore[attr-defined]
        start = jnp.broadcast_to(jnp.asarray(self.centre, centres.dtype), (pool.inputs,))
        if self.placement is not None and state.visited is not None:
            start = self.placement.draw(state.visited, mixed(state.salt), start)
        column = new.reshape(-1, *(1,) * (size.ndim - 1))
        pool = eqx.tree_at(
            lambda each: (each.pool.centre, getattr(each.pool, name), each.active),
            pool,
            (
                jnp.where(new[:, None], start, centres),
                jnp.where(column, math.log(self.width), size),
                pool.active | new,
            ),
        )
        added = due & room
        fresh = state._replace(unit=place, age=jnp.int32(0), criterion=self.criterion.renew(state.criterion))
        return jax.tree.map(lambda a, b: jnp.where(added, a, b), fresh, state), pool, new


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
