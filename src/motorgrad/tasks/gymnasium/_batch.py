"""Gymnasium environments of all seeds: making, stepping, saving and restoring them."""

import contextlib
import functools
import pickle
import weakref
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Float

from motorgrad._errors import check
from motorgrad.tasks.gymnasium._spaces import ActionCode

if TYPE_CHECKING:
    import gymnasium

STEPS = 20  # of a trial, before a copy is made and after


class EnvironmentState(NamedTuple):
    """The result of a decision in a Gymnasium environment. Any leading axes.

    - `observation` (size): flattened, before any reset, unscaled.
    - `reward`: the sum over the decision's steps; `steps`, their number.
    - `terminated`, `truncated`: as reported by the environment.
    """

    observation: Any
    reward: Any
    terminated: Any
    truncated: Any
    steps: Any


class EnvironmentBatch:
    """One environment per seed, which seeds its random numbers; they are stepped one after the other.

    For each seed, `packed` holds the observation, reward, terminated, truncated, steps, and a flag: 1 if an observation
    or reward was not finite. Such a row keeps its previous observation, with reward 0.
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
        self._close = weakref.finalize(self, _close_all, self._environments)
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
        with np.errstate(over="ignore"):  # numbers beyond single precision become infinite, which is detected below
            packed[:, :size] = np.asarray(seen).reshape(len(seen), size)
            packed[:, size:] = outcomes
        self.lost = not np.isfinite(packed).all()
        if self.lost:
            broken = ~np.isfinite(packed).all(axis=1)
            packed[broken, :size] = self._before[broken, :size]
            packed[broken, size:] = (0.0, 0.0, 0.0, 0.0, 1.0)

    def reset(self, rows: Any = None) -> None:
        """Start a new episode; an environment's random numbers continue."""
        for row in range(len(self.seeds)) if rows is None else rows:
            self._begin(int(row), None)

    @property
    def unpack(self) -> Callable[[Any], EnvironmentState]:
        return functools.partial(_unpack, self._size)

    def snapshot(self) -> dict[str, np.ndarray]:
        """The environments as bytes, empty if they cannot be saved, and the packed rows."""
        # A pickle ends in a full stop, so NumPy's byte strings, which drop trailing zeros, keep all of it.
        content = [serialize(environment) if self.copies else b"" for environment in self._environments]
        return {"environments": np.array(content, np.bytes_), "packed": self.packed.copy()}

    def restore(self, snapshot: Mapping[str, np.ndarray]) -> None:
        """Return to a snapshot. Environments that could not be saved stay as they are."""
        content = snapshot["environments"].tolist()
        check(len(content) == len(self.seeds), "environments", len(content), f"one for each of {len(self.seeds)} seeds")
        if all(content):
            replaced = self._environments[:]
            self._environments[:] = [deserialize(each) for each in content]
            _close_all(replaced)
        np.copyto(self.packed, snapshot["packed"])

    def _begin(self, row: int, seed: int | None) -> None:
        observation, _ = self._environments[row].reset(seed=seed)
        check(np.size(observation) == self._size, f"{self._env_id}: observation", observation, f"{self._size} numbers")
        self.packed[row] = 0.0
        with np.errstate(over="ignore"):
            self.packed[row, : self._size] = np.ravel(observation)
        finite = np.isfinite(self.packed[row]).all()
        check(finite, f"{self._env_id}: observation after reset", observation, "finite in single precision")


def make_environment(env_id: str, kwargs: Mapping[str, Any]) -> "gymnasium.Env":
    """`gymnasium.make(env_id, **kwargs)`, with any failure as a one-line `ValueError`."""
    import gymnasium

    try:
        return gymnasium.make(env_id, **kwargs)
    except gymnasium.error.UnregisteredEnv as error:
        raise ValueError(f"env_id = {env_id!r}: {_one_line(error)}") from None
    except gymnasium.error.DependencyNotInstalled as error:
        raise ValueError(f"env_id = {env_id!r}: a dependency is not installed: {_one_line(error)}") from None
    except ImportError as error:  # Gymnasium's MuJoCo environments raise it without naming a remedy
        raise ValueError(
            f"env_id = {env_id!r}: a dependency is not installed: {_one_line(error)}; "
            "for those of Gymnasium: pip install 'gymnasium[mujoco]', or another of its extras"
        ) from None
    except Exception as error:  # an environment's own code may raise anything
        given = f" with {dict(kwargs)}" if kwargs else ""
        raise ValueError(
            f"env_id = {env_id!r}: cannot be made{given}: {type(error).__name__}: {_one_line(error)}"
        ) from None


def why_no_copy(env_id: str, kwargs: Mapping[str, Any]) -> str | None:
    """Why an environment cannot be saved and restored; `None` if a restored copy continues exactly like its original.

    Being picklable is not sufficient: many environments pickle only their constructor's arguments, without the current
    state. So a copy is made within an episode, and both are stepped.
    """
    original, copy, stage = make_environment(env_id, kwargs), None, "its steps fail"
    try:
        sample = original.action_space.sample
        original.action_space.seed(0)
        original.reset(seed=0)
        for made in range(2 * STEPS):
            _, _, terminated, truncated, _ = original.step(sample())
            if terminated or truncated:
                original.reset()
            elif made >= STEPS:
                break
        stage = "it cannot be serialised"
        copy = deserialize(serialize(original))
        stage = "a restored copy of it fails"
        actions = [sample() for _ in range(STEPS)]
        pairs = zip(_trial(copy, actions), _trial(original, actions), strict=True)
        same = all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)
        return None if same else "a restored copy of it continues differently from the original"
    except Exception as error:  # all of this runs the environment's own code, which may raise anything
        return f"{stage}: {type(error).__name__}: {_one_line(error)}"
    finally:
        original.close()
        if copy is not None:
            with contextlib.suppress(Exception):  # the copy may be incomplete
                copy.close()


def serialize(environment: "gymnasium.Env") -> bytes:
    """An environment as bytes, including its state.

    It is pickled twice. The bytes also encode which equal parts are the same object, and a copy has less of that
    information than its original. Pickling twice makes the bytes of both equal.
    """
    import cloudpickle

    return cloudpickle.dumps(pickle.loads(cloudpickle.dumps(environment)))


def deserialize(content: bytes) -> "gymnasium.Env":
    """Restore an environment from bytes. This runs code named in the bytes: restore only what you trust."""
    return pickle.loads(content)


def _unpack(size: int, packed: Any) -> EnvironmentState:
    flags = (packed[..., size], packed[..., size + 1] > 0, packed[..., size + 2] > 0, packed[..., size + 3])
    return EnvironmentState(packed[..., :size], *flags)


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


def _one_line(error: BaseException) -> str:
    """An exception's message on one line."""
    return " ".join(str(error).split())
