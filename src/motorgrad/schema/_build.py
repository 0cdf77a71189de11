"""Settings: frozen dataclasses and parts of learners from plain tables, and back; unknown settings are refused."""

import dataclasses
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from motorgrad._errors import check, shown, unknown
from motorgrad.schema._declare import declared_by, inherit_declarations
from motorgrad.schema._part import Part, fields_of, hints_of, kind_of, options_of, parts_in, with_article
from motorgrad.schema._texts import with_fields
from motorgrad.schema._words import Words

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T")
MAX_SINGLE_PRECISION = 3.4e38
WHOLE = 2**63 - 1
EXACT = 2**53  # the largest up to which a float is the one whole number that was written


def build(cls: type[T], values: Mapping[str, Any], where: str = "", base: T | None = None) -> T:
    """An instance of the dataclass `cls` from a table of `values`; a field that is a dataclass takes a table itself.

    Settings that a table leaves out come from `base`, or are the defaults of `cls`; likewise in tables within it.

    **Raises:** `ValueError` that names the unknown key and the nearest known one, the value of a wrong type, or the key
    that is missing.
    """
    base = None if any(name in values for name in getattr(cls, "restarts", ())) else base
    given = convert(cls, values, where, base)
    fields = fields_of(cls)
    for name, field in fields.items():
        if base is None and name not in given and default_of(field) is dataclasses.MISSING:
            raise ValueError(f"{_place(where, name)}: must be given")
    try:
        return cls(**given) if base is None else dataclasses.replace(base, **given)  # type: ignore[type-var]
    except ValueError as error:
        named = str(error).split(" ", 1)[0].partition(".")[0] in fields
        raise ValueError(f"{where}{'.' if named else ': '}{error}" if where else str(error)) from None


def check_fields(instance: "DataclassInstance") -> None:
    """Convert the fields of a frozen dataclass to their annotated types, as settings from a file are.

    An instance made in Python so has the types of one made from TOML.

    **Raises:** `ValueError` for a field of the wrong type, out of its range, or not among the options of its `Literal`.
    """
    for field in dataclasses.fields(instance):
        if field.init:
            value = as_hinted(hints_of(type(instance))[field.name], getattr(instance, field.name), field.name)
            object.__setattr__(instance, field.name, value)
            declared = declared_by(field)
            plain = value is None or isinstance(value, str | Part)
            check(plain or declared.range is None or declared.range.allows(value), field.name, value, declared.allowed)


class Settings:
    """Base of frozen dataclasses whose fields declare what they are (`number`, `count`, `static`, `inner`): it converts
    and checks their values, then calls `validate`."""

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        inherit_declarations(cls)
        with_fields(cls)

    def __post_init__(self) -> None:
        check_fields(self)  # type: ignore[arg-type]
        self.validate()

    def validate(self) -> None:
        """Refuse values that do not go together. It is called once every field has passed its own check."""


def convert(cls: type, values: Mapping[str, Any], where: str = "", base: object = None) -> dict[str, Any]:
    """The values in the types of the fields of `cls`: `build` without making the instance."""
    hints = hints_of(cls)
    fields = fields_of(cls)
    given = {}
    for key, value in expanded(cls, values).items():
        if key not in fields:
            known = [*fields, *getattr(cls, "aliases", {})]
            raise unknown(f"setting of {where or cls.__name__.lower()}", key, known, deeper(cls, key, base))
        default = default_of(fields[key]) if base is None else getattr(base, key)
        given[key] = as_hinted(hints[key], value, _place(where, key), default)
    return given


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


def table(instance: "DataclassInstance") -> dict[str, Any]:
    """The inverse of `build`: a dataclass as a plain table.

    Fields that are `None` by default are left out where they are `None`; others are then `"none"`. A part of a learner
    names its `kind`, and all that it is without as `"none"`.
    """
    values = {name: getattr(instance, name) for name in fields_of(type(instance))}
    if getattr(instance, "brief", False):
        values = {name: v for name, v in values.items() if v != default_of(fields_of(type(instance))[name])}
    if isinstance(instance, Part):
        return {"kind": kind_of(instance)} | {name: _plain("none" if v is None else v) for name, v in values.items()}
    fields = fields_of(type(instance))
    given = {name: value for name, value in values.items() if value is not None or default_of(fields[name]) is not None}
    plain = {name: declared_by(fields[name]).plain or _plain for name in given}
    return {name: "none" if value is None else plain[name](value) for name, value in given.items()}


def default_of(field: dataclasses.Field[Any]) -> Any:
    """A field's default, made if it must be; `dataclasses.MISSING` where there is none."""
    return field.default if field.default_factory is dataclasses.MISSING else field.default_factory()


def as_hinted(hint: Any, value: Any, where: str, default: Any = None) -> Any:
    """A plain value as the type `hint`; a table changes the `default` if that is a dataclass.

    **Raises** `ValueError` that says where, the value and what it must be.
    """
    value = value.item() if isinstance(value, np.generic) else value
    value = value.read(hint, where) if isinstance(value, Words) else value
    if (kinds := parts_in(hint)) and (_is_kind(hint, value) or _is_part_table(hint, value, default)):
        return _part(kinds, hint, value, where, default)
    origin = typing.get_origin(hint)
    options = typing.get_args(hint)
    if hint is Any:
        return value
    if origin in (typing.Union, types.UnionType):
        return _one_of(hint, options, value, where, default)
    if origin is typing.Literal:
        if not any(type(value) is type(option) and value == option for option in options):
            raise unknown(where, value, map(str, options))
        return value
    if origin is tuple:
        check(isinstance(value, tuple | list), where, value, "a list")
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
        if isinstance(value, Mapping):
            base = default if dataclasses.is_dataclass(default) and not isinstance(default, type) else None
            return build(typing.cast(type, hint if base is None else type(base)), value, where, base)
        check(isinstance(value, typing.cast(type, hint)), where, value, f"a table of the settings of {_name(hint)}")
        return value
    if hint is float:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        check(
            number and -MAX_SINGLE_PRECISION <= value <= MAX_SINGLE_PRECISION,
            where,
            value,
            "a finite number in single precision",
        )
        return float(value)
    if hint is int:
        if isinstance(value, float) and value.is_integer() and abs(value) <= EXACT:  # 1e5
            return int(value)
        check(isinstance(value, int) and not isinstance(value, bool), where, value, "an integer")
        check(-WHOLE <= value <= WHOLE, where, value, f"an integer of at most {WHOLE}")
        return value
    if hint is Path:
        text = str(value) if isinstance(value, str | Path) else ""
        check(text and "\0" not in text, where, value, "a path")
        return Path(text)
    check(isinstance(value, origin or hint), where, value, _name(hint))
    return value


def _is_kind(hint: object, value: object) -> bool:
    """Whether a value is a part or names its kind. Where a number may stand too, only a known name does."""
    if not isinstance(value, str) or float not in options_of(hint):
        return isinstance(value, str | Part)
    return any(value in kind.kinds() for kind in parts_in(hint))


def _is_part_table(hint: object, value: object, default: object) -> bool:
    """Whether a table describes a part or changes the `default` part, and not numbers by group."""
    mappings = any(
        isinstance(o := typing.get_origin(option), type) and issubclass(o, Mapping) for option in typing.get_args(hint)
    )
    if not isinstance(value, Mapping):
        return False
    changes = isinstance(default, Part) and value.keys() <= fields_of(type(default)).keys()
    return not mappings or "kind" in value or changes


def _part(
    kinds: tuple[type[Part], ...], hint: object, value: Part | str | Mapping[str, Any], where: str, default: object
) -> Part | None:
    """A part of a learner: itself, by the name of its kind, or as a table with its `kind` and its settings.

    Without a `kind` the table changes the `default`; where there is no default, the only kind is meant. A part of
    another kind than the default starts from the kind's own settings.
    """
    if isinstance(value, Part):
        check(isinstance(value, kinds), where, value, _name(hint))
        return value
    known = {name: cls for kind in kinds for name, cls in kind.kinds().items()}
    presets = {name: changes for kind in kinds for name, changes in getattr(kind, "presets", {}).items()}
    optional = type(None) in typing.get_args(hint)
    settings = {"kind": value} if isinstance(value, str) else dict(value)
    name = settings.pop("kind", None)
    name = name.read(str, _place(where, "kind")) if isinstance(name, Words) else name
    check(name is None or isinstance(name, str), _place(where, "kind"), name, "the name of a kind")
    if optional and name == "none":
        check(not settings, where, value, "'none' without settings")
        return None
    base = default if isinstance(default, kinds) else None
    if name in presets:
        return _part(kinds, hint, settings, where, _part(kinds, hint, presets[name], where, default))
    if name is None:
        cls = type(base) if base is not None else next(iter(known.values())) if len(known) == 1 else None
        if cls is None:
            raise ValueError(f"{_place(where, 'kind')}: must be given: {', '.join(known)}")
    elif name not in known:
        raise unknown(where, name, [*known, *presets, *(["none"] if optional else [])], registered=True)
    else:
        cls = known[name]
    if base is not None and type(base) is not cls:
        # another kind of agent keeps the settings that both have
        related = isinstance(base, cls) or issubclass(cls, type(base))
        shared = {name: getattr(base, name) for name in fields_of(type(base)) if name in fields_of(cls)}
        base = cls(**shared) if related and getattr(cls, "aliases", None) else None
    return build(cls, settings, where, base)


def _one_of(hint: object, options: tuple[Any, ...], value: object, where: str, default: object) -> Any:
    if (value is None or value == "none") and type(None) in options:
        return None
    for option in options:
        part = isinstance(option, type) and issubclass(option, Part)  # a table of one has a kind
        if dataclasses.is_dataclass(option) and isinstance(value, Mapping) and not part:
            return as_hinted(option, value, where, default)  # what is wrong in it is worth saying
    lists = [option for option in options if typing.get_origin(option) is tuple]
    if len(lists) == 1 and isinstance(value, tuple | list):
        return as_hinted(lists[0], value, where, default)
    for option in sorted(options, key=lambda option: option is not type(value)):  # 10.0 stays a float
        try:
            return as_hinted(option, value, where, default)
        except ValueError:
            continue
    raise ValueError(f"{where} = {shown(value)}: must be {_name(hint)}")


def _place(where: str, key: str) -> str:
    key = key if key.isidentifier() else shown(key)
    return f"{where}.{key}" if where else key


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return table(value)
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items() if item is not None}
    return str(value) if isinstance(value, Path) else value


def _name(hint: Any) -> str:
    names = {int: "an integer", float: "a number", str: "a string", bool: "true or false", Path: "a path"}
    if typing.get_origin(hint) is typing.Literal:
        return " or ".join(map(repr, typing.get_args(hint)))
    options = [option for option in typing.get_args(hint) if option is not type(None)]
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        return " or ".join(map(_name, options))
    if isinstance(typing.get_origin(hint), type):
        return "a table" if issubclass(typing.get_origin(hint), Mapping) else "a list"  # type: ignore[arg-type]
    if hint in names:
        return names[hint]
    return with_article(hint.__name__) if isinstance(hint, type) else str(hint)
