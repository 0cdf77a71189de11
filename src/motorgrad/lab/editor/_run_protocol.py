"""What clients ask of a run. `branch` is the name of a branch; see `_protocol` for the rest."""

import dataclasses
from typing import Any, ClassVar

from motorgrad.lab.editor._protocol import Operation


@dataclasses.dataclass(frozen=True)
class Play(Operation):
    """Run: at a `speed` of so many simulated seconds in one, or as quickly as possible without."""

    op: ClassVar[str] = "play"
    speed: float | None = None


@dataclasses.dataclass(frozen=True)
class Speed(Operation):
    """Another speed."""

    op: ClassVar[str] = "speed"
    speed: float | None = None


@dataclasses.dataclass(frozen=True)
class Pause(Operation):
    """Stop after the tick that is being made."""

    op: ClassVar[str] = "pause"


@dataclasses.dataclass(frozen=True)
class Tick(Operation):
    """Make `n` ticks, after those that were asked for before and are still to be made, and pause."""

    op: ClassVar[str] = "tick"
    n: int = 1


@dataclasses.dataclass(frozen=True)
class Reset(Operation):
    """Begin again at tick 0 with the diagram as it stands, and forget all branches."""

    op: ClassVar[str] = "reset"


@dataclasses.dataclass(frozen=True)
class Seeds(Operation):
    """Begin again with so many seeds, 0 … n − 1, or with this list of them."""

    op: ClassVar[str] = "seeds"
    n: int | list[int]


@dataclasses.dataclass(frozen=True)
class Watch(Operation):
    """Look also at these outputs; those that were watched before and are not in the list are no longer."""

    op: ClassVar[str] = "watch"
    addresses: list[str]


@dataclasses.dataclass(frozen=True)
class Scrub(Operation):
    """Go to a tick that a branch has made; what follows it stays."""

    op: ClassVar[str] = "scrub"
    branch: str
    tick: int


@dataclasses.dataclass(frozen=True)
class Fork(Operation):
    """Begin a new branch at a tick of another, by default where that is."""

    op: ClassVar[str] = "fork"
    branch: str
    tick: int | None = None
    name: str | None = None


@dataclasses.dataclass(frozen=True)
class Prune(Operation):
    """Forget a branch."""

    op: ClassVar[str] = "prune"
    branch: str


@dataclasses.dataclass(frozen=True)
class Log(Operation):
    """Ask for the log of a branch, by default of the present one: all that its numbers follow from."""

    op: ClassVar[str] = "log"
    branch: str | None = None


@dataclasses.dataclass(frozen=True)
class Replay(Operation):
    """Run a log again, as a new set of branches, and see whether the end is the same bit for bit."""

    op: ClassVar[str] = "replay"
    log: dict[str, Any]


RUN = (Play, Speed, Pause, Tick, Reset, Seeds, Watch, Scrub, Fork, Prune, Log, Replay)
"""All of them."""
