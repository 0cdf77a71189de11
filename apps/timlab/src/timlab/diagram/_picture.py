"""Diagrams as pictures, in SVG: for notebooks, and wherever there is no editor."""

import html
import re
from typing import Any

from motorgrad._arguments import check_arguments
from timlab.diagram._diagram import Diagram
from timlab.diagram._faces import HEADER, ROW, Face, face_of
from timlab.diagram._layers import layered
from timlab.diagram._routes import Point, joints, routes
from timlab.diagram._signals import wired_shapes

NAME = "#26292e"
QUIET = "#646b75"
EDGE = "#b8bec7"
WIRE = "#5b6470"
PAGE = "#ffffff"
REMARK = "#fbf6e6"
HUES = {
    **{"sources": "#009e73", "sinks": "#2c92c9", "learning": "#d55e00", "bodies and worlds": "#9a5fa8"},
    **{"dynamics": "#0072b2", "logic": "#a67c00"},
}
MARGIN = 30  # pixels
_NOT_XML = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def to_svg(diagram: Diagram) -> str:
    """Draw a diagram as an SVG image, in light colours, with subsystems closed. Blocks stand where they were put in the
    editor, the others in layers along the wires. A notebook shows a diagram in this way.

        Path("loop.svg").write_text(timlab.to_svg(diagram), encoding="utf-8")
    """
    check_arguments(to_svg, locals())
    faces = {name: face_of(diagram, name) for name in diagram.nodes}
    places = _places(diagram, faces)
    boxes = [(*places[name], face.width, face.height) for name, face in faces.items()]
    shapes = wired_shapes(diagram)
    wires = _ends(diagram, faces, places)
    paths = routes(boxes, wires)
    nets = {name: net for name, (net, *_) in wires.items()}
    drawn = [_wire(path, wide=bool(shapes.get(nets[name]))) for name, path in paths.items()]
    dots = [f'<circle cx="{x}" cy="{y}" r="3.5" fill="{WIRE}"/>' for x, y in joints(paths, nets)]
    remarks: list[Any] = list(diagram.layout.get("comments", {}).values())
    points = [point for path in paths.values() for point in path]
    corners = [(x, y, x + w, y + h) for x, y, w, h in (*boxes, *(each["box"] for each in remarks))]
    corners += [(x, y, x, y) for x, y in points] or [(0, 0, 0, 0)]
    left, top = (min(corner[i] for corner in corners) - MARGIN for i in (0, 1))
    width, height = (max(corner[i + 2] for corner in corners) + MARGIN - low for i, low in enumerate((left, top)))
    size = f'width="{width:g}" height="{height:g}"'
    return "".join(
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="{left:g} {top:g} {width:g} {height:g}" ',
            f'font-family="system-ui, sans-serif" role="img" aria-label="{_escaped(diagram.title or "diagram")}">',
            f'<rect x="{left:g}" y="{top:g}" {size} fill="{PAGE}"/>',
            *map(_remark, remarks),
            *drawn,
            *dots,
            *(_at(places[name], _block(face)) for name, face in faces.items()),
            "</svg>\n",
        )
    )


Diagram._repr_svg_ = to_svg


def outline(diagram: Diagram) -> dict[str, Any]:
    """What a small picture of a diagram shows: `boxes`, each with its left and upper edge, width, height and category,
    and `wires`, each from one point to another. Wires are not routed, which takes most of the time of `to_svg`.
    """
    faces = {name: face_of(diagram, name) for name in diagram.nodes}
    places = _places(diagram, faces)
    boxes = [(*places[name], face.width, face.height, face.category) for name, face in faces.items()]
    return {"boxes": boxes, "wires": [(*begin, *end) for _, begin, end in _ends(diagram, faces, places).values()]}


def _places(diagram: Diagram, faces: dict[str, Face]) -> dict[str, tuple[float, float]]:
    """Where blocks were put, and the others below these."""
    known = diagram.layout.get("positions", {})
    places = {name: (float(known[name][0]), float(known[name][1])) for name in faces if name in known}
    loose = {name: (face.width, face.height) for name, face in faces.items() if name not in places}
    pairs = [(s, t) for (t, _), (s, _) in diagram.wires.items() if s in loose and t in loose]
    left = min((x for x, _ in places.values()), default=0.0)
    below = max((y + faces[name].height + 60 for name, (_, y) in places.items()), default=0.0)
    return places | {name: (x + left, y + below) for name, (x, y) in layered(loose, pairs).items()}


def _ends(
    diagram: Diagram, faces: dict[str, Face], places: dict[str, tuple[float, float]]
) -> dict[str, tuple[str, Point, Point]]:
    """The source of each wire, where it begins and where it ends, by its target; without those that lack a port."""
    wires: dict[str, tuple[str, Point, Point]] = {}
    for target, source in diagram.wires.items():
        begin, end = (_end(diagram, faces, places, *at) for at in (("outputs", *source), ("inputs", *target)))
        if begin is not None and end is not None:
            wires[".".join(target)] = ".".join(source), begin, end
    return wires


def _end(
    diagram: Diagram, faces: dict[str, Face], places: dict[str, tuple[float, float]], side: str, name: str, port: str
) -> Point | None:
    """Where a wire begins or ends; `None` where there is no such port."""
    names = list(getattr(diagram.nodes[name].block, side)) if name in faces else []
    if port not in names:
        return None
    x, y = faces[name].port(side, port, names)
    return places[name][0] + x, places[name][1] + y


def _wire(path: list[Point], wide: bool, radius: float = 5) -> str:
    """A path with rounded corners; thick for more than one number."""
    parts = [f"M{path[0][0]:g} {path[0][1]:g}"]
    for before, (x, y), after in zip(path, path[1:], path[2:], strict=False):
        ends = []
        for ax, ay in (before, after):
            length = max(abs(ax - x) + abs(ay - y), 1e-9)
            by = min(radius, length / 2) / length
            ends.append(f"{x + (ax - x) * by:g} {y + (ay - y) * by:g}")
        parts.append(f"L{ends[0]}Q{x:g} {y:g} {ends[1]}")
    parts.append(f"L{path[-1][0]:g} {path[-1][1]:g}")
    return f'<path d="{"".join(parts)}" fill="none" stroke="{WIRE}" stroke-width="{3 if wide else 1.5}"/>'


def _block(face: Face) -> str:
    if face.triangle:
        parts = [
            f'<path d="M1 21V79L{face.width - 1} 50Z" fill="{PAGE}" stroke="{WIRE}"/>',
            _text(0, 14, 13, _fitting(face.name, face.width, 7.4), f'fill="{NAME}" font-weight="600"'),
            _text(round(10 + 0.29 * face.width), 54, 12, face.text, f'fill="{NAME}" text-anchor="middle"'),
        ]
    else:
        pen = f'fill="none" stroke="{HUES.get(face.category, WIRE)}" stroke-width="1.5"'
        joined = 'stroke-linecap="round" stroke-linejoin="round"'
        parts = [
            f'<rect width="{face.width}" height="{face.height}" rx="7" fill="{PAGE}" stroke="{EDGE}"/>',
            f'<path transform="translate(8 10) scale(1.125)" d="{face.icon}" {pen} {joined}/>',
            _text(32, 17, 13, _fitting(face.name, face.width - 40, 7.4), f'fill="{NAME}" font-weight="600"'),
            _text(32, 32, 11, _fitting(face.text, face.width - 40, 6.2), f'fill="{QUIET}"'),
        ]
    for x, anchor, aside, labels in ((0, "start", 9, face.inputs), (face.width, "end", -9, face.outputs)):
        for row, label in enumerate(labels):
            y = HEADER + ROW * row + ROW // 2
            parts.append(f'<circle cx="{x}" cy="{y}" r="4" fill="{WIRE}"/>')
            if not face.triangle:
                parts.append(_text(x + aside, y + 4, 11, label, f'fill="{QUIET}" text-anchor="{anchor}"'))
    return "".join(parts)


def _remark(remark: Any) -> str:
    x, y, width, height = remark["box"]
    lines = [_text(10, 20 + 17 * i, 12, line, f'fill="{NAME}"') for i, line in enumerate(remark["text"].split("\n"))]
    return _at((x, y), f'<rect width="{width:g}" height="{height:g}" rx="6" fill="{REMARK}"/>{"".join(lines)}')


def _at(place: Point, content: str) -> str:
    return f'<g transform="translate({place[0]:g} {place[1]:g})">{content}</g>'


def _text(x: float, y: float, size: int, content: str, more: str) -> str:
    return f'<text x="{x}" y="{y}" font-size="{size}" {more}>{_escaped(content)}</text>'


def _escaped(content: str) -> str:
    """A text in XML, which has no way to write control characters."""
    return html.escape(_NOT_XML.sub("\ufffd", content))


def _fitting(content: str, width: float, letter: float) -> str:
    return content if len(content) * letter <= width else f"{content[: max(1, int(width / letter) - 1)]}…"
