"""Where jobs run: in this process, or in processes of this machine.

An `Executor` has three doors: `submit` a job, `wait` until some are done, `close`. What is submitted is a future, whose
`result()` is the job's `Outcome`. The driver decides everything else.
"""

import abc
import multiprocessing
import os
import signal
import threading
from collections.abc import Collection
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.connection import wait as wait_for
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, ClassVar, Protocol

from motorgrad._errors import check_integer
from motorgrad._processes import SAFE, environment
from motorgrad._signals import STOPS
from motorgrad.studies._jobs import AnyJob, Outcome, Work, work


class Pending(Protocol):
    """The future of a job."""

    def done(self) -> bool: ...
    def result(self) -> Outcome: ...


class Executor(abc.ABC):
    """Where jobs run. An executor receives the folder of the study, the number of workers (0 for its own choice),
    information for the jobs, and its own options.

    - `itself`: whether jobs run in the process of the driver.
    - `needs`: the arguments of `require` before a job runs there, where that takes an extra.
    """

    itself: bool = False
    needs: ClassVar[tuple[str, ...]] = ()

    @abc.abstractmethod
    def __init__(self, folder: Path, workers: int, job_settings: Work, **options: object): ...

    @property
    def workers(self) -> int:
        """The number of jobs in flight."""
        return 1

    @abc.abstractmethod
    def submit(self, job: AnyJob, path: Path) -> Pending:
        """Begin a job in its run directory. Returns a future."""

    def has_died(self, error: BaseException) -> bool:
        """Whether the error of a future tells that the job's process or machine has died, for which the job is not to
        blame."""
        return False

    def wait(self, flying: Collection[Any], seconds: float) -> set[Any]:
        """The futures that are done, after at most this number of seconds."""
        return set(wait(flying, seconds, FIRST_COMPLETED).done)

    def stop(self) -> None:
        """Ask all jobs to save their progress and to end. Jobs of this process receive the request with it."""
        return

    def close(self) -> None:
        """Release everything. Jobs that are still in flight are abandoned."""
        return


class Here(Executor):
    """This process, one job after the other. It alone receives the requests to stop."""

    itself = True

    def __init__(self, folder: Path, workers: int, job_settings: Work):
        check_integer("workers", workers, 0, 1)
        self._job_settings = job_settings

    def submit(self, job: AnyJob, path: Path) -> "Future[Outcome]":
        future: Future[Outcome] = Future()
        try:
            future.set_result(work(job, path, self._job_settings))
        except (Exception, KeyboardInterrupt) as error:
            future.set_exception(error)
        return future


class Processes(Executor):
    """Processes of this machine, by default one for each processor; each has its share of the threads.

    Every process has a pool of its own, so that the others do not notice when one is killed.
    """

    def __init__(self, folder: Path, workers: int, job_settings: Work):
        check_integer("workers", workers, 0, 4096)
        cores = processors()
        self._workers = workers or cores
        self._job_settings = job_settings._replace(threads=job_settings.threads or max(1, cores // self._workers))
        self._free: list[ProcessPoolExecutor] = []
        self._busy: dict[Future[Any], ProcessPoolExecutor] = {}

    @property
    def workers(self) -> int:
        return self._workers

    def has_died(self, error: BaseException) -> bool:
        return isinstance(error, BrokenProcessPool)

    def submit(self, job: AnyJob, path: Path) -> "Future[Outcome]":
        context = multiprocessing.get_context("spawn")
        pool = self._free.pop() if self._free else ProcessPoolExecutor(1, context, _begin)
        settings = process_settings(self._job_settings.threads)
        with environment(settings):  # of the process, which starts with its first job
            future = pool.submit(work, job, path, self._job_settings)
        self._busy[future] = pool
        return future

    def wait(self, flying: Collection[Any], seconds: float) -> set[Any]:
        done = super().wait(flying, seconds)
        for future in done & self._busy.keys():
            pool = self._busy.pop(future)
            if isinstance(future.exception(), BrokenProcessPool):
                pool.shutdown(wait=False)
            else:
                self._free.append(pool)
        return done

    def stop(self) -> None:
        for pool in self._busy.values():
            for process in _processes_of(pool):
                process.terminate()

    def close(self) -> None:
        processes = [process for pool in (*self._free, *self._busy.values()) for process in _processes_of(pool)]
        for pool in self._busy.values():  # a second request interrupts at once; what is saved stays
            for process in _processes_of(pool):
                process.kill()
        for pool in (*self._free, *self._busy.values()):
            pool.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            process.join()


def _processes_of(pool: ProcessPoolExecutor) -> list[BaseProcess]:
    return list((pool._processes or {}).values())


def processors() -> int:
    """The processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def process_settings(threads: int) -> dict[str, str]:
    """Environment variables for a process with this number of threads, whose modules are not those of the working
    folder. They must be set before it starts."""
    return {"NPROC": str(threads), "OMP_NUM_THREADS": str(threads), **SAFE}


def _begin() -> None:
    """Prepare a process: Ctrl-C and SIGTERM matter only to its jobs, and it ends when the driver is killed."""
    if hasattr(os, "setpgid"):
        os.setpgid(0, 0)  # Ctrl-C at a terminal reaches the driver alone, whose request is then the first that jobs get
    for number in STOPS:
        signal.signal(number, signal.SIG_IGN)
    driver = multiprocessing.parent_process()
    assert driver is not None

    def watch() -> None:
        wait_for([driver.sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
