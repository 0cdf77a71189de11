"""A comparison: its plan, and how it runs in a folder."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from motorgrad._arguments import check_arguments
from motorgrad.studies._driver import whole
from motorgrad.studies.comparison._plan import ComparisonPlan
from motorgrad.studies.comparison._results import ComparisonResults
from motorgrad.studies.comparison._run import run_comparison


@dataclasses.dataclass(frozen=True)
class Comparison(ComparisonPlan):
    """Methods compared on tasks. Every method's settings are chosen on some seeds and judged on others.

    **Raises** `ValueError` that names the setting, and the nearest known one, before any work.

    ```python
    comparison = mg.Comparison(
        tasks=["three-state", "call-admission"],
        methods={"OLGARB": {"estimator": "olgarb"}, "OLPOMDP": {"estimator": "olpomdp"}},
        agent={"learning_rate": [0.01, 0.1]},
        metric="reward",
        steps=5_000,
        seeds={"tune": 4, "judge": 16},
    )
    ```
    """

    def run(self, out: Path | str, **options: Any) -> ComparisonResults:
        """Run the comparison in a folder, or continue it there. `options` as in `run_study`.

        **Raises** as `Study.run`.
        """
        return whole(run_comparison(self, out, **options))

    @staticmethod
    def load(path: Path | str, *, trust: bool = False) -> ComparisonResults:
        """The `ComparisonResults` in a folder so far. `trust` as in `read`."""
        return ComparisonResults.load(path, trust=trust)


ComparisonResults.kind = Comparison


def compare(
    tasks: Any,
    methods: Any,
    metric: str = "reward",
    *,
    out: Path | str,
    steps: int | None = None,
    seconds: float | None = None,
    seeds: Any = None,
    run: Mapping[str, Any] | None = None,
    **settings: Any,
) -> ComparisonResults:
    """Compare methods on tasks: choose the settings of each on some seeds, and judge it on others.

    **Arguments:**

    - `out`: the folder. A comparison that is found there unfinished continues.
    - `seeds`: a table with `tune` and `judge`, by default 4 and 16.
    - `run`: how and where jobs run, the options of `motorgrad.studies.run_study`, such as `{"on": "processes"}`.
    - the others: as in `Comparison`.

    **Returns** the `ComparisonResults`; its page is `index.html` of the folder.

    **Raises** as `Comparison` and `Comparison.run`.

    ```python
    found = mg.compare(
        ["three-state", "call-admission"],
        ["olgarb", "olpomdp"],
        agent={"learning_rate": [0.01, 0.1]},
        steps=2_000,
        out="runs/two",
        run={"progress": False},
    )
    print(found.summary.to_pylist()[0])
    ```
    """
    check_arguments(compare, locals(), ("metric", "out", "run"))
    seeds = {"tune": 4, "judge": 16} if seeds is None else seeds
    made = Comparison(tasks, methods, metric, seeds, steps=steps, seconds=seconds, **settings)
    return made.run(out, **(run or {}))
