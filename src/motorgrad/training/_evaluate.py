"""Evaluation: a frozen policy from a fresh start."""

import dataclasses
import warnings
from pathlib import Path
from typing import Any, Literal, overload

import jax
import numpy as np
import pyarrow as pa

from motorgrad._arguments import check_arguments
from motorgrad._errors import check_integer, choice, counted
from motorgrad.learning import Agent
from motorgrad.policies import Policy
from motorgrad.tasks import Task
from motorgrad.training._broken import lanes_in_words, not_finite
from motorgrad.training._episodes import EpisodeEvaluation, decision_seeds, evaluate_episodes
from motorgrad.training._load import load
from motorgrad.training._metrics import Records
from motorgrad.training._run import Run
from motorgrad.training.engines import MAX_TALLY_DECISIONS, BodyStepper, Mode, stepper_for, without_broken
from motorgrad.training.store import RunWarning

STEPS = 2000
"""Decisions of an evaluation, by default."""


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Evaluation:
    """The behaviour of the policies of a run without learning.

    - `records`: a table as a run's `metrics`, one row per window and seed.
    - `reward`: mean reward per decision of each seed, `(seeds,)`.
    - `metrics`: mean of each of the task's metrics, per seed; NaN where it never occurred.
    - `motion_metrics`: metrics of the whole motion, a number or a word per seed, such as the class of a gait; empty
      without a body.
    - `time`, `position`, `sensors`, `control`: for bodies, the recorded motion of the seeds at every decision, seeds
      leading: `(decisions,)`, `(seeds, decisions, nq)`, by name `(seeds, decisions, …)`, `(seeds, decisions, groups)`.
    - `activation`: the state of activation dynamics in that motion, `(seeds, decisions, na)`; `None` without any.
    - `marks`: the places that the task marks, such as targets, `(seeds, decisions, marks, 4)`; `None` without any.
    """

    records: pa.Table
    reward: np.ndarray
    metrics: dict[str, np.ndarray]
    time: np.ndarray
    position: np.ndarray | None = None
    sensors: dict[str, np.ndarray] | None = None
    control: np.ndarray | None = None
    motion_metrics: dict[str, np.ndarray] = dataclasses.field(default_factory=dict)
    activation: np.ndarray | None = None
    marks: np.ndarray | None = None

    def __repr__(self) -> str:
        medians = []
        for name, values in {"reward": self.reward, **self.metrics}.items():
            known = np.asarray(values, float)[np.isfinite(values)]
            of = "" if len(known) == len(self.reward) else f" (of {len(known)})"
            medians.append(f"median {name} {np.median(known):.4g}{of}" if len(known) else f"median {name} unknown")
        size = f"{counted(len(self.reward), 'seed')}, {counted(len(self.time), 'decision')}"
        return f"Evaluation({size}, {', '.join(medians)})"


@overload
def evaluate(
    run: Run | Path | str,
    steps: int | None = None,
    *,
    episodes: None = None,
    seed: int = 0,
    mode: Literal["sample", "mode"] = "sample",
    untrained: bool = False,
    threads: int = 0,
    trust: bool = False,
    allow_changed: bool = False,
) -> Evaluation: ...


@overload
def evaluate(
    run: Run | Path | str,
    steps: int | None = None,
    *,
    episodes: int,
    seed: int = 0,
    mode: Literal["sample", "mode"] = "sample",
    untrained: bool = False,
    threads: int = 0,
    trust: bool = False,
    allow_changed: bool = False,
) -> EpisodeEvaluation: ...


def evaluate(
    run: Run | Path | str,
    steps: int | None = None,
    *,
    episodes: int | None = None,
    seed: int = 0,
    mode: Literal["sample", "mode"] = "sample",
    untrained: bool = False,
    threads: int = 0,
    trust: bool = False,
    allow_changed: bool = False,
) -> Evaluation | EpisodeEvaluation:
    """Evaluate the policies of all seeds of a run from a fresh start, without learning.

    For a policy that is not finite, every result is NaN, with a warning.

    **Arguments:**

    - `run`: a run, or the directory of one.
    - `steps`: decisions per seed, by default 2,000; with `episodes`, decisions after which an episode is cut, by
      default 100,000 where the task has no limit.
    - `episodes`: whole episodes of every policy, each in dynamics of its own, in place of a number of decisions.
    - `seed`: of the random numbers of the evaluation, at least 0. They differ from those of learning.
    - `mode`: `"sample"` draws every action; `"mode"` takes the most probable one.
    - `untrained`: evaluate the policies as they were before learning.
    - `threads`: as in `train`.
    - `trust`, `allow_changed`: as in `load`, for a directory.

    **Returns** an `Evaluation`; with `episodes` an `EpisodeEvaluation`, which has the return and the length of every
    episode.

    ```python
    run = mg.train("t-maze", steps=2_000, seeds=4, progress=False)
    found = mg.evaluate(run, episodes=50)
    print(found.over_seeds("return"))  # the mean over four seeds, with its interval
    ```
    """
    check_arguments(evaluate, locals(), ("run", "untrained", "trust", "allow_changed"))
    run = run if isinstance(run, Run) else load(run, trust=trust, allow_changed=allow_changed)
    if steps is not None or episodes is None:
        steps = STEPS if steps is None else steps
        check_integer("steps", steps, 1, MAX_TALLY_DECISIONS, "decisions")
    choice("mode", mode, ("sample", "mode"))
    check_integer("seed", seed, 0, 2**31 - 1)
    policies = run.initial if untrained else run.policies
    if episodes is None:
        assert steps is not None
        return _by_decisions(run, policies, steps, seed, mode, threads)
    more: Any = {"seed": seed, "mode": mode, "threads": threads, "longest": steps, "settings": run.settings}
    return evaluate_episodes(run.task, policies, run.memory, run.seeds, episodes, **more)


def _by_decisions(run: Run, policies: Policy, steps: int, seed: int, mode: Mode, threads: int) -> Evaluation:
    """The evaluation of the policies of a run for a number of decisions."""
    agent = Agent(jax.tree.map(lambda leaf: leaf[0], policies))
    lanes = run.seeds * max(1, len(run.settings))
    stepper = stepper_for(run.task, agent, decision_seeds(lanes, seed), mode, threads)
    stepper.set_policies(policies, run.memory)
    motion = _Motion(stepper, run.task) if isinstance(stepper, BodyStepper) else None
    if motion is None:
        stepper.advance(steps)
    else:
        motion.record(steps)
    record = without_broken(stepper.harvest())
    broken = not_finite(policies)
    if broken.any():
        said = lanes_in_words(broken, run.seeds, run.settings)
        message = f"{said}: parameters that are not finite; nothing is said of them (NaN)"
        warnings.warn(message, RunWarning, stacklevel=3)
    records = Records(np.asarray(lanes, np.int32), run.task.period, len(run.settings), run.task.metric_units)
    records.add(record, steps, 0, 0.0)
    table = records.take()
    assert table is not None
    skipped = {"reward", "baseline", "parameters", "episodes", "diverged"}
    metrics = {name: record[name] for name in record if name not in skipped and not name.endswith("_count")}
    time = run.task.period * np.arange(1, steps + 1)
    moved = {} if motion is None else motion.found(broken)
    return Evaluation(table, table["reward"].to_numpy(), metrics, time, **moved)


class _Motion:
    """The motion of bodies at every decision."""

    def __init__(self, stepper: BodyStepper, task: Task):
        self.stepper, self.task = stepper, task
        self.packed: list[np.ndarray] = []
        self.control: list[np.ndarray] = []
        self.marks: list[np.ndarray] = []

    def record(self, steps: int) -> None:
        """Make decisions."""
        stepper, task = self.stepper, self.task
        marked_now = stepper.viewer(lambda cycle, state: task.marks(cycle.memory, state))
        marked = type(task).marks is not Task.marks
        for _ in range(steps):
            self.control.append(np.array(stepper.control))
            before = marked_now() if marked else None
            stepper.advance(1)
            self.packed.append(stepper.batch.packed.copy() if stepper.ended is None else stepper.ended)
            if before is not None:  # where an episode has ended, the task already has the targets of the next one
                renewed = (self.packed[-1] != stepper.batch.packed).any(axis=1)
                self.marks.append(np.where(renewed[:, None, None], before, marked_now()))

    def found(self, broken: np.ndarray) -> dict[str, Any]:
        """What was recorded, by the names of `Evaluation`; nothing is said of `broken` lanes."""
        state = self.stepper.batch.unpack(np.stack(self.packed, axis=1))
        metrics = self.task.motion_metrics(state)
        if broken.any():
            unknown = {name: "unknown" if each.dtype.kind == "U" else np.nan for name, each in metrics.items()}
            metrics = {name: np.where(broken, unknown[name], each) for name, each in metrics.items()}
        return {
            "position": state.position,
            "sensors": state.sensors,
            "control": np.stack(self.control, axis=1),
            "motion_metrics": metrics,
            "activation": state.activation,
            "marks": np.stack(self.marks, axis=1) if self.marks else None,
        }
