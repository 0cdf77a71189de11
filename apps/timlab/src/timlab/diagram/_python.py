"""Diagrams as Python source code."""

import keyword
import pprint
import re
from typing import Any

from motorgrad._arguments import check_arguments
from motorgrad.schema import fields_of
from timlab.diagram._block import Block
from timlab.diagram._diagram import HEAD, Diagram

WIDTH = 110  # characters of a line


def to_python(diagram: Diagram) -> str:
    """Python source that builds the diagram as `diagram`, after its subsystems, which are variables named like the
    blocks.

    Only fields that differ from their defaults are written. A block type of your own is looked up in `BLOCKS`.
    """
    check_arguments(to_python, locals())
    lines = ["import timlab", ""]
    _build(diagram, "diagram", {"diagram", "timlab"}, lines)
    return "\n".join(lines).rstrip() + "\n"


def _build(diagram: Diagram, name: str, taken: set[str], lines: list[str]) -> None:
    """Append the lines that build a diagram as the variable `name`, after those of its subsystems."""
    inner = {}
    for own, node in diagram.nodes.items():
        if isinstance(node.block, Diagram):
            inner[own] = _variable(own, taken)
            _build(node.block, inner[own], taken, lines)
    heads = {each: value for each, value in diagram.head.items() if value != HEAD[each]}
    lines.append(f"{name} = timlab.Diagram({_arguments(heads)})")
    given: set[str] = set()
    for own, node in diagram.nodes.items():
        block = inner[own] if isinstance(node.block, Diagram) else _call(node.block)
        id = "" if node.id == own and own not in given else f", id={node.id!r}"
        given.add(node.id)
        lines.append(f"{name}.add({own!r}, {block}{id})")
    for target, source in diagram.wires.items():
        lines.append(f"{name}.connect({'.'.join(source)!r}, {'.'.join(target)!r})")
    if diagram.layout:
        lines.append(f"{name}.layout = {pprint.pformat(diagram.layout, width=WIDTH, compact=True, sort_dicts=False)}")
    lines.append("")


def _call(block: Block) -> str:
    kind = type(block)
    public = kind.__module__.startswith("timlab.")
    made = f"timlab.{kind.__name__}" if public else f"timlab.BLOCKS[{kind.name!r}]"
    fields = fields_of(kind)
    unusual = {name: getattr(block, name) for name in fields if getattr(block, name) != fields[name].default}
    return f"{made}({_arguments(unusual)})"


def _arguments(values: dict[str, Any]) -> str:
    return ", ".join(f"{name}={value!r}" for name, value in values.items())


def _variable(name: str, taken: set[str]) -> str:
    """A new Python name like the name of a block."""
    plain = re.sub(r"\W+", "_", name.lower(), flags=re.ASCII).strip("_")
    base = f"{plain}_" if keyword.iskeyword(plain) else plain if plain[:1].isalpha() else f"part_{plain}".rstrip("_")
    number = 1
    new = base
    while new in taken:
        number += 1
        new = f"{base}_{number}"
    taken.add(new)
    return new
