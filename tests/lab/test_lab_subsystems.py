"""Subsystems that are evaluated under a condition."""

import numpy as np
import pytest

from motorgrad import lab


def conditional(gate: lab.Block, solver: str = "rk4") -> lab.Diagram:
    """A subsystem behind a gate that is driven by a pulse, which is high in the first half of every second."""
    inner = lab.Diagram()
    blocks = {
        **{"go": gate, "u": lab.Inlet(), "twice": lab.Gain(2.0), "level": lab.Integrator(1.0)},
        **{"noise": lab.UniformNoise(), "before": lab.UnitDelay(), "high": lab.Compare(">=", 1.05)},
        **{"a": lab.Outlet(), "b": lab.Outlet(), "c": lab.Outlet(), "d": lab.Outlet(kind="bool")},
    }
    for name, block in blocks.items():
        inner.add(name, block)
    wires = ("u twice", "twice level", "level a", "noise before", "noise b", "before c", "level high.u1", "high d")
    for wire in wires:
        inner.connect(*wire.split())
    diagram = lab.Diagram(0.1, solver=solver)
    diagram.add("inner", inner)
    for name, block in {"pulse": lab.Pulse(), "high": lab.Compare(">", 0.5), "one": lab.Sine(0.0, offset=0.5)}.items():
        diagram.add(name, block)
    for wire in ("pulse high.u1", "high inner.go", "one inner.u"):
        diagram.connect(*wire.split())
    for name in "abcd":
        diagram.add(name, lab.Outlet(kind="bool" if name == "d" else "float"))
        diagram.connect(f"inner.{name}", name)
    return diagram


@pytest.mark.parametrize("solver", ["rk4", "tsit5"])
def test_an_enabled_subsystem_rests_while_its_condition_does_not_hold(solver):
    diagram = conditional(lab.Enable(), solver)
    run = lab.Run(diagram)
    record, again = run.advance(25), lab.Interpreter(diagram).advance(25)
    seen = {name: record[f"{name}.u"][0] for name in "abcd"}
    for name, values in seen.items():
        np.testing.assert_allclose(values, again[f"{name}.u"][0], rtol=1e-6)
    ticks = np.arange(25)
    open_ticks = 5 * (ticks // 10) + np.minimum(ticks % 10, 5)  # before each tick
    np.testing.assert_allclose(seen["a"], 1 + 0.1 * open_ticks, rtol=1e-6)
    opened = ticks % 10 < 5
    assert len(set(seen["b"][opened])) == opened.sum()  # other numbers in every open tick
    np.testing.assert_array_equal(seen["b"][1:][~opened[1:]], seen["b"][:-1][~opened[1:]])
    np.testing.assert_array_equal(seen["c"][opened][1:], seen["b"][opened][:-1])
    np.testing.assert_array_equal(seen["d"], open_ticks - (~opened).astype(int) >= 1)  # the last value, not a new one


@pytest.mark.parametrize(
    ("on", "opens"), [("rising", (0, 10, 20)), ("falling", (5, 15)), ("either", (0, 5, 10, 15, 20))]
)
def test_a_triggered_subsystem_is_evaluated_when_its_condition_changes(on, opens):
    seen = lab.Interpreter(conditional(lab.Trigger(on))).advance(25)["b.u"][0]
    assert tuple(np.flatnonzero(np.diff(seen, prepend=0.0))) == opens


def test_a_gate_that_is_not_wired_is_open_and_hosts_must_not_stand_behind_one():
    inner = lab.Diagram()
    inner.add("go", lab.Enable())
    inner.add("level", lab.Integrator(1.0))
    inner.add("one", lab.Constant(1.0))
    inner.connect("one", "level")
    diagram = lab.Diagram(0.1)
    diagram.add("inner", inner)
    run = lab.Run(diagram, watch=["inner/level.y"])
    np.testing.assert_allclose(run.advance(11)["inner/level.y"][0, -1], 2.0, rtol=1e-6)
    assert lab.loads(lab.dumps(diagram)) == diagram
    inner.add("body", lab.Body("hopper"))
    assert "inner/body: runs on the host: it must not be in an enabled or triggered subsystem" in map(
        str, lab.problems(diagram)
    )
