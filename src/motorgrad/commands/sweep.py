"""`motorgrad sweep STUDY`: run a study on one machine or many."""

import dataclasses
import sys
from typing import Any

from motorgrad._errors import counted, plain
from motorgrad._extras import require
from motorgrad._files import read_toml
from motorgrad._signals import unfinished
from motorgrad.options import finite_table, listed_failures, parse, print_outcome, print_place, write_json
from motorgrad.options.executors import StudyFile
from motorgrad.schema import static
from motorgrad.studies import Best, Results, Search, SearchResults, Study, broken_text, settings_text

Ranking = list[tuple[dict[str, Any], list[Best]]]


@dataclasses.dataclass(frozen=True)
class Sweep(StudyFile):
    """Run a study: the tasks × settings × seeds of a TOML file. A list in its tables task and agent is a grid.
    Seeds and numbers of the learner are trained side by side in one compiled call; other settings become separate jobs.
    The same command continues a study that was stopped or killed. Failing jobs are tried again, then set aside."""

    metric: str = static(
        "reward", help="The metric that ranks the settings, here and on the page index.html of the folder"
    )

    def validate(self) -> None:
        super().validate()
        if isinstance(self.made, Search):
            require(*Search.needs)

    @property
    def kind(self) -> type[Study | Search]:
        return Search if "search" in read_toml(self.file) else Study

    @property
    def size(self) -> str:
        study = self.made.study if isinstance(self.made, Search) else self.made
        seeds = f"{counted(len(study.seed_list), 'seed')} × {counted(study.steps, 'decision')}"
        if isinstance(self.made, Search):
            return f"a search of {counted(self.made.trials, 'trial')}, {self.made.batch:,} at a time, × {seeds}"
        return f"{counted(len(study.points), 'setting')} × {seeds} in {counted(len(study.jobs), 'compiled call')}"


def run(arguments: list[str]) -> int:
    options = parse(Sweep, arguments, "sweep")
    print(options.size, file=sys.stderr)
    if isinstance(options.made, Search):
        results = unfinished("results", lambda: options.made.run(options.folder, **options.options))
        metric = options.made.metric
        best: Ranking = [({}, results.best())]
    else:
        metric = options.metric
        results = unfinished("results", lambda: options.made.run(options.folder, metric=metric, **options.options))
        known = metric in results.metrics
        best = [(task, results.best(metric, where=task)) for task in results.tasks] if known else []
    if str(options.json) != "-":
        _print(results, metric, best)
    write_json(options.json, _record(results, metric, best))
    return 0 if results.complete else 1 if results.failures else 130


def _print(results: Results | SearchResults, metric: str, best: Ranking) -> None:
    print_outcome(results)
    for task, table in best:
        if table:
            print(plain(f"the best by {metric}{f' of {settings_text(task)}' if task else ''}:"))
        for each in table:
            broken = f" ({counted(each.broken, 'seed')} not finite)" if each.broken else ""
            print(f"  {each.value.words()}: {plain(settings_text(each.settings, task))}{broken}")
    for stage in results.rounds if isinstance(results, SearchResults) else [results]:
        if said := broken_text(stage).strip():
            print(f"{stage.path.parent.name + ': ' if isinstance(results, SearchResults) else ''}{said}")
    page = "" if isinstance(results, SearchResults) else f"; its page is {results.path / 'index.html'}"
    print_place(results, page, "study")


def _record(results: Results | SearchResults, metric: str, best: Ranking) -> dict[str, Any]:
    listed = [
        {
            "point": each.point,
            "settings": each.settings,
            "value": finite_table(dataclasses.asdict(each.value)),
            "broken": each.broken,
        }
        for _, table in best
        for each in table
    ]
    about = {"path": str(results.path), "complete": results.complete, "metric": metric}
    return {**about, "best": listed, "failures": listed_failures(results.failures)}
