"""The state machine: its rules, and that the hexapod's leg controller is one."""

import math

import numpy as np
import pytest
from block_driver import drive, of

from motorgrad.bodies import LEGS, TRIPODS, HexapodReading, TripodController
from timlab import Diagram, Interpreter, Outlet, Run

LOWEST = -0.6


def tripod_machine(controller, immediate):
    """The leg controller as a table; what `go` and `down` need of other legs comes in by wires."""
    turning = list(controller.turning.values())
    return of(
        "state machine",
        states=("stance", "wait", "swing", "drop"),
        transitions=(
            ("stance", "lateral < back", "wait"),
            ("wait", "opposing > 1", "swing"),
            ("swing", "lateral > forward", "drop"),
            ("drop", "contact > touch or vertical < low", "stance"),
        ),
        reads=("lateral", "vertical", "contact", "opposing"),
        gives=("lateral_velocity", "vertical_velocity"),
        table=tuple((each.lateral, each.vertical) for each in turning),
        constants=("back", "forward", "touch", "low"),
        numbers=(
            math.radians(controller.back),
            math.radians(controller.forward),
            controller.contact,
            LOWEST + math.radians(controller.margin),
        ),
        initial=tuple("stance" if leg in TRIPODS[0] else "swing" for leg in LEGS),
        immediate=immediate,
        shape=(6,),
    )


def readings(ticks):
    """Angles and contacts that wander over all thresholds."""
    rng = np.random.default_rng(5)
    lateral = 0.5 * np.sin(np.cumsum(rng.uniform(0, 0.5, (ticks, 6)), axis=0))
    vertical = LOWEST + 0.3 * rng.uniform(size=(ticks, 6)) ** 3
    contact = rng.uniform(size=(ticks, 6)) ** 4
    return {"lateral": lateral, "vertical": vertical, "contact": contact}


def by_oracle(controller, seen):
    """The states after each decision, by the library's own controller."""
    readings = [
        HexapodReading(seen["lateral"][t], *[np.zeros(6)] * 10)._replace(
            vertical=seen["vertical"][t], contact=seen["contact"][t]
        )
        for t in range(len(seen["lateral"]))
    ]
    states = [controller.begin(readings[0])]
    for reading in readings:
        states.append(controller.decide(states[-1], reading, np.full(6, LOWEST)))
    return np.array(states)


def test_is_the_leg_controller_of_the_hexapod_tick_by_tick():
    """With what other legs do taken from the oracle: every rule of a leg, and its velocities."""
    controller, seen = TripodController(), readings(600)
    states = by_oracle(controller, seen)
    first = np.array([leg in TRIPODS[0] for leg in LEGS])
    standing = states[:-1] <= 1
    opposing = np.where(first, (standing & ~first).sum(-1, keepdims=True), (standing & first).sum(-1, keepdims=True))
    inputs = {**seen, "opposing": opposing}
    at_once = drive(tripod_machine(controller, True), 600, **inputs)
    np.testing.assert_array_equal(at_once["state"], states[1:])
    velocities = np.stack([controller.velocities(row) for row in states[1:]])
    both = np.concatenate([at_once["lateral_velocity"], at_once["vertical_velocity"]], axis=-1)
    np.testing.assert_allclose(both, velocities, rtol=1e-6)
    np.testing.assert_array_equal(drive(tripod_machine(controller, False), 600, **inputs)["state"], states[:-1])
    assert {tuple(pair) for pair in np.stack([states[:-1], states[1:]], -1).reshape(-1, 2)} == {
        (0, 0), (1, 1), (2, 2), (3, 3), (0, 1), (1, 2), (2, 3), (3, 0)
    }  # fmt: skip


@pytest.mark.ci
def test_six_legs_coupled_by_wires_walk_as_the_controller_does(tmp_path):
    """All in one diagram: legs count who stands of the other tripod."""
    controller, seen = TripodController(), readings(300)
    states = by_oracle(controller, seen)
    for name, values in seen.items():
        np.savez(tmp_path / f"{name}.npz", **{leg: values[:, i] for i, leg in enumerate(LEGS)})
    first = [leg in TRIPODS[0] for leg in LEGS]
    diagram = Diagram(0.02)
    diagram.add("legs", tripod_machine(controller, False))
    for name in seen:
        diagram.add(f"{name} file", of("data file", str(tmp_path / f"{name}.npz"), LEGS))
        diagram.add(name, of("join", (0,) * 6))
        for number, leg in enumerate(LEGS, 1):
            diagram.connect(f"{name} file.{leg}", f"{name}.u{number}")
        diagram.connect(name, f"legs.{name}")
    diagram.add("stands", of("expression", "if(s <= 1, 1, 0)", ("s",), shape=(6,)))
    diagram.add("opposing", of("matrix gain", [[float(a != b) for b in first] for a in first]))
    diagram.add("out", Outlet((6,), "int"))
    for source, target in (
        ("legs.state", "stands"),
        ("stands", "opposing"),
        ("opposing", "legs.opposing"),
        ("legs.state", "out"),
    ):
        diagram.connect(source, target)
    np.testing.assert_array_equal(Run(diagram).advance(300)["out.u"][0], states[:-1])
    np.testing.assert_array_equal(Interpreter(diagram).advance(30)["out.u"][0], states[:30])


def test_first_transition_that_holds_is_made_and_any_state_is_a_star():
    block = of(
        "state machine",
        ("a", "b", "c"),
        (("a", "u > 1", "b"), ("a", "u > 0", "c"), ("*", "u < 0", "a")),
        immediate=True,
    )
    given = drive(block, 6, u=np.array([0.0, 0.5, -1.0, 2.0, 2.0, -1.0]))["state"]
    np.testing.assert_array_equal(given, [0, 2, 0, 1, 1, 0])


def test_time_in_a_state_counts_from_its_beginning():
    block = of(
        "state machine",
        ("red", "green"),
        (("red", "since >= stay", "green"), ("green", "since >= stay/2", "red")),
        reads=(),
        constants=("stay",),
        numbers=0.395,
    )
    given = drive(block, 18, 0.1)["state"]
    np.testing.assert_array_equal(given, [0] * 5 + [1] * 2 + [0] * 4 + [1] * 2 + [0] * 4 + [1])


def test_wrong_machines_are_refused_by_name():
    for settings, message in (
        ({"transitions": (("of", "u", "on"),)}, r"unknown state in transitions\[0\] 'of': did you mean 'off'"),
        ({"transitions": (("off", "u", "no"),)}, r"unknown state in transitions\[0\] 'no'"),
        ({"transitions": (("off", "v > 0", "on"),)}, r"transitions\[0\] = 'v > 0': column 1: unknown name 'v'"),
        ({"transitions": (("off", "u"),)}, r"transitions\[0\] = .*: must be a list of 3 entries"),
        ({"states": ()}, "states = .*: must be a list of 1 … 100 names"),
        ({"initial": "dead"}, "unknown state in initial 'dead': .*known are off, on"),
        ({"initial": ("on", "off")}, r"initial = .*: must be one state, or a list of them of shape \(\)"),
        ({"gives": ("state",)}, r"gives\[0\] = 'state': must be another name"),
        ({"gives": ("a", "b"), "table": ((1.0, 2.0, 3.0),)}, r"table: shape = \(1, 3\)"),
        ({"reads": ("since",)}, r"reads\[0\] = 'since': must be another name"),
    ):
        with pytest.raises(ValueError, match=message):
            of("state machine", **settings)
