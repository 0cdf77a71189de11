"""The loop over decisions: advance, record, commit; the same for every task and engine."""

import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np
import pyarrow as pa

from motorgrad._errors import check
from motorgrad._settings import table
from motorgrad.learning import Agent, RunningMean
from motorgrad.tasks import BodyTask, Task, make
from motorgrad.training._body_stepper import BodyStepper
from motorgrad.training._checkpoint import fingerprint, into
from motorgrad.training._cycle import Mode
from motorgrad.training._directory import RunDirectory, RunDirectoryError
from motorgrad.training._progress import Report
from motorgrad.training._records import Records
from motorgrad.training._run import Run
from motorgrad.training._settings import describe_agent, settings_for
from motorgrad.training._stepper import Stepper
from motorgrad.training._world_stepper import WorldStepper

SLICE = 0.2  # seconds of work between two looks at the clock and at Ctrl-C


def stepper_of(task: Task, agent: Agent, seeds: Sequence[int], mode: Mode = "learn", threads: int = 0) -> Stepper:
    """The engine for a task: compiled loops for worlds, `mujoco.batch` for bodies."""
    if isinstance(task, BodyTask):
        return BodyStepper(task, agent, seeds, mode, threads)
    return WorldStepper(task, agent, seeds, mode)


def train(
    task: Task | str,
    agent: Agent | None = None,
    steps: int = 100_000,
    seeds: int | Sequence[int] = 1,
    out: Path | str | None = None,
    *,
    window: int | None = None,
    checkpoint_every: float = 30.0,
    threads: int = 0,
    progress: bool = True,
) -> Run:
    """Let an agent learn a task, for many seeds at once.

    **Arguments:**

    - `task`: a task, or the name of one.
    - `agent`: what learns; by default the learner that goes with the task.
    - `steps`: decisions per seed; where the directory holds a run that has made more, that run is given back.
    - `seeds`: how many (0, 1, 2 …), or which.
    - `out`: the run directory. If it holds the same run, unfinished, training goes on where its last checkpoint was,
      bit for bit; if it is finished, it is given back; with more `steps` than before, it is continued.
    - `window`: decisions per record of the metrics, by default a two-hundredth of the steps, or what the run under way
      has.
    - `checkpoint_every`: seconds of wall time between checkpoints.
    - `threads`: that step the physics of bodies; 0 for one per processor.
    - `progress`: whether to show how far it is.

    **Returns** a `Run`. Ctrl-C saves everything and gives back the unfinished run (`complete` is `False`).

    **Raises** `ValueError` for impossible settings and `RunDirectoryError` for a directory that cannot be used, both
    before any work starts.
    """
    task = make(task) if isinstance(task, str) else task
    check(isinstance(task, Task), "task", task, "a task, or the name of one")
    check(agent is None or isinstance(agent, Agent), "agent", agent, "an Agent, or None for the task's own")
    agent = settings_for(task).agent(task) if agent is None else agent
    check(_whole(seeds) or isinstance(seeds, Iterable), "seeds", seeds, "how many, or a list of them")
    chosen = list(range(seeds) if isinstance(seeds, int | np.integer) else seeds)
    check(_whole(steps) and 1 <= steps <= 2**32 - 256, "steps", steps, "an integer from 1 to 4,294,967,040")
    check(len(chosen) > 0, "seeds", chosen, "at least one seed")
    valid = all(_whole(seed) and 0 <= seed < 2**31 for seed in chosen)
    check(valid, "seeds", chosen, "integers from 0 to 2147483647")
    check(len(set(chosen)) == len(chosen), "seeds", seeds, "all different")
    check(window is None or (_whole(window) and window >= 1), "window", window, "a whole number of at least 1 decision")
    check(checkpoint_every >= 0, "checkpoint_every", checkpoint_every, "at least 0 seconds")
    check(_whole(threads) and threads >= 0, "threads", threads, "0 for all processors, or their number")
    chosen = [int(seed) for seed in chosen]
    with nullcontext() if out is None else RunDirectory(out) as directory:
        return _Training(task, agent, int(steps), chosen, directory, window, checkpoint_every, threads).run(progress)


def _whole(value: Any) -> TypeGuard[int]:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


class _Training:
    """One call of `train`."""

    def __init__(
        self,
        task: Task,
        agent: Agent,
        steps: int,
        seeds: list[int],
        directory: RunDirectory | None,
        window: int | None,
        checkpoint_every: float,
        threads: int,
    ):
        self.task, self.directory, self.checkpoint_every = task, directory, checkpoint_every
        self.stepper = stepper_of(task, agent, seeds, threads=threads)
        self.config: dict[str, Any] = {
            "run": {"steps": steps, "seeds": seeds, "window": int(window or max(1, steps // 200))},
            "task": {"name": task.name, **table(task)},
            "agent": describe_agent(agent, self.stepper.policy),
        }
        learner = self.stepper.state["cycle"].agent
        self.config["agent"]["initial"] = fingerprint((learner.policy, learner.ascent))
        self.records = Records(self.stepper.seeds, task.period)
        self.initial = self.stepper.policies()
        self.wall, self.recorded = 0.0, 0
        if directory is not None:
            self._open(directory, window)

    def _open(self, directory: RunDirectory, window: int | None) -> None:
        """Take up the run that the directory holds, or begin one."""
        if directory.started:
            before = directory.read_config()
            if window is None:
                self.config["run"]["window"] = before["run"]["window"]
            _same(before, self.config, directory.path)
        directory.write_config(self.config)
        if (found := directory.latest()) is None:
            directory.roll_back(0)
            directory.save_initial(self.initial)
        else:
            arrays, about = found
            directory.roll_back(about["decision"])
            self.stepper.restore(into(self.stepper.state, arrays))
            self.recorded, self.wall = about["recorded"], about["wall"]
            if about["decision"] > self.config["run"]["steps"]:
                self.config["run"]["steps"] = about["decision"]
                directory.write_config(self.config)
        directory.note_session(self.config["run"]["seeds"])

    def run(self, progress: bool) -> Run:
        steps, window = self.config["run"]["steps"], self.config["run"]["window"]
        stepper, saved, count = self.stepper, time.monotonic(), 1
        with (
            _stop_on_interrupt() as stopped,
            Report(self.task, len(stepper.seeds), steps, stepper.decision, progress) as report,
        ):
            while stepper.decision < steps and not stopped():
                due = min((stepper.decision // window + 1) * window, steps)
                made, start = min(count, due - stepper.decision), time.perf_counter()
                stepper.advance(made)
                took = max(time.perf_counter() - start, 1e-6)
                self.wall += took
                # The slice grows to the time wanted; the first, which compiles, says nothing about speed.
                count = max(1, min(2 * count, round(made * SLICE / took)))
                reward = self._record() if stepper.decision == due else None
                report.update(stepper.decision, made / took, reward)
                if self.directory and time.monotonic() - saved >= self.checkpoint_every and stepper.decision < steps:
                    self._commit()
                    saved = time.monotonic()
            self._commit()
        metrics = self.directory.metrics() if self.directory else self.records.take()
        path = self.directory and self.directory.path
        learner = stepper.state["cycle"].agent
        estimate = learner.gradient.mean if isinstance(learner.gradient, RunningMean) else None
        return Run(
            self.config,
            stepper.decision,
            pa.table({}) if metrics is None else metrics,
            learner.policy,
            self.initial,
            estimate,
            path,
            self.task,
        )

    def _record(self) -> float:
        mean = self.records.add(self.stepper.harvest(), self.stepper.decision, self.recorded, self.wall)
        self.recorded = self.stepper.decision
        return mean

    def _commit(self) -> None:
        """Save everything, where there is a directory."""
        if self.directory is not None:
            about = {"decision": self.stepper.decision, "recorded": self.recorded, "wall": self.wall}
            self.directory.save(self.stepper.state, about, self.records.take())


def _same(before: dict[str, Any], now: dict[str, Any], path: Path) -> None:
    """Refuse to go on with a run of another configuration, naming the first difference."""

    def differ(old: Any, new: Any, where: str) -> Iterator[str]:
        if isinstance(old, dict) and isinstance(new, dict):
            for key in [*new, *(k for k in old if k not in new)]:
                yield from differ(old.get(key), new.get(key), f"{where}.{key}" if where else key)
        elif old != new and where != "run.steps":
            yield f"{where} was {old!r} and is now {new!r}"

    # A number says more than the fingerprint of the initial learner, which changes with it.
    differences = sorted(differ(before, now, ""), key=lambda difference: difference.startswith("agent.initial"))
    if differences:
        raise RunDirectoryError(
            f"{path} holds a run of another configuration: {differences[0]}; "
            "choose another directory, or the same settings"
        )


@contextmanager
def _stop_on_interrupt() -> Iterator[Callable[[], bool]]:
    """Turn the first Ctrl-C into a request to stop at the next safe point; a second one interrupts at once."""
    asked = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield asked.is_set
        return

    def ask(number: int, frame: Any) -> None:
        if asked.is_set():
            signal.default_int_handler(number, frame)
        asked.set()

    previous = signal.signal(signal.SIGINT, ask)
    try:
        yield asked.is_set
    finally:
        signal.signal(signal.SIGINT, previous)
