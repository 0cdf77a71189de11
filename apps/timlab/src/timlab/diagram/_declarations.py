"""What a block declares: its ports, its parameters, which may change during a run, and its settings, which may not.

Parameters and settings are declared in the type of a field: `gain: Annotated[Any, Parameter("the factor")] = 1.0`.
"""

import dataclasses
import functools
import typing
from collections.abc import Mapping
from typing import Any, Literal

import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from motorgrad._arguments import check_arguments
from motorgrad._errors import check, choice

Kind = Literal["float", "int", "bool"]
SIGNAL_KINDS: tuple[Kind, ...] = ("bool", "int", "float")
"""From narrow to wide: a wire may lead to a wider kind."""


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


@dataclasses.dataclass(frozen=True)
class Parameter:
    """Declares a number, or an array of numbers, that may change during a run.

    **Arguments:**

    - `help`: what it is, in a few words.
    - `unit`: its unit.
    - `low`, `high`: the range of every element; `open` excludes the ends.
    - `kind`: the kind of its numbers.
    - `optional`: whether `None` may stand for an absent parameter. Presence is structure: a run cannot change it.
    """

    help: str = ""
    unit: str = ""
    low: float = -np.inf
    high: float = np.inf
    kind: Kind = "float"
    open: bool = False
    optional: bool = False

    def __post_init__(self) -> None:
        choice("kind", self.kind, SIGNAL_KINDS)

    def plain(self, name: str, value: object) -> Any:
        """A value as nested tuples of plain numbers. **Raises** `ValueError` for a value that is not allowed."""
        if value is None and self.optional:
            return None
        try:
            given = np.asarray(value)
        except (TypeError, ValueError, OverflowError):  # ragged lists
            given = np.asarray(None)
        allowed = {"float": "biuf", "int": "biu", "bool": "b"}[self.kind]
        # an array must have elements, and no number may overflow single precision
        number = given.dtype.kind in allowed and given.size > 0
        check(number, name, value, self.allowed())
        with np.errstate(over="ignore"):
            finite = np.all(np.isfinite(given.astype(np.float32)))
        if self.kind == "int":
            finite = finite and np.all(np.abs(given.astype(float)) < 2**31)
        within = (given > self.low) & (given < self.high) if self.open else (given >= self.low) & (given <= self.high)
        check(finite and np.all(within), name, value, self.allowed())
        plain = {"float": float, "int": int, "bool": bool}[self.kind]
        return nested(given.astype(plain).tolist())

    def array(self, value: ArrayLike) -> np.ndarray:
        """A plain value as the array that the block's functions see."""
        return np.asarray(value, dtype_of(self.kind))

    def allowed(self) -> str:
        """The allowed values, in words that complete "must be …"."""
        if self.kind == "bool":
            return "true or false, or a list of them"
        least, most = ("above", "below") if self.open else ("at least", "at most")
        bounds = [f"{least} {self.low:g}"] if self.low > -np.inf else []
        bounds += [f"{most} {self.high:g}"] if self.high < np.inf else []
        numbers = "integers" if self.kind == "int" else "finite numbers"
        words = [f"{numbers} {' and '.join(bounds)}".rstrip(), *([f"in {self.unit}"] if self.unit else [])]
        return ", ".join([*words, *(["or none"] if self.optional else [])])


@dataclasses.dataclass(frozen=True)
class Setting:
    """Declares a value that decides a block's shapes or structure, with a few words of `help`. Changing a setting
    recompiles the diagram.

    A setting is a number, a string, a boolean, `None`, or nested tuples of these. Its type hint is enforced when a
    block is made. `choices` lists all allowed strings.
    """

    help: str = ""
    choices: tuple[str, ...] = ()


@functools.cache
def hints_of(cls: type) -> Mapping[str, Any]:
    """The type hints of a block type's fields, without what is declared in them."""
    return typing.get_type_hints(cls)


@functools.cache
def _declared(cls: type, kind: type) -> dict[str, Any]:
    found = {}
    for name, hint in typing.get_type_hints(cls, include_extras=True).items():
        for part in getattr(hint, "__metadata__", ()):
            if isinstance(part, kind):
                found[name] = part
    return {field.name: found[field.name] for field in dataclasses.fields(cls) if field.name in found}


def parameters_of(cls: type) -> Mapping[str, Parameter]:
    """The parameters of a block type, by name."""
    check_arguments(parameters_of, locals())
    return _declared(cls, Parameter)


def settings_of(cls: type) -> Mapping[str, Setting]:
    """The settings of a block type, by name."""
    check_arguments(settings_of, locals())
    return _declared(cls, Setting)


def nested(value: object) -> Any:
    """Nested lists as nested tuples."""
    return tuple(map(nested, value)) if isinstance(value, tuple | list) else value
