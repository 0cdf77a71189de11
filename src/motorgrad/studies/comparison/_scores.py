"""What a comparison has found so far: the chosen settings, and the scores of the judging seeds."""

import functools
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Float

from motorgrad._errors import choice, counted
from motorgrad.statistics import distribution_scores, percentile_range
from motorgrad.studies._grid import as_given, frozen
from motorgrad.studies._partition import Job
from motorgrad.studies._results import Results
from motorgrad.studies.comparison._plan import SCORED, ComparisonPlan, Scored
from motorgrad.training import Run, load

Pair = tuple[str, str]
"""A method and a task, by their names in the comparison."""
Choice = Literal["tuned", "shared", "benchmark"]
CHOICES: dict[Choice, str] = {
    "tuned": "the best settings for each task",
    "shared": "the one setting with the best mean normalized score",
    "benchmark": "the one setting with the best mean share of the pool",
}
"""How settings are chosen, on the seeds that tune: for each task; one for all tasks by the mean of normalized scores
(Adkins, Bowling & White, 2024), or by the mean share of all runs that are no better (Patterson et al., 2024)."""
STAGES = ("pilot", "tuning", "judging")
PILOT = 2000  # decisions per run of the pilot


class ComparisonScores:
    """All that `ComparisonResults` are but their tables and figures, which are made of these numbers."""

    def __init__(self, comparison: ComparisonPlan, path: Path | str, trust: bool = False):
        self.comparison = comparison
        self.path = Path(path)
        self._trust = trust
        self._runs: dict[tuple[str, str], Run] = {}

    @functools.cached_property
    def stages(self) -> dict[str, Results]:
        """The results of the studies that have begun: `"pilot"`, `"tuning"` and `"judging"`."""
        begun = [name for name in STAGES if (self.path / name / "study.toml").is_file()]
        return {name: Results.load(self.path / name, trust=self._trust) for name in begun}

    @property
    def complete(self) -> bool:
        """Whether all is judged, and no job was set aside."""
        return "judging" in self.stages and all(stage.complete for stage in self.stages.values())

    @property
    def failures(self) -> list[dict[str, Any]]:
        """The jobs that were set aside, in all stages."""
        return [failure for stage in self.stages.values() for failure in stage.failures]

    @functools.cached_property
    def steps(self) -> dict[Pair, int]:
        """The decisions of a run of each method on each task. For a budget in seconds, those that the pilot says, in
        two digits."""
        comparison = self.comparison
        found = {}
        for method, task in comparison.pairs:
            steps = comparison.steps_of(task)
            if comparison.seconds is not None:
                (point,) = self.points("pilot", (method, task))
                made = comparison.seconds / max(self.cost("pilot", point), 1e-12)
                unit = 10 ** max(0, int(np.log10(max(made, 1.0))) - 1)
                steps = int(min(max(10, made // unit * unit), 2**31))
            assert steps is not None
            found[method, task] = steps
        return found

    def points(self, stage: str, pair: Pair) -> list[int]:
        """The points of a stage's study that are a method's settings on a task, in their order: in tuning all settings,
        in judging those that were chosen."""
        comparison = self.comparison
        known = self._places[stage]
        if stage == "pilot":
            agents = comparison.settings(*pair)[:1]
            steps = PILOT
        else:
            chosen = comparison.settings(*pair)
            agents = chosen if stage == "tuning" else [chosen[index] for index in self._judged(pair)]
            steps = self.steps[pair]
        task = comparison.tasks[pair[1]].task
        return [known[frozen({"task": task, "agent": agent, "steps": steps})] for agent in agents]

    def judged_cases(self) -> list[dict[str, Any]]:
        """The chosen settings of every method on every task as cases of a study."""
        found = []
        for pair in self.comparison.pairs:
            settings = self.comparison.settings(*pair)
            about = {"task": self.comparison.tasks[pair[1]].task, "steps": self.steps[pair]}
            found += [{**about, "agent": as_given(settings[index])} for index in self._judged(pair)]
        return found

    # what tuning has found

    def tried(self, pair: Pair) -> Float[np.ndarray, "settings seeds"]:
        """What every setting of a method earned on a task in tuning, by the score that chooses; greater is better. NaN
        where it is not known."""
        return self._goodness("tuning", pair[1], self.comparison.choose_by)[self.points("tuning", pair)]

    @functools.cached_property
    def pools(self) -> dict[str, Float[np.ndarray, "settings seeds"]]:
        """What all settings of all methods earned on each task in tuning."""
        pairs = self.comparison.pairs
        return {
            task: np.concatenate([self.tried(pair) for pair in pairs if pair[1] == task])
            for task in self.comparison.tasks
            if any(pair[1] == task for pair in pairs)
        }

    @functools.cached_property
    def scales(self) -> dict[str, tuple[float, float]]:
        """What is scored 0 and 1 on each task; greater is better."""
        found = {}
        for task, pool in self.pools.items():
            given = self.comparison.tasks[task].scale
            if given is None and not np.isfinite(pool.mean(axis=1)).any():
                metric = self.comparison.metric_of(task)
                lost = sum(self.stages["tuning"].broken.values())
                raise ValueError(
                    f"tasks.{task}: no setting of any method has a finite {metric} with every tuning seed, so none can "
                    f"be chosen ({counted(lost, 'run')} of tuning ended with parameters that are not finite): take "
                    "other settings, such as lower learning rates, in another folder"
                )
            low, high = percentile_range(pool.mean(axis=1)) if given is None else (self.sign * end for end in given)
            found[task] = (float(low), float(high))
        return found

    def normalized(self, task: str, values: np.ndarray) -> np.ndarray:
        """What was earned on a task as a score."""
        low, high = self.scales[task]
        return (values - low) / (high - low)

    @functools.cached_property
    def chosen(self) -> dict[Pair, dict[Choice, int]]:
        """The settings that were chosen for every method on every task, by their numbers among its `settings`."""
        found: dict[Pair, dict[Choice, int]] = {}
        for method in self.comparison.methods:
            tasks = self.tasks_of(method)
            tried = {task: self.tried((method, task)) for task in tasks}
            tuned = {task: _best(values.mean(axis=1)) for task, values in tried.items()}
            shared = _best(sum(self.normalized(task, values).mean(axis=1) for task, values in tried.items()))
            shares = [distribution_scores(values, self.pools[task]).mean(axis=1) for task, values in tried.items()]
            benchmark = _best(np.sum(shares, axis=0))
            for task in tasks:
                found[method, task] = {"tuned": tuned[task], "shared": shared, "benchmark": benchmark}
        return found

    def tasks_of(self, method: str) -> list[str]:
        """The tasks of a method."""
        return [task for name, task in self.comparison.pairs if name == method]

    def _judged(self, pair: Pair) -> list[int]:
        """The settings that are judged, once each."""
        return sorted(set(self.chosen[pair].values()))

    def judged_point(self, pair: Pair, chosen: Choice = "tuned") -> int:
        """The point of judging with the chosen settings of a method on a task."""
        return self.points("judging", pair)[self._judged(pair).index(self.chosen[pair][chosen])]

    # what judging has found

    @functools.cached_property
    def methods(self) -> list[str]:
        """The methods that are judged on all tasks, in the order of the comparison. Only these are compared across
        tasks."""
        tasks = list(self.comparison.tasks)
        return [
            method
            for method in self.comparison.methods
            if self.tasks_of(method) == tasks and all(self.is_judged((method, task)) for task in tasks)
        ]

    def is_judged(self, pair: Pair) -> bool:
        """Whether a method is judged on a task."""
        if "judging" not in self.stages:
            return False
        return all(self._done[point] for point in self.points("judging", pair))

    def earned(self, pair: Pair, scored: Scored = "final", chosen: Choice = "tuned") -> Float[np.ndarray, " seeds"]:
        """What a method earned on a task with the chosen settings, for each judging seed; greater is better. Where the
        metric never occurred, or the policy is not finite, it is the worst that was earned on the task; NaN where that
        is so with every seed."""
        choice("scored", scored, SCORED)
        choice("chosen", chosen, CHOICES)
        values = self._goodness("judging", pair[1], scored)
        judged = [other for other in self.comparison.pairs if other[1] == pair[1] and self.is_judged(other)]
        known = [point for other in judged for point in self.points("judging", other)]
        worst = np.nanmin(values[known]) if np.isfinite(values[known]).any() else np.nan
        row = values[self.judged_point(pair, chosen)]
        return np.where(np.isfinite(row), row, worst if np.isfinite(row).any() else np.nan)

    def broken(self, method: str, chosen: Choice = "tuned") -> int:
        """The number of judging runs of a method, with the chosen settings on its tasks, whose policy is not finite."""
        lost = self.stages["judging"].broken
        return sum(lost.get(self.judged_point((method, task), chosen), 0) for task in self.tasks_of(method))

    def scores(
        self, method: str, scored: Scored = "final", chosen: Choice = "tuned"
    ) -> Float[np.ndarray, "tasks seeds"]:
        """The normalized scores of a method with the chosen settings on its tasks, for each judging seed."""
        return np.array(
            [self.normalized(task, self.earned((method, task), scored, chosen)) for task in self.tasks_of(method)]
        )

    def shares(self, method: str) -> Float[np.ndarray, "tasks seeds"]:
        """The scores of the cross-environment hyperparameter setting benchmark (Patterson et al., 2024): with one
        setting for all tasks, the share of all runs of tuning that a run is at least as good as."""
        scored = self.comparison.choose_by
        return np.array(
            [
                distribution_scores(self.earned((method, task), scored, "benchmark"), self.pools[task])
                for task in self.tasks_of(method)
            ]
        )

    def curve(self, pair: Pair, chosen: Choice = "tuned") -> tuple[np.ndarray, Float[np.ndarray, "seeds records"]]:
        """The decisions of each record, and the metric while learning for every judging seed; greater is better."""
        point = self.judged_point(pair, chosen)
        job = self._jobs["judging"][point]
        run = self._run("judging", point)
        decision, values = run.curve(self.comparison.metric_of(pair[1]))
        seeds = len(run.seeds)
        rows = slice(job.points.index(point) * seeds, (job.points.index(point) + 1) * seeds)
        return decision, self.sign * values[rows]

    def period(self, task: str) -> float | None:
        """Simulated seconds per decision; `None` where the task has no time of its own."""
        made = self.comparison.tasks[task].made
        return None if made.period == 1 else made.period

    def cost(self, stage: str, point: int) -> float:
        """Processor seconds per decision and run of a point, without compiling: those of its compiled call after its
        first record, divided by the number of runs that learn in it side by side."""
        run = self._run(stage, point)
        decision, seconds = (run.metrics[name].to_numpy()[:: run.lanes] for name in ("decision", "cpu_time"))
        if len(decision) < 2:
            return float(seconds[-1] / decision[-1] / run.lanes)
        return float((seconds[-1] - seconds[0]) / (decision[-1] - decision[0]) / run.lanes)

    def spent(self, stage: str, pair: Pair) -> tuple[int, int, float]:
        """Runs, decisions and processor seconds, with compiling, of a method on a task in a stage."""
        points = self.points(stage, pair)
        study = self.stages[stage].study
        seconds = 0.0
        for point in points:
            run = self._run(stage, point)
            seconds += float(run.metrics["cpu_time"][-1].as_py()) * len(run.seeds) / run.lanes
        runs = len(points) * len(study.seed_list)
        return runs, runs * self.steps[pair], seconds

    # the studies

    @property
    def sign(self) -> int:
        """The factor of the metric that makes greater values better: 1 or -1."""
        return 1 if self.comparison.direction == "maximize" else -1

    def _goodness(self, stage: str, task: str, scored: Scored) -> np.ndarray:
        """A score of all points of a stage, `(points, seeds)`; greater is better."""
        end = "" if scored == "final" else f"_{scored.replace('-', '_')}"
        name = f"{self.comparison.metric_of(task)}{end}"
        results = self.stages[stage]
        if name not in results.metrics:
            return np.full((len(results.study.points), len(results.study.seed_list)), np.nan)
        return self.sign * results.values(name)

    @functools.cached_property
    def _places(self) -> dict[str, dict[str, int]]:
        """The points of each stage's study by what they are."""
        found = {name: stage.study.points for name, stage in self.stages.items()}
        return {name: {frozen(each): index for index, each in enumerate(points)} for name, points in found.items()}

    @functools.cached_property
    def _jobs(self) -> dict[str, dict[int, Job]]:
        """The job of every point."""
        return {name: {p: job for job in stage.study.jobs for p in job.points} for name, stage in self.stages.items()}

    @functools.cached_property
    def _done(self) -> np.ndarray:
        """Whether each point of judging is done."""
        table = self.stages["judging"].table
        done = np.zeros(len(self.stages["judging"].study.points), bool)
        done[table["point"].to_numpy()] = np.asarray(table["status"].to_pylist()) == "done"
        return done

    def _run(self, stage: str, point: int) -> Run:
        """The run of the compiled call in which a point learns."""
        name = self._jobs[stage][point].name
        if (stage, name) not in self._runs:
            self._runs[stage, name] = load(self.path / stage / "jobs" / name, trust=self._trust)
        return self._runs[stage, name]


def _best(values: ArrayLike) -> int:
    """The place of the greatest value that is finite; the first where none is."""
    values = np.asarray(values, float)
    return int(np.argmax(np.where(np.isfinite(values), values, -np.inf)))
