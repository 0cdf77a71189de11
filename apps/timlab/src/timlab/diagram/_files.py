"""Diagram files: plain JSON in canonical form, one line per block and per wire.

The logic comes first and the layout, which belongs to an editor, last. Loading reads numbers and strings and looks up
block types by name; no code is executed.
"""

import dataclasses
import json
import math
import re
from collections import Counter
from collections.abc import Collection, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

from motorgrad._arguments import check_arguments
from motorgrad._errors import MAX_VALUE_CHARACTERS, check, shown, unknown
from motorgrad._files import write_atomically
from motorgrad._limits import MAX_DIAGRAM_CHARACTERS, MAX_INTEGER_DIGITS, MAX_NESTING_DEPTH
from motorgrad._reading import content_of
from motorgrad.schema import default_of, fields_of
from timlab.diagram._block import BLOCKS, Block
from timlab.diagram._diagram import HEAD, Diagram, Node
from timlab.diagram._foreign import from_a_file

FORMAT = "motorgrad diagram"
VERSION = 1
SUBSYSTEM = "diagram"
"""The type of a subsystem in files."""
SCHEDULE = {"every": 1, "period": None}
"""Fields that are written only where they differ from these defaults."""
ALWAYS = ("title", "comment", "tick", "substeps")  # written even where they are at their defaults
PARTS = ("blocks", "wires", "layout")
MAX_COORDINATE = 1e9  # pixels from the origin of a drawing
_HALF = re.compile("[\ud800-\udfff]")


class _Lines(dict[str, Any]):
    """A table that is written with one line per entry; other tables are written on one line."""


def dumps(diagram: Diagram) -> str:
    """The text of a diagram's file: equal diagrams give equal texts.

    **Raises** `ValueError` for a layout that is not plain, finite data.
    """
    check_arguments(dumps, locals())
    head = {name: value for name, value in diagram.head.items() if name in ALWAYS or value != HEAD[name]}
    data = _Lines(format=FORMAT, version=VERSION, **head, **_content(diagram))
    check_data(data)
    return _written(data, 1) + "\n"


def loads(text: str, trust: bool = False) -> Diagram:
    """Parse the text of a file, the inverse of `dumps`.

    The diagram need not be able to run, so that unfinished work can be saved; `problems` reports what is missing or
    does not fit. Code that blocks hold (`Foreign`) is kept, and refuses to run unless you `trust` the file.

    **Raises** `ValueError` that names the place: for invalid JSON, another format or version, unknown block types,
    ports or names, and numbers that are not finite or not allowed.
    """
    check_arguments(loads, locals())
    check(
        isinstance(text, str) and len(text) <= MAX_DIAGRAM_CHARACTERS,
        "file",
        text,
        f"a string of at most {MAX_DIAGRAM_CHARACTERS:,} characters",
    )
    try:
        data = json.loads(text, object_pairs_hook=_unique)
    except json.JSONDecodeError as error:
        raise ValueError(f"line {error.lineno}, column {error.colno}: must be JSON: {error.msg}") from None
    except _PlacedError:
        raise
    except ValueError as error:  # an integer of thousands of digits
        raise ValueError(f"file: must be JSON: {error}") from None
    except RecursionError:
        raise ValueError(f"file: must have at most {MAX_NESTING_DEPTH} nested lists and tables") from None
    check_data(data)
    check(isinstance(data, dict), "file", data, "a table")
    check(data.get("format") == FORMAT, "format", data.get("format"), f"{FORMAT!r}")
    version = data.get("version")
    check(
        version == VERSION and not isinstance(version, bool), "version", version, f"{VERSION}, which this release reads"
    )
    _check_keys("file", data, ("format", "version", *HEAD, *PARTS))
    with from_a_file(trust):
        return _read_diagram(data, "")


def save(diagram: Diagram, path: Path | str) -> None:
    """Write a diagram to a file, atomically."""
    check_arguments(save, locals())
    write_atomically(Path(path), dumps(diagram).encode())


def load(path: Path | str, trust: bool = False) -> Diagram:
    """Read a diagram from a file. Code that its blocks hold may run only if you `trust` it.

    **Raises** `ValueError` as `loads` does, naming the file, and `OSError` if it cannot be read.
    """
    check_arguments(load, locals())
    try:
        return loads(content_of(Path(path), 4 * MAX_DIAGRAM_CHARACTERS).decode(), trust)
    except ValueError as error:  # invalid UTF-8 too
        raise ValueError(f"{path}: {error}") from None


def _content(diagram: Diagram) -> dict[str, Any]:
    blocks = _Lines({name: _node(node) for name, node in diagram.nodes.items()})
    wires = _Lines({".".join(target): ".".join(source) for target, source in sorted(diagram.wires.items())})
    return {"blocks": blocks, "wires": wires} | ({"layout": _Lines(diagram.layout)} if diagram.layout else {})


def _node(node: Node) -> dict[str, Any]:
    block = node.block
    if isinstance(block, Diagram):
        own = {name: value for name, value in block.head.items() if value != HEAD[name]}
        return _Lines(type=SUBSYSTEM, id=node.id, **own, **_content(block))
    fields = {name: getattr(block, name) for name in fields_of(type(block))}
    kept = {name: value for name, value in fields.items() if name not in SCHEDULE or value != SCHEDULE[name]}
    module = type(block).__module__
    own = {} if module.split(".")[0] == "timlab" else {"module": module}  # so that a reader knows what to import
    return {"type": block.name, "id": node.id, **own, **kept}


def _written(value: object, depth: int) -> str:
    if not isinstance(value, _Lines) or not value:
        return json.dumps(value, ensure_ascii=False)
    lines = [
        f"{'  ' * depth}{json.dumps(name, ensure_ascii=False)}: {_written(x, depth + 1)}" for name, x in value.items()
    ]
    return "{\n" + ",\n".join(lines) + f"\n{'  ' * (depth - 1)}}}"


def _read_diagram(data: Mapping[str, Any], path: str) -> Diagram:
    """The diagram of a table; `path` is its place as a subsystem."""
    for name in ("title", "comment"):
        check(isinstance(data.get(name, ""), str), f"{path}{name}", data.get(name), "a string")
    for part in PARTS:
        check(isinstance(data.get(part, {}), dict), f"{path}{part}", data.get(part), "a table")
    with _error_context(path.rstrip("/") or "diagram"):
        diagram = Diagram(**{name: data[name] for name in HEAD if name in data})
    for name, node in data.get("blocks", {}).items():
        with _error_context(f"{path}{name}"):
            check(isinstance(node, dict), "block", node, "a table with its type and settings")
            id = node.get("id", name)
            check(isinstance(id, str), "id", id, "a string")
            diagram.add(name, _block(node, f"{path}{name}"), id)
    for target, source in data.get("wires", {}).items():
        with _error_context(f"wire to {path}{target}"):
            diagram.connect(source, target)
    with _error_context(path.rstrip("/") or "diagram"):
        diagram.layout = checked_layout(data.get("layout", {}))
    return diagram


def _block(node: Mapping[str, Any], place: str) -> Block | Diagram:
    kind = node.get("type")
    if kind == SUBSYSTEM:
        _check_keys(SUBSYSTEM, node, ("type", "id", *HEAD, *PARTS))
        return _read_diagram(node, f"{place}/")
    module = node.get("module")
    check(module is None or isinstance(module, str), "module", module, "a string")
    if module is not None and kind not in BLOCKS:
        raise ValueError(
            f"the type of block {shown(kind)} is defined in {shown(module)}, which is not imported: motorgrad lab "
            "--import FILE, or import it in Python before the diagram is loaded"
        )
    return make_block(kind, {name: value for name, value in node.items() if name not in ("type", "id", "module")})


def make_block(kind: object, fields: Mapping[str, Any]) -> Block:
    """A block from the name of its type and a table of fields.

    **Raises** `ValueError` for an unknown type or field, and for a missing or invalid field.
    """
    if not isinstance(kind, str) or kind not in BLOCKS:
        raise unknown("type of block", kind, (*BLOCKS, SUBSYSTEM))
    cls = BLOCKS[kind]
    _check_keys(kind, fields, fields_of(cls))
    for name in required_fields(cls):
        if name not in fields:
            raise ValueError(f"{kind}: {name} must be given")
    return cls(**fields)


def check_names(block: Block, fields: Mapping[str, Any]) -> None:
    """Refuse values of fields that a block does not have. **Raises** `ValueError`."""
    _check_keys(block.name, fields, {**fields_of(type(block)), **block.parameters})


def required_fields(cls: type[Block]) -> list[str]:
    """The fields of a block type that have no default."""
    return [name for name, field in fields_of(cls).items() if default_of(field) is dataclasses.MISSING]


class _error_context:
    """A context that adds the place, a block or a wire, to errors. Errors from within a subsystem have their place
    already.
    """

    def __init__(self, place: str):
        self.place = place

    def __enter__(self) -> None:
        return None

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if isinstance(error, _PlacedError) or not isinstance(error, ValueError | TypeError | OSError):
            return
        raise _PlacedError(f"{_place_name(self.place)}: {' '.join(str(error).split())}") from None


class _PlacedError(ValueError):
    pass


def _place_name(place: str) -> str:
    """A place for a message; the names in a file may be anything."""
    return place if place.isprintable() and len(place) <= 2 * MAX_VALUE_CHARACTERS else shown(place)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        twice = Counter(name for name, _ in pairs).most_common(1)[0][0]
        raise _PlacedError(f"{shown(twice)}: must occur once in its table")
    return table


def _check_keys(what: str, table: Mapping[str, Any], known: Collection[str]) -> None:
    for name in table:
        if name not in known:
            raise unknown(f"setting of {what}", name, known)


def check_data(data: object, place: tuple[str, ...] = ()) -> None:
    """Refuse data that a file cannot or should not contain, naming its place."""
    depth = len(place)
    if wanted := _wanted(data, depth):
        name = _place_name(".".join(place)) or "file"
        check(False, name, "…" if depth > MAX_NESTING_DEPTH else data, wanted)
    if isinstance(data, dict):
        for key, value in data.items():
            check(isinstance(key, str), _place_name(".".join(place)) or "file", key, "a table whose keys are strings")
            check_data(key, place)
            check_data(value, (*place, key))
    elif isinstance(data, list | tuple):
        for number, value in enumerate(data):
            check_data(value, (*place, str(number)))


def _wanted(data: object, depth: int) -> str:
    """What data must be instead, in words that complete "must be …"; empty if it may be as it is."""
    if depth > MAX_NESTING_DEPTH:
        return f"in at most {MAX_NESTING_DEPTH} nested lists and tables"
    if isinstance(data, str):
        return "whole characters" if _HALF.search(data) else ""
    if isinstance(data, float):
        return "" if math.isfinite(data) else "finite"
    if isinstance(data, int):
        return "" if abs(data) < 10**MAX_INTEGER_DIGITS else f"a number of at most {MAX_INTEGER_DIGITS} digits"
    return "" if data is None or isinstance(data, list | tuple | dict) else "plain data"


def checked_layout(layout: dict[str, Any]) -> dict[str, Any]:
    """A layout whose `positions` by name and `comments` by id are as the editor writes them; the rest may be any data.

    **Raises** `ValueError` that names the place.
    """
    for part, sound, wanted in (
        ("positions", lambda own: _are_pixels(own, 2), "[x, y]"),
        ("comments", _is_comment, "a table of its text and its box, [x, y, width, height]"),
    ):
        given = layout.get(part, {})
        check(isinstance(given, dict), f"layout: {part}", given, "a table")
        for name, own in given.items():
            check(
                sound(own), f"layout: {part}: {_place_name(name)}", own, f"{wanted}, within {MAX_COORDINATE:g} pixels"
            )
    return layout


def _is_comment(value: object) -> bool:
    if not isinstance(value, dict) or not isinstance(value.get("text"), str):
        return False
    box: Any = value.get("box")
    return _are_pixels(box, 4) and min(box[2:]) > 0


def _are_pixels(value: object, count: int) -> bool:
    if not isinstance(value, list | tuple) or len(value) != count:
        return False
    return all(type(x) in (int, float) and abs(x) <= MAX_COORDINATE for x in value)
