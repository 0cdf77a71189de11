"""Gymnasium environments of all seeds: making, stepping, saving and restoring them."""

import contextlib
import functools
import math
import weakref
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Float

from motorgrad._errors import check
from motorgrad.tasks.gymnasium._making import make_environment, one_line
from motorgrad.tasks.gymnasium._spaces import ActionCode
from motorgrad.tasks.gymnasium._state import read_state, write_state

if TYPE_CHECKING:
    import gymnasium

STEPS = 20  # of a trial, before a copy is made and after


class EnvironmentState(NamedTuple):
    """The result of a decision in a Gymnasium environment. Any leading axes.

    - `observation` (size): flattened, before any reset, unscaled.
    - `reward`: the sum over the decision's steps; `steps`, their number.
    - `terminated`, `truncated`: as reported by the environment.
    - `info` (keys): the sum over these steps of each number that is read from the environment's `info`; `told` (keys),
      in how many of the steps it was there and finite.
    """

    observation: Any
    reward: Any
    terminated: Any
    truncated: Any
    steps: Any
    info: Any = None
    told: Any = None


class EnvironmentBatch:
    """One environment per seed, which seeds its random numbers; they are stepped one after the other.

    For each seed, `packed` holds the observation, reward, terminated, truncated, steps, the sums and counts of what is
    read from `info`, and a flag: 1 if an observation or reward was not finite. Such a row keeps its previous
    observation, with reward 0.
    """

    def __init__(
        self,
        env_id: str,
        kwargs: Mapping[str, Any],
        seeds: Sequence[int],
        size: int,
        code: ActionCode,
        repeat: int,
        saved: bool,
        info: Sequence[str] = (),
    ):
        self.info = tuple(info)
        self.seeds = [int(seed) for seed in seeds]
        self.repeat = repeat
        self.saved = saved
        self._env_id, self._decode, self._size = env_id, code.decode, size
        self._environments = [make_environment(env_id, kwargs) for _ in self.seeds]
        self._close = weakref.finalize(self, _close_all, self._environments)
        self.packed = np.zeros((len(self.seeds), size + 5 + 2 * len(self.info)), np.float32)
        self._before = self.packed.copy()
        self.lost = self._restored = False
        for row, seed in enumerate(self.seeds):
            self._begin(row, seed)

    def step(self, actions: Float[np.ndarray, "seeds size"]) -> None:
        np.copyto(self._before, self.packed)
        repeat, keys = self.repeat, self.info
        seen: list[Any] = []
        outcomes: list[tuple[Any, ...]] = []
        for row, (environment, action) in enumerate(zip(self._environments, self._decode(actions), strict=True)):
            try:
                observation, reward, terminated, truncated, info = environment.step(action)
                made, read = 1, numbers_in(info, keys) if keys else ()
                while made < repeat and not (terminated or truncated):
                    observation, more, terminated, truncated, info = environment.step(action)
                    reward, made = float(reward) + float(more), made + 1
                    if keys:
                        read = [a + b for a, b in zip(read, numbers_in(info, keys), strict=True)]
            except Exception as error:
                error.add_note(f"in a step of {self._env_id} of seed {self.seeds[row]}, action {action!r}")
                self._fail(error)
                raise
            seen.append(observation)
            outcomes.append((reward, terminated, truncated, made, *read, 0.0))
        packed, size = self.packed, self._size
        with np.errstate(over="ignore"):  # numbers beyond single precision become infinite, which is detected below
            packed[:, :size] = np.asarray(seen).reshape(len(seen), size)
            packed[:, size:] = outcomes
        self.lost = not np.isfinite(packed).all()
        if self.lost:
            broken = ~np.isfinite(packed).all(axis=1)
            packed[broken, :size] = self._before[broken, :size]
            packed[broken, size:-1] = 0.0
            packed[broken, -1] = 1.0

    def reset(self, rows: Any = None) -> None:
        """Start a new episode; an environment's random numbers continue."""
        for row in range(len(self.seeds)) if rows is None else rows:
            self._begin(int(row), None)

    @property
    def unpack(self) -> Callable[[Any], EnvironmentState]:
        return functools.partial(_unpack, self._size, len(self.info))

    @property
    def environments(self) -> Sequence["gymnasium.Env"]:
        """The environments, one for each seed. They are others after `restore`."""
        return self._environments

    def snapshot(self) -> dict[str, np.ndarray]:
        """The environments as text, empty if they cannot be saved, and the packed rows."""
        # The text ends in a bracket, so NumPy's byte strings, which drop trailing zeros, keep all of it.
        content = [write_state(environment) if self.saved else b"" for environment in self._environments]
        return {"environments": np.array(content, np.bytes_), "packed": self.packed.copy()}

    def restore(self, snapshot: Mapping[str, np.ndarray]) -> None:
        """Return to a snapshot. Environments that could not be saved stay as they are."""
        content = snapshot["environments"].tolist()
        check(len(content) == len(self.seeds), "environments", len(content), f"one for each of {len(self.seeds)} seeds")
        for environment, each in zip(self._environments, content, strict=True):
            if each:
                read_state(each, environment)
                self._restored = True
        np.copyto(self.packed, snapshot["packed"])

    def _fail(self, error: Exception) -> None:
        """Blame the stored state for an error of an environment that was restored: its numbers may be of any type."""
        if self._restored:
            told = f"{type(error).__name__}: {one_line(error)}"
            raise RuntimeError(f"{self._env_id} fails after it was restored from a checkpoint: {told}") from error

    def _begin(self, row: int, seed: int | None) -> None:
        try:
            observation, _ = self._environments[row].reset(seed=seed)
        except Exception as error:
            self._fail(error)
            raise
        check(np.size(observation) == self._size, f"{self._env_id}: observation", observation, f"{self._size} numbers")
        self.packed[row] = 0.0
        with np.errstate(over="ignore"):
            self.packed[row, : self._size] = np.ravel(observation)
        finite = np.isfinite(self.packed[row]).all()
        check(finite, f"{self._env_id}: observation after reset", observation, "finite in single precision")


def numbers_in(info: Mapping[str, Any], keys: Sequence[str]) -> list[float]:
    """The numbers of these keys in a step's `info`, 0 where one is missing or not finite; then 1 for each that is
    there, else 0."""
    values = [_number(info[key]) if key in info else None for key in keys]
    return [0.0 if value is None else value for value in values] + [0.0 if value is None else 1.0 for value in values]


def _number(value: Any) -> float | None:
    """A number, a flag, or an array of one, as a finite number in single precision; `None` for anything else."""
    try:
        found = float(np.float32(np.asarray(value).item()))
    except (TypeError, ValueError):  # an array of several, text, an object
        return None
    return found if math.isfinite(found) else None


class Info(NamedTuple):
    """What environments say in `info`: the keys of single numbers, and all keys, in the order in which they came."""

    numbers: tuple[str, ...]
    keys: tuple[str, ...]


def find_info(environment: "gymnasium.Env", wanted: Collection[str]) -> Info:
    """The keys of `info` in the first step of an episode of random actions. If `wanted` keys are missing, as those
    are that come with the end of an episode alone, in all of its steps up to a thousand."""
    numbers: dict[str, None] = {}
    keys: dict[str, None] = {}
    environment.action_space.seed(0)
    environment.reset(seed=0)
    for _ in range(1000 if wanted else 1):
        _, _, terminated, truncated, info = environment.step(environment.action_space.sample())
        keys |= dict.fromkeys(map(str, info))
        numbers |= dict.fromkeys(str(key) for key, value in info.items() if _number(value) is not None)
        if terminated or truncated or numbers.keys() >= set(wanted):
            break
    return Info(tuple(numbers), tuple(keys))


def why_not_saved(env_id: str, kwargs: Mapping[str, Any]) -> str | None:
    """Why an environment cannot be saved such that a restored one goes on exactly like its original; `None` if it can.

    It is saved as plain data within an episode and restored, and both are stepped. What an environment says of itself
    is not sufficient: many pickle only their constructor's arguments. Pickles are not used, as reading one runs code.
    """
    try:
        same = _goes_on(env_id, kwargs)
    except _NoTrial as error:
        return str(error)
    return None if same else "a restored copy of it continues differently from the original"


class _NoTrial(Exception):
    """A trial of an environment that fails, with the stage and the reason."""


def _goes_on(env_id: str, kwargs: Mapping[str, Any]) -> bool:
    """Whether a copy of an environment, made within an episode, continues exactly like its original."""
    original, copy, stage = make_environment(env_id, kwargs), None, "its steps fail"
    try:
        sample = original.action_space.sample
        original.action_space.seed(0)
        original.reset(seed=0)
        _wander(original)
        stage = "it cannot be written as data"
        copy = _copied(env_id, kwargs, original)
        stage = "a restored copy of it fails"
        actions = [sample() for _ in range(STEPS)]
        pairs = zip(_trial(copy, actions), _trial(original, actions), strict=True)
        return all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)
    except Exception as error:  # all of this runs the environment's own code, which may raise anything
        raise _NoTrial(f"{stage}: {type(error).__name__}: {one_line(error)}") from None
    finally:
        _close_all([original, *([] if copy is None else [copy])])


def _wander(environment: "gymnasium.Env") -> None:
    """Take random steps, to within an episode."""
    for made in range(2 * STEPS):
        _, _, terminated, truncated, _ = environment.step(environment.action_space.sample())
        if terminated or truncated:
            environment.reset()
        elif made >= STEPS:
            break


def _copied(env_id: str, kwargs: Mapping[str, Any], original: "gymnasium.Env") -> "gymnasium.Env":
    """A copy by way of data: another environment, with a past of its own, in the state of the original."""
    copy = make_environment(env_id, kwargs)
    copy.action_space.seed(1)
    copy.reset(seed=1)
    _wander(copy)
    read_state(write_state(original), copy)
    return copy


def _unpack(size: int, keys: int, packed: Any) -> EnvironmentState:
    flags = (packed[..., size], packed[..., size + 1] > 0, packed[..., size + 2] > 0, packed[..., size + 3])
    first, end = size + 4, size + 4 + keys
    return EnvironmentState(packed[..., :size], *flags, packed[..., first:end], packed[..., end : end + keys])


def _close_all(environments: Sequence["gymnasium.Env"]) -> None:
    for environment in environments:
        with contextlib.suppress(Exception):  # it is no longer needed
            environment.close()


def _trial(environment: "gymnasium.Env", actions: list[Any]) -> list[np.ndarray]:
    """The results of these actions, and the first observations of the next two episodes."""
    seen = []
    for action in actions:
        observation, reward, terminated, truncated, _ = environment.step(action)
        seen.append(np.append(np.ravel(observation), (float(reward), terminated, truncated)))
        if terminated or truncated:
            seen.append(np.ravel(environment.reset()[0]))
    return seen + [np.ravel(environment.reset()[0]) for _ in range(2)]
