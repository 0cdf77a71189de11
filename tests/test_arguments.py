"""What is given to a public function is looked at before anything is done with it, and refused by name in one line."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

import inspect
import math
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
import pytest
from matplotlib.axes import Axes

import motorgrad as mg
import timlab
import timsim
from motorgrad import plane
from motorgrad._arguments import check_arguments
from timsim.live import Camera, Session, Setup, Stage
from timsim.page import Page

ODD = (object(), b"x", 1j)  # of no kind that any argument is
TOP = {  # what is not refused by checks of the function's own; they take more than annotations say, such as 1e6 steps
    "agent_for": ("task", "steps"),
    "compare": ("metric", "out", "run"),
    "evaluate": ("run", "untrained", "trust", "allow_changed"),
    "load": ("path", "task", "trust", "allow_changed"),
    "resume": ("path", "progress", "trust", "allow_changed"),
    "train": ("task", "seeds", "out", "progress", "tensorboard", "allow_changed"),
}
DOORS = {f"mg.{name}": getattr(mg, name) for name in TOP}
MADE = (
    *(timlab.Diagram, timlab.DiagramEnv, timlab.DiagramPolicy, timlab.Interpreter, timlab.Run, timlab.Timeline),
    *(
        timsim.Course,
        plane.DrawnPaths,
        plane.DrawnUnits,
        timsim.Motion,
        timsim.Painter,
        timsim.Plot,
        timsim.Viewpoint,
    ),
    *(Camera, Stage, Session, Page),
)
DOORS |= {kind.__name__: kind for kind in MADE}
EDITS = ("add", "connect", "contains", "disconnect", "remove", "rename", "replace", "use", "uses_of")
DOORS |= {f"diagram.{name}": getattr(timlab.Diagram(tick=0.1), name) for name in EDITS}
for room in (timsim, timlab, plane):
    found = {name: getattr(room, name) for name in room.__all__ if inspect.isfunction(getattr(room, name))}
    DOORS |= {f"{room.__name__}.{name}": each for name, each in found.items()}


def blank(kind):
    """An instance of which nothing is looked at, as all kinds are found out before."""
    return tuple.__new__(kind) if issubclass(kind, tuple) else object.__new__(kind)


def good(door, name, parameter):
    """A value of the right kind."""
    if parameter.default is not parameter.empty:
        made = "marks", "cameras"  # by factories of fields
        return {"marks": np.zeros((0, 0, 4)), "cameras": {}}[name] if name in made else parameter.default
    kinds = {
        "activation": lambda: np.zeros(1),
        "ax": lambda: blank(Axes),
        "address": lambda: "x",
        "axes": lambda: blank(Axes),
        "cls": lambda: timlab.Gain,
        "block": lambda: timlab.Gain(1.0),
        "course": lambda: blank(timsim.Course),
        "decision": lambda: np.arange(1),
        "diagram": lambda: timlab.Diagram(tick=0.1),
        "forces": lambda: np.zeros((1, 2)),
        "frame": lambda: 0,
        "linear": lambda: blank(timlab.Linear),
        "log": list,
        "methods": dict,
        "model": lambda: mujoco.MjModel.from_xml_string("<mujoco/>"),
        "motion": lambda: blank(timsim.Motion),
        "motions": list,
        "name": lambda: "x",
        "names": list,
        "new": lambda: "x",
        "occupancy": lambda: np.zeros((2, 2)),
        "old": lambda: "x",
        "other": lambda: timlab.Diagram(tick=0.1),
        "out": lambda: "x",
        "path": lambda: "x",
        "paths": list,
        "period": lambda: 1.0,
        "policies": lambda: mg.policies.hyperplanes(2, 3),
        "policy": lambda: mg.policies.hyperplanes(2, 3),
        "position": lambda: np.zeros(3),
        "record": lambda: blank(timlab.Record),
        "records": list,
        "regions": list,
        "reward": lambda: np.zeros((1, 1)),
        "outcome": lambda: blank(mg.training.Evaluation),
        "run": lambda: blank(mg.Run if door.startswith(("mg.", "timsim.")) else timlab.Run),
        "session": lambda: blank(Session),
        "setup": lambda: blank(Setup),
        "source": lambda: timlab.Diagram(tick=0.1),
        "target": lambda: (0.0, 0.0, 1.0),
        "task": lambda: mg.make("particle"),
        "tasks": dict,
        "seed": lambda: 0,
        "text": lambda: "x",
        "time": lambda: np.arange(1),
        "title": lambda: "x",
        "tick": lambda: 1.0,
        "ticks": lambda: 1,
        "values": lambda: np.zeros(1),
    }
    if door in ("diagram.connect", "diagram.disconnect"):
        return "x"
    return kinds[name]()


ANYTHING = ("Any", "ArrayLike", "ColorType", "object")
"""Annotations of what comes in many forms: the functions themselves find out whether it will do."""


def arguments():
    for door, function in DOORS.items():
        for name, parameter in inspect.signature(function).parameters.items():
            if name not in TOP.get(door.removeprefix("mg."), (name,)):
                continue
            several = parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
            first = str(parameter.annotation).split(" | ")[0]
            if not several and not any(each in first for each in ANYTHING):
                yield door, name


@pytest.mark.parametrize(("door", "name"), list(arguments()))
def test_a_value_of_the_wrong_kind_is_refused_by_name(door, name):
    parameters = inspect.signature(DOORS[door]).parameters
    kinds = inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD
    given = {each: good(door, each, known) for each, known in parameters.items() if known.kind not in kinds}
    for odd in ODD:
        with pytest.raises(ValueError, match=rf"^{name} = .*: must be .") as error:
            DOORS[door](**{**given, name: odd})
        assert len(str(error.value).splitlines()) == 1


VIEWED = [
    ("run", 5, "a Run, a path, a text or None"),
    ("run", [], "a Run, a path, a text or None"),
    ("record", 5, "a path, a text or None"),
    ("stage", 5, "a Stage or None"),
    ("stage", "moon", "a Stage or None"),
    ("planet", 5, "a Planet or None"),
    ("motion", 5, "a Motion, a path, a text or None"),
    ("agent", 5, "a Learner, a table or None"),
    ("agent", "olgarb", "a Learner, a table or None"),
    ("beside", 5, "a table or None"),
    ("beside", ["untrained"], "a table or None"),
    ("seed", 1.5, "an integer or a sequence"),
    ("seed", True, "an integer or a sequence"),
    ("seed", None, "an integer or a sequence"),
    ("seed", "0", "an integer or a sequence"),
    ("seed", [0, 1.5], "an integer >= 0"),
    ("seed", [[0]], "an integer >= 0"),
    ("seed", -1, "an integer >= 0"),
    ("speed", "fast", "a number"),
    ("speed", math.nan, ""),
    ("playing", "yes", "True or False"),
    ("frozen", 1, "True or False"),
    ("trust", "no", "True or False"),
    ("wait", None, "True or False"),
    ("host", 5, "a text"),
    ("port", "8080", "an integer or None"),
    ("port", 1.5, "an integer or None"),
    ("task", 5, "a task, a body, a MuJoCo model, or the path of one"),
    ("task", None, "a task, a body, a MuJoCo model, or the path of one"),
    ("task", [], "a task, a body, a MuJoCo model, or the path of one"),
    ("task", b"hopper", "a task, a body, a MuJoCo model, or the path of one"),
]


@pytest.mark.parametrize(("name", "value", "allowed"), VIEWED)
def test_view_refuses_odd_values_before_anything_starts(name, value, allowed):
    with pytest.raises(ValueError, match=rf"{name}\b.* = .*must be .*{allowed}") as error:
        timsim.view(**{"task": "hopper", name: value})
    assert len(str(error.value).splitlines()) == 1


def test_numbers_of_numpy_are_numbers():
    rights: list[Any] = [(np.int64(3), np.float32(1.5), np.arange(3)), (3, 2, range(3), "x")]
    wrongs: list[Any] = [(3.0, 1.0, 1), (True, 1.0, 1), (3, True, 1), (3, "1", 1), (3, 1.0, "123"), (3, 1.0, 1, 5)]

    def door(whole: int, number: float, several: "int | Sequence[int] | np.ndarray", path: str | None = None):
        check_arguments(door, locals())
        return True

    for right in rights:
        assert door(*right)
    for wrong in wrongs:
        with pytest.raises(ValueError, match="must be"):
            door(*wrong)
