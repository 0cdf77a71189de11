"""Jobs as the driver and the executors see them: each has its own folder."""

import abc
import contextlib
import importlib.util
import json
import os
import pickle
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

import filelock

from motorgrad._consent import allow
from motorgrad._files import read_json, write_atomically
from motorgrad._signals import interrupt_when_asked

PATIENCE = 60.0  # seconds for a process that is being killed to let go of a job's folder


class Outcome(NamedTuple):
    """The result that a worker returns.

    - `result`: result of the job; `None` where it was stopped before its end.
    - `learned`: seconds of learning, including compiling.
    - `busy`: whether another process has the folder.
    """

    result: Any
    learned: float = 0.0
    busy: bool = False


class Work(NamedTuple):
    """Information for every job, beside the job itself.

    - `threads` and `checkpoint_every`: as in `train`.
    - `imports`: modules that register tasks and parts.
    - `allowed`: names of code that the user has named or trusted.
    """

    threads: int = 0
    checkpoint_every: float = 30.0
    imports: tuple[str, ...] = ()
    allowed: tuple[str, ...] = ()


class AnyJob(Protocol):
    """A job. It travels to its worker by pickle."""

    @property
    def name(self) -> str:
        """Its name, unique in the folder."""
        ...

    def do(self, path: Path, job_settings: Work) -> Outcome:
        """Do the job in its folder, or the rest of it."""
        ...


JobKind = TypeVar("JobKind", bound=AnyJob)
ResultKind = TypeVar("ResultKind")


def parcel(job: AnyJob, path: Path, job_settings: Work) -> tuple[bytes, str, tuple[str, ...]]:
    """What `work_parcel` is given in a process that knows nothing of this one: a job, the working folder, and the
    modules that are imported first, which may be there, and be needed to read the job."""
    import cloudpickle

    return cloudpickle.dumps((job, path, job_settings)), os.getcwd(), job_settings.imports


def work_parcel(content: bytes, folder: str, imports: tuple[str, ...]) -> Outcome:
    """Do the job of a parcel."""
    with contextlib.suppress(OSError):  # another machine may not have it
        os.chdir(folder)
    missing = any(importlib.util.find_spec(name.partition(".")[0]) is None for name in imports)
    if missing and folder not in sys.path:
        sys.path.append(folder)  # last, so that no file there takes the place of another module
    return work(*pickle.loads(content))


def work(job: AnyJob, path: Path | str, job_settings: Work) -> Outcome:
    """Do a job in its folder: the whole work of a worker."""
    path = Path(path)
    path.mkdir(parents=True, exist_ok=True)
    with interrupt_when_asked():
        allow(job_settings.allowed)
        for name in job_settings.imports:
            importlib.import_module(name)
        try:
            # an earlier worker of the same job, whose driver was killed, may still hold the folder
            with filelock.FileLock(path / ".lock", timeout=PATIENCE):
                pass
        except filelock.Timeout:
            return Outcome(None, busy=True)
        return job.do(path, job_settings)


class JobFolder(contextlib.AbstractContextManager[Any], Generic[JobKind, ResultKind]):
    """A folder in which every job has a folder, as the driver sees it. Jobs that were set aside are in `failures`. The
    driver enters it as a context manager.

    - `noun` and `counted`: what progress is shown of, and in what.
    """

    noun = "study"
    counted = "jobs"

    def __init__(self, path: Path | str):
        self.path = Path(path)

    @property
    @abc.abstractmethod
    def jobs(self) -> Sequence[JobKind]:
        """All jobs."""

    @abc.abstractmethod
    def place(self, job: JobKind) -> Path:
        """The folder of a job."""

    @abc.abstractmethod
    def saved(self, job: JobKind) -> int:
        """The progress of a job, in some unit, from which the next worker continues if this one is killed."""

    @abc.abstractmethod
    def add(self, job: JobKind, result: ResultKind) -> None:
        """Record a job that is done."""

    @abc.abstractmethod
    def is_done(self, job: JobKind) -> bool:
        """Whether a job is done."""

    def __exit__(self, *_: object) -> None:
        """Leave the folder to others."""

    def about(self, job: JobKind) -> dict[str, Any]:
        """The record of a failed job."""
        return {}

    def failures(self) -> list[dict[str, Any]]:
        """The jobs that were set aside: `job`, `attempts`, `message`, `traceback`, and what there is about them."""
        return [_failure(file) for file in sorted((self.path / "failures").glob("[!.]*.json"))]

    def set_aside(self, job: JobKind, attempts: int, error: BaseException, traceback: str) -> None:
        """Record why a job failed."""
        message = " ".join(f"{type(error).__name__}: {error}".splitlines())
        said = {"job": job.name, "attempts": attempts, "message": message, "traceback": traceback, **self.about(job)}
        (self.path / "failures").mkdir(exist_ok=True)
        write_atomically(self.path / "failures" / f"{job.name}.json", json.dumps(said, indent=2).encode())

    def forgive(self, job: JobKind) -> None:
        """Forget that a job failed, before it is tried again."""
        (self.path / "failures" / f"{job.name}.json").unlink(missing_ok=True)


def _failure(file: Path) -> dict[str, Any]:
    """The record of a job that was set aside. **Raises** `ValueError` for a damaged one."""
    found = read_json(file)
    texts = isinstance(found, dict) and all(isinstance(found.get(key), str) for key in ("job", "message", "traceback"))
    if not (texts and isinstance(found.get("attempts"), int)):
        raise ValueError(f"{file}: damaged: must say which job failed, how often and why; delete it")
    return found
