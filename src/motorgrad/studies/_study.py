"""A study: its plan, and how it runs in a folder."""

import dataclasses
from pathlib import Path
from typing import Any

from motorgrad.studies._driver import run_study, whole
from motorgrad.studies._folder import StudyFolder
from motorgrad.studies._plan import StudyPlan
from motorgrad.studies._results import Results


@dataclasses.dataclass(frozen=True)
class Study(StudyPlan):
    """Tasks × settings × seeds. In every table a list is a grid.

    The study alone determines its `jobs`, each of which is one compiled call and one run directory: neither the
    number of workers nor a failure changes a number.

    **Raises** `ValueError` that names the setting, and the nearest known one, before any work.

    ```python
    study = mg.Study(task=["three-state", "chain"], agent={"learning_rate": [1e-3, 1e-2]}, steps=2_000, seeds=4)
    results = study.run("runs/study", progress=False)
    print(results.best("reward")[0].settings)
    ```
    """

    def run(self, out: Path | str, **options: Any) -> Results:
        """Run the study in a folder, or continue it there. Returns its `Results`. `run_study` has the options.

        **Raises** as `run_study`; and where it was asked to stop (Ctrl-C), once all is saved, `KeyboardInterrupt`,
        whose `results` are those so far.
        """
        return whole(run_study(self, out, **options))

    @staticmethod
    def load(path: Path | str, *, trust: bool = False) -> Results:
        """The `Results` in a study's folder, whether or not the study still runs. `trust` as in `read`."""
        return Results.load(path, trust=trust)


StudyFolder.kind = Study
