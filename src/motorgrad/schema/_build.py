"""Objects from plain tables of settings, whoever wrote them: every value read, converted and put in its place."""

import dataclasses
import re
import types
import typing
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from motorgrad._errors import check, shown, unknown
from motorgrad.schema._declare import default_of
from motorgrad.schema._part import Part, fields_of, hints_of, options_of, parts_in, with_article
from motorgrad.schema._table import table
from motorgrad.schema._words import Words

T = TypeVar("T")
MAX_SINGLE_PRECISION = 3.4e38
MAX_INTEGER = 2**63 - 1
MAX_EXACT_FLOAT = 2**53  # the largest up to which a float is the one whole number that was written


def build(cls: type[T], values: Any, where: str = "", base: T | None = None) -> T:
    """An instance of `cls`, a frozen dataclass or a part, from a table of `values`; a field that holds settings of its
    own takes a table itself, and a part a table with its `kind`, or only the name of the kind.

    Settings that a table leaves out come from `base`, or are the defaults of `cls`; likewise in tables within it.

    **Raises:** `ValueError` that names the unknown key and the nearest known one, the value of a wrong type or out of
    its range, or the key that is missing.
    """
    values = _read(cls, values, where)
    outermost = _described(cls, values, where, base)
    if outermost is None:
        return _plain_value(cls, values, where, base)
    # A loop over all tables in place of a function that calls itself for each: a value is read here, and the part that
    # checks it is made here, however deep it stands.
    tables = [outermost]
    for each in tables:  # which grows; the outer ones come first
        for name, hint, given, place, default in each.entries():
            value = _read(hint, given, place)
            inner = _described(hint, value, place, default)
            if inner is None:
                each.given[name] = _plain_value(hint, value, place, default)
            else:
                each.inner.append((name, inner))
                tables.append(inner)
    for each in reversed(tables):
        each.given |= {name: inner.made for name, inner in each.inner}
        each.check_complete()
        try:
            each.made = each.cls(**each.given) if each.base is None else dataclasses.replace(each.base, **each.given)
        except ValueError as error:
            raise each.named(error) from None
    return outermost.made


class _Table:
    """A table of settings on its way to an instance of a class."""

    def __init__(
        self,
        cls: type,
        settings: Mapping[str, Any],
        where: str,
        base: object = None,
        shared: Mapping[str, Any] | None = None,
    ):
        self.cls: Any = cls
        self.settings = settings
        self.where = where
        self.base: Any = None if any(name in settings for name in getattr(cls, "restarts", ())) else base
        self.given: dict[str, Any] = dict(shared or {})
        self.shared = shared or {}
        self.inner: list[tuple[str, _Table]] = []
        self.made: Any = None

    def entries(self) -> Iterator[tuple[str, Any, Any, str, Any]]:
        """For each setting in the table: its name, type, value, place, and what it is without."""
        hints = hints_of(self.cls)
        fields = fields_of(self.cls)
        for name, value in expanded(self.cls, self.settings).items():
            if name not in fields:
                known = [*fields, *getattr(self.cls, "aliases", {})]
                kind = f"setting of {self.where or self.cls.__name__.lower()}"
                raise unknown(kind, name, known, deeper(self.cls, name, self.base))
            default = default_of(fields[name]) if self.base is None else getattr(self.base, name)
            yield name, hints[name], value, _place(self.where, name), self.shared.get(name, default)

    def check_complete(self) -> None:
        """Refuse a table without a setting that must be given."""
        for name, field in fields_of(self.cls).items():
            if self.base is None and name not in self.given and default_of(field) is dataclasses.MISSING:
                raise ValueError(f"{_place(self.where, name)}: must be given")

    def named(self, error: ValueError) -> ValueError:
        """An error of the class with the place of the table before it."""
        if not self.where:
            return error
        field = re.split(r"\W", str(error), maxsplit=1)[0] in fields_of(self.cls)  # also `low, high` and `hidden[0]`
        return ValueError(f"{self.where}{'.' if field else ': '}{error}")


def convert(cls: type, values: Mapping[str, Any]) -> dict[str, Any]:
    """The values in the types of the fields of `cls`: `build` without making the instance."""
    entries = _Table(cls, values, "").entries()
    return {name: as_hinted(hint, value, place, default) for name, hint, value, place, default in entries}


class _Changes(dict[str, Any]):
    """A table that changes some entries of the one it takes the place of."""


class _PartTable(dict[str, Any]):
    """The table of a part that was given whole, whose settings may still be changed."""

    def __init__(self, part: Mapping[str, Any]):
        super().__init__((name, _PartTable(v) if isinstance(v, Mapping) else v) for name, v in part.items())


def full_path(cls: type, key: str) -> str:
    """The path that a key stands for, whose first name may be short (`cls.aliases`): `trace.decay`, `decay`."""
    first, dot, rest = key.partition(".")
    return f"{getattr(cls, 'aliases', {}).get(first, first)}{dot}{rest}"


def expanded(cls: type, values: Mapping[str, Any]) -> dict[str, Any]:
    """A table with short names (`cls.aliases`) and dotted paths replaced by tables within tables.

    **Raises** `ValueError` for a setting that is given twice.
    """
    if not issubclass(cls, Part):
        full = [full_path(cls, key) for key in values]
        for key, name in zip(values, full, strict=True):
            check(full.count(name) == 1, key, values[key], "given once")
        return dict(zip(full, values.values(), strict=True))
    found: dict[str, Any] = {}
    for key in sorted(values, key=lambda key: full_path(cls, key).count(".")):
        *outer, last = full_path(cls, key).split(".")
        node = found
        for name in outer:
            inner = node.setdefault(name, _Changes())
            if not isinstance(inner, _Changes | _PartTable):  # a part by its kind, or given whole: the caller's own
                if isinstance(inner, Part):
                    inner = _PartTable(table(inner))
                else:
                    inner = dict(inner) if isinstance(inner, Mapping) else {"kind": inner}
                node[name] = inner
            node = inner
        value = values[key]
        if isinstance(value, Mapping) and isinstance(node.get(last), dict):
            value = {**node[last], **value}
        elif last in node and outer and not isinstance(node, _PartTable):
            check(node[last] == value, key, value, "given once")
        node[last] = value
    return found


def deeper(cls: type, key: str, base: object = None) -> list[str]:
    """Where tables within the table have a setting of this name."""
    hints = hints_of(cls)
    found = []
    for name, field in fields_of(cls).items():
        default = default_of(field) if base is None else getattr(base, name)
        inner = type(default) if dataclasses.is_dataclass(default) else hints[name]
        if dataclasses.is_dataclass(inner):
            found += [f"{name}.{key}"] if key in fields_of(inner) else []
            made = default if dataclasses.is_dataclass(default) and not isinstance(default, type) else None
            found += [f"{name}.{deeper}" for deeper in deeper(typing.cast(type, inner), key, made)]
    return found


def as_hinted(hint: Any, value: Any, where: str, default: Any = None) -> Any:
    """A plain value as the type `hint`; a table changes the `default` if that is a dataclass.

    **Raises** `ValueError` that says where, the value and what it must be.
    """
    value = _read(hint, value, where)
    described = _described(hint, value, where, default)
    return _plain_value(hint, value, where, default) if described is None else build(hint, value, where, default)


def _read(hint: object, value: Any, where: str) -> Any:
    """A value as a file would have it: words of the command line are read as the type says, and `None` is nothing."""
    value = value.item() if isinstance(value, np.generic) else value
    value = value.read(hint, where) if isinstance(value, Words) else value
    if type(None) in options_of(hint) and parts_in(hint):
        if isinstance(value, Mapping) and value.get("kind") == "none":
            check(len(value) == 1, where, value, "'none' without settings")
            return None
        return None if isinstance(value, str) and value == "none" else value
    return value


def _described(hint: Any, value: Any, where: str, default: object) -> _Table | None:
    """The table from which a value is made; `None` for a value that is itself what it stands for.

    This is where a kind is chosen by its name. Without a `kind` a table changes the `default`; where there is none,
    the type itself is meant if it is a kind, or else the only one. A part of another kind than the default starts from
    the kind's own settings.
    """
    kinds = parts_in(hint)
    if not kinds or not (_is_kind(hint, value) or _is_part_table(hint, value, default)):
        for option in options_of(hint) if isinstance(value, Mapping) else ():
            if dataclasses.is_dataclass(option) and not issubclass(typing.cast(type, option), Part):
                base = default if dataclasses.is_dataclass(default) and not isinstance(default, type) else None
                return _Table(typing.cast(type, option) if base is None else type(base), value, where, base)
        return None
    if isinstance(value, Part):
        return None
    known = {name: cls for kind in kinds for name, cls in (kind.kinds() or {kind.__name__: kind}).items()}
    presets = {name: changes for kind in kinds for name, changes in getattr(kind, "presets", {}).items()}
    settings = {"kind": value} if isinstance(value, str) else dict(value)
    name = settings.pop("kind", None)
    name = name.read(str, _place(where, "kind")) if isinstance(name, Words) else name
    check(name is None or isinstance(name, str), _place(where, "kind"), name, "the name of a kind")
    base: Any = default if isinstance(default, kinds) else None
    if name in presets:
        base = build(hint, presets[name], where, base)
        name = None
    if name is None:
        usual = [hint] if hint in known.values() else list(known.values())
        if base is None and len(usual) > 1:
            raise ValueError(f"{_place(where, 'kind')}: must be given: {', '.join(known)}")
        cls = usual[0] if base is None else type(base)
    elif name not in known:
        none = ["none"] if type(None) in options_of(hint) else []
        raise unknown(where, name, [*known, *presets, *none], registered=True)
    else:
        cls = known[name]
    if base is not None and type(base) is not cls:
        settings_from = getattr(cls, "settings_from", None)  # a learner of another kind keeps the policy
        return _Table(cls, settings, where, None, None if settings_from is None else settings_from(base))
    return _Table(cls, settings, where, base)


def _is_kind(hint: object, value: object) -> bool:
    """Whether a value is a part or names its kind. Where a number may stand too, only a known name does."""
    if not isinstance(value, str) or float not in options_of(hint):
        return isinstance(value, str | Part)
    return any(value in kind.kinds() for kind in parts_in(hint))


def _is_part_table(hint: object, value: object, default: object) -> bool:
    """Whether a table describes a part or changes the `default` part, and not numbers by group."""
    mappings = any(
        isinstance(o := typing.get_origin(option), type) and issubclass(o, Mapping) for option in options_of(hint)
    )
    if not isinstance(value, Mapping):
        return False
    changes = isinstance(default, Part) and value.keys() <= fields_of(type(default)).keys()
    return not mappings or "kind" in value or changes


def _plain_value(hint: Any, value: Any, where: str, default: Any = None) -> Any:
    """A value that no table describes, as the type `hint`."""
    origin = typing.get_origin(hint)
    options = typing.get_args(hint)
    kinds = parts_in(hint)
    if hint is Any:
        return value
    if kinds and isinstance(value, Part):
        check(isinstance(value, kinds), where, value, _name(hint))
        return value
    if origin in (typing.Union, types.UnionType):
        return _one_of(hint, options, value, where, default)
    if origin is typing.Literal:
        if not any(type(value) is type(option) and value == option for option in options):
            raise unknown(where, value, map(str, options))
        return value
    if origin is tuple:
        value = value.tolist() if isinstance(value, np.ndarray) else value
        check(isinstance(value, Sequence) and not isinstance(value, str | bytes), where, value, "a list")
        inner = [options[0]] * len(value) if len(options) == 2 and options[1] is Ellipsis else list(options)
        check(len(inner) == len(value), where, value, f"a list of {len(inner)} entries")
        return tuple(as_hinted(i, v, f"{where}[{n}]") for n, (i, v) in enumerate(zip(inner, value, strict=True)))
    if isinstance(origin, type) and issubclass(origin, Mapping):
        check(isinstance(value, Mapping), where, value, "a table")
        value = {**default, **value} if isinstance(value, _Changes) and isinstance(default, Mapping) else value
        inner = {name: hint if isinstance(item, Mapping) else options[1] for name, item in value.items()}
        return {name: as_hinted(inner[name], item, _place(where, str(name))) for name, item in value.items()}
    if hint is types.NoneType:
        check(value is None or value == "none", where, value, "none")
        return None
    if dataclasses.is_dataclass(hint):
        words = _name(hint) if kinds else f"a table of the settings of {_name(hint)}"
        check(isinstance(value, typing.cast(type, hint)), where, value, words)
        return value
    if hint is float:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        finite = number and -MAX_SINGLE_PRECISION <= value <= MAX_SINGLE_PRECISION
        check(finite, where, value, "a finite number in single precision")
        return float(value)
    if hint is int:
        if isinstance(value, float) and value.is_integer() and abs(value) <= MAX_EXACT_FLOAT:  # 1e5
            return int(value)
        check(isinstance(value, int) and not isinstance(value, bool), where, value, "an integer")
        check(-MAX_INTEGER <= value <= MAX_INTEGER, where, value, f"an integer of at most {MAX_INTEGER}")
        return value
    if hint is Path:
        text = str(value) if isinstance(value, str | Path) else ""
        check(text and "\0" not in text, where, value, "a path")
        return Path(text)
    check(isinstance(value, origin or hint), where, value, _name(hint))
    return value


def _one_of(hint: object, options: tuple[Any, ...], value: object, where: str, default: object) -> Any:
    if (value is None or value == "none") and type(None) in options:
        return None
    some = [option for option in options if option is not types.NoneType]
    lists = [option for option in some if typing.get_origin(option) is tuple]
    only = some if len(some) == 1 else lists if isinstance(value, tuple | list) else []
    if len(only) == 1:  # what is wrong in it is worth saying
        return as_hinted(only[0], value, where, default)
    for option in sorted(options, key=lambda option: option is not type(value)):  # 10.0 stays a float
        try:
            return as_hinted(option, value, where, default)
        except ValueError:
            continue
    raise ValueError(f"{where} = {shown(value)}: must be {_name(hint)}")


def _place(where: str, key: str) -> str:
    key = key if key.isidentifier() else shown(key)
    return f"{where}.{key}" if where else key


def _name(hint: Any) -> str:
    names = {int: "an integer", float: "a number", str: "a string", bool: "true or false", Path: "a path"}
    if typing.get_origin(hint) is typing.Literal:
        return " or ".join(map(repr, typing.get_args(hint)))
    options = [option for option in typing.get_args(hint) if option is not type(None)]
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        return " or ".join(_name(option) for option in options if option is not int or float not in options)
    if isinstance(typing.get_origin(hint), type):
        return "a table" if issubclass(typing.get_origin(hint), Mapping) else "a list"  # type: ignore[arg-type]
    if hint in names:
        return names[hint]
    return with_article(hint.__name__) if isinstance(hint, type) else str(hint)
