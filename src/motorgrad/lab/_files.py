"""Diagrams as files: plain data, canonical, one line for each block and each wire.

A file has the logic first and the layout, where an editor has put things, last. To load one is to read numbers and
texts and to look up types of blocks by name; no code comes from it.
"""

import dataclasses
import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from motorgrad._errors import check, unknown
from motorgrad._files import write_atomically
from motorgrad.lab._block import Block
from motorgrad.lab._diagram import Diagram
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


def dumps(diagram: Diagram) -> str:
    """A diagram as the text of a file: equal diagrams give the same text.

    **Raises** `ValueError` for a layout that is not plain, finite data.
    """
    head = {"format": FORMAT, "version": VERSION, **{name: getattr(diagram, name) for name in HEAD}}
    return _written({**head, **_content(diagram)}, 0) + "\n"


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
    except RecursionError:
        raise ValueError(f"file: must have at most {DEEPEST} lists and tables within each other") from None
    check(isinstance(data, dict), "file", data, "a table")
    check(data.get("format") == FORMAT, "format", data.get("format"), f"{FORMAT!r}")
    version = data.get("version")
    check(
        version == VERSION and not isinstance(version, bool), "version", version, f"{VERSION}, which this release reads"
    )
    _check_finite(data)
    _check_names("file", data, ("format", "version", *HEAD, *PARTS))
    diagram = Diagram(**{name: data[name] for name in HEAD if name in data})
    _fill(diagram, data, "")
    return diagram


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
    wires = {".".join(target): ".".join(source) for target, source in sorted(diagram.wires.items())}
    content = {"blocks": {name: _node(node) for name, node in diagram.nodes.items()}, "wires": wires}
    return content | ({"layout": diagram.layout} if diagram.layout else {})


def _node(node: Any) -> dict[str, Any]:
    if isinstance(node.block, Diagram):
        own = {name: getattr(node.block, name) for name, usual in HEAD.items() if getattr(node.block, name) != usual}
        return {"type": SUBSYSTEM, "id": node.id, **own, **_content(node.block)}
    fields = {field.name: getattr(node.block, field.name) for field in dataclasses.fields(node.block) if field.init}
    kept = {name: value for name, value in fields.items() if name not in SCHEDULE or value != SCHEDULE[name]}
    return {"type": node.block.name, "id": node.id, **kept}


def _fill(diagram: Diagram, data: Mapping[str, Any], path: str) -> None:
    """Put the blocks, wires and layout of a table into a diagram, which is the subsystem `path`."""
    for part in PARTS:
        check(isinstance(data.get(part, {}), dict), f"{path}{part}", data.get(part), "a table")
    for name, node in data.get("blocks", {}).items():
        place = f"{path}{name}"
        check(isinstance(node, dict), place, node, "a table with the type of the block and its settings")
        id = node.get("id", name)
        with _placed(place):
            check(isinstance(id, str), "id", id, "a text")
            diagram.add(name, _block(node, place), id)
    for target, source in data.get("wires", {}).items():
        with _placed(f"wire to {path}{target}"):
            diagram.connect(source, target)
    diagram.layout = data.get("layout", {})


def _block(node: Mapping[str, Any], place: str) -> Block | Diagram:
    kind = node.get("type")
    if kind == SUBSYSTEM:
        _check_names(SUBSYSTEM, node, ("type", "id", *HEAD, *PARTS))
        inner = Diagram(**{name: node[name] for name in HEAD if name in node})
        _fill(inner, node, f"{place}/")
        return inner
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
    missing = [name for name in needed if name not in node]
    check(not missing, kind, sorted(node), f"a table with {', '.join(needed)}")
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
        raise _PlacedError(f"{self.place}: {' '.join(str(error).split())}") from None


class _PlacedError(ValueError):
    pass


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        twice = next(name for name in table if sum(name == other for other, _ in pairs) > 1)
        raise ValueError(f"{twice!r}: must be there once in its table")
    return table


def _check_names(what: str, table: Mapping[str, Any], known: Any) -> None:
    for name in table:
        if name not in known:
            raise unknown(f"setting of {what}", name, known)


def _check_finite(data: Any) -> None:
    for place, value in _numbers(data, (), 0):
        check(math.isfinite(value), ".".join(place), value, "finite")


def _numbers(data: Any, place: tuple[str, ...], depth: int) -> Iterator[tuple[tuple[str, ...], float]]:
    check(depth <= DEEPEST, ".".join(place), "…", f"in at most {DEEPEST} lists and tables within each other")
    if isinstance(data, dict):
        for name, value in data.items():
            yield from _numbers(value, (*place, name), depth + 1)
    elif isinstance(data, list | tuple):
        for number, value in enumerate(data):
            yield from _numbers(value, (*place, str(number)), depth + 1)
    elif isinstance(data, float):
        yield place, data


LINES = 3
"""Down to this depth every entry has a line of its own: parts, their blocks and wires; and so on in a subsystem."""


def _written(table: Any, depth: int) -> str:
    """A table with a line for each entry; blocks, and what else lies deeper, on one line each."""
    lines = []
    for name, value in table.items():
        inner = isinstance(value, dict) and value and (depth < 1 or name in PARTS or value.get("type") == SUBSYSTEM)
        text = _written(value, depth + 1) if inner and name != "layout" else _plain(value)
        if name == "layout":
            text = _table_of_lines(value, depth + 1)
        lines.append(f"{'  ' * (depth + 1)}{_plain(name)}: {text}")
    return "{\n" + ",\n".join(lines) + f"\n{'  ' * depth}}}"
