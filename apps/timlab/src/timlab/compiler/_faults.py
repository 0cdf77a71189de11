"""What keeps a tick from being computed rightly: numbers in the state of the compiled loop, one of each for a seed."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

NONE, STEPS, SHORT, CROSSINGS, LOST, LOOP, SIGNAL = range(7)
"""Kinds of faults: too many steps of the solver; steps that are too short; too many crossings; a state or its slope
that is not finite; an algebraic loop without a solution; a signal that is not finite."""
Fault = dict[str, Array]
"""`kind` of the fault at which the state was left; `within`, its time in seconds since the tick; where there are
crossings, `chatter`, 1 + the number of the first one that chattered, else 0, and `since`, the tick."""


def no_fault(crossings: bool) -> Fault:
    """A start without a fault."""
    none = jnp.zeros((), jnp.int32)
    chatter = {"chatter": none, "since": jnp.zeros((), jnp.uint32)} if crossings else {}
    return {"kind": none, "within": jnp.zeros(()), **chatter}


def joined(before: Fault, kind: Array, within: Array, chatter: Array | None, tick: Array) -> Fault:
    """The fault after a tick, given what was before it and what it brought."""
    after = {"kind": jnp.where(kind != NONE, kind, before["kind"])}
    after["within"] = jnp.where(kind != NONE, within, before["within"])
    if chatter is not None:
        first = before["chatter"] != NONE
        after["chatter"] = jnp.where(first, before["chatter"], chatter)
        after["since"] = jnp.where(first, before["since"], tick.astype(jnp.uint32))
    return after


def owners(parts: Sequence[tuple[Sequence[int], tuple[int, ...]]]) -> np.ndarray:
    """For each number of a state or of the crossings, raveled leaf by leaf, which block has it. `parts` are pairs of
    blocks and the shapes of their leaves; blocks lead in the shapes.
    """
    found = [np.repeat(members, int(np.prod(shape[1:]))) for members, shape in parts]
    return np.concatenate(found).astype(np.int32) if found else np.zeros(0, np.int32)
