"""Plain tables of settings: what a file or a stored run has, from which `build` makes the same again."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.schema._declare import declared_by, default_of
from motorgrad.schema._part import Part, fields_of, kind_of

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


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
