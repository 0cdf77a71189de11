"""Pictures of diagrams without an editor: sound SVG, blocks in layers, wires that go round them."""

import itertools
from typing import Any
from xml.etree import ElementTree

import timlab
from timlab.diagram._layers import layered
from timlab.diagram._routes import joints, routes

SVG = "{http://www.w3.org/2000/svg}"


def texts(svg: str) -> list[str | None]:
    return [each.text for each in ElementTree.fromstring(svg).iter(f"{SVG}text")]


def test_a_notebook_shows_blocks_with_their_faces():
    diagram = timlab.Diagram(title='an "odd" <title>', parameters={"mass": 2.0}, uses={"weight.gain": "mass"})
    blocks = {
        "<a&b>": timlab.Constant(1.0),
        "error": timlab.Sum("+-"),
        "weight": timlab.Gain(-2.5),
        "other": timlab.Gain(-2.5),
    }
    for name, block in {**blocks, "power": timlab.Expression("-v*v", ("v",)), "go": timlab.Goto("there")}.items():
        diagram.add(name, block)
    for wire in (("<a&b>", "error.u1"), ("error", "weight"), ("weight", "power.v"), ("weight", "error.u2")):
        diagram.connect(*wire)
    diagram.add("empty", timlab.Diagram())
    diagram.layout = {
        "positions": {"other": [500, 40]},
        "comments": {"1": {"text": "here\nthere", "box": [0, 0, 9, 9]}},
    }
    svg = diagram._repr_svg_()
    assert svg == timlab.to_svg(diagram)
    shown = texts(svg)
    assert {"<a&b>", "+", "−", "mass", "−2.5", "−v·v", "[there]", "subsystem", "here", "there"} <= set(shown)
    assert "translate(500 40)" in svg
    assert len(list(ElementTree.fromstring(svg).iter(f"{SVG}path"))) == 4 + 5 + 2  # wires, pictures, triangles
    assert texts(timlab.Diagram()._repr_svg_()) == []


def test_blocks_lie_in_layers_and_do_not_overlap():
    wires = [(pair[0], pair[1]) for pair in ["sa", "ab", "bc", "ac", "ca", "dc", "cc", "be", "ef", "af"]]
    sizes = dict.fromkeys("sabcdefg", (100, 50))
    places = layered(sizes, wires)
    x = {name: place[0] for name, place in places.items()}
    assert x["a"] < x["b"] < x["c"] == x["e"] < x["f"]
    assert x["d"] == x["b"]  # just before what it leads to
    for one in sizes:
        for other in sizes:
            (x0, y0), (x1, y1) = places[one], places[other]
            assert one == other or abs(x0 - x1) >= 100 or abs(y0 - y1) >= 50, (one, other)
    assert layered({}, []) == {}


def test_wires_go_round_blocks_and_part_with_dots():
    boxes = [(0, 0, 100, 60), (200, -40, 100, 140), (400, 0, 100, 60)]
    wires: dict[str, Any] = {
        "over": ("one", (100, 30), (400, 30)),
        "middle": ("one", (100, 30), (200, 30)),
        "back": ("two", (500, 30), (0, 30)),
    }
    paths = routes(boxes, wires)
    for name, path in paths.items():
        assert (path[0], path[-1]) == wires[name][1:]
        for (x0, y0), (x1, y1) in itertools.pairwise(path):
            assert x0 == x1 or y0 == y1
            for x, y, width, height in boxes:
                inside = max(x0, x1) > x and min(x0, x1) < x + width and max(y0, y1) > y and min(y0, y1) < y + height
                assert not inside, (name, path)
    assert paths["back"][1][0] > 500
    assert paths["back"][-2][0] < 0  # it leaves to the right, and comes from the left
    assert len(joints(paths, {name: wire[0] for name, wire in wires.items()})) == 1


def test_control_characters_spoil_no_picture():
    diagram = timlab.Diagram(title="\0\x1b")
    diagram.layout = {"comments": {"1": {"text": "a\b\uffffc", "box": [0, 0, 9, 9]}}}
    assert texts(timlab.to_svg(diagram)) == ["a\ufffd\ufffdc"]
