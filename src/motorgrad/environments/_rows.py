"""Several copies of a task in step, without a learner: what an environment is made of."""

from typing import Any, NamedTuple

import numpy as np
from gymnasium.error import ClosedEnvironmentError
from gymnasium.utils.seeding import np_random

from motorgrad._errors import check
from motorgrad.bodies import BodyBatch
from motorgrad.environments._compiled import choose, compiled
from motorgrad.tasks import BodyTask, Task
from motorgrad.worlds import World


class Outcome(NamedTuple):
    """What a decision led to, rows leading. `readings` holds, by name, the values and whether each occurred."""

    observation: np.ndarray
    reward: np.ndarray
    terminated: np.ndarray
    truncated: np.ndarray
    diverged: np.ndarray
    readings: dict[str, tuple[np.ndarray, np.ndarray]]


class Rows:
    """`count` copies of `task`, each with a random generator of its own, so that no row changes another's numbers.

    `decisions` counts those of each row's present episode.
    """

    def __init__(self, task: Task, count: int, threads: int = 1):
        whole = isinstance(count, int | np.integer) and not isinstance(count, bool) and count >= 1
        check(whole, "num_envs", count, "a whole number >= 1")
        if not isinstance(task.dynamics, World) and not isinstance(task, BodyTask):
            raise ValueError(f"task = {task.name!r}: must be over a world or a body to become an environment")
        self.task, self.period = task, task.period
        self._size, self._limit = task.observation_size, task.episode_limit
        self.generators = [np_random()[0] for _ in range(count)]
        self.decisions = np.zeros(count, np.int64)
        on_body = isinstance(task, BodyTask)
        self._body = task.batch(range(count), threads) if on_body else None
        self.activation = np.zeros((count, 0 if self._body is None else len(self._body.groups)))
        """What the simulations were told in the decision just made, rows leading; zeros where an episode begins."""
        self._packed = np.zeros((count, 0), np.float32) if self._body is None else self._body.packed
        self._every, self._nothing = np.ones(count, bool), np.zeros((count, 0), np.float32)
        self._functions = compiled(task)
        self._carry: Any = None
        self._closed = False

    @property
    def body(self) -> BodyBatch | None:
        """The simulations; `None` for a task over a world.

        **Raises:** `gymnasium.error.ClosedEnvironmentError` after `close`.
        """
        if self._closed:
            raise ClosedEnvironmentError("this environment is closed: make another one")
        return self._body

    def reset(self, mask: np.ndarray, anew: bool = False) -> np.ndarray:
        """Begin new episodes in the rows of `mask`, all of them the first time; what is observed there.

        `anew`: without what the task's memory keeps from one episode to the next, as the first time.
        """
        if self.body is not None:
            self.body.reset(mask)
            self.activation = np.where(mask[:, None], 0.0, self.activation)
        functions, numbers = self._functions, self._draw(self._functions.begins, mask)
        if anew or self._carry is None:
            carry, observation = functions.begin(self._packed, numbers)
        else:
            carry, observation = functions.again(self._carry, self._packed, numbers)
        observation = np.array(observation, np.float32)  # also waits until `packed` has been read
        self._carry = choose(mask, carry, self._carry)
        self.decisions[mask] = 0
        return observation[mask]

    def step(self, action: np.ndarray, live: np.ndarray | None = None) -> Outcome:
        """One decision in the rows of `live`; in the others nothing counts, and they must be reset.

        A row that diverges is back at its start. It is truncated, pays 0, and nothing has occurred in it.
        """
        body, size, limit = self.body, self._size, self._limit
        if body is None:
            diverged = np.zeros(len(action), bool)
        else:
            assert isinstance(self.task, BodyTask)
            self.activation = np.asarray(self.task.control(action, self._carry[0]))
            body.step(self.activation)
            diverged = body.packed[:, -1] > 0
        numbers = self._draw(self._functions.decides, self._every if live is None else live)
        self._carry, outcome = self._functions.decide(self._carry, self._packed, action, numbers)
        outcome = np.array(outcome, float)  # waits until `packed` and `action` have been read
        good = ~diverged
        if live is not None:
            diverged, good = diverged & live, good & live
        self.decisions += 1 if live is None else live
        terminated = (outcome[:, size + 1] > 0) & good
        cut = outcome[:, size + 2] > 0
        if limit is not None:
            cut |= self.decisions >= limit
        truncated = diverged | (cut & good & ~terminated)
        readings = {
            name: (outcome[:, first], (outcome[:, first + 1] > 0) & good)
            for first, name in zip(range(size + 3, outcome.shape[1], 2), self.task.reports, strict=True)
        }
        observation = np.array(outcome[:, :size], np.float32)
        return Outcome(observation, np.where(good, outcome[:, size], 0.0), terminated, truncated, diverged, readings)

    def close(self) -> None:
        """Let go of the simulations and their threads."""
        self._body, self._packed, self._carry, self._closed = None, np.zeros((0, 0)), None, True

    def _draw(self, size: int, mask: np.ndarray) -> np.ndarray:
        """Numbers from U[0, 1) for the rows of `mask`; the others draw nothing."""
        if not size:
            return self._nothing
        drawn = np.zeros((len(mask), size), np.float32)
        for row in np.flatnonzero(mask):
            drawn[row] = self.generators[row].random(size, np.float32)
        return drawn
