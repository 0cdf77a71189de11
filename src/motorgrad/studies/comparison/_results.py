"""The results of a comparison: its scores with tables and figures of them."""

import functools
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pyarrow as pa

from motorgrad._errors import check, counted
from motorgrad._files import replacing
from motorgrad.studies.comparison._figures import standing_alone
from motorgrad.studies.comparison._plan import ComparisonPlan
from motorgrad.studies.comparison._scores import ComparisonScores
from motorgrad.studies.comparison._tables import tables_of


class ComparisonResults(ComparisonScores):
    """The results of a comparison so far. The comparison may still be running.

    Scores are normalized: 0 and 1 are the ends of each task's `scale`, and more is better.
    """

    kind: ClassVar[type[ComparisonPlan]] = ComparisonPlan
    """What reads `comparison.toml`: `Comparison`, which says so itself, as it stands above its results."""

    @staticmethod
    def load(path: Path | str, *, trust: bool = False) -> "ComparisonResults":
        """The results in the folder of a comparison. Reading takes no lock. `trust` as in `Comparison.read`."""
        return ComparisonResults(ComparisonResults.kind.read(Path(path) / "comparison.toml", trust=trust), path, trust)

    def __repr__(self) -> str:
        size = f"{counted(len(self.comparison.methods), 'method')} on {counted(len(self.comparison.tasks), 'task')}"
        return f"ComparisonResults({self.path}, {size}, {'complete' if self.complete else 'unfinished'})"

    @functools.cached_property
    def tables(self) -> dict[str, pa.Table]:
        """All tables by name, as far as the comparison has come. `docs/compare.md` has their columns."""
        return {name: pa.Table.from_pylist(rows) for name, rows in tables_of(self).items() if rows}

    @property
    def summary(self) -> pa.Table:
        """A row for every method, score, statistic and choice of settings: `method`, `chosen`, `scored`, `statistic`,
        `value`, `low`, `high`, `runs`, `broken`. The interval is a stratified bootstrap over the tasks; NaN where a
        method earned nothing on a task. `broken` counts the runs whose policy is not finite.

        **Raises** `ValueError` as long as no method is judged on all tasks.
        """
        check("summary" in self.tables, "methods", self.methods, "judged on all tasks, at least one, for a summary")
        return self.tables["summary"]

    @property
    def ranking(self) -> list[dict[str, Any]]:
        """The interquartile means by which methods are ranked, the best first: those rows of `summary` with settings
        tuned for each task, by the score that chooses. Methods with `broken` runs come last. Empty as long as no method
        is judged on all tasks."""
        wanted = {"chosen": "tuned", "scored": self.comparison.choose_by, "statistic": "interquartile mean"}
        rows = self.tables["summary"].to_pylist() if "summary" in self.tables else []
        rows = [row for row in rows if wanted.items() <= row.items()]
        return sorted(rows, key=lambda row: (row["broken"] > 0, np.isnan(row["value"]), -row["value"]))

    @property
    def figures(self) -> dict[str, str]:
        """The figures of the page by name, each as the text of an SVG file. Empty as long as no method is judged on all
        tasks."""
        return standing_alone(self.comparison, self.tables, self.ranking)

    def write_tables(self) -> None:
        """Write the tables as CSV files to `tables/` of the folder."""
        from pyarrow import csv

        (self.path / "tables").mkdir(exist_ok=True)
        for name, found in self.tables.items():
            with replacing(self.path / "tables" / f"{name}.csv") as file:
                csv.write_csv(found, file)
