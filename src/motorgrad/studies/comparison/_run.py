"""How a comparison runs: a pilot where the budget is in seconds, the study that tunes, the study that judges.

comparison.toml   the comparison
pilot/            the folder of a study: how many decisions a second of the processor makes, for a budget in seconds
tuning/           the folder of the study that chooses settings
judging/          the folder of the study that is reported
tables/*.csv      the results
index.html        the page
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import tomli_w

from motorgrad._files import check_writable, write_atomically
from motorgrad.studies._driver import run_study
from motorgrad.studies._folder import check_folder, locked
from motorgrad.studies._study import Study
from motorgrad.studies.comparison._page import write_page
from motorgrad.studies.comparison._plan import MEASURES, ComparisonPlan
from motorgrad.studies.comparison._results import ComparisonResults
from motorgrad.studies.comparison._scores import PILOT

FILE = "comparison.toml"


def run_comparison(comparison: ComparisonPlan, out: Path | str, **options: Any) -> ComparisonResults:
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
    stored = comparison.read(file, trust=trust).as_table() if file.is_file() else None
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


def _stages(comparison: ComparisonPlan, path: Path, trust: bool) -> Iterator[tuple[str, Study]]:
    """The studies of a comparison, each made when those before it are done."""
    if comparison.seconds is not None:
        cases = [comparison.first_case(*pair, PILOT) for pair in comparison.pairs]
        pilot = Study(cases=cases, seeds=tuple(comparison.seeds.tuning), lanes=comparison.lanes)
        yield "pilot", pilot
    yield "tuning", comparison.tuning(ComparisonResults(comparison, path, trust).steps)
    chosen = ComparisonResults(comparison, path, trust).judged_cases()
    yield "judging", comparison.study(chosen, comparison.seeds.judging, MEASURES)
