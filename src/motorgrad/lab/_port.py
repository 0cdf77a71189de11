"""Ports: where signals enter and leave a block."""

import dataclasses
from typing import Any, Literal

import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check, choice

Kind = Literal["float", "int", "bool"]
KINDS: tuple[Kind, ...] = ("bool", "int", "float")
"""From narrow to wide: a wire may lead to a wider kind."""


@dataclasses.dataclass(frozen=True)
class Port:
    """One end of a wire, which carries an array of fixed shape.

    **Arguments:**

    - `shape`: of the array; `()` for one number.
    - `kind`: `"float"`, `"int"` (32 bits) or `"bool"`. A wire may lead from a narrow kind to a wider one.
    - `feedthrough`: of an input, whether an output depends on it at the same tick.
    - `default`: of an input, what is read where no wire leads to it; `None` if one must.
    - `help`, `unit`: for people.
    """

    shape: tuple[int, ...] = ()
    kind: Kind = "float"
    feedthrough: bool = True
    default: float | None = None
    help: str = ""
    unit: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "shape", checked_shape("shape", self.shape))
        choice("kind", self.kind, KINDS)

    @property
    def dtype(self) -> Any:
        """Floats are of JAX's precision of the moment."""
        return dtype_of(self.kind)

    def takes(self, other: "Port") -> bool:
        """Whether a wire may lead here from the output `other`."""
        return self.shape == other.shape and KINDS.index(other.kind) <= KINDS.index(self.kind)

    def described(self) -> str:
        """Shape and kind in words."""
        return f"{self.kind}s of shape {self.shape}" if self.shape else f"one {self.kind}"


def dtype_of(kind: Kind) -> Any:
    """The arrays' type of a kind of signal or parameter."""
    return {"float": jnp.result_type(float), "int": np.dtype(np.int32), "bool": np.dtype(bool)}[kind]


def checked_shape(name: str, shape: Any) -> tuple[int, ...]:
    """A shape as a tuple. **Raises** `ValueError` unless it is one, of at most 2³¹ numbers."""
    given = tuple(shape) if isinstance(shape, tuple | list) else None
    whole = given is not None and all(isinstance(n, int | np.integer) and not isinstance(n, bool) for n in given)
    valid = given is not None and whole and all(n >= 1 for n in given) and np.prod(given, dtype=float) < 2**31
    check(valid, name, shape, "a list of whole numbers from 1, () for one number")
    return tuple(int(n) for n in given or ())
