"""Declarations of settings: what a field says of itself, once, for every way in and for every reader."""

import dataclasses
import math
import sys
import types
from collections.abc import Callable, Mapping
from typing import Any, Literal, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check

Kind = Literal["float", "int", "bool"]
MAX_NAMED_END = 2**30  # of whole numbers: one from here on is as good as none, and messages leave it out
MAX_WHOLE = 2**31 - 1


class Range(NamedTuple):
    """The values that a number may take: finite, between `low` and `high`, and of a `kind`."""

    low: float = -math.inf
    high: float = math.inf
    open_low: bool = False
    open_high: bool = False
    kind: Kind = "float"

    @property
    def whole(self) -> bool:
        """Whether it is an integer."""
        return self.kind == "int"

    def allows(self, value: object) -> bool:
        """Whether a number, or every number of an array, is finite and within the range."""
        if type(value) is float and self.kind == "float":  # as most are, and arrays take their time
            above = value > self.low if self.open_low else value >= self.low
            return above and math.isfinite(value) and (value < self.high if self.open_high else value <= self.high)
        try:
            numbers = np.asarray(value)
        except (TypeError, ValueError):  # lists of different lengths
            return False
        floats = numbers.dtype.kind == "f" or jnp.issubdtype(numbers.dtype, jnp.floating)
        if self.kind == "bool":
            return numbers.dtype.kind == "b"
        if numbers.dtype.kind not in "iu" and (self.whole or not floats):
            return False
        above = numbers > self.low if self.open_low else numbers >= self.low
        below = numbers < self.high if self.open_high else numbers <= self.high
        return bool(np.all(np.isfinite(numbers) & above & below))

    @property
    def ends(self) -> str:
        """The ends in words: "at least 0", "from 1 to 100", "in [0, 1)"; nothing where there are none."""
        return self._ends(far=False)

    def _ends(self, far: bool) -> str:
        if self.whole:
            near = self.high < MAX_NAMED_END or far
            return f"from {self.low:,} to {self.high:,}" if near else f"at least {self.low:,}"
        if math.isinf(self.high):
            return "" if math.isinf(self.low) else f"{'above' if self.open_low else 'at least'} {self.low:g}"
        if math.isinf(self.low):
            return f"{'below' if self.open_high else 'at most'} {self.high:g}"
        return f"in {'(' if self.open_low else '['}{self.low:g}, {self.high:g}{')' if self.open_high else ']'}"

    def words(self, value: object = None) -> str:
        """What is allowed instead of a value, in words that complete "must be …"."""
        if self.kind == "bool":
            return "true or false"
        ends = self._ends(far=isinstance(value, int) and value > self.high)
        if ends.startswith("in "):
            return ends
        kind = "an integer" if self.whole else "a finite number"
        return f"{kind} {'of ' if ends.startswith('at') else ''}{ends}".rstrip()

    def __str__(self) -> str:
        return self.words()


@dataclasses.dataclass(frozen=True)
class Declared:
    """What a field declares beside its name, its type and its default.

    Command line, files, calls, sliders of TimSim, forms of TimLab, tables of documentation and messages read it here.
    """

    help: str = ""
    """What it is, in a line; in Markdown, with formulas between dollar signs."""
    unit: str = ""
    range: Range | None = None
    """The values that a number may take; of an array or a list, each of its numbers."""
    live: bool = False
    """Whether it may change while something runs. Other settings are structure, or are used only at the start."""
    groups: bool = False
    """Whether it also takes a mapping from names of a policy's fields to numbers or arrays."""
    option: bool = True
    """Whether the command line offers it. What is too much for one is given in a file."""
    positional: str = ""
    """What the help of a command shows for a word without a name, such as "FILE"; empty for an option."""
    metavar: str = ""
    """What the help shows for the value of an option, where its type does not say it."""
    plain: Callable[[Any], Any] | None = None
    """How a value is written to a file, where it is no number, text, list, table or dataclass."""

    @property
    def kind(self) -> Kind:
        """The kind of its numbers."""
        return "float" if self.range is None else self.range.kind

    @property
    def allowed(self) -> str:
        """The values that a number may take, in words that complete "must be …"."""
        return self.instead_of(None)

    def instead_of(self, value: object) -> str:
        """`allowed`, with a far end where it is what refuses the value."""
        unit = self.unit and f", in {self.unit}"
        return f"{(self.range or Range()).words(value)}{unit}"

    def check(self, name: str, value: object) -> None:
        """Refuse a number, or numbers, out of the range. **Raises** `ValueError`, by the `name`."""
        check(self.range is None or self.range.allows(value), name, value, self.instead_of(value))


def number(
    default: object = dataclasses.MISSING,
    low: float = -math.inf,
    high: float = math.inf,
    *,
    open_low: bool = False,
    open_high: bool = False,
    groups: bool = False,
    at_start: bool = False,
    kind: Kind = "float",
    unit: str = "",
    help: str = "",
) -> Any:
    """Declare a field that holds a number, or an array of numbers: in a part of a learner, a leaf of the tree; in
    other settings, where its type is `Any`, one number or nested lists of numbers.

    **Arguments:**

    - `default`: the field's default; a field whose type allows `None` may be absent.
    - `low` and `high`: the range, each end included unless `open_low` or `open_high` says otherwise.
    - `groups`: whether the field also takes a mapping from names of a policy's fields to numbers or arrays. A name may
      be the end of a field's path, such as `movement.weights`.
    - `at_start`: whether it is used only to build the first state, so that changing it during a run has no effect.
    - `kind`: `"int"` or `"bool"` for integers or truth values that may change while something runs.
    - `unit`, `help`: for people.
    """
    allowed = Range(low, high, open_low, open_high, kind)
    declared = Declared(help, unit, allowed, not at_start, groups)
    keywords = {"converter": as_number} if kind == "float" else {}
    return eqx.field(metadata={"declared": declared}, **keywords, **_default(default))


def count(
    default: object = dataclasses.MISSING, low: int = 0, high: int = MAX_WHOLE, *, unit: str = "", help: str = ""
) -> Any:
    """Declare a field that holds a whole number which is part of the structure: a length, an interval or a count."""
    declared = Declared(help, unit, Range(low, high, kind="int"))
    return eqx.field(static=True, metadata={"declared": declared}, **_default(default))


def static(
    default: object = dataclasses.MISSING,
    *,
    factory: Callable[[], object] | None = None,
    converter: Callable[[Any], object] | None = None,
    kw_only: bool = False,
    allowed: Range | None = None,
    unit: str = "",
    help: str = "",
    option: bool = True,
    positional: str = "",
    metavar: str = "",
    plain: Callable[[Any], Any] | None = None,
) -> Any:
    """Declare a field that is part of the structure: a choice by name, a flag, a path, a list, or a number that fixes a
    shape.

    **Arguments:** the `default`, or a `factory` that makes it; `converter` and `kw_only` as in `equinox.field`; the
    range of the numbers that are `allowed`; the others as in `Declared`.
    """
    declared = Declared(help, unit, allowed, option=option, positional=positional, metavar=metavar, plain=plain)
    keywords: dict[str, Any] = {"kw_only": True} if kw_only else {}  # kw_only=False would undo that of a whole class
    keywords |= {} if converter is None else {"converter": converter}
    keywords |= _default(default) if factory is None else {"default_factory": factory}
    return eqx.field(static=True, metadata={"declared": declared}, **keywords)


def inner(
    default: object = dataclasses.MISSING,
    *,
    factory: Callable[[], object] | None = None,
    converter: Callable[[Any], object] | None = None,
    unit: str = "",
    help: str = "",
) -> Any:
    """Declare a field that holds settings of its own, such as a part of a learner, or values that are no single number
    and that a program carries along.

    **Arguments:** the `default`, or a `factory` that makes it; `converter` as in `equinox.field`; `unit` and `help` for
    people.
    """
    keywords: dict[str, Any] = {} if converter is None else {"converter": converter}
    keywords |= _default(default) if factory is None else {"default_factory": factory}
    return eqx.field(metadata={"declared": Declared(help, unit)}, **keywords)


def _default(default: object) -> dict[str, Any]:
    return {} if default is dataclasses.MISSING else {"default": default}


def declared_by(field: "dataclasses.Field[Any]") -> Declared:
    """What a field of a dataclass declares."""
    return field.metadata.get("declared", NOTHING)


NOTHING = Declared()


def holds_numbers(field: "dataclasses.Field[Any]") -> bool:
    """Whether a field of a dataclass was declared by `number`: whether its numbers are carried along by a program."""
    return declared_by(field).range is not None and not field.metadata.get("static", False)


def default_of(field: dataclasses.Field[Any]) -> Any:
    """A field's default, made if it must be; `dataclasses.MISSING` where there is none."""
    return field.default if field.default_factory is dataclasses.MISSING else field.default_factory()


def inherited_fields(cls: type) -> dict[str, "dataclasses.Field[Any]"]:
    """The fields of the bases of a class, by name."""
    found: dict[str, dataclasses.Field[Any]] = {}
    for base in reversed(cls.__mro__[1:]):
        found |= vars(base).get("__dataclass_fields__", {})
    return found


def inherit_declarations(cls: type) -> None:
    """Have fields that a class being defined declares again, only for another type or default, keep what their bases
    declare, even bases that are no dataclasses."""
    bases = reversed(cls.__mro__[1:])
    known = {name: item for base in bases for name, item in vars(base).items() if isinstance(item, dataclasses.Field)}
    known |= inherited_fields(cls)
    for name in _own_annotations(cls):
        if name in known and declared_by(known[name]) is not NOTHING:
            given = getattr(cls, name, dataclasses.MISSING)
            field = given if isinstance(given, dataclasses.Field) else eqx.field(**_default(given))
            if declared_by(field) is NOTHING:
                field.metadata = types.MappingProxyType({**known[name].metadata, **field.metadata})
                setattr(cls, name, field)


def _own_annotations(cls: type) -> Mapping[str, Any]:
    """The annotations of a class's own body. Since Python 3.14 they are made when they are asked for, and names in them
    may be unknown as yet (PEP 649)."""
    if sys.version_info >= (3, 14):
        import annotationlib

        return annotationlib.get_annotations(cls, format=annotationlib.Format.FORWARDREF)
    return vars(cls).get("__annotations__", {})


def as_number(value: object) -> Any:
    """A number as it is kept: a float, an array of them, or a mapping of either; anything else is left to the check.
    A mapping within one gives its numbers longer names: `{"movement": {"bias": 0.1}}` is `{"movement.bias": 0.1}`."""
    if isinstance(value, Mapping):
        found: dict[str, Any] = {}
        for name, item in value.items():
            kept = as_number(item)
            inner = kept if isinstance(kept, dict) else {"": kept}
            found |= {f"{name}.{own}" if own else str(name): each for own, each in inner.items()}
        return found
    if isinstance(value, bool | np.bool_):
        return value
    if isinstance(value, int | float | np.number):
        return float(value)
    if isinstance(value, list | tuple | np.ndarray):
        try:
            array = np.asarray(value)
        except ValueError:
            return value
        return array.astype(float) if array.dtype.kind in "iuf" else value
    return value


def plain_numbers(value: object, name: str, declared: Declared, optional: bool = False) -> Any:
    """One number of the declared kind, or nested lists of such numbers as nested tuples, whatever their range.

    **Raises** `ValueError` for anything else, and for numbers that overflow single precision.
    """
    if value is None and optional:
        return None
    try:
        given = np.asarray(value)
    except (TypeError, ValueError, OverflowError):  # lists of different lengths
        given = np.asarray(None)
    right = given.size > 0 and given.dtype.kind in {"float": "biuf", "int": "biu", "bool": "b"}[declared.kind]
    if right:
        with np.errstate(over="ignore"):
            right = bool(np.all(np.isfinite(given.astype(np.float32))))
        right = right and (declared.kind != "int" or bool(np.all(np.abs(given.astype(float)) <= MAX_WHOLE)))
    check(right, name, value, f"{declared.allowed}, or a list of such values{', or none' if optional else ''}")
    return _nested(given.astype({"float": float, "int": int, "bool": bool}[declared.kind]).tolist())


def _nested(value: object) -> Any:
    return tuple(map(_nested, value)) if isinstance(value, list) else value
