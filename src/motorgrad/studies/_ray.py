"""Jobs as tasks of Ray, on this machine or on a cluster."""

import contextlib
import logging
import tempfile
import time
from collections.abc import Collection
from pathlib import Path
from typing import Any

from motorgrad._errors import check_integer
from motorgrad._extras import require
from motorgrad._processes import environment
from motorgrad.studies._executors import Executor, process_settings, processors
from motorgrad.studies._jobs import AnyJob, Work, parcel, work_parcel
from motorgrad.studies._ray_alone import ray_alone

AHEAD = 2  # jobs in flight for each that fits, so that a node need not wait for the driver


class Ray(Executor):
    """Tasks of Ray. By default Ray is started on this machine alone.

    Each job takes `threads` processors, by default one. The folder of the study must be the same on all nodes, on a
    shared file system. A cluster is used as it is.

    What is started here ends with the study. It listens to this machine alone, and to nobody without a token that is
    drawn for it; it has no dashboard, and reports nothing to Ray's makers.

    **Arguments:** `address`: of a cluster, such as `"auto"` on one of its nodes, or `"ray://HOST:10001"`.

    **Raises** `RuntimeError` without the package, or where it would listen to other machines.
    """

    needs = ("running jobs on Ray needs", "ray", "ray")

    def __init__(self, folder: Path, workers: int, job_settings: Work, address: str = ""):
        require(*self.needs)
        import ray  # type: ignore[import-not-found]
        from ray import exceptions as errors  # type: ignore[import-not-found]

        check_integer("workers", workers, 0, 1_000_000)
        self._ray = ray
        ours = not ray.is_initialized()
        self._started = contextlib.ExitStack()
        quiet = {"log_to_driver": False, "logging_level": logging.WARNING}
        # Ray's processes look for modules first in the working folder, unless they are given one of their own
        with tempfile.TemporaryDirectory() as empty:
            quiet["runtime_env"] = {"working_dir": empty}
            if ours and address:
                with environment():
                    ray.init(address, **quiet)
                self._started.callback(ray.shutdown)
            elif ours:
                self._started.enter_context(ray_alone(ray, max(workers, processors()), **quiet))
        self._deaths = (
            errors.WorkerCrashedError,
            errors.NodeDiedError,
            errors.LocalRayletDiedError,
            errors.OutOfMemoryError,
            errors.ObjectLostError,
        )
        self._job_settings = job_settings._replace(threads=job_settings.threads or 1)
        self._most = workers
        self._fit = 0
        self._asked = -1.0
        # the driver knows better than Ray whether to try a job again
        settings = {"env_vars": process_settings(self._job_settings.threads)}
        task = ray.remote(work_parcel)
        self._task: Any = task.options(num_cpus=self._job_settings.threads, max_retries=0, runtime_env=settings)
        self._references: dict[Any, Any] = {}

    @property
    def workers(self) -> int:
        """Twice the number of jobs for which the cluster, which may grow and shrink, has room."""
        now = time.monotonic()
        if now > self._asked + 1.0:
            self._fit = int(self._ray.cluster_resources().get("CPU", 0) // self._job_settings.threads)
            self._asked = now
        return min(self._most or AHEAD * self._fit, AHEAD * self._fit)

    def has_died(self, error: BaseException) -> bool:
        return isinstance(error, self._deaths)

    def submit(self, job: AnyJob, path: Path) -> Any:
        reference = self._task.remote(*parcel(job, path.absolute(), self._job_settings))
        future = reference.future()
        self._references[future] = reference
        return future

    def wait(self, flying: Collection[Any], seconds: float) -> set[Any]:
        done = super().wait(flying, seconds)
        for future in done:
            del self._references[future]
        return done

    def stop(self) -> None:
        for reference in self._references.values():
            self._ray.cancel(reference, force=False)  # a SIGINT, on which a job saves what it has

    def close(self) -> None:
        self._started.close()
