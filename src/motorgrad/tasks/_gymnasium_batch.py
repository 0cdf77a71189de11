"""Gymnasium environments of all seeds, stepped one after the other."""

import contextlib
import weakref
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Float

from motorgrad._errors import check
from motorgrad.tasks._gymnasium_make import make_environment, restored, saved
from motorgrad.tasks._gymnasium_spaces import ActionCode

if TYPE_CHECKING:
    import gymnasium


class EnvironmentState(NamedTuple):
    """What one decision led to in a Gymnasium environment. Any leading axes.

    - `observation` (size): flattened, before any reset, unscaled.
    - `reward`: the sum over the decision's steps; `steps`, how many they were.
    - `terminated`, `truncated`: as the environment said.
    """

    observation: Any
    reward: Any
    terminated: Any
    truncated: Any
    steps: Any


class EnvironmentBatch:
    """One environment for each seed, which is what its own random numbers are seeded with.

    `packed` holds for each seed the observation, reward, terminated, truncated, steps, and a flag: 1 where an
    observation or reward was not finite. Such a row keeps the observation before it, with reward 0.
    """

    def __init__(
        self,
        env_id: str,
        kwargs: Mapping[str, Any],
        seeds: Sequence[int],
        size: int,
        code: ActionCode,
        repeat: int,
        copies: bool,
    ):
        self.seeds, self.repeat, self.copies = [int(seed) for seed in seeds], repeat, copies
        self._env_id, self._decode, self._size = env_id, code.decode, size
        self._environments = [make_environment(env_id, kwargs) for _ in self.seeds]
        self._close = weakref.finalize(self, _close, self._environments)
        self.packed = np.zeros((len(self.seeds), size + 5), np.float32)
        self._before = self.packed.copy()
        self.lost = False
        for row, seed in enumerate(self.seeds):
            self._begin(row, seed)

    def step(self, actions: Float[np.ndarray, "seeds size"]) -> None:
        np.copyto(self._before, self.packed)
        repeat = self.repeat
        seen: list[Any] = []
        outcomes: list[tuple[Any, ...]] = []
        for row, (environment, action) in enumerate(zip(self._environments, self._decode(actions), strict=True)):
            try:
                observation, reward, terminated, truncated, _ = environment.step(action)
                made = 1
                while made < repeat and not (terminated or truncated):
                    observation, more, terminated, truncated, _ = environment.step(action)
                    reward, made = float(reward) + float(more), made + 1
            except Exception as error:
                error.add_note(f"in a step of {self._env_id} of seed {self.seeds[row]}, action {action!r}")
                raise
            seen.append(observation)
            outcomes.append((reward, terminated, truncated, made, 0.0))
        packed, size = self.packed, self._size
        with np.errstate(over="ignore"):  # what is beyond single precision becomes infinite, which is noticed below
            packed[:, :size] = np.asarray(seen).reshape(len(seen), size)
            packed[:, size:] = outcomes
        self.lost = not np.isfinite(packed).all()
        if self.lost:
            broken = ~np.isfinite(packed).all(axis=1)
            packed[broken, :size] = self._before[broken, :size]
            packed[broken, size:] = (0.0, 0.0, 0.0, 0.0, 1.0)

    def reset(self, rows: Any = None) -> None:
        """Begin a new episode; an environment's random numbers go on where they were."""
        for row in range(len(self.seeds)) if rows is None else rows:
            self._begin(int(row), None)

    def unpack(self, packed: Any) -> EnvironmentState:
        size = self._size
        flags = (packed[..., size], packed[..., size + 1] > 0, packed[..., size + 2] > 0, packed[..., size + 3])
        return EnvironmentState(packed[..., :size], *flags)

    def snapshot(self) -> dict[str, np.ndarray]:
        """The environments as bytes, empty where they cannot be saved, and the packed rows."""
        # A pickle ends in a full stop, so that NumPy's strings, which forget zeros at their ends, keep all of it.
        content = [saved(environment) if self.copies else b"" for environment in self._environments]
        return {"environments": np.array(content, np.bytes_), "packed": self.packed.copy()}

    def restore(self, snapshot: Mapping[str, np.ndarray]) -> None:
        """Go back to a snapshot. Where environments could not be saved they stay as they are."""
        content = snapshot["environments"].tolist()
        check(len(content) == len(self.seeds), "environments", len(content), f"one for each of {len(self.seeds)} seeds")
        if all(content):
            replaced = self._environments[:]
            self._environments[:] = [restored(each) for each in content]
            _close(replaced)
        np.copyto(self.packed, snapshot["packed"])

    def _begin(self, row: int, seed: int | None) -> None:
        observation, _ = self._environments[row].reset(seed=seed)
        check(np.size(observation) == self._size, f"{self._env_id}: observation", observation, f"{self._size} numbers")
        self.packed[row] = 0.0
        with np.errstate(over="ignore"):
            self.packed[row, : self._size] = np.ravel(observation)
        finite = np.isfinite(self.packed[row]).all()
        check(finite, f"{self._env_id}: observation after reset", observation, "finite in single precision")


def _close(environments: Sequence["gymnasium.Env"]) -> None:
    for environment in environments:
        with contextlib.suppress(Exception):  # nothing depends on it any more
            environment.close()
