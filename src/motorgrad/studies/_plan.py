"""The plan of a study: tasks × settings × seeds, as one table."""

import dataclasses
import functools
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, Self

from motorgrad import schema
from motorgrad._errors import check, check_integer, choice
from motorgrad._files import read_toml
from motorgrad.schema import Range, Settings, build, inner, static, table
from motorgrad.studies._grid import MAX_POINTS, Point, bounded, distinctions, draw, expand, frozen, has_range
from motorgrad.studies._partition import Job, Measure, partition
from motorgrad.tasks import TASKS
from motorgrad.training import MAX_STEPS, check_imports

DEFAULT_EVALUATE = 2000


@dataclasses.dataclass(frozen=True)
class Design(Settings):
    """How the ranges of a study are drawn."""

    kind: Literal["random", "sobol"] = static(
        help='`"random"`, independent and uniform draws; or `"sobol"`, a scrambled Sobol sequence, which fills '
        "the space more evenly (Owen, 1998)"
    )
    count: int = schema.count(
        low=1, high=MAX_POINTS, help="draws for each combination of the lists; for Sobol a power of two"
    )
    seed: int = schema.count(0, help="seed of the draws")

    def validate(self) -> None:
        right = self.kind != "sobol" or self.count & (self.count - 1) == 0
        check(right, "count", self.count, "a power of two for a Sobol sequence")


@dataclasses.dataclass(frozen=True)
class StudyPlan(Settings):
    """All that `Study` is but how it runs: the table, its settings and its jobs."""

    task: Any = static(None, help="the name of a task, a table with its `name` and settings, or a list of these")
    agent: Any = static(
        factory=dict,
        help="changes to the task's own learner, as in `agent_for`; or a list of such tables. A list of numbers or "
        "names is a grid; a setting that takes a list itself is a list of lists",
    )
    steps: int = schema.count(100_000, 1, MAX_STEPS, unit="decisions", help="length of each run")
    seeds: int | tuple[int, ...] = static(
        1, allowed=Range(0, 2**31 - 1, kind="int"), help="their number (0, 1, 2 …), or a list of them"
    )
    window: int | None = schema.count(
        None, 1, unit="decisions", help="per record of the metrics, by default a fiftieth of the steps"
    )
    lanes: int = schema.count(
        1024,
        1,
        1_000_000,
        help="the most settings × seeds of one compiled call. Another number may change the last bits of results",
    )
    design: Design | None = inner(
        None,
        help='how ranges are drawn. With it, a table `{"low": 1e-4, "high": 1e-1, "scale": "log"}` is a range; without '
        "a `scale` it is linear",
    )
    cases: Any = static(
        None,
        help="instead of `task` and `agent`, a list of tables with a `task`, an `agent` and, if they have their own, "
        "`steps` and `window`: settings that belong to some tasks only. What occurs in several cases learns once",
    )
    measures: tuple[Measure, ...] | None = static(
        None,
        help="what the table has of every metric beside its mean over the last tenth of the records, while learning: "
        '`"online"`, the mean over all records, as `NAME_online`; `"frozen"` and `"frozen-mode"`, the mean without '
        "learning at the end, with actions drawn or the most probable ones (`evaluate`), as `NAME_frozen` and "
        "`NAME_frozen_mode`",
    )
    evaluate: int | None = schema.count(
        None, 1, 10**9, unit="decisions", help="per seed without learning, by default 2,000"
    )

    def validate(self) -> None:
        if self.cases is not None:
            self._check_cases()
            return
        task = [{"name": each} if isinstance(each, str) else each for each in _listed(self.task)]
        wanted = "the name of a task, a table with its name, or a list of them"
        check(task and all(isinstance(each, Mapping) for each in task), "task", self.task, wanted)
        for each in task:
            check("name" in each, "task.name", each, "given")
            for name in _listed(each["name"]):
                choice("task", name, TASKS, registered=True)
        agent = _listed(self.agent)
        check(all(isinstance(each, Mapping) for each in agent), "agent", self.agent, "a table, or a list of tables")
        object.__setattr__(self, "task", task[0] if len(task) == 1 else task)
        object.__setattr__(self, "agent", agent[0] if len(agent) == 1 else agent)

    @classmethod
    def read(cls, path: Path | str, *, trust: bool = False) -> Self:
        """The study in a TOML file.

        **Arguments:** `trust`: whether its tasks may import modules that the file names.

        **Raises** `ValueError` that names the file and the setting, and `NotTrusted`.
        """
        values = {name: value for name, value in read_toml(Path(path)).items() if name != "search"}
        try:
            study = build(cls, values)
            for case in study.tables:
                for point in expand({"task": case["task"]}):
                    check_imports(point["task"], str(path), trust)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
        return study

    def as_table(self) -> dict[str, Any]:
        """The study as a plain table, as in its file."""
        return table(self)

    @property
    def tables(self) -> list[dict[str, Any]]:
        """The cases; without any, `task` and `agent` as a single one."""
        return [{"task": self.task, "agent": self.agent}] if self.cases is None else self.cases

    @functools.cached_property
    def points(self) -> list[Point]:
        """Every setting as a table of `task` and `agent`, in the order of the grid; later lists change faster."""
        if self.cases is None:
            return points_of(self.tables[0], self.design)
        # a design is for the cases that have ranges
        found = (p for case in self.cases for p in points_of(case, self.design if has_range(case["agent"]) else None))
        return list({frozen(point): point for point in bounded(found, "cases")}.values())

    @functools.cached_property
    def settings(self) -> list[dict[str, Any]]:
        """What distinguishes each point, by path, such as `{"task.name": "chain", "agent.learning_rate": 0.01}`."""
        return distinctions(self.points)

    @functools.cached_property
    def seed_list(self) -> list[int]:
        """The seeds."""
        return list(range(self.seeds)) if isinstance(self.seeds, int) else list(self.seeds)

    @functools.cached_property
    def jobs(self) -> list[Job]:
        """The compiled calls of the study, all checked.

        **Raises** `ValueError` that names the first impossible setting.
        """
        evaluate = DEFAULT_EVALUATE if self.evaluate is None else self.evaluate
        given = (self.steps, self.seeds, self.window, self.lanes)
        return partition(self.points, *given, self.measures or (), evaluate)

    def check(self) -> None:
        """Check every combination. **Raises** `ValueError` that names the first impossible setting."""
        _ = self.jobs

    def _check_cases(self) -> None:
        check(self.task is None and not self.agent, "task", self.task, "left out, as agent, where there are cases")
        right = isinstance(self.cases, list | tuple) and self.cases and all(isinstance(c, Mapping) for c in self.cases)
        check(right, "cases", self.cases, "a list of tables with a task, an agent and, where they differ, steps")
        for case in self.cases:
            for name in case:
                choice("setting of cases:", name, ("task", "agent", "steps", "window"))
            check(isinstance(case.get("agent", {}), Mapping), "cases.agent", case.get("agent"), "a table")
            for name in ("steps", "window"):
                check_integer(f"cases.{name}", case.get(name, 1), 1)
        made = [
            {**case, "task": StudyPlan(case.get("task")).task, "agent": dict(case.get("agent", {}))}
            for case in self.cases
        ]
        object.__setattr__(self, "cases", made)


def points_of(case: Mapping[str, Any], design: Design | None) -> list[Point]:
    """The settings of a case, or of a study without cases, in the order of the grid, with its ranges drawn."""
    if design is None:
        return expand(case)
    return draw(expand(case, ranges=True), design.kind, design.count, design.seed)


def _listed(value: object) -> list[Any]:
    """A list, or the one thing that is given instead of a list."""
    return list(value) if isinstance(value, list | tuple) else [value]
