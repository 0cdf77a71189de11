"""Checking the fields of frozen dataclasses against their annotations."""

import dataclasses
from typing import Any

from motorgrad._settings import as_hinted


def check_fields(instance: Any) -> None:
    """Convert the fields of a frozen dataclass to their annotated types, as settings from a file are.

    Call this first in `__post_init__`, so that an instance made in Python has the types of one made from TOML.

    **Raises:** `ValueError` for a field of the wrong type, or not among the options of its `Literal`.
    """
    for field in dataclasses.fields(instance):
        object.__setattr__(instance, field.name, as_hinted(field.type, getattr(instance, field.name), field.name))
