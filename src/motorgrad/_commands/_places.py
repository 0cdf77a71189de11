"""Options of the commands that run jobs: where, and how many at a time."""

import dataclasses
from typing import Any

from motorgrad._commands import IMPORTED
from motorgrad._errors import check, choice
from motorgrad.studies import PLACES


@dataclasses.dataclass(frozen=True, kw_only=True)
class Places:
    """Where jobs run."""

    on: str = "here"
    """Where jobs run: here, in this process; processes, of this machine; ray; slurm."""
    address: str = ""
    """The address of a Ray cluster, such as auto or ray://HOST:10001; without it Ray starts on this machine alone."""
    slurm: tuple[str, ...] | None = None
    """Parameters of Slurm's jobs, such as partition=cpu timeout_min=120 mem_gb=4."""
    workers: int = 0
    """Jobs that run at the same time; 0 for as many as there are processors."""
    threads: int = 0
    """Threads of each job; 0 for its share of the processors."""
    attempts: int = 3
    """How often a job that fails is tried, before it is set aside and the others go on."""

    def check_places(self) -> None:
        """**Raises** `ValueError` for options that do not fit together."""
        choice("on", self.on, PLACES)
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
