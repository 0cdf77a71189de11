"""Reproduce many experiments: each is a job of the driver of studies."""

import dataclasses
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from motorgrad._errors import counted
from motorgrad._files import check_writable
from motorgrad._signals import interrupt
from motorgrad.studies import JobFolder, On, Outcome, Work, drive
from motorgrad_thesis._experiment import Experiment
from motorgrad_thesis._registry import EXPERIMENTS
from motorgrad_thesis._report import write_report
from motorgrad_thesis._reproduce import Reproduction, check_settings, reproduce


class Reproductions(NamedTuple):
    """What `reproduce_all` has done.

    - `done`: the reproductions, in the order of the experiments.
    - `failures`: of the experiments that were set aside: `job`, `attempts`, `message`, `traceback`.
    - `report`: the page on everything in the folder.
    - `complete`: whether every experiment was reproduced.
    """

    done: list[Reproduction]
    failures: list[dict[str, Any]]
    report: Path
    complete: bool


def reproduce_all(
    experiments: Sequence[Experiment],
    out: Path | str = "runs/reproduce",
    *,
    quick: bool = False,
    films: bool = False,
    on: On = "here",
    workers: int = 0,
    threads: int = 0,
    attempts: int = 3,
    imports: tuple[str, ...] = (),
    progress: bool = True,
    options: Mapping[str, Any] | None = None,
) -> Reproductions:
    """Reproduce experiments on one machine or many, and write the report.

    An experiment that fails is tried again, after the others, and then set aside with its reason. One whose process or
    machine is killed goes on with its finished parts. Experiments that train the same share the run: the second waits.

    **Arguments:** `experiments`, with their settings; `out`, `quick` and `films` as in `reproduce`; the others as in
    `motorgrad.studies.run_study`. They have no effect on any number.

    **Returns** the reproductions and the failures.

    **Raises** `ValueError`, before any work, if the folder holds one of the experiments with other settings. After
    Ctrl-C or SIGTERM, once all is saved, `KeyboardInterrupt`, whose `results` are those so far; calling it again
    resumes.
    """
    check_writable("out", Path(out), folder=True)
    here = progress and on == "here"  # jobs that follow one another tell of themselves
    said = [f"{number} of {len(experiments)}" if here else "" for number in range(1, len(experiments) + 1)]
    jobs = [_Job(each, quick, films, words) for each, words in zip(experiments, said, strict=True)]
    folder = _Folder(Path(out), jobs)
    for job in jobs:
        check_settings(job.experiment, folder.place(job))
    drive(
        folder,
        Work(threads, imports=tuple(imports)),
        lambda learned: folder.report(),
        on=on,
        workers=workers,
        attempts=attempts,
        progress=progress and not here,
        options=options,
    )
    done = [folder.done[job.name] for job in jobs if folder.is_done(job)]
    names = {job.name for job in jobs}
    failures = [failure for failure in folder.failures() if failure["job"] in names]
    results = Reproductions(done, failures, folder.path / "report.html", len(done) == len(jobs))
    if results.complete or failures:
        return results
    message = f"stopped after {len(done):,} of {counted(len(jobs), 'experiment')}, saved in {folder.path}"
    raise interrupt(f"{message}; the same call continues", results=results)


@dataclasses.dataclass(frozen=True)
class _Job:
    """An experiment to reproduce. `said`: its number, if the job shows progress itself."""

    experiment: Experiment
    quick: bool
    films: bool
    said: str = ""

    @property
    def name(self) -> str:
        return self.experiment.name

    def do(self, path: Path, job_settings: Work) -> Outcome:
        if self.said:
            print(f"{self.name}: {self.experiment.title} ({self.said})", file=sys.stderr)
        how: dict[str, Any] = {"quick": self.quick, "films": self.films, "threads": job_settings.threads}
        try:
            return Outcome(reproduce(self.experiment, path.parent, progress=bool(self.said), **how))
        except KeyboardInterrupt:
            return Outcome(None)


class _Folder(JobFolder):
    """The folder of reproductions. Every experiment has a lock of its own, so that it may have several drivers."""

    noun = "reproduce"
    counted = "experiments"

    def __init__(self, path: Path, jobs: list[_Job]):
        super().__init__(path)
        self._jobs = jobs
        self.done: dict[str, Reproduction] = {}

    @property
    def jobs(self) -> list[_Job]:
        return self._jobs

    def place(self, job: _Job) -> Path:
        return self.path / job.name

    def saved(self, job: _Job) -> int:
        """The parts of the experiment that are finished."""
        return sum(1 for _ in self.place(job).glob("parts/*.npz"))

    def add(self, job: _Job, result: Reproduction) -> None:
        self.done[job.name] = result

    def is_done(self, job: _Job) -> bool:
        """Whether the experiment was reproduced in this session; what is stored is soon drawn again."""
        return job.name in self.done

    def report(self) -> None:
        self.path.mkdir(parents=True, exist_ok=True)
        write_report(self.path, EXPERIMENTS)
