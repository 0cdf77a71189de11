"""The training loop: advance, record, commit; the same for every task and engine."""

import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pyarrow as pa

from motorgrad._errors import check
from motorgrad._progress import Progress
from motorgrad._settings import table
from motorgrad._signals import stop_when_asked
from motorgrad.learning import Agent, RunningMean
from motorgrad.policies import Policy, describe
from motorgrad.tasks import HostTask, Task
from motorgrad.training._agents import agent_table
from motorgrad.training._arguments import TrainingArguments, check_training
from motorgrad.training._run import Records, Run, given_initial, memory_in, saved_agent, saved_task
from motorgrad.training._sweep import numbers_by_lane
from motorgrad.training.engines import training_stepper_for
from motorgrad.training.plots import EventFiles, check_tensorboard, start_time
from motorgrad.training.store import RunDirectory, RunDirectoryError, RunWarning, by_name, fill_tree, fingerprint

SLICE = 0.2  # seconds of work between two checks of the clock and of Ctrl-C


def train(
    task: Task | str,
    agent: Agent | Mapping[str, Any] | None = None,
    steps: int = 100_000,
    seeds: int | Sequence[int] = 1,
    out: Path | str | None = None,
    *,
    sweep: Mapping[str, Sequence[float]] | Sequence[Mapping[str, float]] | None = None,
    window: int | None = None,
    checkpoint_every: float = 30.0,
    threads: int = 0,
    progress: bool = True,
    tensorboard: bool = False,
    initial: Policy | None = None,
) -> Run:
    """Train an agent on a task, for many seeds at once.

    **Arguments:**

    - `task`: a task, or the name of one.
    - `agent`: the learner; or changes to the task's own learner, as in `agent_for`; by default that learner.
      A run whose parts are all registered can be resumed from its directory alone (`resume`).
    - `steps`: decisions per seed. If the directory holds a run with more decisions, that run is returned.
    - `seeds`: their number (0, 1, 2 …), or a list of them.
    - `out`: the run directory. If it holds the same run, unfinished, training continues from its last checkpoint, bit
      for bit; if it is finished, it is returned, or continued where `steps` are more than before.
    - `sweep`: several settings of the agent's numbers, which learn side by side in one compiled call: a mapping from
      paths to lists of numbers, which combine as a product, or a list of mappings. Seed k has the same
      random numbers under every setting. `Run.split` gives the run of each setting.
    - `window`: decisions per record of the metrics, by default a two-hundredth of the steps, or what the run in the
      directory has.
    - `checkpoint_every`: seconds of wall time between checkpoints.
    - `threads`: for bodies, the threads of physics and learning; 0 for one per processor.
    - `progress`: whether to show progress.
    - `tensorboard`: whether to write TensorBoard event files to `tensorboard/` of the run directory. They hold every
      record up to the newest checkpoint exactly once, also after a kill.
    - `initial`: the policies from which the seeds start, along a leading axis, such as the `policies` of a run; by
      default the agent's own. They must have the structure of the agent's policy.

    **Returns** a `Run`. Ctrl-C or SIGTERM saves everything and returns the unfinished run (`complete` is `False`).

    **Raises** `ValueError` for impossible settings and `RunDirectoryError` for a directory that cannot be used, both
    before any work starts.

    ```python
    run = mg.train("hopper", steps=100_000, seeds=16, out="runs/hopper")
    swept = mg.train("hopper", steps=100_000, seeds=16, sweep={"estimator.trace.decay": [0.98, 0.99, 0.995]})
    swept.plot("apex", "decay.png")
    ```
    """
    arguments = check_training(task, agent, steps, seeds, window, checkpoint_every, threads, initial, sweep)
    if tensorboard:
        check(not arguments.settings, "tensorboard", tensorboard, "False for a sweep: write it for each of run.split()")
        check(out is not None, "tensorboard", tensorboard, "False for a run in memory: give `out`")
        check_tensorboard()
    with nullcontext() if out is None else RunDirectory(out) as directory:
        return _Training(arguments, directory, window, checkpoint_every, threads, tensorboard).run(progress)


def resume(
    path: Path | str,
    steps: int | None = None,
    *,
    checkpoint_every: float = 30.0,
    threads: int = 0,
    progress: bool = True,
) -> Run:
    """Resume the run in a directory, with its own task, learner, seeds and sweep.

    **Arguments:**

    - `path`: the run directory.
    - `steps`: decisions per seed, by default those of the run.
    - the others as in `train`; they do not change any number.

    **Returns** the `Run`; a finished one is returned as it is.

    **Raises** `RunDirectoryError` where there is no run, or one whose task or agent was made in Python: pass
    these to `train` with `out=path`.
    """
    config = RunDirectory(path).read_config()
    task, run = saved_task(config), config["run"]
    agent = saved_agent(task, config["agent"], f"{path}: agent")
    total = run["steps"] if steps is None else steps
    return train(
        task,
        agent,
        total,
        run["seeds"],
        path,
        checkpoint_every=checkpoint_every,
        threads=threads,
        progress=progress,
        initial=given_initial(path),
        sweep=config.get("sweep"),
    )


class _Training:
    """One call of `train`."""

    def __init__(
        self,
        arguments: TrainingArguments,
        directory: RunDirectory | None,
        window: int | None,
        checkpoint_every: float,
        threads: int,
        tensorboard: bool,
    ):
        task, agent, steps, seeds, initial, settings = arguments
        self.task, self.directory, self.checkpoint_every = task, directory, checkpoint_every
        lanes = seeds * max(1, len(settings))
        numbers = numbers_by_lane(settings, len(seeds))
        mark = None if initial is None else fingerprint(initial)
        if initial is not None and settings:
            initial = jax.tree.map(lambda leaf: np.concatenate([leaf] * len(settings)), initial)
        self.stepper = training_stepper_for(task, agent, lanes, threads, initial, numbers)
        self.config: dict[str, Any] = {
            "run": {"steps": steps, "seeds": seeds, "window": int(window or max(1, steps // 200))},
            "task": {"name": task.name, **table(task)},
            "agent": agent_table(agent),
        }
        if settings:
            self.config["sweep"] = settings
        if mark is not None:
            self.config["run"]["initial"] = mark
        start = self.stepper.state["cycle"].agent
        begins = {"structure": describe(self.stepper.policy), "initial": fingerprint((start.policy, start.chain))}
        self.learner = {**self.config["agent"], **begins}
        self.records = Records(self.stepper.seeds, task.period, len(settings))
        self.initial = self.stepper.policies()
        self.wall, self.recorded = 0.0, 0
        self.events: EventFiles | None = None
        if directory is not None:
            self._open(directory, window)
            if tensorboard or (directory.path / "tensorboard").is_dir():
                check_tensorboard()
                self.events = EventFiles(directory.path / "tensorboard", seeds, start_time(directory.path))
                self.events.add(directory.metrics())

    def _open(self, directory: RunDirectory, window: int | None) -> None:
        """Resume the run in the directory, or start one."""
        learner, found = None, directory.latest() if directory.is_run else None
        if directory.is_run:
            before = directory.read_config()
            if window is None:
                self.config["run"]["window"] = before["run"]["window"]
            learner = directory.learner()
            now = self.config if learner is None else {**self.config, "agent": self.learner}
            _check_same_configuration(before if learner is None else {**before, "agent": learner}, now, directory.path)
            if found is not None:
                _check_steps(directory.path, self.config["run"]["steps"], before["run"]["steps"], found[1]["decision"])
        self._check_resumable(directory.path, found is not None and found[1]["decision"])
        directory.write_config(self.config)
        if learner is None or not directory.has_initial_policies:
            directory.save_initial(self.initial, self.learner)
        if found is None:
            directory.roll_back(0)
        else:
            arrays, about = found
            directory.roll_back(about["decision"], about["recorded"])
            self.stepper.restore(fill_tree(self.stepper.state, arrays))
            self.recorded, self.wall = about["recorded"], about["wall"]
            if about["decision"] > self.config["run"]["steps"]:
                self.config["run"]["steps"] = about["decision"]
                directory.write_config(self.config)
        continues = found is not None and found[1]["decision"] < self.config["run"]["steps"]
        directory.add_session(self.config["run"]["seeds"], continues)

    def _check_resumable(self, path: Path, made: int | bool) -> None:
        """Warn where the dynamics cannot be saved; refuse to resume such a run."""
        why = self.task.no_resume if isinstance(self.task, HostTask) else None
        if why is None:
            return
        if made is False:
            warnings.warn(f"{path}: this run cannot be resumed if it is stopped: {why}", RunWarning, stacklevel=2)
        elif made < self.config["run"]["steps"]:
            raise RunDirectoryError(
                f"{path} holds a run stopped after {made:,} decisions, which cannot be resumed: {why}; "
                "choose another directory, or delete this one"
            )

    def run(self, progress: bool) -> Run:
        steps, window = self.config["run"]["steps"], self.config["run"]["window"]
        stepper, saved, count = self.stepper, time.monotonic(), 1
        with (
            stop_when_asked() as stopped,
            _TrainingProgress(self.task, len(stepper.seeds), steps, stepper.decision, progress) as report,
        ):
            while stepper.decision < steps and not stopped():
                due = min((stepper.decision // window + 1) * window, steps)
                made, start = min(count, due - stepper.decision), time.perf_counter()
                stepper.advance(made)
                took = max(time.perf_counter() - start, 1e-6)
                self.wall += took
                # slices grow up to the time wanted; the time of the first includes compiling
                count = max(1, min(2 * count, round(made * SLICE / took)))
                latest = {} if stepper.decision % window else self._record()
                report.report(stepper.decision, made / took, latest)
                if self.directory and time.monotonic() - saved >= self.checkpoint_every and stepper.decision < steps:
                    self._commit()
                    saved = time.monotonic()
            self._commit()
        metrics = self.directory.metrics() if self.directory else self.records.take()
        path = self.directory and self.directory.path
        state = stepper.state
        learner = state["cycle"].agent
        estimate = learner.gradient.mean if isinstance(learner.gradient, RunningMean) else None
        return Run(
            self.config,
            stepper.decision,
            pa.table({}) if metrics is None else metrics,
            self.stepper.policies(),
            self.initial,
            estimate,
            path,
            self.task,
            memory_in(by_name(state)),
        )

    def _record(self) -> dict[str, float]:
        """Add a record. Returns the means over the seeds of the reward and of the task's first reading."""
        record = self.stepper.harvest()
        latest = {"reward": self.records.add(record, self.stepper.decision, self.recorded, self.wall)}
        for name in self.task.reports[:1]:
            seen = record[name][np.isfinite(record[name])]
            latest |= {name: float(seen.mean())} if len(seen) else {}
        self.recorded = self.stepper.decision
        return latest

    def _commit(self) -> None:
        """Save everything, where there is a directory.

        At the end, the unfinished window has a record, too. It is not part of the state, so more steps complete it.
        """
        about = {"decision": self.stepper.decision, "recorded": self.recorded, "wall": self.wall}
        short = self.recorded < self.stepper.decision == self.config["run"]["steps"]
        if self.directory is None:
            if short:
                self._record()
            return
        state, records = self.stepper.state, [self.records.take()]
        if short:
            self._record()
            records.append(self.records.take())
        self.directory.save({**state, "kept": self.stepper.policies()}, about, records)
        if self.events is not None:
            for part in records:
                self.events.add(part)


def _check_steps(path: Path, steps: int, before: int, made: int) -> None:
    """Refuse fewer steps than an unfinished run has. (A finished run is returned.)"""
    if steps < before and made < before:
        raise RunDirectoryError(
            f"{path} holds a run of {before:,} decisions, of which {made:,} are made, but steps = {steps:,}: "
            f"give {before:,} or more, or choose another directory"
        )


def _check_same_configuration(before: dict[str, Any], now: dict[str, Any], path: Path) -> None:
    """Refuse to resume a run of another configuration, naming the first difference."""

    def differ(old: Any, new: Any, where: str) -> Iterator[str]:
        if isinstance(old, dict) and isinstance(new, dict):
            for key in [*new, *(k for k in old if k not in new)]:
                yield from differ(old.get(key), new.get(key), f"{where}.{key}" if where else key)
        elif old != new and where != "run.steps":
            yield f"{where} was {old!r} and is now {new!r}"

    # name a number rather than the fingerprint of the initial learner, which changes with it
    differences = sorted(differ(before, now, ""), key=lambda difference: difference.startswith("agent.initial"))
    if differences:
        raise RunDirectoryError(
            f"{path} holds a run of another configuration: {differences[0]}; "
            "choose another directory, or the same settings"
        )


class _TrainingProgress(Progress):
    """Progress of a training: decisions per second, simulated time, the latest means, the time left."""

    def __init__(self, task: Task, seeds: int, steps: int, start: int, shown: bool):
        super().__init__(task.name, "decisions", steps, start, shown)
        self.task, self.seeds = task, seeds
        self._latest: dict[str, float] = {}

    def report(self, decision: int, rate: float, latest: Mapping[str, float]) -> None:
        """Show progress at a `decision`, the `rate` in decisions per second and seed, and new means of the metrics."""
        self._latest |= latest
        facts = [f"{name} {value:.4g}" for name, value in reversed(self._latest.items())]
        facts += [f"{rate * self.seeds:,.0f} decisions/s"]
        facts += [f"{decision * self.task.period:,.0f} s simulated"] if self.task.period != 1 else []
        left = (self.total - decision) / rate if rate else 0
        facts_text = " · ".join([*facts, f"{self.seeds} seed{'s' * (self.seeds > 1)}"])
        self.update(decision, facts_text, without_bar=f"{left:.0f} s left")
