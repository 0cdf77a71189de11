"""Any Gymnasium environment as a task."""

import contextlib
import dataclasses
import functools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad._consent import allow
from motorgrad._errors import check, unknown
from motorgrad._interface import ActionCode, Interface, ObservationCode
from motorgrad._running import RunningMean
from motorgrad.schema import count, number, static
from motorgrad.tasks._host_task import HostTask
from motorgrad.tasks._task import Actions, Flag, Metric, Scalar
from motorgrad.tasks.gymnasium._batch import EnvironmentBatch, EnvironmentState, find_info, why_not_saved
from motorgrad.tasks.gymnasium._making import foreign_code, id_of, make_environment
from motorgrad.tasks.gymnasium._names import documented_names
from motorgrad.tasks.gymnasium._spaces import Code, Scaling, action_code, observation_code
from motorgrad.tasks.gymnasium._workers import WorkerBatch

if TYPE_CHECKING:
    import gymnasium

SUCCESS = ("solved", "success", "is_success")
"""Keys of `info` by which environments report success: MyoSuite's, Meta-World's and Gymnasium-Robotics'."""
TAKEN = ("return", "length", "reward", "episodes", "diverged", "baseline", "parameters", "seed", "decision")
TAKEN += ("simulated_time", "wall_time", "cpu_time", "setting", "units", "adding")  # other columns of the metrics

MANY = 1000  # observed numbers, with which the preset's matrices become too large


class EnvironmentMemory(NamedTuple):
    """The memory of a task on an environment: return and length of the current episode, running mean and variance of
    the observations (`None` without running scaling), whether these are frozen, and on how many steps of the episode
    the task was solved (`None` where the environment does not say)."""

    returned: Scalar
    length: Scalar
    mean: RunningMean | None
    variance: RunningMean | None
    frozen: Flag
    solved: Scalar | None = None


class _Facts(NamedTuple):
    seen: ObservationCode
    code: ActionCode
    period: float
    longest: int | None
    info: tuple[str, ...]
    """The keys of `info` that are read, that of success first where there is one."""
    succeeds: bool
    """Whether there is one."""


@dataclasses.dataclass(frozen=True)
class Gymnasium(HostTask):
    """A Gymnasium environment with its own observations, rewards, ends of episodes and time limit.

    Observed: the environment's observation, flattened and scaled; with discrete actions also a constant 1, because a
    softmax has no bias. Reported for each episode: its `return`, the sum of the environment's rewards, and its `length`
    in steps. Where the environment reports success in its `info`, as `solved`, `success` or `is_success`, so are
    `success`, the share of episodes that succeed, and `solved`, the share of steps on which the task is solved.

    **Raises:** `ValueError` for an environment that does not exist or cannot be made, an unsupported space, or a
    setting that does not fit it; `NotTrusted` for one that would import what its user has not named.
    """

    name: ClassVar[str] = "gymnasium"
    episodic: ClassVar[bool] = True
    metric_units: ClassVar[Mapping[str, str]] = {"length": "steps", "success": "1", "solved": "1"}

    env_id: str = static(
        "CartPole-v1",
        help='the environment\'s id, such as `"CartPole-v1"`, or `"module:Name-v0"` for one that a module '
        'registers, or `"module:name"` for a class or a function of a module that makes one. A module'
        " is imported only where the user names it: by `from_gymnasium`, on the command line, or by "
        "trusting the file that names it",
    )
    kwargs: Mapping[str, bool | int | float | str] | None = static(
        None,
        help="arguments passed to `gymnasium.make`: numbers, strings, true or false. They may include "
        "`max_episode_steps`",
    )
    repeat: int = count(
        1, 1, help="number of environment steps per decision, during which the action is held and rewards are summed"
    )
    scaling: Scaling = static(
        "auto",
        help='scaling of observations: `"bounds"` scales them from their bounds to −1 … 1; `"running"` '
        "subtracts the running mean of this seed's observations and divides by their standard "
        'deviation, clipped to ±5; `"auto"` uses bounds within ±1e6, and running statistics '
        'elsewhere; `"none"` leaves them unchanged',
    )
    code: Code = static(
        "auto",
        help='encoding of actions: `"choice"`, `"count"`, `"bits"`, `"each"`, `"continuous"`, `"antagonists"`, or '
        '`"auto"` for the default of the action space; see `docs/foreign-environments.md`',
    )
    end_reward: float = number(
        0.0,
        help="reward added, for the learner only, at a decision at which the environment terminates (not at a "
        "time limit). If every step has the same reward, only the ends inform an average reward",
    )
    info: tuple[str, ...] = static(
        (),
        help="further keys of a step's `info` dictionary to read, each a single number or a flag. The mean "
        "over steps is recorded under the key's name. Where the environment reports several of `solved`, "
        "`success` and `is_success`, the one named here means success",
    )
    success_steps: int = count(
        1, 1, 2**24, unit="steps", help="the least number of solved steps in a successful episode"
    )

    def __post_init__(self) -> None:
        for name, value in self._kwargs.items():
            plain = isinstance(value, bool | int | float | str)
            check(plain, f"kwargs.{name}", value, "a number, a string, true or false, so that the run can be described")
        super().__post_init__()

    def validate(self) -> None:
        super().validate()
        check(len(set(self.info)) == len(self.info), "info", self.info, "different keys")
        _ = self._facts  # raises for unsupported spaces

    @property
    def _kwargs(self) -> Mapping[str, Any]:
        return {} if self.kwargs is None else self.kwargs

    def __reduce__(self) -> tuple[Any, ...]:  # the cached facts hold functions, so they are derived again
        return _again, tuple(getattr(self, field.name) for field in dataclasses.fields(self))

    @functools.cached_property
    def _facts(self) -> _Facts:
        environment = make_environment(self.env_id, self._kwargs)
        try:
            seen = observation_code(environment.observation_space, self.scaling, self.env_id)
            code = action_code(environment.action_space, self.code, self.env_id)
            step: Any = None
            with contextlib.suppress(Exception):  # a property of its own may raise anything before the first reset
                step = getattr(environment.unwrapped, "dt", None)
            limit = environment.spec.max_episode_steps if environment.spec else None
            info = self._info(environment)
            doc = type(environment.unwrapped).__doc__
            inputs = documented_names(doc, "observation", seen.size)
            # a softmax has no bias
            seen = dataclasses.replace(seen, names=inputs or seen.names, constant=code.kind == "discrete")
            code = dataclasses.replace(code, names=documented_names(doc, "action", code.size))
        finally:
            with contextlib.suppress(Exception):  # it is no longer needed
                environment.close()
        timed = isinstance(step, int | float | np.number) and 0 < step < np.inf
        period = self.repeat * float(step) if timed else 1.0
        longest = None if limit is None else math.ceil(limit / self.repeat)
        return _Facts(seen, code, period, longest, info, any(key in SUCCESS for key in info))

    def _info(self, environment: "gymnasium.Env") -> tuple[str, ...]:
        """The keys of `info` to be read, that of success first. **Raises** `ValueError` for one that is not there."""
        for key in self.info:
            free = key not in TAKEN and not key.endswith("_count")
            check(free, "info", key, f"another key: metrics have a column of that name ({', '.join(TAKEN)})")
        try:
            found = find_info(environment, self.info)
        except Exception as error:  # an environment's own code may raise anything
            if self.info:
                raise ValueError(f"info = {self.info!r}: a step of {self.env_id} fails: {error!r}") from None
            return ()  # training will say what fails
        for key in self.info:
            if key not in found.keys:
                raise unknown(f"info of {self.env_id}:", key, found.keys)
            check(key in found.numbers, f"info of {self.env_id}", key, "the key of one finite number or flag")
        reported = [key for key in (*self.info, *found.numbers) if key in SUCCESS][:1]
        return (*reported, *(key for key in self.info if key not in SUCCESS))

    @property
    def dynamics(self) -> str:
        """The environment's id; each batch makes its own environments."""
        return self.env_id

    @property
    def actions(self) -> Literal["binary", "discrete", "continuous"]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self._facts.code.kind  # type: ignore[return-value]

    @property
    def metric_names(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        facts = self._facts
        read = ("success", "solved", *facts.info[1:]) if facts.succeeds else facts.info
        return ("return", "length", *read)

    @property
    def observation_size(self) -> int:
        return self._facts.seen.size + self._facts.seen.constant

    @property
    def observation_names(self) -> tuple[str, ...]:
        """Names of the observed numbers, as the environment's documentation has them."""
        seen = self._facts.seen
        return (*seen.names, "constant") if seen.constant else seen.names

    @property
    def of_many_numbers(self) -> str:
        """What to do where a learner cannot take so many observed numbers as those of a picture; empty for few."""
        if self.observation_size <= MANY:
            return ""
        return (
            f"{self.env_id} shows {self._facts.seen.size:,} numbers, {self._facts.seen.shape}: make fewer of them "
            "with gymnasium.wrappers.GrayscaleObservation, ResizeObservation or TransformObservation, or take the "
            "preset 'ppo', which keeps no matrix of all parameters"
        )

    @property
    def action_size(self) -> int:
        return self._facts.code.size

    @property
    def action_names(self) -> tuple[str, ...]:
        """Names of the actions, as the environment's documentation has them; empty where it names none."""
        return self._facts.code.names

    @property
    def observation_code(self) -> ObservationCode:
        return self._facts.seen

    def interface(self, actions: Actions | None = None) -> Interface:
        del actions  # it takes one kind
        return Interface(self._facts.seen, self._facts.code, self.period)

    @property
    def action_range(self) -> tuple[tuple[float, float], ...]:
        return self._facts.code.bounds or super().action_range

    @property
    def period(self) -> float:
        """Simulated seconds per decision if the environment declares the duration of a step (`dt`), else 1."""
        return self._facts.period

    @property
    def longest_episode(self) -> int | None:
        return self._facts.longest

    @property
    def no_resume(self) -> str | None:
        return None if self._not_saved is None else f"{self.env_id}: {self._not_saved}"

    @functools.cached_property
    def _not_saved(self) -> str | None:
        return why_not_saved(self.env_id, self._kwargs)

    @classmethod
    def imports(cls, settings: Mapping[str, Any]) -> list[str]:
        return foreign_code(settings.get("env_id"), settings.get("kwargs"))

    def batch(self, seeds: Sequence[int], threads: int = 0, workers: int = 0) -> EnvironmentBatch | WorkerBatch:
        """One environment per seed, stepped one after the other in this process, or in worker processes (`workers`)."""
        del threads
        facts = self._facts
        settings = (facts.seen.shape, facts.code, self.repeat, self._not_saved is None, facts.info)
        kind = functools.partial(WorkerBatch, workers) if workers else EnvironmentBatch
        return kind(self.env_id, self._kwargs, seeds, *settings)

    def init(self, uniforms: Float[Array, " 0"]) -> EnvironmentMemory:
        zero = jnp.zeros(())
        solved = zero if self._facts.succeeds else None
        return EnvironmentMemory(zero, zero, *self._facts.seen.start(), jnp.zeros((), bool), solved)

    def renew(self, memory: EnvironmentMemory, uniforms: Float[Array, " 0"]) -> EnvironmentMemory:
        zero = jnp.zeros(())
        return memory._replace(returned=zero, length=zero, solved=None if memory.solved is None else zero)

    def freeze(self, memory: EnvironmentMemory) -> EnvironmentMemory:
        return memory._replace(frozen=jnp.ones((), bool))

    def observe(
        self, memory: EnvironmentMemory, state: EnvironmentState, uniforms: Float[Array, " 0"]
    ) -> tuple[EnvironmentMemory, Float[Array, " inputs"]]:
        mean, variance, seen = self._facts.seen.observe(memory.mean, memory.variance, memory.frozen, state.observation)
        return memory._replace(mean=mean, variance=variance), seen

    def sense(
        self, memory: EnvironmentMemory, state: EnvironmentState, uniforms: Float[Array, " 0"]
    ) -> tuple[EnvironmentMemory, Float[Array, " size"]]:
        return memory, state.observation

    def reward(
        self, memory: EnvironmentMemory, state: EnvironmentState, action: Array
    ) -> tuple[EnvironmentMemory, Scalar, Flag]:
        memory = memory._replace(returned=memory.returned + state.reward, length=memory.length + state.steps)
        if memory.solved is not None:
            memory = memory._replace(solved=memory.solved + state.info[0])
        reward = state.reward + self.end_reward * state.terminated if self.end_reward else state.reward
        return memory, reward, state.terminated

    @property
    def reward_names(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return ("environment", "end_reward") if self.end_reward else ()

    def reward_terms(self, memory: EnvironmentMemory, state: EnvironmentState) -> dict[str, Scalar]:
        return {"environment": state.reward, "end_reward": self.end_reward * state.terminated}

    def truncated(self, memory: EnvironmentMemory, state: EnvironmentState) -> Flag:
        return state.truncated

    def metrics(self, memory: EnvironmentMemory, state: EnvironmentState) -> dict[str, Metric]:
        """Of an episode that has just ended: `return`, the sum of its rewards, `length`, its number of steps, and
        `success`, whether it was solved on `success_steps` of them. Of a decision: `solved`, on which share of its
        steps, and the mean of each key of `info`."""
        ended = state.terminated | state.truncated
        facts = self._facts
        found = {"return": (memory.returned, ended), "length": (memory.length, ended)}
        if memory.solved is not None:
            found["success"] = (jnp.where(memory.solved >= self.success_steps, 1.0, 0.0), ended)
        names = ("solved", *facts.info[1:]) if facts.succeeds else facts.info
        for index, name in enumerate(names):
            count = state.info_count[index]
            found[name] = (state.info[index] / jnp.maximum(count, 1), count > 0)
        return found


def _again(env_id: str, kwargs: Mapping[str, Any] | None, *settings: Any) -> Gymnasium:
    """The task in another process. What was allowed where it comes from is allowed there."""
    allow([env_id, *(value for value in (kwargs or {}).values() if isinstance(value, str))])
    return Gymnasium(env_id, kwargs, *settings)


def from_gymnasium(
    env_id: str | Callable[..., Any],
    *,
    repeat: int = 1,
    scaling: Scaling = "auto",
    code: Code = "auto",
    end_reward: float = 0.0,
    info: Sequence[str] = (),
    success_steps: int = 1,
    **kwargs: bool | int | float | str,
) -> Gymnasium:
    """A Gymnasium environment as a task, for our agents to learn.

    **Arguments:** `env_id` and `kwargs`, as in `gymnasium.make`; in place of an id also the class of an environment, or
    a function that returns one, with a name at the top of a module, from which a saved run makes it again; `repeat`,
    `scaling`, `code`, `end_reward`, `info` and `success_steps`, as in `Gymnasium` (whose `kwargs` also accept an
    environment's own arguments of these names).

    **Raises:** as `Gymnasium`.

    ```python
    task = mg.tasks.from_gymnasium("CartPole-v1", end_reward=-1.0)
    own = mg.tasks.from_gymnasium(MyEnvironment, difficulty=3)  # your class, and its argument
    run = mg.train(task, steps=100_000, seeds=4)
    ```
    """
    env_id = env_id if isinstance(env_id, str) else id_of(env_id)
    allow([env_id, *(value for value in kwargs.values() if isinstance(value, str))])
    return Gymnasium(env_id, kwargs or None, repeat, scaling, code, end_reward, tuple(info), success_steps)
