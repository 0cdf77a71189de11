"""What a page can ask of a run. Every order is checked when it is made, before it is sent."""

import dataclasses
import math
from pathlib import Path

from motorgrad._errors import check

SLOWEST = 0.05
STRONGEST = 1e6  # N


@dataclasses.dataclass(frozen=True)
class Play:
    """Go on."""


@dataclasses.dataclass(frozen=True)
class Pause:
    """Stop between two decisions."""


@dataclasses.dataclass(frozen=True)
class Step:
    """Make so many decisions, and pause."""

    decisions: int = 1

    def __post_init__(self) -> None:
        whole = isinstance(self.decisions, int) and 1 <= self.decisions <= 1_000_000
        check(whole, "decisions", self.decisions, "a whole number from 1 to 1,000,000")


@dataclasses.dataclass(frozen=True)
class Reset:
    """Begin anew: body and learner as at the start, edits kept."""


@dataclasses.dataclass(frozen=True)
class Speed:
    """Simulated seconds per second of wall time, at least 0.05; `math.inf` for as fast as possible."""

    factor: float

    def __post_init__(self) -> None:
        check(self.factor >= SLOWEST, "speed", self.factor, f"at least {SLOWEST}, or inf for as fast as possible")


@dataclasses.dataclass(frozen=True)
class Push:
    """Push a part of the body: a force in world coordinates at its centre of mass, for some simulated seconds.

    **Arguments:** `body`: its name in the model; `force`: (x, y, z) in N; `seconds`.
    """

    body: str
    force: tuple[float, float, float]
    seconds: float = 0.1

    def __post_init__(self) -> None:
        valid = len(self.force) == 3 and all(math.isfinite(x) and abs(x) <= STRONGEST for x in self.force)
        check(valid, "force", self.force, f"three numbers in N, each at most {STRONGEST:g}")
        check(0 < self.seconds <= 60, "seconds", self.seconds, "above 0, at most 60")


@dataclasses.dataclass(frozen=True)
class Scrub:
    """Go back, or forward again, to a decision, and pause there: body, learner and all."""

    decision: int

    def __post_init__(self) -> None:
        check(isinstance(self.decision, int) and self.decision >= 0, "decision", self.decision, "a whole number from 0")


@dataclasses.dataclass(frozen=True)
class Edit:
    """Set one of `Session.settings` to a value."""

    name: str
    value: float

    def __post_init__(self) -> None:
        check(math.isfinite(self.value), self.name, self.value, "a finite number")


@dataclasses.dataclass(frozen=True)
class Freeze:
    """Act on by the policy as it is; nothing is learnt."""


@dataclasses.dataclass(frozen=True)
class Thaw:
    """Learn on from where it was frozen."""


@dataclasses.dataclass(frozen=True)
class Save:
    """Write the policy to a file (.npz)."""

    path: str

    def __post_init__(self) -> None:
        _npz(self.path)


@dataclasses.dataclass(frozen=True)
class Load:
    """Put a policy in place that was saved, or that a run directory holds (of its first seed, or of `seed`)."""

    path: str
    seed: int | None = None

    def __post_init__(self) -> None:
        if not Path(self.path).is_dir():
            _npz(self.path)


@dataclasses.dataclass(frozen=True)
class Compare:
    """Show an untrained body beside the one that learns, or no longer."""

    on: bool = True


@dataclasses.dataclass(frozen=True)
class Control:
    """Set an actuator of a model without a learner, in its own units."""

    actuator: int
    value: float

    def __post_init__(self) -> None:
        check(math.isfinite(self.value), "control", self.value, "a finite number")


Order = Play | Pause | Step | Reset | Speed | Push | Scrub | Edit | Freeze | Thaw | Save | Load | Compare | Control


def _npz(path: str) -> None:
    check(Path(path).suffix == ".npz", "path", path, "a file ending in .npz, or a run directory to load from")
