"""Settings: building frozen dataclasses from plain tables, refusing what they do not know."""

import dataclasses
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from motorgrad._errors import check, shown, unknown

T = TypeVar("T")
LARGEST = 3.4e38  # of single precision
WHOLE = 2**63 - 1
EXACT = 2**53  # the largest up to which a float is the one whole number that was written


def build(cls: type[T], values: Mapping[str, Any], where: str = "", base: T | None = None) -> T:
    """An instance of the dataclass `cls` from a table of `values`; a field that is a dataclass takes a table itself.

    What a table leaves out is as in `base`, or as `cls` has it by default. So it is for tables within the table.

    **Raises:** `ValueError` that names the unknown key and the nearest known one, the value of a wrong type, or the key
    that is missing.
    """
    given, fields = convert(cls, values, where, base), fields_of(cls)
    for name, field in fields.items():
        if base is None and name not in given and default_of(field) is dataclasses.MISSING:
            raise ValueError(f"{_place(where, name)}: must be given")
    try:
        return cls(**given) if base is None else dataclasses.replace(base, **given)  # type: ignore[type-var]
    except ValueError as error:
        named = str(error).split(" ", 1)[0].partition(".")[0] in fields
        raise ValueError(f"{where}{'.' if named else ': '}{error}" if where else str(error)) from None


def convert(cls: type, values: Mapping[str, Any], where: str = "", base: Any = None) -> dict[str, Any]:
    """The values as `cls` wants them, each by itself; as `build` without making the instance."""
    hints, fields, given = typing.get_type_hints(cls), fields_of(cls), {}
    for key, value in values.items():
        if key not in fields:
            raise unknown(f"setting of {where or cls.__name__.lower()}", key, fields, _deeper(cls, key, base))
        default = default_of(fields[key]) if base is None else getattr(base, key)
        given[key] = as_hinted(hints[key], value, _place(where, key), default)
    return given


def _deeper(cls: type, key: str, base: Any = None) -> list[str]:
    """Where tables within the table have a setting of this name."""
    hints, found = typing.get_type_hints(cls), []
    for name, field in fields_of(cls).items():
        default = default_of(field) if base is None else getattr(base, name)
        inner = type(default) if dataclasses.is_dataclass(default) else hints[name]
        if dataclasses.is_dataclass(inner):
            found += [f"{name}.{key}"] if key in fields_of(inner) else []
            found += [f"{name}.{deeper}" for deeper in _deeper(typing.cast(type, inner), key)]
    return found


def table(instance: Any) -> dict[str, Any]:
    """The inverse of `build`: a dataclass as a plain table. Fields that are `None` are left out."""
    values = {name: getattr(instance, name) for name in fields_of(type(instance))}
    return {name: _plain(value) for name, value in values.items() if value is not None}


def fields_of(cls: Any) -> dict[str, dataclasses.Field[Any]]:
    """The fields of a dataclass that it takes, by name."""
    return {field.name: field for field in dataclasses.fields(cls) if field.init}


def default_of(field: dataclasses.Field[Any]) -> Any:
    """A field's default, made if it must be; `dataclasses.MISSING` where there is none."""
    return field.default if field.default_factory is dataclasses.MISSING else field.default_factory()


def as_hinted(hint: Any, value: Any, where: str, default: Any = None) -> Any:
    """A plain value as the type `hint`; a table changes the `default` if that is a dataclass.

    **Raises** `ValueError` that says where, the value and what it must be.
    """
    value = value.item() if isinstance(value, np.generic) else value
    origin, options = typing.get_origin(hint), typing.get_args(hint)
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
        return {name: as_hinted(options[1], item, _place(where, str(name))) for name, item in value.items()}
    if dataclasses.is_dataclass(hint):
        if isinstance(value, Mapping):
            base = default if dataclasses.is_dataclass(default) and not isinstance(default, type) else None
            return build(typing.cast(type, hint if base is None else type(base)), value, where, base)
        check(isinstance(value, typing.cast(type, hint)), where, value, f"a table of the settings of {_name(hint)}")
        return value
    if hint is float:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        check(number and -LARGEST <= value <= LARGEST, where, value, "a finite number in single precision")
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
    check(isinstance(value, hint), where, value, _name(hint))
    return value


def _one_of(hint: Any, options: tuple[Any, ...], value: Any, where: str, default: Any) -> Any:
    if value is None and type(None) in options:
        return None
    for option in options:
        if dataclasses.is_dataclass(option) and isinstance(value, Mapping):  # what is wrong in it is worth saying
            return as_hinted(option, value, where, default)
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
    return names.get(hint) or getattr(hint, "__name__", str(hint))
