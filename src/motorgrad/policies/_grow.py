"""Pools that grow."""

from typing import TypeVar

import equinox as eqx
import jax
import numpy as np
from jax.core import Tracer

from motorgrad._errors import check
from motorgrad.policies._binary import BinaryUnits
from motorgrad.policies._graded import GradedUnits
from motorgrad.policies._policy import Policy, is_plain

P = TypeVar("P", bound=Policy)


def grow(pool: P, more: P) -> P:
    """A pool with the units of `more` after its own.

    Arrays that lead with the units of both are joined. Others are settings that units share, such as a common height:
    they are the pool's, and `more` must have the same. For the pools of many seeds, whose arrays have a leading axis,
    map it: `jax.vmap(grow)`.

    **Arguments:** two pools of one kind of binary or graded units, over the same inputs.

    **Raises:** `ValueError` for policies that are no such pools, for pools of two kinds, and for those that differ in
    what units share.
    """
    kinds = [type(each).__name__ for each in (pool, more)]
    check(type(pool) is type(more), "more", kinds[1], f"of the pool's kind, {kinds[0]}")
    wanted = "a pool of one kind of units, binary or graded"
    check(isinstance(pool, BinaryUnits | GradedUnits) and is_plain(pool), "pool", kinds[0], wanted)
    check(pool.inputs == more.inputs, "more.inputs", more.inputs, f"the pool's, {pool.inputs}")

    def joined(name: str) -> jax.Array:
        own, new = getattr(pool, name), getattr(more, name)
        if own.shape[:1] == (pool.outputs,) and new.shape[:1] == (more.outputs,):
            return jax.numpy.concatenate([own, new])
        check(own.shape == new.shape, f"more.{name}.shape", new.shape, f"the pool's, {own.shape}")
        if not isinstance(own, Tracer) and not isinstance(new, Tracer):  # while tracing there is no value to look at
            check(np.array_equal(own, new), f"more.{name}", new.tolist(), f"the pool's, {own.tolist()}")
        return own

    names = tuple(name for name, part in vars(pool).items() if hasattr(part, "shape"))
    for name in vars(pool).keys() - set(names):
        own, new = getattr(pool, name), getattr(more, name)
        check(own == new, f"more.{name}", new, f"the pool's, {own}")
    return eqx.tree_at(lambda each: [getattr(each, name) for name in names], pool, [joined(name) for name in names])
