"""The plan of a comparison: tasks × methods × settings, seeds that tune and seeds that judge, and a budget."""

import dataclasses
import functools
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, Self, cast

from motorgrad._errors import check, check_integer, choice, unknown
from motorgrad._files import read_toml
from motorgrad.schema import Range, Settings, build, count, inner, number, static, table
from motorgrad.studies._grid import as_given, distinctions, has_range
from motorgrad.studies._partition import Measure
from motorgrad.studies._plan import Design, points_of
from motorgrad.studies._study import Study
from motorgrad.tasks import Task, make
from motorgrad.training import MAX_STEPS, changed, changes_named, check_imports

Scored = Literal["final", "online", "frozen", "frozen-mode"]
SCORED: dict[Scored, str] = {
    "final": "while learning, the last tenth",
    "online": "while learning, the whole time",
    "frozen": "without learning, actions drawn",
    "frozen-mode": "without learning, the most probable action",
}
"""What a run can be scored by: its metric over the last tenth of the records or over all of them; without learning at
the end, with actions drawn or with the most probable ones."""
MEASURES: tuple[Measure, ...] = ("online", "frozen", "frozen-mode")


@dataclasses.dataclass(frozen=True)
class Seeds(Settings):
    """Two disjoint sets of seeds."""

    tune: int | tuple[int, ...] = static(
        allowed=Range(0, 2**31 - 1, kind="int"),
        help="the seeds that choose settings: their number (0, 1, 2 …), or a list of them",
    )
    judge: int | tuple[int, ...] = static(
        allowed=Range(0, 2**31 - 1, kind="int"),
        help="the seeds that are reported: their number, which follow those that tune, or a list of them",
    )

    def validate(self) -> None:
        start = 0
        for name in ("tune", "judge"):
            value = getattr(self, name)
            if isinstance(value, int):
                check_integer(name, value, 1, 1_000_000)
                value = tuple(range(start, start + value))
            check(value and len(set(value)) == len(value), name, list(value), "different seeds")
            object.__setattr__(self, name, value)
            start = max(value) + 1
        both = sorted(set(self.tuning) & set(self.judging))
        if both:
            raise ValueError(
                f"judge = {self.judging}: seed {', '.join(map(str, both))} is in tune, too: seeds that have chosen a "
                "method's settings cannot judge it"
            )

    @property
    def tuning(self) -> list[int]:
        """The seeds that choose settings."""
        return list(cast(tuple[int, ...], self.tune))

    @property
    def judging(self) -> list[int]:
        """The seeds that are reported."""
        return list(cast(tuple[int, ...], self.judge))


@dataclasses.dataclass(frozen=True)
class JudgedTask(Settings):
    """A task of a comparison."""

    task: Any = static(
        None,
        help="the name of the task, or a table with its `name` and settings; by default its name in the comparison",
    )
    steps: int | None = count(
        None, 1, MAX_STEPS, unit="decisions", help="length of each run; by default that of the comparison"
    )
    metric: str | None = static(None, help="metric of the task, by default that of the comparison")
    agent: Mapping[str, Any] = static(
        factory=dict, help="settings that every method has on this task, such as a policy. They are not tuned"
    )
    scale: tuple[float, float] | None = static(
        None,
        help="what is to be scored 0 and 1, such as what a random and the best policy earn; by default the 5th and the "
        "95th percentile of what the settings of all methods reached in tuning",
    )

    def validate(self) -> None:
        different = self.scale is None or self.scale[0] != self.scale[1]
        check(different, "scale", self.scale, "two different numbers")

    @functools.cached_property
    def made(self) -> Task:
        """The task itself."""
        return make(**self.task)


@dataclasses.dataclass(frozen=True)
class ComparisonPlan(Settings):
    """All that `Comparison` is but how it runs: its tasks, methods and settings, and the studies of its stages."""

    tasks: Any = static(help="a list of names, or a table of them: each with the fields of `JudgedTask`, or none")
    methods: Any = static(
        help="a table of changes to the task's own learner for every method, as in `agent_for`; a list is a grid, from "
        "which the settings are chosen. `tasks` among them names the tasks that the method is for, by default all. A "
        "word stands for a named estimator or a preset; a list of words for several"
    )
    metric: str = static(help='the metric by which methods are compared: `"reward"`, or a reading that all tasks have')
    seeds: Seeds = inner(help="`Seeds`, or a table with `tune` and `judge`")
    steps: int | None = count(None, 1, MAX_STEPS, unit="decisions", help="the budget of every run")
    seconds: float | None = number(
        None,
        0,
        open_low=True,
        unit="s",
        help="instead of `steps`, the budget of every run in processor time. A short pilot measures how many decisions "
        "each method makes in that time on each task. What it measured is kept in the folder",
    )
    agent: Mapping[str, Any] = static(
        factory=dict, help="settings of every method, which a method can set otherwise; a list is a grid"
    )
    direction: Literal["maximize", "minimize"] = static("maximize", help="whether more of the metric is better")
    choose_by: Scored = static(
        "final",
        help='the score that chooses settings: `"final"`, the last tenth of the records, while learning; `"online"`, '
        'all records; `"frozen"` or `"frozen-mode"`, without learning',
    )
    evaluate: int = count(2000, 1, 10**9, unit="decisions", help="length of each evaluation without learning")
    window: int | None = count(None, 1, unit="decisions", help="as in `Study`")
    lanes: int = count(1024, 1, 1_000_000, help="as in `Study`")
    design: Design | None = inner(None, help="as in `Study`")

    def validate(self) -> None:
        object.__setattr__(self, "tasks", dict(_tasks(self.tasks, self)))
        object.__setattr__(self, "methods", dict(_methods(self.methods, self.tasks)))
        if self.seconds is not None:
            check(self.steps is None, "steps", self.steps, "left out where there is a budget in seconds")
            timed = [name for name, task in self.tasks.items() if task.steps is not None]
            check(not timed, "tasks.steps", timed, "left out where there is a budget in seconds")
        elif self.steps is None:
            without = [name for name, task in self.tasks.items() if task.steps is None]
            check(not without, "steps", None, "given, the decisions of every run; or seconds, of processor time")

    @classmethod
    def read(cls, path: Path | str, *, trust: bool = False) -> Self:
        """The comparison in a TOML file.

        **Arguments:** `trust`: whether its tasks may import modules that the file names.

        **Raises** `ValueError` that names the file and the setting, and `NotTrusted`.
        """
        values = read_toml(Path(path))
        try:
            for name, given in _named(values.get("tasks", {})):
                task = given.get("task", name) if isinstance(given, Mapping) else name
                check_imports(task if isinstance(task, Mapping) else {"name": task}, str(path), trust)
            return build(cls, values)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None

    def as_table(self) -> dict[str, Any]:
        """The comparison as a plain table, as in its file."""
        return table(self)

    @functools.cached_property
    def pairs(self) -> list[tuple[str, str]]:
        """Every method with each of its tasks."""
        return [(name, task) for name, method in self.methods.items() for task in method.get("tasks", self.tasks)]

    def settings(self, method: str, task: str) -> list[dict[str, Any]]:
        """The settings of a method to try on a task, as changes to its learner; the same for every task."""
        case = self.case(method, task, 1)
        return [point["agent"] for point in points_of(case, self.design if has_range(case["agent"]) else None)]

    def varied(self, method: str) -> list[dict[str, Any]]:
        """What distinguishes the settings of a method, by name."""
        task = next(task for name, task in self.pairs if name == method)
        return distinctions(self.settings(method, task))

    def is_drawn(self, method: str) -> bool:
        """Whether settings of a method are drawn from ranges."""
        return any(has_range(self.case(name, task, 1)["agent"]) for name, task in self.pairs if name == method)

    def steps_of(self, task: str) -> int | None:
        """The budget of a run on a task in decisions; `None` where it is in seconds."""
        return self.tasks[task].steps or self.steps

    def metric_of(self, task: str) -> str:
        """The metric of a task."""
        return self.tasks[task].metric or self.metric

    def study(self, cases: Sequence[Mapping[str, Any]], seeds: Sequence[int], measures: Sequence[Measure]) -> Study:
        """A study of this comparison."""
        return Study(
            cases=list(cases),
            steps=self.steps or 1,
            seeds=tuple(seeds),
            window=self.window,
            lanes=self.lanes,
            design=self.design if any(has_range(case["agent"]) for case in cases) else None,
            measures=tuple(measures) or None,
            evaluate=self.evaluate if measures else None,
        )

    def tuning(self, steps: Mapping[tuple[str, str], int]) -> Study:
        """The study that chooses settings, given the decisions of every method on every task."""
        cases = [self.case(*pair, steps[pair]) for pair in self.pairs]
        return self.study(cases, self.seeds.tuning, () if self.choose_by == "final" else (self.choose_by,))

    def check(self) -> None:
        """Check every method on every task. **Raises** `ValueError` that names the first that is impossible."""
        for method, task in self.pairs:
            steps = self.steps_of(task) or 1
            try:
                self.study([self.case(method, task, steps)], self.seeds.tuning, ()).check()
            except ValueError as error:
                raise ValueError(f"methods.{method} on tasks.{task}: {error}") from None

    def first_case(self, method: str, task: str, steps: int) -> dict[str, Any]:
        """The first setting of a method on a task as a study has it."""
        return {**self.case(method, task, steps), "agent": as_given(self.settings(method, task)[0])}

    def case(self, method: str, task: str, steps: int) -> dict[str, Any]:
        """A method on a task as a study has it."""
        own = {name: value for name, value in self.methods[method].items() if name != "tasks"}
        agent = changed(changed(self.agent, self.tasks[task].agent), own)
        return {"task": self.tasks[task].task, "agent": agent, "steps": steps}


def _named(given: Any) -> Iterator[tuple[str, Any]]:
    """Names with what is given about them, from a table or a list of names."""
    if isinstance(given, Mapping):
        yield from given.items()
        return
    listed = [given] if isinstance(given, str) else given
    right = isinstance(listed, list | tuple) and all(isinstance(name, str) for name in listed)
    check(right, "tasks", given, "a list of names, or a table of them")
    yield from ((name, {}) for name in listed)


def _tasks(given: object, comparison: ComparisonPlan) -> Iterator[tuple[str, JudgedTask]]:
    """The tasks of a comparison by name, checked."""
    named = dict(_named(given))
    check(named, "tasks", given, "at least one task")
    for name, value in named.items():
        where = f"tasks.{name}"
        check(isinstance(value, Mapping | JudgedTask), where, value, "a table")
        about = value if isinstance(value, JudgedTask) else build(JudgedTask, value, where)
        task = name if about.task is None else about.task
        task = {"name": task} if isinstance(task, str) else task
        check(isinstance(task, Mapping) and "name" in task, f"{where}.task", task, "a name, or a table with a name")
        about = dataclasses.replace(about, task=dict(task))
        try:
            known = ["reward", *about.made.metric_names]
        except ValueError as error:
            raise ValueError(f"{where}: {error}") from None
        metric = about.metric or comparison.metric
        if metric not in known:
            raise unknown(f"metric of {where}:", metric, known)
        alone = len(points_of({"task": about.task, "agent": about.agent}, None)) == 1 and not has_range(about.agent)
        check(alone, f"{where}.agent", about.agent, "without lists or ranges: what is to be tuned belongs to methods")
        yield name, about


def _methods(given: Any, tasks: Mapping[str, JudgedTask]) -> Iterator[tuple[str, dict[str, Any]]]:
    """The methods of a comparison by name, each as changes to a task's learner."""
    if isinstance(given, list | tuple):
        check(all(isinstance(name, str) for name in given), "methods", given, "a list of names, or a table of them")
        given = {name: name for name in given}
    check(isinstance(given, Mapping) and given, "methods", given, "at least one method")
    for name, value in given.items():
        where = f"methods.{name}"
        if isinstance(value, str):
            value = changes_named(value, "method" if name == value else f"{where}: method")
        check(isinstance(value, Mapping), where, value, "a table of settings, or the name of an estimator or preset")
        own = value.get("tasks", list(tasks))
        check(isinstance(own, list | tuple) and own, f"{where}.tasks", own, "a list of at least one of the tasks")
        for task in own:
            choice(f"{where}.tasks", task, tasks)
        yield name, dict(value)
