"""Pools that shrink: units that take no part are found by what they do, and taken away."""

from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Bool, Float

from motorgrad._errors import check
from motorgrad.policies._binary import BinaryUnits
from motorgrad.policies._masked import Masked
from motorgrad.policies._policy import is_plain

P = TypeVar("P", bound=BinaryUnits)


def activity(policy: BinaryUnits, visited: Float[ArrayLike, "looks inputs"]) -> Float[Array, " units"]:
    """Each unit's mean probability of firing over the observations `visited`.

    Without the unit a decision is another one as often as this, and no more: the total variation distance between the
    joint actions with the unit and with its silence is, at every observation, its probability of firing. So in an
    episode no event's probability changes by more than the activity times the number of decisions.
    """
    looks = _looks(policy, visited)
    return jnp.mean(jax.vmap(policy.prob)(looks), axis=0)


def reach(
    policy: BinaryUnits, low: Float[ArrayLike, " inputs"], high: Float[ArrayLike, " inputs"]
) -> Float[Array, " units"]:
    """The greatest probability with which each unit fires anywhere within the box from `low` to `high`.

    It is that at the box's point next to the unit's centre, so it is for units that fire the less the farther an
    observation is in any input: Gaussians, soft spheres and soft boxes.
    """
    pool = policy.pool if isinstance(policy, Masked) else policy
    check(hasattr(pool, "centre"), "policy", type(pool).__name__, "a pool of local units, which have a centre")
    centre: Array = pool.centre  # type: ignore[attr-defined]
    low, high = (jnp.broadcast_to(jnp.asarray(side, centre.dtype), (policy.inputs,)) for side in (low, high))
    if not isinstance(low, Tracer) and not isinstance(high, Tracer):
        check(bool(jnp.all(low <= high)), "low, high", (low.tolist(), high.tolist()), "a box, low <= high")
    return jnp.diagonal(jax.vmap(policy.prob)(jnp.clip(centre, low, high)))


def prune(policy: P, kept: Bool[ArrayLike, " units"]) -> P:
    """The policy without the units that are not `kept`, such as those of an `activity` or a `reach` below a bound.

    A `Masked` pool keeps its arrays and switches the units off, so this may be mapped over seeds or compiled. Of any
    other pool the rows are removed, the inverse of `grow`; the shapes then depend on what is kept.

    **Raises:** `ValueError` for a pool of several kinds, for one that would have no unit left, and for a `kept` that is
    not true or false for each unit.
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

    return jax.tree.map(fewer, policy)


def _looks(policy: BinaryUnits, visited: Float[ArrayLike, "looks inputs"]) -> Float[Array, "looks inputs"]:
    looks = jnp.asarray(visited)
    fits = looks.ndim == 2 and looks.shape[0] > 0 and looks.shape[1] == policy.inputs
    check(fits, "visited", looks.shape, f"at least one observation of {policy.inputs} numbers, a row each")
    return looks
