"""Diagrams as files: plain data, canonical, one line for each block and each wire.

A file has the logic first and the layout, where an editor has put things, last. To load one is to read numbers and
texts and to look up types of blocks by name; no code comes from it.
"""

import dataclasses
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from motorgrad._errors import LONGEST, check, shown, unknown
from motorgrad._files import write_atomically
from motorgrad.lab._block import Block
from motorgrad.lab._diagram import Diagram, Node
from motorgrad.lab._registry import BLOCKS

FORMAT = "motorgrad diagram"
VERSION = 1
SUBSYSTEM = "diagram"
"""The type under which a subsystem stands in a file."""
LARGEST = 50_000_000  # characters
DEEPEST = 100  # lists and tables within each other
SCHEDULE = {"every": 1, "period": None}
"""Fields that stand in a file only where they differ from these: at every tick."""
HEAD = {"title": "", "comment": "", "tick": 0.01, "substeps": 1}
PARTS = ("blocks", "wires", "layout")


class _Lines(dict[str, Any]):
    """A table with a line for each entry; others stand on one line."""


def dumps(diagram: Diagram) -> str:
    """A diagram as the text of a file: equal diagrams give the same text.

    **Raises** `ValueError` for a layout that is not plain, finite data.
    """
    data = _Lines(
        format=FORMAT, version=VERSION, **{name: getattr(diagram, name) for name in HEAD}, **_content(diagram)
    )
    _check_plain(data, (), 0)
    return _written(data, 1) + "\n"


def loads(text: str) -> Diagram:
    """The diagram that a text describes, `dumps` undone.

    It is a diagram, but need not run: what is missing or does not fit is told by `problems`, so that half-finished work
    can be kept.

    **Raises** `ValueError`, naming the place, for text that is no JSON, another format or version, types of blocks,
    ports or names that there are not, and numbers that are not finite or not allowed.
    """
    check(isinstance(text, str) and len(text) <= LARGEST, "file", text, f"a text of at most {LARGEST:,} characters")
    try:
        data = json.loads(text, object_pairs_hook=_unique)
    except json.JSONDecodeError as error:
        raise ValueError(f"line {error.lineno}, column {error.colno}: must be JSON: {error.msg}") from None
    except _PlacedError:
        raise
    except ValueError as error:  # numbers of thousands of digits
        raise ValueError(f"file: must be JSON: {error}") from None
    except RecursionError:
        raise ValueError(f"file: must have at most {DEEPEST} lists and tables within each other") from None
    _check_plain(data, (), 0)
    check(isinstance(data, dict), "file", data, "a table")
    check(data.get("format") == FORMAT, "format", data.get("format"), f"{FORMAT!r}")
    version = data.get("version")
    check(
        version == VERSION and not isinstance(version, bool), "version", version, f"{VERSION}, which this release reads"
    )
    _check_names("file", data, ("format", "version", *HEAD, *PARTS))
    return _diagram(data, "")


def save(diagram: Diagram, path: Path | str) -> None:
    """Write a diagram to a file, which is replaced in one go."""
    write_atomically(Path(path), dumps(diagram).encode())


def load(path: Path | str) -> Diagram:
    """Read a diagram from a file. **Raises** as `loads`, naming the file, and `OSError` where it cannot be read."""
    try:
        return loads(Path(path).read_bytes().decode())
    except ValueError as error:  # among them: no UTF-8
        raise ValueError(f"{path}: {error}") from None


def _content(diagram: Diagram) -> dict[str, Any]:
    blocks = _Lines({name: _node(node) for name, node in diagram.nodes.items()})
    wires = _Lines({".".join(target): ".".join(source) for target, source in sorted(diagram.wires.items())})
    return {"blocks": blocks, "wires": wires} | ({"layout": _Lines(diagram.layout)} if diagram.layout else {})


def _node(node: Node) -> dict[str, Any]:
    block = node.block
    if isinstance(block, Diagram):
        own = {name: getattr(block, name) for name, usual in HEAD.items() if getattr(block, name) != usual}
        return _Lines(type=SUBSYSTEM, id=node.id, **own, **_content(block))
    fields = {field.name: getattr(block, field.name) for field in dataclasses.fields(block) if field.init}
    kept = {name: value for name, value in fields.items() if name not in SCHEDULE or value != SCHEDULE[name]}
    return {"type": block.name, "id": node.id, **kept}


def _written(value: Any, depth: int) -> str:
    if not isinstance(value, _Lines) or not value:
        return json.dumps(value, ensure_ascii=False)
    lines = [
        f"{'  ' * depth}{json.dumps(name, ensure_ascii=False)}: {_written(x, depth + 1)}" for name, x in value.items()
    ]
    return "{\n" + ",\n".join(lines) + f"\n{'  ' * (depth - 1)}}}"


def _diagram(data: Mapping[str, Any], path: str) -> Diagram:
    """The diagram of a table, which is the subsystem `path`."""
    for name in ("title", "comment"):
        check(isinstance(data.get(name, ""), str), f"{path}{name}", data.get(name), "a text")
    for part in PARTS:
        check(isinstance(data.get(part, {}), dict), f"{path}{part}", data.get(part), "a table")
    with _placed(path.rstrip("/") or "diagram"):
        diagram = Diagram(**{name: data[name] for name in HEAD if name in data})
    for name, node in data.get("blocks", {}).items():
        with _placed(f"{path}{name}"):
            check(isinstance(node, dict), "block", node, "a table with its type and settings")
            id = node.get("id", name)
            check(isinstance(id, str), "id", id, "a text")
            diagram.add(name, _block(node, f"{path}{name}"), id)
    for target, source in data.get("wires", {}).items():
        with _placed(f"wire to {path}{target}"):
            diagram.connect(source, target)
    diagram.layout = data.get("layout", {})
    return diagram


def _block(node: Mapping[str, Any], place: str) -> Block | Diagram:
    kind = node.get("type")
    if kind == SUBSYSTEM:
        _check_names(SUBSYSTEM, node, ("type", "id", *HEAD, *PARTS))
        return _diagram(node, f"{place}/")
    if not isinstance(kind, str) or kind not in BLOCKS:
        raise unknown("type of block", kind, (*BLOCKS, SUBSYSTEM))
    cls = BLOCKS[kind]
    names = [field.name for field in dataclasses.fields(cls) if field.init]
    _check_names(kind, node, ("type", "id", *names))
    needed = [
        field.name
        for field in dataclasses.fields(cls)
        if field.init and field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
    ]
    for name in needed:
        if name not in node:
            raise ValueError(f"{kind}: {name} must be given")
    return cls(**{name: node[name] for name in names if name in node})


class _placed:
    """Errors within say at which block or wire they arose; those of a subsystem's parts have said so already."""

    def __init__(self, place: str):
        self.place = place

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        if isinstance(error, _PlacedError) or not isinstance(error, ValueError | TypeError | OSError):
            return
        raise _PlacedError(f"{_named(self.place)}: {' '.join(str(error).split())}") from None


class _PlacedError(ValueError):
    pass


def _named(place: str) -> str:
    """A place in a message, which a file may name as it likes."""
    return place if place.isprintable() and len(place) <= 2 * LONGEST else shown(place)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        twice = next(name for name in table if sum(name == other for other, _ in pairs) > 1)
        raise _PlacedError(f"{shown(twice)}: must be there once in its table")
    return table


def _check_names(what: str, table: Mapping[str, Any], known: Any) -> None:
    for name in table:
        if name not in known:
            raise unknown(f"setting of {what}", name, known)


def _check_plain(data: Any, place: tuple[str, ...], depth: int) -> None:
    """Refuse what a file cannot hold, or should not: by its place."""
    name = _named(".".join(place)) or "file"
    check(depth <= DEEPEST, name, "…", f"in at most {DEEPEST} lists and tables within each other")
    check(data is None or isinstance(data, bool | int | float | str | list | tuple | dict), name, data, "plain data")
    check(not isinstance(data, float) or math.isfinite(data), name, data, "finite")
    if isinstance(data, str):
        check(data.isascii() or not any("\ud800" <= sign <= "\udfff" for sign in data), name, data, "whole characters")
    elif isinstance(data, dict):
        for key, value in data.items():
            check(isinstance(key, str), name, key, "a table whose names are texts")
            _check_plain(key, place, depth)
            _check_plain(value, (*place, key), depth + 1)
    elif isinstance(data, list | tuple):
        for number, value in enumerate(data):
            _check_plain(value, (*place, str(number)), depth + 1)
