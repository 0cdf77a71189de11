"""A task as a Gymnasium environment, and many copies of it as a vector environment."""

from collections.abc import Sequence
from typing import Any, ClassVar

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from motorgrad._errors import check, check_integer, choice
from motorgrad.environments._picture import Picture
from motorgrad.environments._rows import Rows
from motorgrad.environments._spaces import as_array, check_action, check_options, metadata_of, spaces_of, task_of
from motorgrad.tasks import Task

ALL = np.ones(1, bool)


class TaskEnv(gymnasium.Env[np.ndarray, Any]):
    """A task as a `gymnasium.Env`.

    **Observation:** `Box` of float32, raw: in the task's own units, without running statistics. Of a policy that
    motorgrad has learned, `Run.act` takes them as they are. **Action:** `MultiBinary(action_size)`, a zero or a one per
    group of muscles or unit; `Discrete(action_size)` for a task with discrete actions; for continuous actions a `Box`
    of the task's `action_range`. For a learner that wants numbers from −1 to 1, `gymnasium.wrappers.RescaleAction` and
    `NormalizeObservation` make them. **Reward** and `terminated` are the task's. `truncated` is true when the task's
    own `time_limit` is reached, or the simulation diverged; the body is then back at its start, and the reward is 0.

    **Info:** `simulated_time` (s, since the start of the episode), `diverged` (bool), and each of the task's metrics at
    the decisions at which it occurs (the hopper's `apex`, in m).

    **Arguments:**

    - `task`: a task or its name, with further settings by name.
    - `render_mode`: `"rgb_array"`, `"human"` (a matplotlib window, in real time) or `None`; bodies only.
    - `width`, `height`: of pictures, in pixels; even, at least 64.

    **Raises:** `ValueError` for unknown settings (suggesting the nearest known one), invalid values and invalid
    actions; `RuntimeError` for `"human"` without a screen; `gymnasium.error.ResetNeeded` for a step before `reset` or
    after the end of the episode.

    ```python
    env = gymnasium.make("motorgrad/Hopper-v0", penalty=0.2)
    observation, info = env.reset(seed=1)
    ```
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["human", "rgb_array"]}

    def __init__(
        self,
        task: Task | str = "hopper",
        *,
        render_mode: str | None = None,
        width: int = 640,
        height: int = 480,
        **settings: object,
    ):
        if render_mode is not None:
            choice("render_mode", render_mode, TaskEnv.metadata["render_modes"])
        self.task = task_of(task, settings)
        self.metadata = metadata_of(self.task, TaskEnv.metadata)  # type: ignore[misc]
        self.observation_space, self._space = spaces_of(self.task)
        self.action_space = self._space
        self._binary = np.equal(self.task.actions, "binary")
        self.render_mode = render_mode
        self._rows = Rows(self.task, 1)
        self._picture = None if render_mode is None else Picture(self._rows, render_mode, width, height)
        self._running = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start an episode. A `seed` restarts the random numbers; otherwise they continue. There are no `options`."""
        check_options(options)
        super().reset(seed=seed)
        self._rows.generators[0] = self.np_random
        observation = self._rows.reset(ALL, anew=seed is not None)[0]
        self._running = True
        if self._picture is not None:
            self._picture.note()
        return observation, {"simulated_time": 0.0, "diverged": False}

    def step(self, action: npt.ArrayLike) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """One decision."""
        rows = self._rows
        if not self._running:
            rows.body  # noqa: B018 (raises if the environment is closed)
            raise gymnasium.error.ResetNeeded("no episode is under way: call reset() before step()")
        outcome = rows.step(check_action(self._space, action, (), self._binary)[None])[0]
        if self._picture is not None:
            self._picture.note()
        columns = rows.columns
        numbers = outcome.tolist()
        terminated = numbers[columns.terminated] > 0
        truncated = numbers[columns.truncated] > 0
        self._running = not (terminated or truncated)
        info = {"simulated_time": rows.decisions.item(0) * rows.period, "diverged": numbers[columns.diverged] > 0}
        for name, place in columns.metrics.items():
            if numbers[place + 1] > 0:
                info[name] = numbers[place]
        observation = np.array(outcome[: columns.reward], np.float32)
        return observation, numbers[columns.reward], terminated, truncated, info

    def render(self) -> np.ndarray | None:  # type: ignore[override]
        """The current picture, `(height, width, 3)` uint8, for `"rgb_array"`; `None` otherwise."""
        return self._picture.paint(0) if self._picture is not None and self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Release threads, window and graphics. Further calls do nothing."""
        self._running = False
        if self._picture is not None:
            self._picture.close()
        self._rows.close()


class TaskVectorEnv(gymnasium.vector.VectorEnv):
    """Many copies of a task as a `gymnasium.vector.VectorEnv`, stepped together on a thread pool.

    Spaces, rewards, infos, arguments and errors are those of `TaskEnv`. In the infos, an array has one entry per row,
    and `_name` says in which rows there is a value. **Autoreset** is `NEXT_STEP`: the step after the last one of an
    episode ignores the row's action, starts the row's next episode, and has reward 0. Row $i$ of `reset(seed=s)` is
    `TaskEnv`'s `reset(seed=s + i)`.

    **Arguments:**

    - `num_envs`: number of rows, ≥ 1.
    - `render_mode`: `"rgb_array"` or `None`; `render` returns a picture of every row.
    - `max_episode_steps`: decisions after which an episode is cut, in addition to the task's own `time_limit`; `None`
      or -1 for never. `gymnasium.make_vec` fills in the id's.
    - `threads`: number of threads that step bodies, 0 for one per processor.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        num_envs: int = 1,
        task: Task | str = "hopper",
        *,
        render_mode: str | None = None,
        width: int = 640,
        height: int = 480,
        max_episode_steps: int | None = None,
        threads: int = 0,
        **settings: object,
    ):
        self.closed = True  # until there is something to close
        if render_mode is not None:
            choice("render_mode", render_mode, TaskVectorEnv.metadata["render_modes"])
        limit = max_episode_steps
        if limit is not None:
            check_integer("max_episode_steps", limit, -1)
            check(limit != 0, "max_episode_steps", limit, "at least 1, or -1 for never")
        self.task = task_of(task, settings)
        self.num_envs = num_envs
        self._rows = Rows(self.task, num_envs, threads)
        self.metadata = metadata_of(self.task, TaskVectorEnv.metadata)  # type: ignore[misc]
        self.single_observation_space, self._space = spaces_of(self.task)
        self.single_action_space = self._space
        self._binary = np.equal(self.task.actions, "binary")
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.render_mode = render_mode
        self._limit = None if limit is None or limit == -1 else int(limit)
        self._picture = None if render_mode is None else Picture(self._rows, render_mode, width, height)
        self._begun = np.zeros(num_envs, bool)
        self._over = np.zeros(num_envs, bool)
        self._every = np.ones(num_envs, bool)
        self._seen = np.zeros(self.observation_space.shape or (), np.float32)
        self.closed = False

    def reset(  # type: ignore[override]
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start episodes in all rows, or in those of the boolean array `options["reset_mask"]`.

        `seed` is a number, from which the rows count up; one number per row; or `None`, which continues the random
        numbers.
        """
        count = self.num_envs
        mask = as_array("reset_mask", check_options(options, ("reset_mask",)).get("reset_mask", self._every))
        check(mask.dtype == bool and mask.shape == (count,), "reset_mask", mask, f"a boolean array ({count},)")
        check((mask | self._begun).all(), "reset_mask", mask.tolist(), "true in every row the first time")
        if seed is None:
            seeds: list[int | None] = [None] * count
        elif isinstance(seed, int | np.integer):
            seeds = [int(seed) + row for row in range(count)]
        else:
            check(isinstance(seed, Sequence | np.ndarray), "seed", seed, f"one number, or {count} of them")
            seeds = list(seed)
        check(len(seeds) == count, "seed", seed, f"one number, or {count} of them")
        anew = mask & np.array([number is not None for number in seeds])
        for row in np.flatnonzero(anew):
            self._rows.generators[row] = np_random(seeds[row])[0]
        for rows, seeded in ((mask & ~anew, False), (anew, True)):
            if rows.any():
                self._seen[rows] = self._rows.reset(rows, seeded)
        self._begun |= mask
        self._over[mask] = False
        if self._picture is not None:
            self._picture.note()
        return self._seen.copy(), self._info(mask, np.zeros(count, bool))

    def step(self, actions: npt.ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One decision in every row, or the start of its next episode."""
        rows, over = self._rows, self._over
        if np.count_nonzero(self._begun) < self.num_envs:
            rows.body  # noqa: B018 (raises if the environment is closed)
            raise gymnasium.error.ResetNeeded("no episode is under way: call reset() before step()")
        actions = check_action(self._space, actions, (self.num_envs,), self._binary)
        some = np.count_nonzero(over) > 0
        outcome = rows.step(actions, ~over if some else None)
        columns = rows.columns
        observation = np.array(outcome[:, : columns.reward], np.float32)
        happened = outcome > 0
        terminated = happened[:, columns.terminated]
        truncated = happened[:, columns.truncated]
        if self._limit is not None and np.count_nonzero(late := rows.decisions >= self._limit):
            truncated |= late & ~over
        if some:
            observation[over] = rows.reset(over)
        if self._picture is not None:
            self._picture.note()
        self._over = terminated | truncated
        self._seen = observation
        reward = outcome[:, columns.reward].astype(float)
        info = self._info(self._every, happened[:, columns.diverged])
        for name, place in columns.metrics.items():
            there = happened[:, place + 1]
            if np.count_nonzero(there):
                info |= {name: np.where(there, outcome[:, place].astype(float), 0.0), f"_{name}": there}
        return observation.copy(), reward, terminated, truncated, info

    def render(self) -> tuple[np.ndarray, ...] | None:
        """A picture of every row, each `(height, width, 3)` uint8, for `"rgb_array"`; `None` otherwise."""
        return None if self._picture is None else tuple(self._picture.paint(row) for row in range(self.num_envs))

    def close_extras(self, **kwargs: object) -> None:
        """Release threads and graphics."""
        if self._picture is not None:
            self._picture.close()
        self._rows.close()
        self._begun[:] = False

    @property
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """The generators of the rows."""
        return tuple(self._rows.generators)

    def _info(self, mask: np.ndarray, diverged: np.ndarray) -> dict[str, Any]:
        """Arrays over the rows; `_name` says in which rows there is a value."""
        time = self._rows.decisions * self._rows.period * mask
        return {"simulated_time": time, "_simulated_time": mask.copy(), "diverged": diverged, "_diverged": mask.copy()}
