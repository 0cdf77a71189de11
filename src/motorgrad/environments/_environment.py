"""A task as a Gymnasium environment."""

from typing import Any, ClassVar

import gymnasium
import numpy as np

from motorgrad._errors import choice
from motorgrad.environments._picture import Picture
from motorgrad.environments._rows import Rows
from motorgrad.environments._spaces import fitting, known_options, metadata_of, spaces_of, stretched, task_of
from motorgrad.tasks import Task

ALL = np.ones(1, bool)


class TaskEnv(gymnasium.Env[np.ndarray, Any]):
    """A task as a `gymnasium.Env`.

    **Observation:** `Box` of float32, `(observation_size,)`. **Action:** `MultiBinary(action_size)`, a zero or a one
    for each group of muscles or unit; `Discrete(action_size)` for a task with a choice of actions; for one of graded
    actions `Box`, from −1 to 1, which stand for the ends of the task's `action_range`. **Reward** and `terminated` are
    the task's. `truncated` when the task's own `time_limit` is over, or the simulation diverged: the body is then
    back at its start, and the reward is 0.

    **Info:** `simulated_time` (s, since the episode began), `diverged` (bool), and each of the task's readings at the
    decisions at which it occurs (the hopper's `apex`, in m).

    **Arguments:**

    - `task`: a task or its name.
    - `render_mode`: `"rgb_array"`, `"human"` (a matplotlib window, in real time) or `None`; bodies only.
    - `width`, `height`: of pictures, in pixels; even, at least 64.
    - further settings of the task by name, if the task is given by name.

    **Raises:** `ValueError` for unknown settings, with the nearest known one, impossible values and actions that do not
    fit; `RuntimeError` for `"human"` without a screen; `gymnasium.error.ResetNeeded` for a step before `reset` or after
    the episode's end.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["human", "rgb_array"]}

    def __init__(
        self,
        task: Task | str = "hopper",
        *,
        render_mode: str | None = None,
        width: int = 640,
        height: int = 480,
        **settings: Any,
    ):
        if render_mode is not None:
            choice("render_mode", render_mode, TaskEnv.metadata["render_modes"])
        self.task = task_of(task, settings)
        self.metadata = metadata_of(self.task, TaskEnv.metadata)  # type: ignore[misc]
        self.observation_space, self._space = spaces_of(self.task)
        self.action_space = self._space
        self.render_mode = render_mode
        self._rows = Rows(self.task, 1)
        self._picture = None if render_mode is None else Picture(self._rows, render_mode, width, height)
        self._running = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode. With a `seed` the random numbers begin anew, else they go on. There are no `options`."""
        known_options(options)
        super().reset(seed=seed)
        self._rows.generators[0] = self.np_random
        observation = self._rows.reset(ALL, anew=seed is not None)[0]
        self._running = True
        if self._picture is not None:
            self._picture.note()
        return observation, {"simulated_time": 0.0, "diverged": False}

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """One decision."""
        rows = self._rows
        if not self._running:
            rows.body  # noqa: B018 (a closed environment says so)
            raise gymnasium.error.ResetNeeded("no episode is under way: call reset() before step()")
        outcome = rows.step(stretched(self.task, fitting(self._space, action))[None])
        if self._picture is not None:
            self._picture.note()
        terminated, truncated = bool(outcome.terminated[0]), bool(outcome.truncated[0])
        self._running = not (terminated or truncated)
        info = {"simulated_time": float(rows.decisions[0] * rows.period), "diverged": bool(outcome.diverged[0])}
        info |= {name: float(value[0]) for name, (value, occurred) in outcome.readings.items() if occurred[0]}
        return outcome.observation[0], float(outcome.reward[0]), terminated, truncated, info

    def render(self) -> np.ndarray | None:  # type: ignore[override]
        """The present picture, `(height, width, 3)` uint8, for `"rgb_array"`; `None` otherwise."""
        return self._picture.paint(0) if self._picture is not None and self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Let go of threads, window and graphics; a second time does nothing."""
        self._running = False
        if self._picture is not None:
            self._picture.close()
        self._rows.close()
