"""Spaces, metadata and actions of an environment."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from motorgrad._errors import check, choice, shown
from motorgrad.environments._picture import screen_problem
from motorgrad.tasks import BodyTask, FiniteTask, Task, make

ActionSpace = spaces.Discrete | spaces.MultiBinary | spaces.Box


def task_of(task: Task | str, settings: dict[str, Any]) -> Task:
    """The task itself, or the one of that name with these settings."""
    if isinstance(task, str):
        return make(task, **settings)
    check(isinstance(task, Task), "task", task, "a task or the name of one")
    check(not settings, "settings", settings, f"part of the task that is given: {task.name!r} is already made")
    return task


def spaces_of(task: Task) -> tuple[spaces.Box, ActionSpace]:
    """The observation and the action space of a task. **Raises** `ValueError` for actions of another kind."""
    wanted = "one that takes binary, discrete or continuous actions"
    check(task.actions in task.accepted_actions, f"task {task.name!r}", task.accepted_actions, wanted)
    most = np.full(task.observation_code.size, np.finfo(np.float32).max)
    low = -most
    high = most
    # these bounds hold only if the task shows the world's own observations
    if isinstance(task, FiniteTask) and type(task).observe is FiniteTask.observe:
        seen = task.dynamics.observations
        low = seen.min(0)
        high = seen.max(0)
    observation = spaces.Box(low.astype(np.float32), high.astype(np.float32), dtype=np.float32)
    if task.actions == "discrete":
        return observation, spaces.Discrete(task.action_size)
    if task.actions == "continuous" or isinstance(task.actions, tuple):
        low, high = np.asarray(task.action_range, np.float32).T
        binary = np.equal(task.actions, "binary")  # among continuous ones
        return observation, spaces.Box(np.where(binary, 0.0, low), np.where(binary, 1.0, high), dtype=np.float32)
    return observation, spaces.MultiBinary(task.action_size)


def metadata_of(task: Task, common: dict[str, Any]) -> dict[str, Any]:
    """An environment's metadata: of the render modes in `common`, those that work for this task on this computer."""
    modes = common["render_modes"] if isinstance(task, BodyTask) else []
    if screen_problem():
        modes = [mode for mode in modes if mode != "human"]
    return {**common, "render_modes": list(modes), "render_fps": 1 / task.period}


def check_action(
    space: ActionSpace, action: object, rows: tuple[int, ...] = (), binary: npt.ArrayLike = False
) -> np.ndarray:
    """Check an action of `space`, or one for each of `rows`, and return a copy in the task's type. Where `binary` is
    true among continuous numbers, those above 0.5 are 1. **Raises** `ValueError` naming what is wrong: shape, dtype or
    range."""
    array = as_array("action", action)
    shape = (*rows, *(space.shape or ()))
    if array.shape != shape:
        check(False, "action.shape", array.shape, str(shape))
    if isinstance(space, spaces.Discrete):
        size = int(space.n)
        check(array.dtype.kind in "iu", "action.dtype", array.dtype, "integer")
        check(((array >= 0) & (array < size)).all(), "action", array.tolist(), f"from 0 to {size - 1}")
        return array.astype(np.int32)
    check(array.dtype.kind in "biuf", "action.dtype", array.dtype, "a number's")
    if isinstance(space, spaces.Box):
        given = array.astype(np.float32)  # in which the bounds are
        if not ((given >= space.low) & (given <= space.high)).all():
            bounds = zip(space.low.flat, space.high.flat, strict=True)
            ranges = [f"from {low:g} to {high:g}" for low, high in sorted({(float(a), float(b)) for a, b in bounds})]
            wanted = f"numbers {' or '.join(ranges[:3])}{', …' * (len(ranges) > 3)}"
            check(False, "action", array.tolist(), wanted)
        return np.where(binary, given > 0.5, given).astype(np.float32)
    if np.count_nonzero(array == (array != 0)) < array.size:
        check(False, "action", array.tolist(), "zeros and ones")
    return array.astype(np.float32)


def as_array(name: str, value: object) -> np.ndarray:
    """An argument as an array. **Raises** `ValueError` where it cannot become one."""
    try:
        return np.asarray(value)
    except Exception:  # lists of different lengths; another library's array, whose conversion may raise anything
        raise ValueError(f"{name} = {shown(value)}: must be numbers, as many in each row") from None


def check_options(options: dict[str, Any] | None, known: tuple[str, ...] = ()) -> dict[str, Any]:
    """Check the options of `reset` and return them."""
    check(options is None or isinstance(options, Mapping), "options", options, "a dictionary, or None")
    for name in options or {}:
        choice("option of reset", name, known)
    return options or {}
