"""What there is to build with: every type of block, and the ready diagrams."""

import dataclasses
import functools
import inspect
import typing
from typing import Any

from motorgrad.lab import gallery
from motorgrad.lab._block import Block
from motorgrad.lab._files import SCHEDULE, SUBSYSTEM
from motorgrad.lab._parameter import parameters_of, settings_of
from motorgrad.lab._registry import BLOCKS
from motorgrad.lab.editor._views import parameter_field, ports


def declarations() -> dict[str, Any]:
    """All that a palette and its forms need: `categories`, each with the names of its types; `blocks` by type, the
    subsystem among them; `gallery`, entries with name, title and comment."""
    kinds = {name: declaration(cls) for name, cls in sorted(BLOCKS.items())}
    kinds[SUBSYSTEM] = _SUBSYSTEM
    categories: dict[str, list[str]] = {}
    for name, kind in kinds.items():
        categories.setdefault(kind["category"], []).append(name)
    return {"categories": dict(sorted(categories.items())), "blocks": kinds, "gallery": _gallery()}


@functools.cache
def declaration(cls: type[Block]) -> dict[str, Any]:
    """One type: name, category, `help`, `fields` in order, and the ports of a new one, `null` where it has fields that
    must be given."""
    parameters, settings, hints = parameters_of(cls), settings_of(cls), typing.get_type_hints(cls)
    fields = []
    for field in sorted(dataclasses.fields(cls), key=lambda field: field.name in SCHEDULE):  # these are last
        if not field.init:
            continue
        own: dict[str, Any] = {"name": field.name, "type": _words(hints[field.name]), "required": _required(field)}
        if field.name in parameters:
            own |= parameter_field(parameters[field.name])
        elif field.name in settings:
            own |= dataclasses.asdict(settings[field.name]) | {"role": "setting"}
        fields.append(own)
    new = None if any(field["required"] for field in fields) else cls()
    for field in fields:
        field["default"] = None if new is None else getattr(new, field["name"])
    return {
        "name": cls.name,
        "category": cls.category,
        "help": inspect.cleandoc(cls.__doc__ or ""),
        "fields": fields,
        "inputs": None if new is None else ports(new.inputs),
        "outputs": None if new is None else ports(new.outputs),
        "drawing": getattr(cls, "drawing", None),
    }


_SUBSYSTEM: dict[str, Any] = {
    "name": SUBSYSTEM,
    "category": "subsystems",
    "help": "A diagram as a block of this one. Inlets and outlets in it are its ports.",
    "fields": [],
    "inputs": [],
    "outputs": [],
    "drawing": None,
}


@functools.cache
def _gallery() -> list[dict[str, str]]:
    made = {name: make() for name, make in gallery.GALLERY.items()}
    return [{"name": name, "title": each.title, "comment": each.comment} for name, each in made.items()]


def _required(field: Any) -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


def _words(hint: Any) -> str:
    """A type as it is written, such as `int`, `float | None` or `tuple[int, ...]`."""
    if isinstance(hint, type) and not typing.get_args(hint):
        return hint.__name__
    return str(hint).replace("typing.", "").replace("collections.abc.", "")
