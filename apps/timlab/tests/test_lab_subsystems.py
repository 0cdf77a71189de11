"""Subsystems: evaluated under a condition, with parameters of their own; and signals that are named."""

from typing import Any

import numpy as np
import pytest

import timlab
from timlab.diagram import wired_shapes
from timlab.editor._edits import Paste, Rename, Set, SetParameter, Ungroup, selection
from timlab.editor._masks import Declare, Undeclare, Use
from timlab.editor._views import view


def conditional(gate: timlab.Block, solver: str = "rk4") -> timlab.Diagram:
    """A subsystem behind a gate that is driven by a pulse, which is high in the first half of every second."""
    inner = timlab.Diagram()
    blocks = {
        **{"go": gate, "u": timlab.Inlet(), "twice": timlab.Gain(2.0), "level": timlab.Integrator(1.0)},
        **{"noise": timlab.UniformNoise(), "before": timlab.UnitDelay(), "high": timlab.Compare(">=", 1.05)},
        **{"a": timlab.Outlet(), "b": timlab.Outlet(), "c": timlab.Outlet(), "d": timlab.Outlet(kind="bool")},
    }
    for name, block in blocks.items():
        inner.add(name, block)
    wires = ("u twice", "twice level", "level a", "noise before", "noise b", "before c", "level high.u1", "high d")
    for wire in wires:
        inner.connect(*wire.split())
    diagram = timlab.Diagram(0.1, solver=solver)
    diagram.add("inner", inner)
    for name, block in {
        "pulse": timlab.Pulse(),
        "high": timlab.Compare(">", 0.5),
        "one": timlab.Sine(0.0, offset=0.5),
    }.items():
        diagram.add(name, block)
    for wire in ("pulse high.u1", "high inner.go", "one inner.u"):
        diagram.connect(*wire.split())
    for name in "abcd":
        diagram.add(name, timlab.Outlet(kind="bool" if name == "d" else "float"))
        diagram.connect(f"inner.{name}", name)
    return diagram


@pytest.mark.ci
@pytest.mark.parametrize("solver", ["rk4", "tsit5"])
def test_the_interpreter_agrees_on_an_enabled_subsystem(solver):
    diagram = conditional(timlab.Enable(), solver)
    record, again = timlab.Run(diagram).advance(25), timlab.Interpreter(diagram).advance(7)
    for name in "abcd":
        np.testing.assert_allclose(record[f"{name}.u"][0, :7], again[f"{name}.u"][0], rtol=1e-6)


@pytest.mark.ci
@pytest.mark.representatives("rk4")
@pytest.mark.parametrize("solver", ["rk4", "tsit5"])
def test_an_enabled_subsystem_rests_while_its_condition_does_not_hold(solver):
    record = timlab.Run(conditional(timlab.Enable(), solver)).advance(25)
    seen = {name: record[f"{name}.u"][0] for name in "abcd"}
    ticks = np.arange(25)
    open_ticks = 5 * (ticks // 10) + np.minimum(ticks % 10, 5)  # before each tick
    np.testing.assert_allclose(seen["a"], 1 + 0.1 * open_ticks, rtol=1e-6)
    opened = ticks % 10 < 5
    assert len(set(seen["b"][opened])) == opened.sum()  # other numbers in every open tick
    np.testing.assert_array_equal(seen["b"][1:][~opened[1:]], seen["b"][:-1][~opened[1:]])
    np.testing.assert_array_equal(seen["c"][opened][1:], seen["b"][opened][:-1])
    np.testing.assert_array_equal(seen["d"], open_ticks - (~opened).astype(int) >= 1)  # the last value, not a new one


def noisy(gate: timlab.Block) -> timlab.Diagram:
    """Of `conditional` the noise alone, which the interpreter is quick to evaluate."""
    inner = timlab.Diagram()
    for name, block in {"go": gate, "noise": timlab.UniformNoise(), "b": timlab.Outlet()}.items():
        inner.add(name, block)
    inner.connect("noise", "b")
    diagram = timlab.Diagram(0.1)
    blocks = {"inner": inner, "pulse": timlab.Pulse(), "high": timlab.Compare(">", 0.5), "b": timlab.Outlet()}
    for name, block in blocks.items():
        diagram.add(name, block)
    for wire in ("pulse high.u1", "high inner.go", "inner.b b"):
        diagram.connect(*wire.split())
    return diagram


def test_a_triggered_source_is_evaluated_when_its_condition_changes():
    seen = timlab.Interpreter(noisy(timlab.Trigger("either"))).advance(25)["b.u"][0]
    assert tuple(np.flatnonzero(np.diff(seen, prepend=0.0))) == (0, 5, 10, 15, 20)


@pytest.mark.ci
@pytest.mark.parametrize(
    ("on", "opens"), [("rising", (0, 10, 20)), ("falling", (5, 15)), ("either", (0, 5, 10, 15, 20))]
)
def test_a_triggered_subsystem_is_evaluated_when_its_condition_changes(on, opens):
    seen = timlab.Interpreter(conditional(timlab.Trigger(on))).advance(25)["b.u"][0]
    assert tuple(np.flatnonzero(np.diff(seen, prepend=0.0))) == opens


def test_a_gate_that_is_not_wired_is_open_and_hosts_must_not_stand_behind_one():
    inner = timlab.Diagram()
    inner.add("go", timlab.Enable())
    inner.add("level", timlab.Integrator(1.0))
    inner.add("one", timlab.Constant(1.0))
    inner.connect("one", "level")
    diagram = timlab.Diagram(0.1)
    diagram.add("inner", inner)
    run = timlab.Run(diagram, watch=["inner/level.y"])
    np.testing.assert_allclose(run.advance(11)["inner/level.y"][0, -1], 2.0, rtol=1e-6)
    assert timlab.loads(timlab.dumps(diagram)) == diagram
    inner.add("body", timlab.Body("hopper"))
    assert "inner/body: runs on the host: it must not be in an enabled or triggered subsystem" in map(
        str, timlab.problems(diagram)
    )


def plant() -> timlab.Diagram:
    """A mass in a subsystem, whose weight and inertia use one parameter; its speed goes to the scope by name."""
    inner = timlab.Diagram()
    blocks = {
        "weight": timlab.Gain(2.0),
        "one": timlab.Constant(1.0),
        "inertia": timlab.Gain(2.0),
        "out": timlab.Outlet(),
    }
    for name, block in {
        **blocks,
        "named": timlab.Goto("sum"),
        "sum": timlab.Sum(),
        "again": timlab.From("sum"),
    }.items():
        inner.add(name, block)
    for wire in ("one weight", "one inertia", "weight sum.u1", "inertia sum.u2", "sum named", "again out"):
        inner.connect(*wire.split())
    inner.use("weight.gain", "mass")
    inner.use("inertia.gain", "mass")
    diagram = timlab.Diagram(parameters={"kilograms": 3.0})
    diagram.add("plant", inner)
    diagram.add("speed", timlab.Outlet())
    diagram.connect("plant.out", "speed")
    diagram.use("plant.mass", "kilograms")
    return diagram


def test_a_subsystem_has_parameters_that_its_blocks_use():
    diagram = plant()
    assert diagram.nodes["plant"].block.parameters == {"mass": 2.0}
    run = timlab.Run(diagram)

    def seen(run):
        return run.advance(1)["speed.u"][0, 0]

    assert seen(run) == 6.0  # the outer diagram's value counts
    run["plant.mass"] = 5.0
    assert (run["kilograms"], run["plant/weight.gain"], seen(run)) == (5.0, 5.0, 10.0)
    run["kilograms"] = 4.0
    assert seen(run) == 8.0
    swept = timlab.Run(diagram, 2, sweep={"kilograms": [1.0, 7.0]})
    np.testing.assert_array_equal(swept.advance(1)["speed.u"][:, 0], [2.0, 14.0])
    assert seen(timlab.Interpreter(diagram)) == 6.0

    again = timlab.loads(timlab.dumps(diagram))
    assert again == diagram == diagram.copy()
    scope: dict = {}
    exec(timlab.to_python(diagram), scope)
    assert scope["diagram"] == diagram
    again.rename("plant", "other")
    assert again.uses == {"other.mass": "kilograms"}
    again.remove("other")
    assert again.uses == {}
    opened = Ungroup((), "plant").apply(diagram)
    assert opened.uses == {"weight.gain": "kilograms", "inertia.gain": "kilograms"}
    assert seen(timlab.Run(opened)) == 6.0
    with pytest.raises(ValueError, match="'kilograms' stands for it"):
        Set((), "plant", "mass", 9.0).apply(diagram)
    changed = Set((), "plant", "mass", 9.0).apply(Use((), "plant", "mass").apply(diagram))
    (field,) = view(changed)["nodes"]["plant"]["parameters"]
    assert (field["name"], field["role"], view(changed)["nodes"]["plant"]["fields"]["mass"]) == (
        "mass",
        "parameter",
        9.0,
    )
    grouped = timlab.group(diagram, ["plant"], "all")
    assert grouped.uses == {"all.kilograms": "kilograms"}
    assert seen(timlab.Run(grouped)) == 6.0


def test_the_editor_declares_parameters_and_says_what_uses_them():
    diagram = plant()
    named = Declare(("plant",), "mass", to="m").apply(diagram)
    assert named.nodes["plant"].block.uses == {"weight.gain": "m", "inertia.gain": "m"}  # type: ignore[union-attr]
    assert named.uses == {"plant.m": "kilograms"}  # and outside
    assert view(named)["nodes"]["plant"]["uses"] == {"m": "kilograms"}
    with pytest.raises(ValueError, match="'mass'"):
        Declare((), "mass", to="other").apply(diagram)

    heavier = SetParameter("kilograms", 8.0).apply(diagram)
    assert timlab.Interpreter(heavier).advance(1)["speed.u"][0, 0] == 16.0
    freed = Undeclare((), "kilograms").apply(heavier)
    assert (freed.parameters, freed.uses) == ({}, {})
    assert timlab.Interpreter(freed).advance(1)["speed.u"][0, 0] == 16.0  # the plant keeps the value
    assert Undeclare(("plant",), "mass").apply(heavier).uses == {}

    used = Use(("plant",), "one", "value", "unit").apply(Declare(("plant",), "unit", 5.0).apply(diagram))
    inner: Any = used.nodes["plant"].block
    assert (inner.parameters, inner.uses["one.value"]) == ({"mass": 2.0, "unit": 5.0}, "unit")
    with pytest.raises(ValueError, match="stands for it"):
        Set(("plant",), "one", "value", 1.0).apply(used)
    own: Any = Use(("plant",), "one", "value").apply(used).nodes["plant"].block
    assert (own.nodes["one"].block.value, "one.value" in own.uses) == (5.0, False)


def test_a_copied_block_goes_on_using_the_parameter():
    diagram = plant()
    fragment = selection(diagram, ("plant",), ["weight", "one"])
    again: Any = Paste(("plant",), fragment).apply(diagram).nodes["plant"].block
    assert again.uses["weight 2.gain"] == "mass"
    elsewhere = Paste((), fragment).apply(timlab.Diagram())
    assert (elsewhere.parameters, elsewhere.uses) == ({"mass": 2.0}, {"weight.gain": "mass"})
    renamed: Any = Rename(("plant",), "weight", "w").apply(diagram).nodes["plant"].block
    assert renamed.uses["w.gain"] == "mass"


def test_wrong_uses_and_names_are_refused():
    diagram = plant()
    with pytest.raises(ValueError, match="'gian'"):
        diagram.use("plant.gian", "mass")
    with pytest.raises(ValueError, match="'tick'"):
        timlab.Diagram(parameters={"tick": 1.0})
    with pytest.raises(ValueError, match="'b'"):
        timlab.Diagram(parameters={"a": 1.0}, uses={"gain.gain": "b"})
    inner: Any = diagram.nodes["plant"].block
    inner.uses["weight.gian"] = "mass"
    inner.uses["weihgt.gain"] = "mass"
    found = list(map(str, timlab.problems(diagram)))
    assert any(line.startswith("plant/weight: unknown parameter 'gian'") for line in found)
    assert "plant/weihgt: a parameter is set for its 'gain', which does not exist" in found
    inner.uses.clear()
    inner.replace("named", timlab.Goto("total"))
    assert "plant/again: there is no goto with the tag 'sum'" in map(str, timlab.problems(diagram))
    inner.replace("again", timlab.From("total"))
    inner.add("second", timlab.Goto("total"))
    assert "plant/second: has the same tag, 'total', as named" in map(str, timlab.problems(diagram))


def test_shapes_follow_from_wires_through_subsystems():
    inner = timlab.Diagram()
    blocks = {"u": timlab.Inlet(), "level": timlab.Integrator(), "twice": timlab.Gain(2.0), "y": timlab.Outlet()}
    for name, block in blocks.items():
        inner.add(name, block)
    for wire in ("u level", "level twice", "twice y"):
        inner.connect(*wire.split())
    diagram = timlab.Diagram(0.5)
    total = timlab.Sum("++", shape=(3,))
    for name, block in {"three": timlab.Constant((1.0, 2.0, 3.0), (3,)), "inner": inner, "sum": total}.items():
        diagram.add(name, block)
    for name, block in {"one": timlab.Constant(1.0), "seen": timlab.Outlet(), "scope": timlab.Scope()}.items():
        diagram.add(name, block)
    for wire in ("three inner.u", "inner.y sum.u1", "one sum.u2", "sum seen", "inner.y scope"):
        diagram.connect(*wire.split())
    assert diagram.mismatch("three", "inner.u") is None
    record = timlab.Run(diagram).advance(3)
    np.testing.assert_allclose(record["seen.u"][0, -1], [3.0, 5.0, 7.0])  # the source is broadcast
    assert record["scope.u"].shape == (1, 3, 3)
    assert diagram.nodes["one"].block == timlab.Constant(1.0)  # the diagram stays as it is
    shapes = wired_shapes(diagram)
    assert {at for at, shape in shapes.items() if shape != (3,)} == set()
    assert {"one.y", "inner.u", "inner/u.y", "inner/twice.u", "inner/y.u", "seen.u"} <= set(shapes)
    assert [port["follows"] for port in view(diagram)["nodes"]["inner"]["inputs"]] == [True]


def test_shapes_that_cannot_follow_are_named_with_both_blocks():
    diagram = timlab.Diagram()
    for name, block in {"three": timlab.Constant(0.0, (3,)), "two": timlab.Gain(shape=(2,))}.items():
        diagram.add(name, block)
    diagram.connect("three", "two")
    (problem,) = timlab.problems(diagram)
    assert str(problem) == "two.u: accepts floats of shape (2,), but three.y outputs floats of shape (3,)"
    assert diagram.mismatch("three", "two") == str(problem)
