"""Jobs of Slurm, through submitit."""

import time
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from motorgrad._errors import check, check_integer
from motorgrad._extras import require
from motorgrad._processes import environment
from motorgrad.studies._executors import Executor, process_settings
from motorgrad.studies._jobs import AnyJob, Outcome, Work, parcel, work_parcel

AT_ONCE = 64  # jobs in Slurm's queue, unless more are asked for
POLL = 0.2  # seconds between two looks at the results


class Slurm(Executor):
    """Jobs of Slurm. The folder of the study must be on a file system that all nodes share; logs are in its `slurm/`.

    A job that Slurm stops because its time is over, or preempts, is submitted again by submitit and continues.

    **Arguments:**

    - `cluster`: `"slurm"`; or `"local"`, processes of this machine, to try a study out.
    - `parameters`: parameters of the jobs: submitit's own, such as `timeout_min`, `mem_gb` and `cpus_per_task`, and
      Slurm's, such as `partition`, `account` and `qos`.

    **Raises** `RuntimeError` without the package, and where there is no Slurm; `ValueError` for unknown parameters.
    """

    needs = ("running jobs on Slurm needs", "submitit", "slurm")

    def __init__(
        self,
        folder: Path,
        workers: int,
        job_settings: Work,
        cluster: str = "slurm",
        parameters: Mapping[str, Any] | None = None,
    ):
        require(*self.needs)
        import submitit  # type: ignore[import-not-found]
        from submitit.core import utils  # type: ignore[import-not-found]

        check_integer("workers", workers, 0, 100_000)
        check(cluster in ("slurm", "local"), "cluster", cluster, "'slurm' or 'local'")
        self._workers = workers or AT_ONCE
        self._errors = utils
        self._job_settings = job_settings._replace(
            threads=job_settings.threads or int((parameters or {}).get("cpus_per_task", 1))
        )
        known = submitit.AutoExecutor._typed_parameters()
        given = {name if name in known else f"slurm_{name}": value for name, value in (parameters or {}).items()}
        exports = [f"export {name}={value}" for name, value in process_settings(self._job_settings.threads).items()]
        given["slurm_setup"] = [*exports, *given.get("slurm_setup", ())]
        try:
            self.executor = submitit.AutoExecutor(folder=folder.absolute() / "slurm", cluster=cluster)
            self.executor.update_parameters(
                **({"name": "motorgrad", "cpus_per_task": self._job_settings.threads, "timeout_min": 24 * 60} | given)
            )
        except (NameError, AssertionError) as error:
            raise ValueError(f"slurm: {error}") from None
        self._jobs: set[Any] = set()

    @property
    def workers(self) -> int:
        return self._workers

    def has_died(self, error: BaseException) -> bool:
        died, raised = self._errors.UncompletedJobError, self._errors.FailedJobError
        return isinstance(error, died) and not isinstance(error, raised)

    def submit(self, job: AnyJob, path: Path) -> Any:
        with environment(process_settings(self._job_settings.threads)):
            submitted = self.executor.submit(ResumableWork(), *parcel(job, path.absolute(), self._job_settings))
        self._jobs.add(submitted)
        return submitted

    def wait(self, flying: Collection[Any], seconds: float) -> set[Any]:
        end = time.monotonic() + seconds
        while not (done := {job for job in flying if job.done()}) and time.monotonic() < end:
            time.sleep(POLL)
        self._jobs -= done
        return done

    def stop(self) -> None:
        for job in self._jobs:
            job.cancel(check=False)  # a SIGTERM, on which a job saves what it has


class ResumableWork:
    """`work_parcel` in the form for submitit: if Slurm stops a job, `checkpoint` submits the same job again."""

    def __call__(self, *arguments: Any) -> Outcome:
        return work_parcel(*arguments)

    def checkpoint(self, *arguments: Any) -> Any:
        import submitit  # type: ignore[import-not-found]

        return submitit.helpers.DelayedSubmission(self, *arguments)
