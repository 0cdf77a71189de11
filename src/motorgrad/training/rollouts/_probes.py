"""What is read from dynamics on the host at every decision, beside what the task sees: bodies and environments."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from motorgrad.bodies import BodyReader, Column, joint_columns
from motorgrad.tasks import Gymnasium, Task
from motorgrad.tasks.gymnasium._outcomes import one_number
from motorgrad.training.engines import BodyStepper, HostStepper, Stepper

if TYPE_CHECKING:
    import gymnasium


class Read(NamedTuple):
    """What a probe has read of a decision: `before` (seeds, readings, columns), of which the first is at its start;
    `end` (seeds, columns), at its end, where it was asked for."""

    before: np.ndarray
    end: np.ndarray | None


class Probe(Protocol):
    """Reads dynamics on the host."""

    @property
    def columns(self) -> Sequence[Column]:
        """Those of a reading."""
        ...

    def read(self, wanted: bool) -> Read:
        """Called at the end of a decision, before any new episode; `wanted`, whether its end is."""
        ...

    def end(self) -> np.ndarray:
        """The end of the last decision, (seeds, columns)."""
        ...

    def info(self) -> dict[str, np.ndarray]:
        """What the last decision led to, beside the task's outcome, by name, `(seeds,)`."""
        ...


class BodyProbe:
    """Reads bodies, every so many physics steps."""

    def __init__(self, stepper: BodyStepper, every: int | None, threads: int):
        self._reader = BodyReader(stepper.batch, threads, every)
        stepper.batch.watcher = self._reader
        self.columns = self._reader.columns

    def read(self, wanted: bool) -> Read:
        return Read(np.stack(self._reader.readings, axis=1), self._reader.end() if wanted else None)

    def end(self) -> np.ndarray:
        return self._reader.end()

    def info(self) -> dict[str, np.ndarray]:
        return {}


class EnvironmentProbe:
    """Reads Gymnasium environments: the action that each receives, MuJoCo's positions and velocities where it has
    them, and the numbers in its `info`."""

    def __init__(self, stepper: HostStepper, task: Gymnasium):
        batch: Any = stepper.batch
        self._taps = [_Tap(environment) for environment in batch.environments]
        batch.environments[:] = self._taps
        code = task.interface().actions
        size = code.outputs
        names = code.names if len(code.names) == size else [str(k + 1) for k in range(size)]
        controls = [Column(f"control: {name}") for name in names] if size > 1 else [Column("control")]
        self._controls = size
        self.columns = [*controls, *self._taps[0].columns]

    def read(self, wanted: bool) -> Read:
        rows = []
        for tap in self._taps:
            rows.append(np.concatenate([np.ravel(np.asarray(tap.action, float)), tap.before]))
            tap.fresh = True
        return Read(np.stack(rows)[:, None], self.end() if wanted else None)

    def end(self) -> np.ndarray:
        nothing = np.full(self._controls, np.nan)
        return np.stack([np.concatenate([nothing, tap.physics()]) for tap in self._taps])

    def info(self) -> dict[str, np.ndarray]:
        names = dict.fromkeys(name for tap in self._taps for name in tap.info_numbers)
        return {name: np.array([tap.info_numbers.get(name, np.nan) for tap in self._taps]) for name in names}


class _Tap:
    """An environment that remembers the first action of a decision, where it was before, and the last `info`."""

    def __init__(self, environment: "gymnasium.Env[Any, Any]"):
        self.env = environment
        self.fresh = True
        self.action: Any = 0.0
        self.info_numbers: dict[str, float] = {}
        physics = _mujoco(environment)
        self.columns = [] if physics is None else joint_columns(physics[0])
        self.before = self.physics()

    def step(self, action: object) -> Any:
        if self.fresh:
            self.fresh = False
            self.action = action
            self.before = self.physics()
        found = self.env.step(action)
        said = {str(key): one_number(value) for key, value in found[4].items()}
        self.info_numbers = {key: number for key, number in said.items() if number is not None}
        return found

    def __getattr__(self, name: str) -> Any:
        return getattr(self.env, name)

    def physics(self) -> np.ndarray:
        """MuJoCo's positions and velocities now; none where there is no MuJoCo."""
        if not self.columns:
            return np.zeros(0)
        found = _mujoco(self.env)
        assert found is not None
        return np.concatenate([np.ravel(found[1].qpos), np.ravel(found[1].qvel)])


def _mujoco(environment: "gymnasium.Env[Any, Any]") -> tuple[Any, Any] | None:
    """MuJoCo's model and data in an environment, where it is one of Gymnasium's, MyoSuite's or alike."""
    bare: Any = environment.unwrapped
    for holder in (bare, getattr(bare, "sim", None)):
        model = getattr(holder, "model", None)
        data = getattr(holder, "data", None)
        model = getattr(model, "ptr", model)
        if hasattr(model, "jnt_type") and hasattr(data, "qpos") and hasattr(data, "qvel"):
            return model, data
    return None


def probe_of(stepper: Stepper, task: Task, every: int | None, threads: int) -> Probe | None:
    """What reads the dynamics of an engine; `None` for worlds, whose state is known."""
    if isinstance(stepper, BodyStepper):
        return BodyProbe(stepper, every, threads)
    if isinstance(stepper, HostStepper) and isinstance(task, Gymnasium):
        return EnvironmentProbe(stepper, task)
    return None
