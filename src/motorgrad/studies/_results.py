"""The results of a study: its table, its runs, the best settings."""

import functools
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import pyarrow as pa

from motorgrad._errors import check_integer, choice, unknown
from motorgrad.statistics import Measured, mean_of, median_of
from motorgrad.studies._folder import StudyFolder
from motorgrad.studies._grid import frozen
from motorgrad.studies._plan import StudyPlan
from motorgrad.training import Run, load


class Best(NamedTuple):
    """One of the best settings.

    - `settings`: by path. `point`: its number.
    - `value`: the metric over the seeds that did not choose it, with its interval.
    - `chosen_by`: the metric over the seeds that did. The luck of the choice is in it. Without held-out seeds it is the
      same as `value`.
    - `done`: whether learning is over.
    - `broken`: the number of seeds whose policy is not finite.
    """

    settings: dict[str, Any]
    point: int
    value: Measured
    chosen_by: Measured
    done: bool
    broken: int = 0


class Results:
    """The results of a study so far. The study may still be running."""

    def __init__(self, folder: StudyFolder):
        self._folder = folder

    @staticmethod
    def load(path: Path | str, *, trust: bool = False) -> "Results":
        """The results in a study's folder, made from its run directories. Reading takes no lock.

        **Raises** `RunDirectoryError` where there is no study, and `NotTrusted` where a task of it imports a module
        that nobody has imported yet, unless you `trust` it.
        """
        folder = StudyFolder(path, trust=trust)
        folder.read_rows()
        folder.read_begun()
        return Results(folder)

    def __repr__(self) -> str:
        jobs = self.study.jobs
        return f"Results({self.path}, {sum(map(self._folder.is_done, jobs)):,} of {len(jobs):,} jobs)"

    @property
    def path(self) -> Path:
        """The folder."""
        return self._folder.path

    @property
    def study(self) -> StudyPlan:
        """The study."""
        return self._folder.study

    @property
    def complete(self) -> bool:
        """Whether every job is done."""
        return all(map(self._folder.is_done, self.study.jobs))

    @property
    def failures(self) -> list[dict[str, Any]]:
        """The jobs that were set aside: `job`, `attempts`, `message`, `traceback`, `points`, the first `settings`."""
        return self._folder.failures()

    @functools.cached_property
    def table(self) -> pa.Table:
        """One row per setting and seed: `job`, `point`, `seed`, the settings by path, `status` (`"done"`, `"failed"`,
        `"begun"` or `"waiting"`), `decision`, the final metrics as `final_metrics` has them, and whether the policy
        is not finite, `broken`; of jobs that have begun, those so far."""
        return self._folder.index()

    @property
    def metrics(self) -> list[str]:
        """The metrics of the table."""
        names = self.table.column_names
        return [name for name in names[names.index("status") + 2 :] if name != "broken"]

    @property
    def tasks(self) -> list[dict[str, Any]]:
        """The settings of each task, by path, as far as tasks differ; for `where` in `best`."""
        each = [
            {path: value for path, value in setting.items() if path.startswith("task.")}
            for setting in self.study.settings
        ]
        return list({frozen(task): task for task in each}.values())

    def run(self, point: int) -> Run:
        """The run of one point, with all its seeds. **Raises** `RunDirectoryError` where it has not begun."""
        check_integer("point", point, 0, len(self.study.points) - 1)
        job = next(job for job in self.study.jobs if point in job.points)
        run = load(self._folder.place(job))
        return run.of_setting(job.points.index(point)) if run.settings else run

    def values(self, metric: str, so_far: bool = False) -> np.ndarray:
        """A metric as `(points, seeds)`; NaN where the job is not done, or, with `so_far`, has nothing yet."""
        if metric not in self.metrics:
            raise unknown("metric", metric, self.metrics)
        column = self.table[metric].to_numpy(zero_copy_only=False).astype(float)
        if not so_far:
            column = np.where(np.asarray(self.table["status"].to_pylist()) == "done", column, np.nan)
        return self._by_point(column)

    @property
    def broken(self) -> dict[int, int]:
        """The settings with a seed whose policy is not finite, so far: the number of such seeds by point."""
        if "broken" not in self.table.column_names:
            return {}
        lost = self.table["broken"].to_numpy(zero_copy_only=False) == 1
        counts = self._by_point(lost).sum(axis=1)
        return {int(point): int(counts[point]) for point in np.flatnonzero(counts)}

    def _by_point(self, column: np.ndarray) -> np.ndarray:
        """A column of the table as `(points, seeds)`."""
        column = column.reshape(-1, len(self.study.seed_list))
        found = np.empty_like(column)
        found[self.table["point"].to_numpy()[:: column.shape[1]]] = column
        return found

    def best(
        self,
        metric: str = "reward",
        count: int = 5,
        *,
        direction: Literal["maximize", "minimize"] = "maximize",
        statistic: Literal["mean", "median"] = "mean",
        held_out: bool = True,
        where: Mapping[str, Any] | None = None,
        so_far: bool = False,
    ) -> list[Best]:
        """The best settings by a metric, with intervals over seeds.

        The best of many is partly the luckiest. So settings are chosen by one half of the seeds and reported over the
        other, where there are four seeds or more.

        **Arguments:**

        - `metric`: a column of the table.
        - `count`: the greatest number of settings.
        - `direction`: whether more is better.
        - `statistic`: over the seeds.
        - `held_out`: `False` chooses and reports by all seeds.
        - `where`: only settings that have these values, such as `{"task.name": "chain"}`. Rewards of different tasks
          do not compare.
        - `so_far`: whether to count jobs that are not done, too.

        Settings with a value that is not finite come last, with NaN: a seed whose policy is not finite, or in which the
        metric never occurred. Those that have no values yet are left out.
        """
        choice("direction", direction, ("maximize", "minimize"))
        choice("statistic", statistic, ("mean", "median"))
        settings = self.study.settings
        for path in where or {}:
            if not any(path in setting for setting in settings):
                raise unknown("setting of the study", path, {path for setting in settings for path in setting})
        wanted = [all(setting.get(path) == value for path, value in (where or {}).items()) for setting in settings]
        values = self.values(metric, so_far)
        broken = self.broken
        finite = np.isfinite(values).all(axis=1) & ~np.isin(np.arange(len(values)), list(broken))
        usable = np.flatnonzero(finite & np.array(wanted))
        done = np.asarray(np.isfinite(self.values(metric)).all(axis=1))
        choosing, reporting = self.choosing(values) if held_out else (values, values)
        centre = np.mean if statistic == "mean" else np.median
        score = centre(choosing[usable], axis=1) * (1 if direction == "minimize" else -1)
        measured = mean_of if statistic == "mean" else median_of
        unknown_one = Measured(math.nan, math.nan, math.nan, 0, statistic, 1.0)
        status = self._by_point(np.asarray(self.table["status"].to_pylist(), object))[:, 0]
        learned = np.isin(status, ("done", "begun") if so_far else ("done",))
        lacking = np.setdiff1d(np.flatnonzero(learned & np.array(wanted)), usable)
        known = [
            Best(settings[point], int(point), measured(reporting[point]), measured(choosing[point]), bool(done[point]))
            for point in usable[np.argsort(score, kind="stable")[:count]]
        ]
        last = [
            Best(settings[point], int(point), unknown_one, unknown_one, status[point] == "done", broken.get(point, 0))
            for point in lacking.tolist()
        ]
        return [*known, *last][:count]

    @staticmethod
    def choosing(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The values by seeds that choose settings, and those by seeds that report them; with fewer than four, all."""
        return (values[:, ::2], values[:, 1::2]) if values.shape[1] >= 4 else (values, values)
