"""The appearance of a block: its size, its picture and its text. The editor's pages draw blocks in the same way."""

import functools
import json
import math
from collections.abc import Sequence
from importlib.resources import files
from typing import Any, NamedTuple

from timlab.diagram._block import Block
from timlab.diagram._declarations import Port, parameters_of
from timlab.diagram._diagram import Diagram

# pixels
HEADER = 40
ROW = 20
PADDING = 10
GRID = 10
LETTER = 6.3
MINUS = "−"
SIGNS = {"+": "+", "-": MINUS, "*": "×", "/": "÷"}
MAX_VALUE_CHARACTERS = 18


class Face(NamedTuple):
    """What is drawn of a block. A gain is a `triangle`, with its number as `text`."""

    name: str
    text: str
    category: str
    icon: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    triangle: bool
    width: int
    height: int

    def port(self, side: str, name: str, names: Sequence[str]) -> tuple[int, int]:
        """Where a port is, from the block's upper left corner."""
        return (0 if side == "inputs" else self.width), HEADER + ROW * list(names).index(name) + ROW // 2


def face_of(diagram: Diagram, name: str) -> Face:
    """The face of a block of a diagram."""
    block = diagram.nodes[name].block
    uses = diagram.uses_of(name)
    kind, category = ("diagram", "subsystems") if isinstance(block, Diagram) else (block.name, block.category)
    signs = getattr(block, "signs", "")
    marks = [SIGNS.get(sign) for sign in signs] if isinstance(signs, str) else []
    inputs = tuple(
        (marks[row] if row < len(marks) else None) or _label(port_name, port)
        for row, (port_name, port) in enumerate(block.inputs.items())
    )
    outputs = tuple(_label(*each) for each in block.outputs.items())
    icons = _icons()
    icon = icons["types"].get(kind) or icons["categories"].get(category, icons["other"])
    if kind == "gain":
        text = uses.get("gain") or shortly(block.gain).replace("-", MINUS)  # type: ignore[union-attr]
        width = _whole(min(260, max(90, 7 * len(name) + 10, 15 * len(text) + 40)))
        return Face(name, text, category, icon, inputs, outputs, True, width, 80)
    formula = "" if isinstance(block, Diagram) else _formula(block)
    text = "subsystem" if isinstance(block, Diagram) else formula or _text(name, block, uses)
    rows = max(len(inputs), len(outputs), 1)
    widest = max(7.8 * len(name), 6 * len(kind) + 16, 6.2 * len(formula)) + 44
    for row in range(rows):
        ports = [side[row] for side in (inputs, outputs) if row < len(side)]
        widest = max(widest, sum(LETTER * (len(label) + 1) + 14 for label in ports) + 16)
    width = _whole(min(260, max(120, widest)))
    return Face(name, text, category, icon, inputs, outputs, False, width, HEADER + ROW * rows + PADDING)


def shortly(value: object) -> str:
    """A value in few characters."""
    if isinstance(value, list | tuple):
        text = f"[{', '.join(map(shortly, value))}]"
    else:
        text = str(value).lower() if isinstance(value, bool) else format(value, ".5g") if _real(value) else str(value)
    return text if len(text) <= MAX_VALUE_CHARACTERS else f"{text[: MAX_VALUE_CHARACTERS - 1]}…"


def _text(name: str, block: Block, uses: dict[str, str]) -> str:
    """The first parameter of a block that is named like its type, or else its type."""
    if block.name != name and not name.startswith(f"{block.name} "):
        return block.name
    field = next(iter(parameters_of(type(block))), None)
    value = None if field is None else uses.get(field, getattr(block, field))
    if field is None or value is None:
        return ""
    return shortly(value) if field == "value" else f"{field.replace('_', ' ')} {shortly(value)}"


def _formula(block: Any) -> str:
    first, second = (*block.inputs, "u", "u")[:2]
    match block.name:
        case "expression":
            return block.expression.replace("*", "·").replace("-", MINUS)
        case "function":
            return f"{block.function}({first})"
        case "compare":
            return f"{first} {block.relation} {second}"
        case "logic":
            return block.operator
        case "reduce":
            return f"{block.how}({first})"
        case "goto" | "from":
            return f"[{block.tag}]"
    return ""


def _real(value: object) -> bool:
    return isinstance(value, int | float)


def _label(name: str, port: Port) -> str:
    return f"{name}[{'×'.join(map(str, port.shape))}]" if port.shape else name


@functools.cache
def _icons() -> dict[str, Any]:
    """Small drawings in a square of 16, by type and by category."""
    return json.loads((files("timlab.diagram") / "icons.json").read_text(encoding="utf-8"))


def _whole(width: float) -> int:
    return math.ceil(width / GRID) * GRID
