"""`motorgrad compare STUDY`: compare methods on one machine or many."""

import dataclasses
import math
import sys
from typing import ClassVar

from motorgrad._errors import counted, plain
from motorgrad._signals import unfinished
from motorgrad.options import finite_table, listed_failures, parse, print_outcome, print_place, write_json
from motorgrad.options.executors import StudyFile
from motorgrad.studies import Comparison, ComparisonResults


@dataclasses.dataclass(frozen=True)
class Compare(StudyFile):
    """Compare methods: the tasks × methods × settings × seeds of a TOML file. Some seeds choose the settings of every
    method; others judge it. The same command continues a comparison that was stopped or killed."""

    file_in_folder: ClassVar[str] = "comparison.toml"

    @property
    def kind(self) -> type[Comparison]:
        return Comparison

    @property
    def size(self) -> str:
        settings = sum(len(self.made.settings(*pair)) for pair in self.made.pairs)
        tune = len(self.made.seeds.tuning)
        judge = len(self.made.seeds.judging)
        tuned = f"{counted(settings, 'setting')} × {counted(tune, 'seed')} to tune"
        tried = f"{tuned}, {len(self.made.pairs):,} × {counted(judge, 'seed')} to judge"
        return f"{len(self.made.methods)} methods on {len(self.made.tasks)} tasks: {tried}"


def run(arguments: list[str]) -> int:
    options = parse(Compare, arguments, "compare")
    print(options.size, file=sys.stderr)
    results = unfinished("results", lambda: options.made.run(options.folder, **options.options))
    if str(options.json) != "-":
        _print(results)
    failures = listed_failures(results.failures)
    write_json(
        options.json,
        {
            "path": str(results.path),
            "complete": results.complete,
            "ranking": [finite_table(row) for row in results.ranking],
            "failures": failures,
        },
    )
    return 0 if results.complete else 1 if failures else 130


def _print(results: ComparisonResults) -> None:
    ranking = results.ranking
    print_outcome(results)
    if ranking:
        print("interquartile means of normalized scores over all tasks, with settings tuned for each:")
    for row in ranking:
        known = not math.isnan(row["value"])
        value = f"{row['value']:.4g} [{row['low']:.4g} … {row['high']:.4g}]" if known else "unknown"
        broken = f" ({row['broken']} of {counted(row['runs'], 'run')} not finite: last)" if row["broken"] else ""
        print(f"  {value}: {plain(row['method'])}{broken}")
    print_place(results, f"; its page is {results.path / 'index.html'}, its tables are in tables/", "comparison")
