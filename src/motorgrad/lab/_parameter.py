"""Fields of a block: parameters, which may change while a diagram runs, and settings, which may not.

They are declared beside the type, `gain: Annotated[Any, Parameter("the factor")] = 1.0`.
"""

import dataclasses
import functools
import typing
from collections.abc import Mapping
from typing import Any

import numpy as np

from motorgrad._errors import check, choice
from motorgrad.lab._port import KINDS, Kind, dtype_of


@dataclasses.dataclass(frozen=True)
class Parameter:
    """Declares a number, or an array of them, that may change while a diagram runs.

    **Arguments:** what it is, in a few words of `help`; its `unit`; the range from `low` to `high` of every number in
    it, whose ends are left out if it is `open`; its `kind`; and whether it is `optional`: `None` then stands for an
    absent parameter. Presence is structure: a running diagram cannot change it.
    """

    help: str = ""
    unit: str = ""
    low: float = -np.inf
    high: float = np.inf
    kind: Kind = "float"
    open: bool = False
    optional: bool = False

    def __post_init__(self) -> None:
        choice("kind", self.kind, KINDS)

    def plain(self, name: str, value: Any) -> Any:
        """A value as nested tuples of plain numbers. **Raises** `ValueError` for what is not allowed."""
        if value is None and self.optional:
            return None
        try:
            given = np.asarray(value)
        except (TypeError, ValueError, OverflowError):  # lists of different lengths
            given = np.asarray(None)
        allowed = {"float": "biuf", "int": "biu", "bool": "b"}[self.kind]
        # an array must have numbers; and what is beyond single precision would be infinite
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

    def array(self, value: Any) -> np.ndarray:
        """A plain value as the array that the functions see."""
        return np.asarray(value, dtype_of(self.kind))

    def allowed(self) -> str:
        """What is allowed, in words that complete "must be …"."""
        if self.kind == "bool":
            return "true or false, or a list of them"
        least, most = ("above", "below") if self.open else ("at least", "at most")
        bounds = [f"{least} {self.low:g}"] if self.low > -np.inf else []
        bounds += [f"{most} {self.high:g}"] if self.high < np.inf else []
        numbers = f"{'whole' if self.kind == 'int' else 'finite'} numbers"
        words = [f"{numbers} {' and '.join(bounds)}".rstrip(), *([f"in {self.unit}"] if self.unit else [])]
        return ", ".join([*words, *(["or none"] if self.optional else [])])


@dataclasses.dataclass(frozen=True)
class Setting:
    """Declares what decides a block's shapes or structure, with what it is in a few `help` words. To change it is to
    compile the diagram again.

    It is a number, a text, a boolean, `None`, or tuples of these; `choices` are all there are, where it is one of some
    texts.
    """

    help: str = ""
    choices: tuple[str, ...] = ()


@functools.cache
def _declared(cls: type, kind: type) -> dict[str, Any]:
    found = {}
    for name, hint in typing.get_type_hints(cls, include_extras=True).items():
        for part in getattr(hint, "__metadata__", ()):
            if isinstance(part, kind):
                found[name] = part
    return {field.name: found[field.name] for field in dataclasses.fields(cls) if field.name in found}


def parameters_of(cls: type) -> Mapping[str, Parameter]:
    """The parameters of a type of block, by name."""
    return _declared(cls, Parameter)


def settings_of(cls: type) -> Mapping[str, Setting]:
    """The settings of a type of block, by name."""
    return _declared(cls, Setting)


def nested(value: Any) -> Any:
    """Lists within lists as tuples."""
    return tuple(map(nested, value)) if isinstance(value, tuple | list) else value
