"""What classes of settings declare, for the pages of the API: griffe reads source code, where a default is a call."""

import dataclasses
import inspect
from importlib import import_module
from typing import Any

import griffe  # pyright: ignore[reportMissingImports]

from motorgrad.learning import PRESETS
from motorgrad.schema import declared_by, default_of


class Declarations(griffe.Extension):
    """Gives a class the docstring that it has once it is defined, with all arguments, and its fields their defaults."""

    def on_module_members(self, *, mod: Any, **_: Any) -> None:
        """Called with every module that griffe has read. `motorgrad.presets` is filled from a registry, so its names
        are in none of its lines."""
        if mod.path != "motorgrad.presets":
            return
        for name, table in PRESETS.items():
            public = name.replace("-", "_")
            mod.set_member(public, griffe.Alias(public, f"{table.__module__}.{table.__qualname__}", parent=mod))

    def on_class_members(self, *, cls: Any, **_: Any) -> None:
        """Called with every class that griffe has read."""
        made = getattr(import_module(cls.module.path), cls.name, None)
        if not isinstance(made, type) or not dataclasses.is_dataclass(made):
            return
        declared = [field for field in dataclasses.fields(made) if declared_by(field).help]
        for field in declared:
            if field.name in cls.members:
                default = default_of(field)
                cls.members[field.name].value = None if default is dataclasses.MISSING else repr(default)
        if declared and cls.docstring is not None:
            cls.docstring.value = inspect.cleandoc(made.__doc__ or "")
