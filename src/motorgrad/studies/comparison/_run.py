"""How a comparison runs: a pilot where the budget is in seconds, the study that tunes, the study that judges.

comparison.toml   the comparison
pilot/            the folder of a study: how many decisions a second of the processor makes, for a budget in seconds
tuning/           the folder of the study that chooses settings
judging/          the folder of the study that is reported
tables/*.csv      the results
index.html        the page
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import tomli_w

from motorgrad._arguments import check_arguments
from motorgrad._files import check_writable, write_atomically
from motorgrad.studies._driver import run_study
from motorgrad.studies._folder import check_folder, locked
from motorgrad.studies._study import Study
from motorgrad.studies.comparison._comparison import MEASURES, Comparison
from motorgrad.studies.comparison._page import write_page
from motorgrad.studies.comparison._results import PILOT, ComparisonResults

FILE = "comparison.toml"


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


def run_comparison(comparison: Comparison, out: Path | str, **options: Any) -> ComparisonResults:
    """Run a comparison in a folder, or continue it there.

    **Arguments:** `options`: as in `run_study`. They have no effect on any number, but for those that are measured in
    seconds. `trust` is for what the folder holds, too: tasks in it that import modules.

    **Returns** the `ComparisonResults` so far. Ctrl-C or SIGTERM lets every job save what it has; the same call then
    continues.

    **Raises** before any work starts: `ValueError` for impossible settings, `RunDirectoryError` for a folder that
    cannot be used, and `NotTrusted` for tasks that import what neither this comparison nor this process has imported.
    """
    path = Path(out)
    check_writable("out", path, folder=True)
    comparison.check()
    trust = bool(options.get("trust", False))
    file = path / FILE
    described = comparison.as_table()
    stored = Comparison.read(file, trust=trust).as_table() if file.is_file() else None
    check_folder(path, FILE, "comparison", described, stored)
    with locked(path, "comparison"):
        write_atomically(file, tomli_w.dumps(described).encode())
        for name, study in _stages(comparison, path, trust):
            write_page(ComparisonResults(comparison, path, trust), running=name)
            stage = run_study(study, path / name, **options)
            if not stage.complete and not stage.failures:  # it was asked to stop
                break
        results = ComparisonResults(comparison, path, trust)
        results.write_tables()
        write_page(results)
    return results


def _stages(comparison: Comparison, path: Path, trust: bool) -> Iterator[tuple[str, Study]]:
    """The studies of a comparison, each made when those before it are done."""
    if comparison.seconds is not None:
        cases = [comparison.first_case(*pair, PILOT) for pair in comparison.pairs]
        pilot = Study(cases=cases, seeds=tuple(comparison.seeds.tuning), lanes=comparison.lanes)
        yield "pilot", pilot
    yield "tuning", comparison.tuning(ComparisonResults(comparison, path, trust).steps)
    chosen = ComparisonResults(comparison, path, trust).judged_cases()
    yield "judging", comparison.study(chosen, comparison.seeds.judging, MEASURES)
