"""Frozen dataclasses of settings: checked when they are made."""

import dataclasses
from typing import TYPE_CHECKING, Any

from motorgrad.schema._build import as_hinted
from motorgrad.schema._declare import declared_by, holds_numbers, inherit_declarations, plain_numbers
from motorgrad.schema._part import Part, hints_of, options_of
from motorgrad.schema._texts import with_fields

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


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


def check_fields(instance: "DataclassInstance") -> None:
    """Convert the fields of a frozen dataclass to their annotated types, as settings from a file are.

    An instance made in Python so has the types of one made from TOML.

    **Raises:** `ValueError` for a field of the wrong type, out of its range, or not among the options of its `Literal`.
    """
    for field in dataclasses.fields(instance):
        if field.init:
            hint = hints_of(type(instance))[field.name]
            value = getattr(instance, field.name)
            declared = declared_by(field)
            options = options_of(hint)
            if Any in options and holds_numbers(field):
                value = plain_numbers(value, field.name, declared, type(None) in options)
            else:
                value = as_hinted(hint, value, field.name)
            object.__setattr__(instance, field.name, value)
            if declared.range is None or value is None or isinstance(value, str | Part):
                continue
            several = isinstance(value, tuple)
            for place, number in enumerate(value if several else (value,)):
                name = f"{field.name}[{place}]" if several else field.name
                declared.check(name, number)
