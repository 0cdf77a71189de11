"""The JSON files of reproductions: reading them, which may be another version's or a stranger's."""

from pathlib import Path
from typing import Any

from motorgrad._errors import shown
from motorgrad._files import read_json

NUMBER = (int, float)
TEXT_TABLE: dict[Any, Any] = {str: str}
"""A table of texts, by any name."""
CLAIM = {
    **{"statement": str, "criterion": str, "finding": str, "verdict": str, "source": str, "note": str},
    **{"kind": str, "of": str, "untested": str},
}
RECORD = {
    **{"name": str, "title": str, "part": str, "source": str, "reading": str, "summary": str},
    **{"command": str, "processor": str},
    **{"settings": dict, "versions": TEXT_TABLE, "claims": [CLAIM], "films": [str]},
    **{"quick": bool, "seconds": NUMBER, "trained": NUMBER},
}
SESSIONS = {"sessions": [{"versions": TEXT_TABLE, "processor": str, "seconds": NUMBER, "trained": {str: NUMBER}}]}
FAILURE = {"job": str, "message": str}
TYPE_LABELS = {str: "a text", dict: "a table", bool: "true or false", NUMBER: "a number"}
AGAIN = "it is damaged or made by another version; delete it, and reproduce the experiment again"


def read_record(file: Path, shape: Any) -> Any:
    """What a JSON file says. **Raises** `ValueError` that names the file, and where it differs from the shape.

    **Arguments:** `shape`: a type; a list with the shape of its elements; a table with those of its entries by name, or
    with that of all by `str`.
    """
    found = read_json(file)
    if wrong := _difference(found, shape, ""):
        raise ValueError(f"{file}: {wrong}: {AGAIN}")
    return found


def _difference(value: Any, shape: Any, name: str) -> str:
    """The first difference, in words."""
    if isinstance(shape, list):
        if not isinstance(value, list):
            return _must(name, value, "a list")
        return next(filter(None, (_difference(each, shape[0], f"{name}[{i}]") for i, each in enumerate(value))), "")
    if isinstance(shape, dict):
        if not isinstance(value, dict):
            return _must(name, value, "a table")
        entries = dict.fromkeys(value, shape[str]) if str in shape else shape
        if missing := [key for key in entries if key not in value]:
            return f"{name or 'the file'} has no {missing[0]!r}"
        inside = f"{name}." if name else ""
        return next(
            filter(None, (_difference(value[key], each, f"{inside}{key}") for key, each in entries.items())), ""
        )
    right = isinstance(value, shape) and (shape is bool or not isinstance(value, bool))
    return "" if right else _must(name, value, TYPE_LABELS[shape])


def _must(name: str, value: Any, kind: str) -> str:
    return f"{name or 'it'} = {shown(value)}, not {kind}"
