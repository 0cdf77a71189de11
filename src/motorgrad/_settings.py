"""Settings: building frozen dataclasses from plain tables, refusing what they do not know."""

import dataclasses
import sys
import types
import typing
from collections.abc import Mapping
from typing import Any, TypeVar

from motorgrad._errors import unknown

T = TypeVar("T")


def build(cls: type[T], values: Mapping[str, Any], where: str = "") -> T:
    """An instance of the dataclass `cls` from a table of `values`; a field that is a dataclass takes a table itself.

    **Raises:** `ValueError` that names the unknown key and the nearest known one, the value of a wrong type, or the key
    that is missing.
    """
    hints = typing.get_type_hints(cls)
    fields = {field.name: field for field in dataclasses.fields(cls) if field.init}  # type: ignore[arg-type]
    given = {}
    for key, value in values.items():
        if key not in fields:
            raise unknown(f"setting of {where or cls.__name__}", key, fields)
        try:
            given[key] = _convert(hints[key], value, f"{where}.{key}" if where else key)
        except TypeError as error:
            raise ValueError(str(error)) from None
    for name, field in fields.items():
        if name not in given and field.default is field.default_factory is dataclasses.MISSING:
            raise ValueError(f"{f'{where}.{name}' if where else name}: must be given")
    return cls(**given)


def table(instance: Any) -> dict[str, Any]:
    """The inverse of `build`: a dataclass as a plain table. Fields that are `None` are left out."""
    values = {}
    for field in dataclasses.fields(instance):
        value = getattr(instance, field.name)
        if value is None or not field.init:
            continue
        values[field.name] = _plain(value)
    return values


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return table(value)
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items() if item is not None}
    return value


def _convert(hint: Any, value: Any, where: str) -> Any:
    origin, options = typing.get_origin(hint), typing.get_args(hint)
    if hint is Any:
        return value
    if origin in (typing.Union, types.UnionType):
        if value is None and type(None) in options:
            return None
        for option in options:
            try:
                return _convert(option, value, where)
            except (TypeError, ValueError):
                continue
        raise TypeError(f"{where} = {value!r}: must be {_name(hint)}")
    if origin is typing.Literal:
        if value not in options:
            raise unknown(where, value, map(str, options))
        return value
    if origin is tuple:
        if not isinstance(value, tuple | list):
            raise TypeError(f"{where} = {value!r}: must be a list")
        inner = [options[0]] * len(value) if len(options) == 2 and options[1] is Ellipsis else list(options)
        if len(inner) != len(value):
            raise TypeError(f"{where} = {value!r}: must have {len(inner)} entries")
        return tuple(_convert(i, v, f"{where}[{n}]") for n, (i, v) in enumerate(zip(inner, value, strict=True)))
    if isinstance(origin, type) and issubclass(origin, Mapping):
        if not isinstance(value, Mapping):
            raise TypeError(f"{where} = {value!r}: must be a table")
        return {name: _convert(options[1], item, f"{where}.{name}") for name, item in value.items()}
    if dataclasses.is_dataclass(hint):
        if isinstance(value, Mapping):
            return build(typing.cast(type, hint), value, where)
        if isinstance(value, typing.cast(type, hint)):
            return value
        raise TypeError(f"{where} = {value!r}: must be a table of the settings of {_name(hint)}")
    if hint is float:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not -sys.float_info.max <= value <= sys.float_info.max:
            raise TypeError(f"{where} = {value!r}: must be a finite number")
        return float(value)
    if (hint is int and isinstance(value, bool)) or not isinstance(value, hint):
        raise TypeError(f"{where} = {value!r}: must be {_name(hint)}")
    return value


def _name(hint: Any) -> str:
    names = {int: "an integer", float: "a number", str: "a string", bool: "true or false", type(None): "none"}
    return names.get(hint) or " or ".join(names.get(o, str(o)) for o in typing.get_args(hint)) or str(hint)
