"""The library's parts with arrays in place of their numbers, so that these may change while a diagram runs."""

from typing import Any, TypeVar

import jax
import jax.numpy as jnp

from motorgrad.lab.diagram import Moment, Port, Signals

T = TypeVar("T")

VALID = Port((), "bool", default=1.0, help="whether something was paid at this tick, at which it counts")


def traced(kind: type[T], **fields: Any) -> T:
    """An instance of a dataclass that has these fields, unchecked: a block has checked its own numbers."""
    made = object.__new__(kind)
    made.__dict__.update(fields)
    return made


def paid(inputs: Signals, now: Moment, port: str = "valid") -> Any:
    """Whether what comes in counts: nothing has been paid before the first action."""
    return inputs[port] & (now.tick > 0)


def where(condition: Any, yes: T, no: T) -> T:
    """The leaves of one tree or of the other."""
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), yes, no)
