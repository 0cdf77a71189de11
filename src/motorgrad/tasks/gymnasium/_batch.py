"""Gymnasium environments of all seeds: making, stepping, saving and restoring them."""

import contextlib
import functools
import math
import weakref
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Float

from motorgrad._arrays import AnyArray
from motorgrad._errors import check, shown
from motorgrad._interface import ActionCode
from motorgrad.tasks.gymnasium._making import make_environment, one_line
from motorgrad.tasks.gymnasium._outcomes import first_observation, misfit, one_number, stacked, step_outcome
from motorgrad.tasks.gymnasium._state import read_state, write_state

if TYPE_CHECKING:
    import gymnasium

STEPS = 20  # of a trial, before a copy is made and after


class EnvironmentState(NamedTuple):
    """The result of a decision in a Gymnasium environment. Any leading axes.

    - `observation` (size): flattened, before any reset, unscaled.
    - `reward`: the sum over the decision's steps; `steps`, their number.
    - `terminated`, `truncated`: as reported by the environment.
    - `info` (keys): the sum over these steps of each number that is read from the environment's `info`; `info_count`
      (keys), in how many of the steps it was there and finite.
    """

    observation: Any
    reward: Any
    terminated: Any
    truncated: Any
    steps: Any
    info: Any = None
    info_count: Any = None


class EnvironmentBatch:
    """One environment per seed, which seeds its random numbers; they are stepped one after the other.

    **Arguments:** the environment's id and its arguments; the `seeds`; the `shape` of an observation; the `code` of the
    actions; `repeat`, steps per decision; whether states can be `saved`; the keys of `info` that are read.

    **Raises** `ValueError` that names environment, step and value where one returns anything but what Gymnasium says.
    The environment's own errors are raised with a note that names environment and step.

    For each seed, `packed` holds the observation, reward, terminated, truncated, steps, the sums and counts of what is
    read from `info`, and a flag: 1 if an observation or reward was not finite. Such a row keeps its previous
    observation, with reward 0.
    """

    def __init__(
        self,
        env_id: str,
        kwargs: Mapping[str, Any],
        seeds: Sequence[int],
        shape: tuple[int, ...],
        code: ActionCode,
        repeat: int,
        saved: bool,
        info: Sequence[str] = (),
    ):
        self.info = tuple(info)
        self.seeds = [int(seed) for seed in seeds]
        self.repeat = repeat
        self.saved = saved
        self._env_id = env_id
        self._code = code
        self._shape = tuple(shape)
        self._size = size = math.prod(self._shape)
        self._decisions = 0
        self._begun = [0] * len(self.seeds)  # the decisions before each episode
        self._made: list[int] = []  # steps of the last decision
        # Gymnasium checked a first step when the task was made; in every step, its checker costs a tenth of CartPole's
        kwargs = {"disable_env_checker": True, **kwargs}
        self._environments = [make_environment(env_id, kwargs) for _ in self.seeds]
        self._close = weakref.finalize(self, _close_all, self._environments)
        self.packed = np.zeros((len(self.seeds), size + 5 + 2 * len(self.info)), np.float32)
        self._before = self.packed.copy()
        self.lost = self._restored = False
        for row, seed in enumerate(self.seeds):
            self._begin(row, seed)

    def step(self, actions: Float[np.ndarray, "seeds size"]) -> None:
        repeat, keys = self.repeat, self.info
        chosen = self._code.native(actions[:, 0] if self._code.kind == "discrete" else actions)
        seen: list[Any] = []
        numbers: list[Any] = []  # all that is packed behind the observations
        read: Sequence[float] = ()
        sums = read
        reward: Any
        total: Any = 0.0
        row = 0
        for environment, action in zip(self._environments, chosen, strict=True):
            made = 1
            while True:
                try:
                    returned = environment.step(action)
                except Exception as error:
                    self._note(error, f"in {self._step(row, made, action)}")
                    raise
                try:
                    observation, reward, terminated, truncated, info = returned
                    usual = type(reward) is float and type(terminated) is bool and type(truncated) is bool
                    if keys or not usual or type(info) is not dict:  # a call takes as long as all of this
                        observation, reward, terminated, truncated, read = step_outcome(returned, keys)
                except (TypeError, ValueError):
                    raise self._refusal(returned, self._step(row, made, action)) from None
                if made > 1:
                    reward += total
                    read = [a + b for a, b in zip(sums, read, strict=True)]
                if made == repeat or terminated or truncated:
                    break
                total, sums = reward, read
                made += 1
            seen.append(observation)
            numbers += (reward, terminated, truncated, made)
            if keys:
                numbers += read
            row += 1
        self._decisions += 1
        width = len(numbers) // row
        self._made = numbers[3::width]
        packed, size = self.packed, self._size
        observations = stacked(seen, self._shape)
        if observations is None:
            raise self._misfit(seen, chosen)
        np.copyto(self._before, packed)
        behind = np.fromiter(numbers, float, len(numbers)).reshape(row, width)
        with np.errstate(over="ignore"):  # numbers beyond single precision become infinite, which is detected below
            packed[:, :size] = observations.reshape(row, size)
            packed[:, size:-1] = behind
        packed[:, -1] = 0.0
        self.lost = bool(np.count_nonzero(np.isfinite(packed)) < packed.size)
        if self.lost:
            broken = ~np.isfinite(packed).all(axis=1)
            packed[broken, :size] = self._before[broken, :size]
            packed[broken, size:-1] = 0.0
            packed[broken, -1] = 1.0

    def reset(self, rows: Sequence[int] | np.ndarray | None = None) -> None:
        """Start a new episode; an environment's random numbers continue."""
        for row in range(len(self.seeds)) if rows is None else rows:
            self._begin(int(row), None)

    @property
    def unpack(self) -> Callable[[Float[AnyArray, "*rows width"]], EnvironmentState]:
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
        self._begun = [self._decisions] * len(self.seeds)

    def _begin(self, row: int, seed: int | None) -> None:
        place = f"the first reset of {self._env_id} of seed {self.seeds[row]}"
        if seed is None:
            place = f"the reset after {self._last_step(row)}"
        try:
            returned = self._environments[row].reset(seed=seed)
        except Exception as error:
            self._note(error, f"in {place}")
            raise
        try:
            observation = first_observation(returned, self._shape)
        except ValueError as error:
            raise self._unfit(error, place) from None
        self.packed[row] = 0.0
        self.packed[row, : self._size] = np.ravel(observation)
        self._begun[row] = self._decisions

    def _step(self, row: int, made: int, action: object = None, before: int = 0) -> str:
        """A step of an environment in words, from the number of it in the decision, which is by default the current
        one, or so many `before`."""
        since = " since it was restored" if self._restored else ""
        number = (self._decisions - before - self._begun[row]) * self.repeat + made
        step = f"step {number} of {self._env_id} of seed {self.seeds[row]}{since}"
        return step if action is None else f"{step}, action {shown(action)}"

    def _last_step(self, row: int, action: object = None) -> str:
        """The last step of the decision before, in words; step 0 before an episode's first decision."""
        some = self._decisions > self._begun[row]
        return self._step(row, self._made[row] if some else 0, action, int(some))

    def _misfit(self, seen: Sequence[Any], chosen: np.ndarray) -> Exception:
        """The error for the first observation that does not fit the observation space."""
        row, error = next((row, found) for row, one in enumerate(seen) if (found := misfit(one, self._shape)))
        return self._unfit(error, self._last_step(row, chosen[row]))

    def _refusal(self, returned: object, place: str) -> Exception:
        """The error for what a step returned."""
        try:
            step_outcome(returned, self.info)
        except ValueError as error:
            return self._unfit(error, place)
        raise AssertionError(returned)  # it was refused before

    def _note(self, error: Exception, place: str) -> None:
        """Add to an environment's own error where it was raised."""
        error.add_note(place)
        if self._restored:
            raise self._unfit(error, place) from error

    def _unfit(self, error: Exception, place: str) -> Exception:
        """The error for what an environment does not do as it should. A stored state is blamed for that of an
        environment that was restored: its numbers may be of any type."""
        if not self._restored:
            return ValueError(f"{place}: {error}")
        message = f"{type(error).__name__}: {one_line(error)}"
        return RuntimeError(f"{self._env_id} fails after it was restored from a checkpoint: {place}: {message}")


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
        known = {key: one_number(value) for key, value in info.items() if isinstance(key, str)}
        keys |= dict.fromkeys(known)
        numbers |= dict.fromkeys(key for key, number in known.items() if number is not None and math.isfinite(number))
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
    original = make_environment(env_id, kwargs)
    copy = None
    stage = "its steps fail"
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


def _unpack(size: int, keys: int, packed: Float[AnyArray, "... width"]) -> EnvironmentState:
    flags = (packed[..., size], packed[..., size + 1] > 0, packed[..., size + 2] > 0, packed[..., size + 3])
    first = size + 4
    end = size + 4 + keys
    return EnvironmentState(packed[..., :size], *flags, packed[..., first:end], packed[..., end : end + keys])


def _close_all(environments: Sequence["gymnasium.Env"]) -> None:
    for environment in environments:
        with contextlib.suppress(Exception):  # it is no longer needed
            environment.close()


def _trial(environment: "gymnasium.Env", actions: list[Any]) -> list[np.ndarray]:
    """The results of these actions, and the first observations of the next two episodes."""
    seen = []
    for action in actions:
        observation, reward, terminated, truncated, _ = step_outcome(environment.step(action), ())
        seen.append(np.append(np.ravel(observation), (reward, terminated, truncated)))
        if terminated or truncated:
            seen.append(np.ravel(environment.reset()[0]))
    return seen + [np.ravel(environment.reset()[0]) for _ in range(2)]
