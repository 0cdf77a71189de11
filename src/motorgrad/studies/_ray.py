"""Jobs as tasks of Ray, on this machine or on a cluster."""

import logging
import os
import time
import warnings
from pathlib import Path
from typing import Any

from motorgrad._errors import check_integer
from motorgrad._extras import require
from motorgrad.studies._jobs import AnyJob, Work, work
from motorgrad.studies._places import Place, processors, thread_settings

AHEAD = 2  # jobs in flight for each that fits, so that a node need not wait for the driver


class Ray(Place):
    """Tasks of Ray. By default Ray is started on this machine alone.

    Each job takes `threads` processors, by default one. The folder of the study must be the same on all nodes, on a
    shared file system. What Ray started here ends with the study.

    **Arguments:** `address`: of a cluster, such as `"auto"` on one of its nodes, or `"ray://HOST:10001"`.

    **Raises** `RuntimeError` without the package.
    """

    needs = ("running jobs on Ray needs", "ray", "ray")

    def __init__(self, folder: Path, workers: int, told: Work, address: str = ""):
        require(*self.needs)
        import ray  # type: ignore[import-not-found]
        from ray import exceptions as errors  # type: ignore[import-not-found]

        check_integer("workers", workers, 0, 1_000_000)
        self._ray, self._ours = ray, not ray.is_initialized()
        if self._ours:
            local = {"num_cpus": max(workers, processors()), "include_dashboard": False} if not address else {}
            with warnings.catch_warnings():  # Ray forks, and executes a program at once
                warnings.filterwarnings("ignore", message="os.fork", category=RuntimeWarning)
                ray.init(address=address or "local", log_to_driver=False, logging_level=logging.WARNING, **local)
        self._deaths = (
            errors.WorkerCrashedError,
            errors.NodeDiedError,
            errors.LocalRayletDiedError,
            errors.OutOfMemoryError,
            errors.ObjectLostError,
        )
        self._told = told._replace(threads=told.threads or 1)
        self._most, self._fit, self._asked = workers, 0, -1.0
        environment = thread_settings(self._told.threads)
        if told.imports:  # modules of the working folder, which may be shared as the study's folder is
            environment["PYTHONPATH"] = os.pathsep.join(filter(None, [os.getcwd(), os.environ.get("PYTHONPATH")]))
        # the driver knows better than Ray whether to try a job again
        self._task: Any = ray.remote(work).options(
            num_cpus=self._told.threads, max_retries=0, runtime_env={"env_vars": environment}
        )
        self._references: dict[Any, Any] = {}

    @property
    def workers(self) -> int:
        """Twice the number of jobs for which the cluster, which may grow and shrink, has room."""
        now = time.monotonic()
        if now > self._asked + 1.0:
            self._fit, self._asked = int(self._ray.cluster_resources().get("CPU", 0) // self._told.threads), now
        return min(self._most or AHEAD * self._fit, AHEAD * self._fit)

    def has_died(self, error: BaseException) -> bool:
        return isinstance(error, self._deaths)

    def submit(self, job: AnyJob, path: Path) -> Any:
        reference = self._task.remote(job, path.absolute(), self._told)
        future = reference.future()
        self._references[future] = reference
        return future

    def wait(self, flying: Any, seconds: float) -> set[Any]:
        done = super().wait(flying, seconds)
        for future in done:
            del self._references[future]
        return done

    def stop(self) -> None:
        for reference in self._references.values():
            self._ray.cancel(reference, force=False)  # a SIGINT, on which a job saves what it has

    def close(self) -> None:
        if self._ours:
            self._ray.shutdown()
