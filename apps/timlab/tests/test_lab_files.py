"""Diagrams as files and as Python: nothing is lost, and what is no diagram is refused by name."""

import json

import pytest

import timlab
from timlab import (
    BLOCKS,
    Constant,
    Diagram,
    Gain,
    Inlet,
    Integrator,
    Outlet,
    Sum,
    dumps,
    load,
    loads,
    save,
    to_python,
)


def level() -> Diagram:
    """A level that follows an input, with a subsystem of its own."""
    sensor = Diagram(title="sensor")
    sensor.add("in", Inlet())
    sensor.add("scale", Gain(0.5, every=3))
    sensor.add("out", Outlet())
    sensor.connect("in", "scale")
    sensor.connect("scale", "out")
    diagram = Diagram(tick=0.02, substeps=2, title="Level", comment="follows „α“,\nslowly")
    diagram.add("input", Constant((0.1, 1 / 3), shape=(2,)), id="the input")
    diagram.add("pick", Inlet(1.0))
    diagram.add("error", Sum("+-"))
    diagram.add("level", Integrator())
    diagram.add("sensor", sensor)
    diagram.connect("pick", "error.u1")
    diagram.connect("sensor", "error.u2")
    diagram.connect("error", "level")
    diagram.connect("level", "sensor")
    diagram.layout = {"blocks": {"level": [1, 2.5]}, "zoom": 1.25, "notes": [{"text": "x", "at": [0, 0]}]}
    return diagram


TEXT = dumps(level())


def test_a_diagram_comes_back_from_its_text_and_the_text_from_it():
    assert loads(TEXT) == level()
    assert dumps(loads(TEXT)) == TEXT
    assert loads(TEXT).nodes["input"].id == "the input"


def test_a_file_has_a_line_for_each_block_and_wire_and_the_layout_last():
    lines = TEXT.splitlines()
    for name in ("input", "pick", "error", "level", "scale"):
        assert sum(f'"{name}": {{"type"' in line for line in lines) == 1
    assert sum('"error.u1": "pick.y"' in line for line in lines) == 1
    assert list(json.loads(TEXT))[-3:] == ["blocks", "wires", "layout"]


def test_layout_is_apart_from_logic():
    moved = level()
    moved.layout = {"zoom": 3}
    assert dumps(moved).split('"layout"')[0] == TEXT.split('"layout"')[0]


def test_a_saved_file_is_loaded_and_errors_name_it(tmp_path):
    path = tmp_path / "level.json"
    save(level(), path)
    assert path.read_text() == TEXT
    assert load(path) == level()
    path.write_bytes(b"\xff\xfe{")
    with pytest.raises(ValueError, match=r"level\.json: .*decode"):
        load(path)


@pytest.mark.parametrize("kind", sorted(BLOCKS))
def test_every_block_that_needs_nothing_is_kept_with_all_its_fields(kind):
    try:
        block = BLOCKS[kind]()
    except (TypeError, ValueError):
        pytest.skip(f"{kind} has no default")
    diagram = Diagram()
    diagram.add("block", block)
    assert loads(dumps(diagram)) == diagram


def test_half_finished_work_is_kept():
    diagram = Diagram()
    diagram.add("error", Sum("+-"))
    assert timlab.problems(diagram)
    assert loads(dumps(diagram)) == diagram


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("{", "[", "line 2, column 11: must be JSON"),
        ('"motorgrad diagram"', '"other"', "format = 'other': must be 'motorgrad diagram'"),
        ('"version": 1', '"version": 2', "version = 2: must be 1"),
        ('"version": 1', '"version": true', "version = True: must be 1"),
        ('"tick": 0.02', '"tick": NaN', "tick = nan: must be finite"),
        ('"tick": 0.02', '"tick": 1e999', "tick = inf: must be finite"),
        ('"tick": 0.02', '"tick": 0', "diagram: tick = 0: must be a positive number"),
        ('"gain": 0.5', '"gain": -Infinity', "blocks.sensor.blocks.scale.gain = -inf: must be finite"),
        ('"gain": 0.5', '"gain": "0.5"', "sensor/scale: gain = '0.5': must be a finite number"),
        ('"gain": 0.5', '"gian": 0.5', "sensor/scale: unknown setting of gain 'gian': did you mean 'gain'?"),
        ('"gain": 0.5', '"gain": 0.5, "gain": 1', "'gain': must occur once"),
        ('"type": "gain"', '"type": "gian"', "sensor/scale: unknown type of block 'gian': did you mean 'gain'?"),
        ('"type": "gain"', '"type": ["gain"]', "sensor/scale: unknown type of block"),
        ('"every": 3', '"every": 0', "sensor/scale: every = 0: must be an integer of at least 1"),
        ('"error.u1"', '"error.u9"', "wire to error.u9: unknown input of error: 'u9'"),
        ('"pick.y"', '"peck.y"', "wire to error.u1: unknown block 'peck': did you mean 'pick'?"),
        ('"pick.y"', "null", "wire to error.u1"),
        ('"id": "the input"', '"id": 3', "input: id = 3: must be a string"),
        ('"id": "the input"', '"id": "level"', "id = 'level': must be a new id"),
        ('"title": "Level"', '"title": 3', "title = 3: must be a string"),
        ('"title": "Level"', '"titel": "Level"', "unknown setting of file 'titel': did you mean 'title'?"),
        ('"title": "Level"', '"title": "\\ud800"', "must be whole characters"),
        ('"zoom": 1.25', '"zoom": ' + "[" * 200 + "]" * 200, "in at most 100 nested lists"),
        ('"zoom": 1.25', '"zoom": ' + "[" * 100_000, "at most 100 nested lists"),
        ('"zoom": 1.25', '"zoom": ' + "9" * 10_000, "must be JSON"),
    ],
)
def test_what_is_no_diagram_is_refused_by_name(old, new, said):
    assert old in TEXT
    with pytest.raises(ValueError) as error:  # noqa: PT011
        loads(TEXT.replace(old, new, 1))
    assert said in str(error.value)
    assert len(str(error.value).splitlines()) == 1


@pytest.mark.parametrize("layout", [{"at": float("nan")}, {"at": object()}, {1: 2}])
def test_a_layout_that_is_no_data_is_refused(layout):
    diagram = level()
    diagram.layout = layout
    with pytest.raises(ValueError, match="layout"):
        dumps(diagram)


BOX = [0, 0, 9, 9]
NO_PLACES = [
    ({"positions": [1, 2]}, "positions = [1, 2]: must be a table"),
    *(({"positions": {"a": place}}, "[x, y]") for place in ("xy", None, [1], [1, True], [1, 1e300], ["1", "2"])),
    ({"comments": []}, "comments = []: must be a table"),
    *(
        ({"comments": {"1": {"text": "x", "box": box}}}, "[x, y, width, height]")
        for box in (None, [0, 0], [0, 0, 0, 1])
    ),
    *(({"comments": {"1": own}}, "its text and its box") for own in ("x", {"box": BOX}, {"text": 5, "box": BOX})),
]


@pytest.mark.parametrize(("layout", "said"), NO_PLACES, ids=range(len(NO_PLACES)))
@pytest.mark.parametrize("deep", [False, True])
def test_places_that_no_page_could_show_are_refused_by_name(layout, said, deep):
    data = json.loads(dumps(Diagram())) | {"layout": layout}
    if deep:
        data = data | {"layout": {}, "blocks": {"sub": {"type": "diagram", "layout": layout}}}
    with pytest.raises(ValueError, match="sub: layout: " if deep else "layout: ") as error:
        loads(json.dumps(data))
    assert said in str(error.value)


def test_python_builds_the_diagram_again():
    program = to_python(level())
    names: dict = {}
    exec(program, names)
    assert names["diagram"] == level()
    assert "timlab.Gain(every=3, gain=0.5)" in program or "timlab.Gain(gain=0.5, every=3)" in program
    assert "value=1.0" in program


def test_python_names_its_subsystems_apart():
    outer = Diagram()
    for name in ("class", "Class", "1st", "diagram"):
        inner = Diagram(title=name)
        inner.add("k", Gain(2.0))
        outer.add(name, inner)
    names: dict = {}
    exec(to_python(outer), names)
    assert names["diagram"] == outer
