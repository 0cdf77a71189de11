"""What a block declares: its ports, its parameters, which may change during a run, and its settings, which may not."""

import dataclasses
import functools
import typing
from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check, choice
from motorgrad.schema import Declared, Kind, Range, declared_by, fields_of, hints_of, holds_numbers, options_of

SIGNAL_KINDS: tuple[Kind, ...] = ("bool", "int", "float")
"""From narrow to wide: a wire may lead to a wider kind."""
SHARED = Declared(range=Range(), live=True)
"""What a parameter of a diagram declares, which stands for those of several blocks: that it is numbers."""


@dataclasses.dataclass(frozen=True)
class Port:
    """One end of a wire, which carries an array of fixed shape.

    **Arguments:**

    - `shape`: of the array; `()` for a scalar.
    - `kind`: `"float"`, `"int"` (32 bits) or `"bool"`. A wire may lead from a narrow kind to a wider one.
    - `feedthrough`: of an input: whether an output depends on it within the same tick.
    - `default`: of an input: its value where no wire leads to it, one number or nested tuples of them that broadcast
      to `shape`; `None` if it must be wired.
    - `help`, `unit`: for people.
    """

    shape: tuple[int, ...] = ()
    kind: Kind = "float"
    feedthrough: bool = True
    default: Any = None
    help: str = ""
    unit: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "shape", checked_shape("shape", self.shape))
        choice("kind", self.kind, SIGNAL_KINDS)
        if self.default is not None:
            given = np.shape(self.default)[::-1]
            own = self.shape[::-1]
            fits = len(given) <= len(own) and all(a in (1, b) for a, b in zip(given, own, strict=False))
            check(fits, "default: shape", given[::-1], f"one that broadcasts to {self.shape}")

    @property
    def dtype(self) -> Any:
        """The arrays' dtype; floats have JAX's current precision."""
        return dtype_of(self.kind)

    def unwired(self, rows: tuple[int, ...] = ()) -> jnp.ndarray:
        """The values where no wire leads to it, `(*rows, *shape)`."""
        default = np.asarray(0.0 if self.default is None else self.default)
        return jnp.broadcast_to(jnp.asarray(default, self.dtype), (*rows, *self.shape))

    def accepts(self, other: "Port") -> bool:
        """Whether the output `other` may be wired to this input."""
        return self.shape == other.shape and SIGNAL_KINDS.index(other.kind) <= SIGNAL_KINDS.index(self.kind)

    def describe(self) -> str:
        """Shape and kind in words."""
        return f"{self.kind}s of shape {self.shape}" if self.shape else f"one {self.kind}"


def dtype_of(kind: Kind) -> Any:
    """The dtype of arrays of this kind."""
    return {"float": jnp.result_type(float), "int": np.dtype(np.int32), "bool": np.dtype(bool)}[kind]


def checked_shape(name: str, shape: object) -> tuple[int, ...]:
    """A shape as a tuple. **Raises** `ValueError` unless it is a valid shape of fewer than 2³¹ elements."""
    given = tuple(shape) if isinstance(shape, tuple | list) else None
    whole = given is not None and all(isinstance(n, int | np.integer) and not isinstance(n, bool) for n in given)
    valid = given is not None and whole and all(n >= 1 for n in given) and np.prod(given, dtype=float) < 2**31
    check(valid, name, shape, "a list of integers from 1, () for one number")
    return tuple(int(n) for n in given or ())


@functools.cache
def parameters_of(cls: type) -> Mapping[str, Declared]:
    """What the parameters of a block type declare, by name: its numbers, which may change during a run."""
    return {name: declared_by(field) for name, field in fields_of(cls).items() if holds_numbers(field)}


@functools.cache
def settings_of(cls: type) -> Mapping[str, Declared]:
    """What the settings of a block type declare, by name: all other fields. Changing one recompiles the diagram."""
    return {name: declared_by(field) for name, field in fields_of(cls).items() if not holds_numbers(field)}


def choices_of(cls: type, name: str) -> tuple[Any, ...]:
    """All values that a field of a block type may have, where its type lists them."""
    hint = hints_of(cls)[name]
    return typing.get_args(hint) if typing.get_origin(hint) is typing.Literal else ()


def allowed_in(cls: type, name: str) -> str:
    """The numbers that a field of a block type may have, in words that complete "must be …"; empty for other fields."""
    field = fields_of(cls)[name]
    declared = declared_by(field)
    if declared.range is None:
        return ""
    options = options_of(hints_of(cls)[name])
    each = "a list, each " if any(typing.get_origin(option) is tuple for option in options) else ""
    several = ", or a list of such values" if isinstance(field.default, tuple) and not each else ""
    none = ", or none" if type(None) in options else ""
    return f"{each}{declared.allowed}{several}{none}"


def nested(value: object) -> Any:
    """Nested lists as nested tuples."""
    return tuple(map(nested, value)) if isinstance(value, tuple | list) else value
