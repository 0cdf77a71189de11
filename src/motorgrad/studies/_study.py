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

    **Arguments:**

    - `task`: the name of a task, a table with its `name` and settings, or a list of these.
    - `agent`: changes to the task's own learner, as in `agent_for`; or a list of such tables. A list of numbers or
      names is a grid; a setting that takes a list itself is a list of lists.
    - `steps`: decisions per seed.
    - `seeds`: their number (0, 1, 2 …), or a list of them.
    - `window`: decisions per record of the metrics, by default a fiftieth of the steps.
    - `lanes`: the most settings × seeds of one compiled call. Another number may change the last bits of results.
    - `design`: how ranges are drawn. With it, a table `{"low": 1e-4, "high": 1e-1, "scale": "log"}` is a range; without
      a `scale` it is linear.
    - `cases`: instead of `task` and `agent`, a list of tables with a `task`, an `agent` and, if they have their own,
      `steps` and `window`: settings that belong to some tasks only. What occurs in several cases learns once.
    - `measures`: what the table has of every metric beside its mean over the last tenth of the records, while learning:
      `"online"`, the mean over all records, as `NAME_online`; `"frozen"` and `"frozen-mode"`, the mean without learning
      at the end, with actions drawn or the most probable ones (`evaluate`), as `NAME_frozen` and `NAME_frozen_mode`.
    - `evaluate`: decisions per seed without learning, by default 2,000.

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
