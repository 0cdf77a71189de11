"""The plan of a study: tasks × settings × seeds, as one table."""

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, Self

from motorgrad._errors import check, check_integer, choice
from motorgrad._files import read_toml
from motorgrad.schema import Settings, as_hinted, build, static, table
from motorgrad.studies._grid import Point, bounded, distinctions, draw, expand, frozen, has_range
from motorgrad.studies._partition import Job, Measure, partition
from motorgrad.tasks import TASKS
from motorgrad.training import check_imports

DEFAULT_LANES = 1024
DEFAULT_EVALUATE = 2000


@dataclasses.dataclass(frozen=True)
class Design(Settings):
    """How the ranges of a study are drawn."""

    kind: Literal["random", "sobol"] = static(
        help='`"random"`, independent and uniform draws; or `"sobol"`, a scrambled Sobol sequence, which fills '
        "the space more evenly (Owen, 1998)"
    )
    count: int = static(help="draws for each combination of the lists; for Sobol a power of two")
    seed: int = static(0, help="seed of the draws")

    def __post_init__(self) -> None:
        choice("design.kind", self.kind, ("random", "sobol"))
        check_integer("design.seed", self.seed, 0, 2**31 - 1)


@dataclasses.dataclass(frozen=True)
class StudyPlan(Settings):
    """All that `Study` is but how it runs: the table, its settings and its jobs."""

    task: Any = None
    agent: Any = dataclasses.field(default_factory=dict)
    steps: int = 100_000
    seeds: int | tuple[int, ...] = 1
    window: int | None = None
    lanes: int = DEFAULT_LANES
    design: Design | None = None
    cases: Any = None
    measures: tuple[Measure, ...] | None = None
    evaluate: int | None = None

    def __post_init__(self) -> None:
        hints = {"steps": int, "seeds": int | tuple[int, ...], "window": int | None, "lanes": int}
        hints |= {"measures": tuple[Measure, ...] | None, "evaluate": int | None}
        for name, hint in hints.items():
            value = getattr(self, name)
            value = tuple(value) if isinstance(value, Sequence) and not isinstance(value, str) else value
            object.__setattr__(self, name, as_hinted(hint, value, name))
        object.__setattr__(self, "design", as_hinted(Design | None, self.design, "design"))
        check_integer("lanes", self.lanes, 1, 1_000_000)
        if self.evaluate is not None:
            check_integer("evaluate", self.evaluate, 1, 10**9)
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
