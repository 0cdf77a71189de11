"""Options of the commands that run jobs: where, and how many at a time."""

import abc
import dataclasses
import functools
import sys
from pathlib import Path
from typing import Any, ClassVar

from motorgrad._errors import check
from motorgrad._extras import require
from motorgrad._files import check_writable
from motorgrad._processes import IMPORTED
from motorgrad.options._results import json_help
from motorgrad.schema import Settings, count, number, static
from motorgrad.studies import EXECUTORS, On
from motorgrad.training import MAX_THREADS


@dataclasses.dataclass(frozen=True, kw_only=True)
class ExecutorOptions(Settings):
    """Where jobs run."""

    on: On = static("here", help="Where jobs run; here is this process, processes are others of this machine")
    address: str = static(
        "",
        help="The address of a Ray cluster, such as auto or ray://HOST:10001; without it Ray starts on this "
        "machine alone",
    )
    slurm: tuple[str, ...] | None = static(
        None, help="Parameters of Slurm's jobs, such as partition=cpu timeout_min=120 mem_gb=4"
    )
    workers: int = count(0, help="The number of jobs that run at the same time; 0 for one per processor")
    threads: int = count(0, 0, MAX_THREADS, help="The number of threads of each job; 0 for its share of the processors")
    attempts: int = count(3, 1, help="How often a failing job is tried before it is set aside; the others continue")

    def validate(self) -> None:
        if needs := EXECUTORS[self.on].needs:
            require(*needs)
        check(self.on == "ray" or not self.address, "address", self.address, "left out, unless --on ray")
        check(self.on == "slurm" or not self.slurm, "slurm", self.slurm, "left out, unless --on slurm")
        _ = self.how

    @property
    def how(self) -> dict[str, Any]:
        """The options as arguments of `run_study` and `reproduce_all`."""
        options: dict[str, Any] = {"address": self.address} if self.on == "ray" else {}
        if self.on == "slurm":
            options = {"parameters": dict(map(_parameter, self.slurm or ()))}
        return {
            "on": self.on,
            "workers": self.workers,
            "threads": self.threads,
            "attempts": self.attempts,
            "imports": tuple(IMPORTED),
            "options": options,
        }


def _parameter(word: str) -> tuple[str, Any]:
    """A parameter of Slurm's jobs as name and value."""
    name, _, value = word.partition("=")
    check(name and value, "slurm", word, "a name and a value, such as partition=cpu")
    try:
        return name, int(value)
    except ValueError:
        return name, value


@dataclasses.dataclass(frozen=True)
class StudyFile(ExecutorOptions, abc.ABC):
    """Options of a command that runs the study or comparison of a TOML file in a folder."""

    study: Path | None = static(
        None, positional="[FILE]", help="The TOML file of the study; without it, that of the folder --out"
    )
    out: Path | None = static(None, help="The folder of the study, by default runs/NAME for NAME.toml")
    checkpoint_every: float = number(30.0, 0, unit="s", help="The time between two checkpoints of a job")
    trust: bool = static(False, help="Run code that the file or the folder names: the module of a task")
    json: Path | None = static(None, help=json_help())

    file_in_folder: ClassVar[str] = "study.toml"

    def validate(self) -> None:
        super().validate()
        check(self.study or self.out, "study", None, "the TOML file of a study, or --out the folder of one")
        check_writable("out", self.folder, folder=True)
        made = self.made  # its errors name the file
        try:
            made.check()
        except ValueError as error:
            raise ValueError(f"{self.file}: {error}") from None

    @property
    @abc.abstractmethod
    def kind(self) -> Any:
        """The class that the file describes."""

    @functools.cached_property
    def made(self) -> Any:
        """The study or comparison in the file."""
        return self.kind.read(self.file, trust=self.trust)

    @property
    def file(self) -> Path:
        """The file that is read."""
        return self.study or self.folder / self.file_in_folder

    @property
    def folder(self) -> Path:
        """The folder in which it runs."""
        if self.out is not None:
            return self.out
        assert self.study is not None
        return Path("runs") / self.study.stem

    @property
    @abc.abstractmethod
    def size(self) -> str:
        """How much there is to do, in words."""

    def effective(self) -> dict[str, Any]:
        print(self.size, file=sys.stderr)
        return self.made.as_table()

    @property
    def options(self) -> dict[str, Any]:
        """The options as arguments of `run_study`."""
        return {**self.how, "checkpoint_every": self.checkpoint_every, "trust": self.trust}
