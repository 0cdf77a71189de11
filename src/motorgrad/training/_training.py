"""One call of `train`: advance, record, commit; the same for every task and engine."""

import dataclasses
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pyarrow as pa
from jaxtyping import Bool, PyTree

from motorgrad._errors import check, counted, shown
from motorgrad._interface import Interface, Statistics
from motorgrad._signals import interrupt, stop_when_asked
from motorgrad.learning import RunningMean
from motorgrad.policies import Policy, describe, with_interface
from motorgrad.schema import numbers_of, table
from motorgrad.tasks import HostTask, Task
from motorgrad.training._agents import agent_table
from motorgrad.training._arguments import TrainingArguments
from motorgrad.training._broken import lanes_in_words, not_all_finite, not_finite
from motorgrad.training._callbacks import Callback, Report
from motorgrad.training._evaluating import STATE, EvaluationCallback, evaluating_of
from motorgrad.training._load import critic_of
from motorgrad.training._metrics import Records, mean_of_samples
from motorgrad.training._progress import TrainingProgress
from motorgrad.training._run import Run
from motorgrad.training._saving import NotSaved, Saving
from motorgrad.training._sweep import numbers_by_lane
from motorgrad.training.engines import training_stepper_for
from motorgrad.training.plots import EventFiles, check_tensorboard, start_time
from motorgrad.training.store import (
    CorruptCheckpoint,
    RunDirectory,
    RunDirectoryError,
    RunWarning,
    differences,
    fill_tree,
    fingerprint,
    release_changes,
    versions,
)

EVALUATION = ("run.evaluate_", "run.keep_")
"""How the names of settings of evaluations begin, in a configuration."""
SLICE = 0.2  # seconds of work between two checks of the clock and of Ctrl-C


class Training:
    """One call of `train`."""

    def __init__(
        self, arguments: TrainingArguments, saving: Saving | None, threads: int, callbacks: tuple[Callback, ...]
    ):
        task, agent, steps, seeds, initial, settings, window, envs, workers, _ = arguments
        self.task, self.saving, self.callbacks = task, saving, callbacks
        self.ended = False  # by a callback
        evaluating = [callback for callback in callbacks if isinstance(callback, EvaluationCallback)]
        check(len(evaluating) < 2, "callbacks", evaluating, "one EvaluationCallback at most, and KeepBest is one")
        self.evaluating = evaluating[0] if evaluating else None
        self._remembered: Callable[[], Any] | None = None
        lanes = seeds * max(1, len(settings))
        numbers = numbers_by_lane(settings, len(seeds))
        mark = None if initial is None else fingerprint(initial)
        if initial is not None and settings:
            initial = jax.tree.map(lambda leaf: np.concatenate([leaf] * len(settings)), initial)
        self.stepper = training_stepper_for(task, agent, lanes, threads, initial, numbers, envs, workers)
        self.envs = envs
        self.config: dict[str, Any] = {
            "run": {"steps": steps, "seeds": seeds, "window": window},
            "task": {"name": task.name, **table(task)},
            "agent": agent_table(agent),
        }
        if settings:
            self.config["sweep"] = settings
        if envs > 1:
            self.config["run"]["envs"] = envs
        if mark is not None:
            self.config["run"]["initial"] = mark
        if self.evaluating is not None:
            self.evaluating.begin(task, steps)
            self.config["run"] |= self.evaluating.settings
        start = self.stepper.state["cycle"].agent
        initial_state = start.policy, getattr(start, "chain", ())
        self.begins = {"structure": describe(self.stepper.policy), "initial": fingerprint(initial_state)}
        self.records = Records(self.stepper.seeds, task.period, len(settings), task.metric_units)
        self.interface = interface_of(task, self.stepper.policy)
        self.initial = self._with_interface(self.stepper.policies(), self.stepper.start_statistics)
        self.wall = 0.0
        self.cpu = 0.0
        self.recorded = 0
        self.lost = np.zeros(len(lanes), bool)
        self.continues = self.finished = False
        self._ending: tuple[Any, ...] | None = None

    def _with_interface(self, policies: Policy, statistics: Statistics | None) -> Policy:
        """Policies, seeds leading, with what their observations and actions mean."""
        if self.interface is None:
            return policies
        fresh = self.interface.fresh(len(self.stepper.seeds))
        return with_interface(policies, fresh if statistics is None else fresh.with_statistics(statistics))

    def _present(self, memory: PyTree) -> Policy:
        """The present policies, with the statistics in the memory of the task, seeds leading."""
        statistics = None if self.interface is None else self.task.statistics(memory)
        return self._with_interface(self.stepper.policies(), statistics)

    def open(self, directory: RunDirectory, window: int | None, allow_changed: bool) -> None:
        """Resume the run in the directory, or start one."""
        path = directory.path
        steps = self.config["run"]["steps"]
        found = directory.to_continue() if directory.is_run else None
        about = None if found is None else found[1]
        before: dict[str, Any] = {}
        if directory.is_run:
            before = directory.config(about, allow_changed)
            if window is None:
                self.config["run"]["window"] = before["run"]["window"]
            self._evaluate_as(before["run"])
            self._compare(directory, before, about, allow_changed)
            if about is not None:
                _check_steps(path, steps, before["run"]["steps"], about["decision"])
        self._check_resumable(path, about is not None and about["decision"])
        if found is not None and about is not None:
            self.continues = about["decision"] < steps
            self.finished = not self.continues and not allow_changed and directory.has_its_end(about)
            self._restore(path, before, found[0])
            if self.evaluating is not None:
                self.evaluating.restore(found[0])
            self._look_for_broken(not_finite(self.stepper.policies()))
            self.recorded = about["recorded"]
            self.wall = about["wall"]
            self.cpu = about.get("cpu", 0.0)
            self.config["run"]["steps"] = max(steps, about["decision"])
        directory.write_config(self.config)
        directory.roll_back(about, self.finished)
        self._restore_initial(directory, about)
        directory.add_session(self.config["run"]["seeds"], about, self.continues)

    def _restore(self, path: Path, before: dict[str, Any], arrays: dict[str, np.ndarray]) -> None:
        """Put the state of a checkpoint in place. **Raises** `RunDirectoryError` where it is another learner's."""
        try:
            state = fill_tree(self.stepper.state, arrays)
            if self.finished and "environments" in state.get("physics", {}):  # no more is done with them
                state["physics"]["environments"] = np.zeros_like(state["physics"]["environments"])
            self.stepper.restore(state)
        except ValueError as error:
            changes = [
                f"{where} was {shown(then)} and is now {shown(new)}"
                for where, new, then in differences(self.config, before)
                if where not in ("run.steps", "run.window") and not where.startswith(EVALUATION)
            ]
            if not changes:
                raise
            more = f" and {len(changes) - 3} more" if len(changes) > 3 else ""
            raise RunDirectoryError(
                f"{path} cannot be continued with these changes: {'; '.join(changes[:3])}{more}: the state of its "
                "learner or dynamics has other parts, or another number of them. Undo them, or choose another "
                f"directory; train(..., initial=mg.load({str(path)!r})) starts anew from what was learned"
            ) from error

    def _evaluate_as(self, before: dict[str, Any]) -> None:
        """Go on evaluating as the run in the directory does, unless a callback says how."""
        if self.evaluating is None and (own := evaluating_of(before)) is not None:
            self.evaluating = own
            self.callbacks = (*self.callbacks, own)
        if self.evaluating is not None:
            self.evaluating.begin(self.task, self.config["run"]["steps"], before.get("evaluate_every"))
            self.config["run"] |= self.evaluating.settings

    def _compare(
        self, directory: RunDirectory, before: dict[str, Any], about: dict[str, Any] | None, allow_changed: bool
    ) -> None:
        """Refuse to resume a run of another configuration, or of another release of motorgrad."""
        if allow_changed:
            return
        path, now = directory.path, self.config
        learner = directory.learner() if about is None else None
        stored = learner and {name: learner[name] for name in self.begins}
        begins = stored if about is None else about["begins"]
        if begins is not None:
            before = {**before, "agent": {**before["agent"], **begins}}
            now = {**now, "agent": {**now["agent"], **self.begins}}
        # name a number rather than the fingerprint of the initial learner, which changes with it
        found = (
            f"{where} was {then!r} and is now {new!r}"
            for where, new, then in differences(now, before)
            if not (then is None and where.startswith(EVALUATION))  # an evaluation may begin at any time
        )
        changed = sorted(
            (difference for difference in found if not difference.startswith("run.steps")),
            key=lambda difference: difference.startswith("agent.initial"),
        )
        if changed:
            steps = now["run"]["steps"]
            made = before["run"]["steps"]
            own = ""
            if steps != made and all(difference.startswith("agent.") for difference in changed):
                own = (
                    f"some learners scale with the steps, which were {made:,} and are now {steps:,}: go on with the "
                    f"run's own learner by mg.resume({str(path)!r}, {steps}), or motorgrad train --resume {path} "
                    f"--steps {steps}; or "
                )
            raise RunDirectoryError(
                f"{path} holds a run of another configuration: {changed[0]}; {own}choose another directory, or the "
                "same settings, or continue on purpose with allow_changed=True (--allow-changed)"
            )
        if about is not None and (changes := release_changes(about["versions"], versions(), ("motorgrad",))):
            raise RunDirectoryError(
                f"{path} holds a run of another version: {changes[0]}; continue it with that version, or on purpose "
                "with allow_changed=True (--allow-changed)"
            )

    def _restore_initial(self, directory: RunDirectory, about: dict[str, Any] | None) -> None:
        """Write the policies before learning, where they are missing or damaged."""
        try:
            if directory.has_initial_policies and directory.learner() is not None:
                return
        except CorruptCheckpoint as error:
            warnings.warn(f"{error}; made again", RunWarning, stacklevel=2)
        meaning = {} if self.interface is None else {"interface": self.interface.table()}
        directory.save_initial(self.initial, {**self.config["agent"], **self.begins, **meaning})

    def write_events(self, directory: RunDirectory, asked: bool) -> None:
        """Begin or continue the event files, where they are asked for or there."""
        if self.saving is None or not (asked or (directory.path / "tensorboard").is_dir()):
            return
        check_tensorboard()
        seeds = self.config["run"]["seeds"]
        self.saving.events = EventFiles(directory.path / "tensorboard", seeds, start_time(directory.path))
        self.saving.events.add(directory.metrics())

    def _check_resumable(self, path: Path, made: int | bool) -> None:
        """Warn where the dynamics cannot be saved; refuse to resume such a run."""
        why = self.task.no_resume if isinstance(self.task, HostTask) else None
        if why is None:
            return
        if made is False:
            warnings.warn(f"{path}: this run cannot be resumed if it is stopped: {why}", RunWarning, stacklevel=2)
        elif made < self.config["run"]["steps"]:
            raise RunDirectoryError(
                f"{path} holds a run stopped after {counted(made, 'decision')}, which cannot be resumed: {why}; "
                "choose another directory, or delete this one"
            )

    def run(self, report: "TrainingProgress") -> Run:
        steps = self.config["run"]["steps"]
        window = self.config["run"]["window"]
        stepper = self.stepper
        saving = self.saving
        count = 1
        if self.continues:
            self._commit()  # the files of this session are covered from its beginning
        report.begin(stepper.decision, steps)
        with stop_when_asked() as stopped:
            while stepper.decision < steps and not self.ended and not stopped() and not (saving and saving.given_up):
                due = min((stepper.decision // window + 1) * window, steps)
                made = min(-(-count // self.envs) * self.envs, due - stepper.decision)
                start = time.perf_counter()
                worked = time.process_time()
                stepper.advance(made)
                self.cpu += time.process_time() - worked
                took = max(time.perf_counter() - start, 1e-6)
                self.wall += took
                # slices grow up to the time wanted; the time of the first includes compiling
                count = max(1, min(2 * count, round(made * SLICE / took)))
                latest = {} if stepper.decision % window else self._record()
                report.report(stepper.decision, made / took, latest)
                if saving and saving.due and stepper.decision < steps:
                    self._commit()
            while not self.finished and not self._commit() and saving and not stopped() and not saving.given_up:
                _wait(saving.pause, stopped)
        run = self._outcome()
        if saving is not None and saving.why is not None:
            error = NotSaved(
                f"{saving.directory.path}: the run ended after {counted(stepper.decision, 'decision')} and could not "
                f"be saved: {saving.why}. The last saved checkpoint stands; in Python, `run` of this error has all"
            )
            error.run = run
            raise error
        if stopped():
            raise interrupt(self._stop_message(), run=run)
        return run

    def _stop_message(self) -> str:
        """How far it is, where it is saved, and how it goes on, once it was asked to stop."""
        done = self.stepper.decision
        steps = self.config["run"]["steps"]
        said = f"stopped after {done:,} of {counted(steps, 'decision')}"
        if self.saving is None:
            return f"{said}; it is not saved, as there is no `out`: `run` of this exception has all"
        return f"{said}, saved in {self.saving.directory.path}; the same call continues"

    def _outcome(self) -> Run:
        saving, state = self.saving, self.stepper.state
        learner = state["cycle"].agent
        samples = getattr(learner, "gradient", None)
        metrics = self.records.take() if saving is None else saving.metrics()
        return dataclasses.replace(
            self._run_of(state["cycle"].memory),
            metrics=pa.table({}) if metrics is None else metrics,
            gradient=mean_of_samples(samples.mean, samples.count) if isinstance(samples, RunningMean) else None,
            path=None if saving is None else saving.directory.path,
            _critic=critic_of(numbers_of(state), self.config["agent"]),
            _evaluations={} if self.evaluating is None else self.evaluating.state,
        )

    def _record(self) -> dict[str, float]:
        """Add a record. Returns the means over the seeds of the reward and of the task's first reading."""
        record = self.stepper.harvest()
        self._look_for_broken(not_all_finite(record["parameters"]))
        latest = {"reward": self.records.add(record, self.stepper.decision, self.recorded, self.wall, self.cpu)}
        for name in self.task.metric_names[:1]:
            seen = record[name][np.isfinite(record[name])]
            latest |= {name: float(seen.mean())} if len(seen) else {}
        self.recorded = self.stepper.decision
        self._report()
        return latest

    def _look_for_broken(self, lost: Bool[np.ndarray, " lanes"]) -> None:
        """Warn of the lanes whose parameters have ceased to be finite since the last record."""
        if (new := lost & ~self.lost).any():
            lanes = lanes_in_words(new, self.config["run"]["seeds"], self.config.get("sweep", []))
            of = f"{np.count_nonzero(lost)} of {len(self.lost)}"
            when = f"parameters not finite by decision {self.stepper.decision:,}"
            what = "from then on nothing is learned, and reward and metrics are NaN"
            ways = "see what is observed and rewarded, or take a lower learning rate"
            warnings.warn(f"{lanes}: {when} ({of} so far): {what}; {ways}", RunWarning, stacklevel=2)
        self.lost |= lost

    def _report(self) -> None:
        """Tell the callbacks of the newest record."""
        if not self.callbacks:
            return
        path = None if self.saving is None else self.saving.directory.path
        run = self.config["run"]
        whole = self.recorded % self.config["run"]["window"] == 0
        about = (self.task.name, run["seeds"], self.recorded, run["steps"], self.records.newest(), path, whole)
        report = Report(*about, self._snapshot)
        ends = [callback(report) is True for callback in self.callbacks]
        self.ended = self.ended or any(ends)

    def _snapshot(self) -> Run:
        """The run as it is now, without records."""
        if self._remembered is None:
            self._remembered = self.stepper.viewer(lambda cycle, state: cycle.memory)
        return self._run_of(self._remembered())

    def _run_of(self, remembered: PyTree) -> Run:
        decision = self.stepper.decision
        policies = self._present(remembered)
        memory = numbers_of(remembered)
        return Run(self.config, decision, pa.table({}), policies, self.initial, _task=self.task, _memory=memory)

    def _commit(self) -> bool:
        """Save everything, where there is a directory; whether that succeeded. At the end, the unfinished window has a
        record, too. It is not part of the state, so more steps complete it."""
        short = self.recorded < self.stepper.decision == self.config["run"]["steps"]
        if self.saving is None:
            if short:
                self._record()
            return True
        if self._ending is not None:  # to make the last record has changed the state
            return self.saving.save(*self._ending)
        about = {"decision": self.stepper.decision, "recorded": self.recorded, "wall": self.wall}
        about |= {"cpu": self.cpu, "config": self.config, "begins": self.begins}
        state = self.stepper.state
        state = {**state, "kept": self._present(state["cycle"].memory)}
        if self.evaluating is not None:
            state[STATE] = self.evaluating.state
        records = self.records.take()
        last = None
        if short:
            self._record()
            last = self.records.take()
            self._ending = (state, about, None, last)
        return self.saving.save(state, about, records, last)


def interface_of(task: Task, policy: Policy) -> Interface | None:
    """What observations and actions of a policy mean on a task; `None`, with a warning, where the task does not say."""
    try:
        return task.interface(policy.actions)  # type: ignore[arg-type]
    except ValueError as error:
        message = f"{error}: its policies act in this task alone, and start others without it"
        warnings.warn(message, RunWarning, stacklevel=2)
        return None


def _wait(seconds: float, stopped: Callable[[], bool]) -> None:
    """Wait, but not on after a request to stop."""
    end = time.monotonic() + seconds
    while time.monotonic() < end and not stopped():
        time.sleep(min(SLICE, max(0.0, end - time.monotonic())))


def _check_steps(path: Path, steps: int, before: int, made: int) -> None:
    """Refuse fewer steps than an unfinished run has. (A finished run is returned.)"""
    if steps < before and made < before:
        raise RunDirectoryError(
            f"{path} holds a run of {counted(before, 'decision')}, of which {made:,} are made, but steps = {steps:,}: "
            f"give {before:,} or more, or choose another directory"
        )
