"""The driver of a study: keeps workers busy, retries failed jobs, and records what happens."""

import contextlib
import threading
import time
import traceback
from collections import Counter, deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Generic, Literal, Protocol, TypeVar

from motorgrad._consent import allowed
from motorgrad._errors import check, check_integer, choice
from motorgrad._files import check_writable
from motorgrad._progress import Progress
from motorgrad._signals import interrupt, stop_when_asked
from motorgrad.studies._executors import Executor, Here, Pending, Processes
from motorgrad.studies._folder import StudyFolder
from motorgrad.studies._jobs import JobFolder, JobKind, Work
from motorgrad.studies._page import write_page
from motorgrad.studies._plan import StudyPlan
from motorgrad.studies._ray import Ray
from motorgrad.studies._results import Results
from motorgrad.studies._slurm import Slurm
from motorgrad.training.store import reading_quietly

EXECUTORS: dict[str, type[Executor]] = {"here": Here, "processes": Processes, "ray": Ray, "slurm": Slurm}
"""Where jobs can run, by name."""

On = Literal["here", "processes", "ray", "slurm"]
"""Where jobs run: in this process, in processes of this machine, on Ray or on Slurm."""
ATTEMPTS = 3
KILLS = 20  # of the processes of one job, one after the other, until it counts as the job's fault
SHARE = 0.02  # of the time, for the index and the page
PAUSE = 2.0  # seconds between two writes of them, at least


class _InFolder(Protocol):
    """Results that a folder holds, of a study, a search or a comparison."""

    @property
    def path(self) -> Path: ...
    @property
    def complete(self) -> bool: ...
    @property
    def failures(self) -> list[dict[str, Any]]: ...


AnyResults = TypeVar("AnyResults", bound=_InFolder)


def run_study(
    study: StudyPlan,
    out: Path | str,
    *,
    on: On = "here",
    workers: int = 0,
    threads: int = 0,
    attempts: int = ATTEMPTS,
    checkpoint_every: float = 30.0,
    imports: tuple[str, ...] = (),
    trust: bool = False,
    progress: bool = True,
    metric: str = "reward",
    options: Mapping[str, Any] | None = None,
) -> Results:
    """Run a study in a folder, or continue it there.

    **Arguments:**

    - `out`: the folder. A study that is found there unfinished continues; jobs that failed before are tried again.
    - `on`: where jobs run: `"here"`, in this process; `"processes"` of this machine; tasks of `"ray"`, by default on
      this machine; jobs of `"slurm"`. The last two need `motorgrad[ray]` and `motorgrad[slurm]`.
    - `workers`: how many jobs run at the same time; 0 for as many as the executor has processors.
    - `threads`: threads of each job; 0 for all processors of this process, or for each worker's share of them.
    - `attempts`: how often a job that fails is tried before it is set aside and the others go on. A job whose process
      or machine dies has not failed; it continues from its last checkpoint.
    - `checkpoint_every`: seconds between two checkpoints of a job.
    - `imports`: modules that each worker imports first, as they register tasks or parts of learners.
    - `trust`: whether to run code that another process named in the folder: modules of tasks.
    - `progress`: whether to show progress.
    - `metric`: the metric by which the page `index.html` of the folder ranks settings.
    - `options`: of the executor: for Ray the `address` of a cluster; for Slurm `parameters` such as
      `{"partition": "cpu", "timeout_min": 120, "mem_gb": 4}`, and `cluster="local"` to try it out.

    None of these has an effect on any number.

    **Returns** the `Results`. Ctrl-C or SIGTERM lets every job save what it has; the same call then continues.

    **Raises** `ValueError` for impossible settings and `RunDirectoryError` for a folder that cannot be used, before any
    work starts.
    """
    check_writable("out", Path(out), folder=True)
    check(study.jobs, "study", study, "of at least one job")  # this makes the tasks, which imports their modules
    folder = StudyFolder(out, study, trust)

    def report(learned: float | None) -> None:
        folder.write_index()
        with reading_quietly():  # its warnings have been given, and other threads go on giving theirs
            write_page(folder, metric, learned)

    job_settings = Work(threads, checkpoint_every, tuple(imports), allowed())
    drive(folder, job_settings, report, on=on, workers=workers, attempts=attempts, progress=progress, options=options)
    return Results(folder)


def whole(results: AnyResults) -> AnyResults:
    """Results, if they are all that there can be. **Raises** `KeyboardInterrupt` where their computation was asked to
    stop: a script is not to go on with a part of them, unless it catches this."""
    if results.complete or results.failures:
        return results
    message = f"stopped; what was done is saved in {results.path}, and the same call continues"
    raise interrupt(message, results=results)


def drive(
    folder: JobFolder[JobKind, Any],
    job_settings: Work,
    report: Callable[[float | None], None],
    *,
    on: On = "here",
    workers: int = 0,
    attempts: int = ATTEMPTS,
    progress: bool = True,
    options: Mapping[str, Any] | None = None,
) -> bool:
    """Do the jobs of a folder that are not done. See `run_study` for the other arguments.

    **Arguments:** `job_settings`: information for every job; `report`: writes down how things stand, now and then and
    at the end, given the seconds of learning in this session, while it lasts.

    **Returns** whether it has come to its end, rather than been asked to stop.
    """
    choice("on", on, EXECUTORS)
    check_integer("attempts", attempts, 1)
    check_integer("threads", job_settings.threads, 0, 4096)
    with folder:
        driver = _Driver(folder, EXECUTORS[on](folder.path, workers, job_settings, **dict(options or {})), attempts)
        driver.run(progress, report)
    return not driver.stopping


class _Driver(Generic[JobKind]):
    """One session of a study."""

    def __init__(self, folder: JobFolder[JobKind, Any], executor: Executor, attempts: int):
        self.folder, self.executor, self.attempts = folder, executor, attempts
        self.jobs = folder.jobs
        self.waiting = deque(job for job in self.jobs if not folder.is_done(job))
        self.flying: dict[Pending, JobKind] = {}
        self.failed = Counter[str]()
        self.killed = Counter[str]()
        self.saved: dict[str, int] = {}
        self.learned = 0.0
        self.stopping = False

    def run(self, progress: bool, report: Callable[[float | None], None]) -> None:
        done = len(self.jobs) - len(self.waiting)
        for job in self.waiting:
            self.folder.forgive(job)
        reporter = _Reporter(self, report)
        reporter.start()
        try:
            with (
                stop_when_asked() as stopped,
                Progress(self.folder.noun, self.folder.counted, len(self.jobs), done, progress) as shown,
            ):
                while self.flying or (self.waiting and not self.stopping):
                    self._submit(stopped)
                    if stopped() and not self.stopping:
                        self.stopping = True
                        self.executor.stop()
                    for future in self.executor.wait(self.flying, 0.5):
                        self._take(self.flying.pop(future), future)
                    done = sum(map(self.folder.is_done, self.jobs))
                    aside = len(self.folder.failures())
                    shown.update(done, f"{len(self.flying)} running" + (f" · {aside} set aside" * bool(aside)))
        finally:
            self.executor.close()
            reporter.finish()

    def _submit(self, stopped: Callable[[], bool]) -> None:
        while self.waiting and len(self.flying) < self.executor.workers and not (stopped() or self.stopping):
            job = self.waiting.popleft()
            self.saved[job.name] = self.folder.saved(job)
            future = self.executor.submit(job, self.folder.place(job))
            self.flying[future] = job
            if future.done():  # this process works itself: take the result before the next job
                return

    def _take(self, job: JobKind, future: Pending) -> None:
        """Take note of how a job ended."""
        try:
            outcome = future.result()
        except KeyboardInterrupt:
            self.stopping = True
        except Exception as error:
            if self.executor.has_died(error):
                self._interrupted(job, error)
                return
            self.failed[job.name] += 1
            self._again(job, error, self.failed[job.name], self.attempts)
        else:
            self.learned += outcome.learned
            if outcome.result is not None:
                self.folder.add(job, outcome.result)
            elif self.executor.itself and not outcome.busy:
                self.stopping = True
            else:
                why = "another process has its folder" if outcome.busy else "it was stopped from outside"
                self._interrupted(job, RuntimeError(why))

    def _interrupted(self, job: JobKind, error: BaseException) -> None:
        """A job has ended early, for which it is not to blame."""
        moved = self.folder.saved(job) > self.saved[job.name]
        self.killed[job.name] = 1 if moved else self.killed[job.name] + 1
        self._again(job, error, self.killed[job.name], KILLS)

    def _again(self, job: JobKind, error: BaseException, count: int, most: int) -> None:
        """Try a job again after the others, or set it aside."""
        if self.stopping or count < most:
            self.waiting.append(job)
            return
        cause = getattr(error, "cause", None)  # Ray wraps the error of a job
        error = cause if isinstance(cause, BaseException) else error
        self.folder.set_aside(job, count, error, "".join(traceback.format_exception(error)))


class _Reporter(threading.Thread):
    """Writes the index and the page beside the driver, rarely enough to take little of the time."""

    def __init__(self, driver: _Driver[Any], report: Callable[[float | None], None]):
        super().__init__(daemon=True)
        self._driver = driver
        self._report = report
        self._over = threading.Event()

    def run(self) -> None:
        pause = PAUSE
        while not self._over.wait(pause):
            started = time.thread_time()
            with contextlib.suppress(Exception):  # the disk may be full; the last report tells
                self._report(self._driver.learned)
            pause = max(PAUSE, (time.thread_time() - started) / SHARE)

    def finish(self) -> None:
        """Write the last report."""
        self._over.set()
        self.join()
        self._report(None)
