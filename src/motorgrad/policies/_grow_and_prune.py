"""Pools that change their number of units: masks, growing and pruning."""

import math
from typing import Literal, Self, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool, Float, PyTree
from numpy.typing import ArrayLike

from motorgrad._errors import check
from motorgrad.policies import abilities
from motorgrad.policies._arguments import SizedTask, sizes
from motorgrad.policies._binary import BinaryUnits
from motorgrad.policies._graded import GradedUnits
from motorgrad.policies._local import GAUSSIANS, LocalUnits, Pair
from motorgrad.policies._oriented import OrientedBoxes, OrientedGaussians
from motorgrad.policies._parameters import fixed, in_structure, is_plain, per_unit, with_fields
from motorgrad.policies._policy import Composed, Policy, check_plain, has_rows, with_interface
from motorgrad.policies._soft_shapes import SoftBoxes, SoftSpheres
from motorgrad.policies._starting import POSITIVE, SHARE_ABOVE_0, Initial, InitialPolicy, function_of
from motorgrad.policies.abilities import Regions
from motorgrad.schema import count, static

T = TypeVar("T")
AnyPolicy = TypeVar("AnyPolicy", bound=Policy)
AnyPool = TypeVar("AnyPool", bound=BinaryUnits)


class Masked(Composed, BinaryUnits):
    r"""A pool some of whose units are switched off, by a mask that is data.

    A unit that is off never fires, its score and Fisher matrix are zero, and no update rule moves its parameters, not
    even by weight decay. The other units are unaffected. The arrays keep their shapes, so that units can be switched on
    and off within one compiled loop, differently for each seed (section 6.4.3 of the thesis). For pools that grow
    between trainings, without the cost of units to come, see `grow`.

    An action in which a switched-off unit fires has probability 0; `enumerate` lists it nevertheless.

    **Arguments:** `pool`, independent units, each with parameters of its own; `active`, `(units,)`, true for the units
    that are on, by default all.

    **Example:**

    ```python
    pool = LocalGaussians(centre=[[0.2], [0.5], [0.9]], log_width=[[-1.5]] * 3)
    Masked(pool, [True, False, True]).prob(jnp.array([0.5]))  # [0.41, 0.0, 0.2]
    ```
    """

    pool: BinaryUnits
    active: Bool[Array, " units"] = fixed(default=None)

    def __init__(self, pool: BinaryUnits, active: ArrayLike | None = None):
        check(isinstance(pool, BinaryUnits), "pool", type(pool).__name__, "a pool of binary units")
        check_plain("pool", pool)
        own = pool.independent and has_rows(pool)
        check(own, "pool", type(pool).__name__, "a pool of independent units with parameters of their own")
        active = jnp.ones(pool.outputs, bool) if active is None else jnp.asarray(active)
        check(active.dtype == bool, "active", active.dtype.name, "true or false for each unit")
        check(active.shape == (pool.outputs,), "active", active.shape, f"of shape {(pool.outputs,)}")
        self.pool, self.active = pool, active

    @property
    def inputs(self) -> int:
        return self.pool.inputs

    @property
    def outputs(self) -> int:
        return self.pool.outputs

    def _masked(self, tree: T) -> T:
        """Zero the rows of switched-off units."""
        return jax.tree.map(lambda x: jnp.where(per_unit(self.active, x), x, 0), tree)

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        return self._masked(self.pool.prob(observation))

    def log_probs(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, " units"]:
        impossible = jnp.where(action > 0, -jnp.inf, 0)
        return jnp.where(self.active, self.pool.log_probs(observation, action), impossible)

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Self:
        return in_structure(self, pool=self._masked(self.pool.score(observation, action)))

    def fisher(
        self, observation: Float[Array, " inputs"], action: Float[Array, " units"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        """The pool's matrices, zero for switched-off units."""
        return self._masked(abilities.fisher(self.pool, observation, action))

    def allowed(self, step: PyTree) -> PyTree:
        return with_fields(step, pool=self._masked(abilities.allowed(self.pool, step.pool)))

    def regions(self) -> Regions | None:
        regions = abilities.regions(self.pool)
        return None if regions is None else regions._replace(active=regions.active & np.asarray(self.active))


class InitialGrowing(InitialPolicy):
    """A pool of local units that are all switched off, for a learner that grows (`motorgrad.learning.Growth`).

    The learner places the units and switches them on.
    """

    units: int | None = count(None, 1, help="the size of the pool, by default one unit for each action of the task")
    shape: Literal["gaussians", "oriented-gaussians", "soft-spheres", "soft-boxes", "oriented-boxes"] = static(
        "gaussians", help="the kind of local units"
    )
    p_max: float = static(
        0.5, allowed=SHARE_ABOVE_0, help="the probability of firing at a unit's centre; of Gaussians only"
    )
    hardness: float = static(
        10.0,
        allowed=POSITIVE,
        help="how steeply the probability falls at a unit's surface; of soft spheres and boxes only",
    )
    pair: Pair = static(
        "exact", help="printed for the biased score that the thesis prints (`PrintedGaussians`); of Gaussians only"
    )

    def validate(self) -> None:
        super().validate()
        fits = self.pair == "exact" or self.shape == "gaussians"
        check(fits, "pair", self.pair, f"exact for {self.shape}")

    def start(self, task: SizedTask | int) -> Initial:
        inputs, outputs = sizes(task, self.units)
        centre = jnp.zeros((outputs, inputs))
        log_hardness = jnp.full(outputs, math.log(self.hardness))
        pool: LocalUnits
        if self.shape in ("gaussians", "oriented-gaussians"):
            gaussians = GAUSSIANS[self.pair](centre, centre, p_max=jnp.asarray(self.p_max))
            pool = gaussians if self.shape == "gaussians" else OrientedGaussians.of(gaussians)
        elif self.shape == "soft-spheres":
            pool = SoftSpheres(centre, jnp.zeros(outputs), log_hardness)
        else:
            boxes = SoftBoxes(centre, centre, log_hardness)
            pool = boxes if self.shape == "soft-boxes" else OrientedBoxes.of(boxes)
        return Masked(pool, jnp.zeros(outputs, bool))


growing = function_of(InitialGrowing)


def grow(pool: AnyPolicy, more: AnyPolicy) -> AnyPolicy:
    """Append the units of `more` to a pool.

    Arrays that lead with the units are concatenated. Other arrays are settings shared by all units, such as a common
    height; they must be equal. For the pools of many seeds, whose arrays have a leading axis, use `jax.vmap(grow)`.

    **Arguments:** `pool` and `more`, two pools of the same kind of binary or graded units, over the same inputs. Their
    `interface` is left out, as the actions are others.

    **Raises:** `ValueError` for policies that are not such pools, for pools of two kinds, and for shared settings that
    differ.

    **Example:**

    ```python
    grow(Motoneurons([0.3], [9.0]), Motoneurons([0.8], [0.0])).threshold  # [0.3, 0.8]
    ```
    """
    pool = with_interface(pool, None)
    more = with_interface(more, None)
    kinds = [type(each).__name__ for each in (pool, more)]
    check(type(pool) is type(more), "more", kinds[1], f"of the pool's kind, {kinds[0]}")
    wanted = "a pool of one kind of units, binary or graded"
    check(isinstance(pool, BinaryUnits | GradedUnits) and is_plain(pool), "pool", kinds[0], wanted)
    check(pool.inputs == more.inputs, "more.inputs", more.inputs, f"the pool's, {pool.inputs}")

    def joined(name: str) -> jax.Array:
        own = getattr(pool, name)
        new = getattr(more, name)
        if own.shape[:1] == (pool.outputs,) and new.shape[:1] == (more.outputs,):
            return jnp.concatenate([own, new])
        check(own.shape == new.shape, f"more.{name}.shape", new.shape, f"the pool's, {own.shape}")
        if not isinstance(own, Tracer) and not isinstance(new, Tracer):  # a tracer has no value to check
            check(np.array_equal(own, new), f"more.{name}", new.tolist(), f"the pool's, {own.tolist()}")
        return own

    names = tuple(name for name, value in vars(pool).items() if hasattr(value, "shape"))
    for name in vars(pool).keys() - set(names):
        own = getattr(pool, name)
        new = getattr(more, name)
        check(own == new, f"more.{name}", new, f"the pool's, {own}")
    return with_fields(pool, **{name: joined(name) for name in names})


def activity(policy: BinaryUnits, visited: Float[ArrayLike, "observations inputs"]) -> Float[Array, " units"]:
    """Mean firing probability of each unit over the observations `visited`.

    This bounds the effect of removing the unit. At every observation, the total variation distance between the joint
    actions with and without the unit equals its firing probability, so its activity is the fraction of decisions that
    can come out differently. Over an episode, no event's probability changes by more than the activity times the number
    of decisions.

    **Arguments:** `policy`: a pool of binary units; `visited`: observations, a row each.
    """
    observations = jnp.asarray(visited)
    fits = observations.ndim == 2 and observations.shape[0] > 0 and observations.shape[1] == policy.inputs
    wanted = f"at least one observation of {policy.inputs} numbers, a row each"
    check(fits, "visited", observations.shape, wanted)
    return jnp.mean(jax.vmap(policy.prob)(observations), axis=0)


def reach(
    policy: BinaryUnits, low: Float[ArrayLike, " inputs"], high: Float[ArrayLike, " inputs"]
) -> Float[Array, " units"]:
    """Maximal firing probability of each unit within the box from `low` to `high`.

    It is attained at the point of the box closest to the unit's centre. This holds for units whose firing probability
    decreases with the distance in every input: Gaussians, soft spheres and soft boxes with axes parallel to the inputs.
    Oriented units are refused; see `activity`.

    **Arguments:** `policy`: a pool of local units; `low` and `high`: opposite corners of the box, or one number each
    for all inputs.
    """
    pool = policy.pool if isinstance(policy, Masked) else policy
    check(hasattr(pool, "centre"), "policy", type(pool).__name__, "a pool of local units, which have a centre")
    parallel = getattr(pool, "aligned", True)
    check(parallel, "policy", type(pool).__name__, "a pool of units with axes parallel to the inputs; use activity")
    centre: Array = pool.centre  # type: ignore[attr-defined]
    low, high = (jnp.broadcast_to(jnp.asarray(side, centre.dtype), (policy.inputs,)) for side in (low, high))
    if not isinstance(low, Tracer) and not isinstance(high, Tracer):
        check(bool(jnp.all(low <= high)), "low, high", (low.tolist(), high.tolist()), "a box, low <= high")
    return jnp.diagonal(jax.vmap(policy.prob)(jnp.clip(centre, low, high)))


def prune(policy: AnyPool, kept: Bool[ArrayLike, " units"]) -> AnyPool:
    """Remove the units that are not `kept`, for example those whose `activity` or `reach` is below a bound.

    A `Masked` pool keeps its arrays and switches the units off, so this can be mapped over seeds or compiled. For any
    other pool the rows are removed, the inverse of `grow`; the shapes then depend on `kept`.

    **Arguments:** `policy`: a pool of units; `kept`: for each unit whether it stays.

    **Raises:** `ValueError` for a policy of several pools, if no unit is left, and if `kept` is not a boolean for each
    unit.

    **Example:**

    ```python
    smaller = prune(policy, activity(policy, visited) >= 1e-3)
    ```
    """
    kept = jnp.asarray(kept)
    check(kept.dtype == bool and kept.shape == (policy.outputs,), "kept", kept, f"{policy.outputs} of true and false")
    if isinstance(policy, Masked):
        return eqx.tree_at(lambda each: each.active, policy, policy.active & kept)
    check(not isinstance(kept, Tracer), "policy", type(policy).__name__, "Masked where it is pruned in compiled code")
    check(is_plain(policy), "policy", type(policy).__name__, "a pool of one kind of units, or Masked")
    check(bool(kept.any()), "kept", "no unit", "at least one unit")
    rows = np.flatnonzero(np.asarray(kept))

    def fewer(leaf: Array) -> Array:
        return leaf[rows] if leaf.shape[:1] == (policy.outputs,) else leaf

    return jax.tree.map(fewer, with_interface(policy, None))  # its actions are others
