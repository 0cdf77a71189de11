"""The partition of a study into compiled calls, which the study alone determines."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyarrow as pa

from motorgrad._files import read_arrays, write_arrays
from motorgrad._signals import unfinished
from motorgrad.studies._grid import Point, frozen, leaves, varied
from motorgrad.studies._jobs import Outcome, Work
from motorgrad.tasks import Task, make
from motorgrad.training import Run, agent_for, check_training, evaluate, final_metrics, sweepable, train

RECORDS = 50  # of the metrics by default: enough for curves of thousands of runs, and cheap to write
Measure = Literal["online", "frozen", "frozen-mode"]
MODES: dict[Measure, Literal["sample", "mode"]] = {"frozen": "sample", "frozen-mode": "mode"}
FROZEN = "frozen.npz"
"""The file of a run directory with the means without learning."""


@dataclasses.dataclass(frozen=True)
class Job:
    """One call of `train`, and one run directory.

    - `name`: name of its directory.
    - `task` and `agent`: the tables from which they are made.
    - `sweep`: the settings that learn side by side; `None` for a single one.
    - `points`: the numbers of the study's points, in the order of the sweep.
    - `steps`, `seeds`, `window`: as in `train`.
    - `measures`, `evaluate`: as in `Study`.
    """

    name: str
    task: dict[str, Any]
    agent: dict[str, Any]
    sweep: list[dict[str, float]] | None
    points: tuple[int, ...]
    steps: int
    seeds: int | tuple[int, ...]
    window: int
    measures: tuple[Measure, ...] = ()
    evaluate: int = 0

    def make_task(self) -> Task:
        """The task."""
        return _task(self.task)

    def do(self, path: Path, job_settings: Work) -> Outcome:
        """Learn, or learn what is left, in the run directory. The result is the run's rows in the index."""
        how = {"sweep": self.sweep, "window": self.window, "threads": job_settings.threads, "progress": False}
        how["checkpoint_every"] = job_settings.checkpoint_every
        run = unfinished("run", lambda: train(self.make_task(), self.agent, self.steps, self.seeds, path, **how))
        learned = float(run.metrics["wall_time"][-1].as_py()) if run.metrics.num_rows else 0.0
        if run.complete and self._modes and not (path / FROZEN).exists():
            write_arrays(path / FROZEN, self._evaluated(run, job_settings.threads))
        return Outcome(self.rows(run) if run.complete else None, learned)

    def rows(self, run: Run) -> pa.Table:
        """The rows of a run in the index: the lanes in order, with their final metrics and the further measures; those
        without learning where they are in its directory; and whether the policy is not finite, `broken`."""
        found = final_metrics(run)
        if "online" in self.measures:
            online = final_metrics(run, share=1.0)
            found |= {f"{name}_online": values for name, values in online.items() if not name.endswith("_total")}
        if self._modes and run.path is not None and (run.path / FROZEN).exists():
            found |= read_arrays(run.path / FROZEN)
        columns = {name: np.asarray(values, float) for name, values in (found | {"broken": run.broken}).items()}
        return pa.table({"decision": np.full(run.lanes, run.decision, np.int64), **columns})

    def is_measured(self, path: Path) -> bool:
        """Whether a run directory has all measures, once learning is over."""
        return not self._modes or (path / FROZEN).exists()

    @property
    def _modes(self) -> dict[str, Literal["sample", "mode"]]:
        """How actions are taken without learning, by the ends of the names of the columns."""
        return {measure.replace("-", "_"): MODES[measure] for measure in self.measures if measure in MODES}

    def _evaluated(self, run: Run, threads: int) -> dict[str, np.ndarray]:
        found = {}
        for end, mode in self._modes.items():
            seen = evaluate(run, self.evaluate, mode=mode, threads=threads)
            found |= {f"{name}_{end}": values for name, values in {"reward": seen.reward, **seen.metrics}.items()}
        return found


def partition(
    points: Sequence[Point],
    steps: int,
    seeds: int | tuple[int, ...],
    window: int | None,
    lanes: int,
    measures: tuple[Measure, ...] = (),
    evaluate: int = 0,
) -> list[Job]:
    """Group points that differ only in numbers of the learner, and cut the groups into compiled calls of equal size.

    **Arguments:** `steps` and `window`: of points that have none of their own. `lanes`: the most settings × seeds of a
    call; a call has at least one setting. `window`: decisions per record; `None` for a fiftieth of the steps.

    **Raises** `ValueError` that names the first impossible setting.
    """
    count = seeds if isinstance(seeds, int) else len(seeds)
    most = max(1, lanes // max(1, count))
    calls = []
    for group in _groups(points):
        base = points[group[0]]
        numbers = _differing(points, group)
        sweep = [{name: _at(points[index]["agent"])[name] for name in numbers} for index in group] if numbers else None
        task = _task(base["task"])
        made = base.get("steps", steps)
        each = base.get("window", max(1, made // RECORDS) if window is None else window)
        try:
            check_training(task, base["agent"], made, seeds, each, sweep=sweep)
        except ValueError as error:
            # a user of a study has written no sweep
            raise ValueError(str(error).replace("sweep['", "agent['")) from None
        size = _size(len(group), most)
        for start in range(0, len(group), size):
            part = slice(start, start + size)
            calls.append((base, None if sweep is None else sweep[part], tuple(group[part]), made, each))
    width = max(4, len(str(len(calls))))
    more = (measures, evaluate)
    return [
        Job(f"{n:0{width}d}-{base['task']['name']}", base["task"], base["agent"], sweep, part, made, seeds, each, *more)
        for n, (base, sweep, part, made, each) in enumerate(calls)
    ]


def _groups(points: Sequence[Point]) -> list[list[int]]:
    """The points of every compiled program: equal in all but numbers that a sweep can vary."""
    alike: dict[str, list[int]] = {}
    for index, point in enumerate(points):
        agent = {path: None if _is_number(value) else value for path, value in _at(point["agent"]).items()}
        length = [point.get("steps"), point.get("window")]
        alike.setdefault(frozen([point["task"], agent, *length]), []).append(index)
    found = []
    for group in alike.values():
        first = points[group[0]]
        agent = agent_for(_task(first["task"]), first["agent"])
        fixed = [name for name in _differing(points, group) if not sweepable(name, agent)]
        parts: dict[str, list[int]] = {}
        for index in group:
            parts.setdefault(frozen([_at(points[index]["agent"])[name] for name in fixed]), []).append(index)
        found += parts.values()
    return sorted(found)


def _differing(points: Sequence[Point], group: Sequence[int]) -> list[str]:
    """The settings of the learner in which the points of a group differ."""
    return varied([_at(points[index]["agent"]) for index in group])


def _size(settings: int, most: int) -> int:
    """The settings of a call: the most that divide all evenly, so that one program serves them all, unless that would
    take more than twice as many calls as necessary."""
    least = -(-settings // most)
    even = (settings // calls for calls in range(least, min(2 * least, settings) + 1) if settings % calls == 0)
    return next(even, -(-settings // least))


def _task(table: dict[str, Any]) -> Task:
    try:
        return make(**table)
    except ValueError as error:
        raise ValueError(f"task: {error}") from None


def _at(agent: dict[str, Any]) -> dict[str, Any]:
    """The settings of an agent by path."""
    return dict(leaves(agent))


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
