"""The orders that a page can give a run, and the subject that carries them out.

An order checks its own values when it is made, and its names against the `Session` before it is sent. An intervention
also knows how to change the subject, so a new one is one class here.
"""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar, Protocol

import mujoco
from jaxtyping import PyTree

from motorgrad._errors import check, unknown
from motorgrad.learning import Learner
from motorgrad.policies import Policy
from motorgrad.tasks import Task
from timsim.live._foreign import Picture
from timsim.live._replies import Branch, Ready
from timsim.live._settings import declared_setting
from timsim.live._snapshot import Sample, Snapshot, Tally

MIN_SPEED = 0.05
MAX_FORCE = 1e6  # N


class Subject(Protocol):
    """What a run simulates: a learner (`Learner`) or a bare model (`BareModel`).

    - `tick`: decisions made; `period`: simulated seconds of one; `frozen`: whether learning is off.
    - `labels`: of the bodies in view, the one that learns first.
    - `settings`: what can be edited, with its present value.
    - `diverged`: how often the simulation has broken down, and was set to its start.
    - `horizon`: the decision up to which it is known from the start, as of a stored motion; 0 of what is simulated.
    """

    frozen: bool
    diverged: int
    horizon: int
    settings: dict[str, float]

    @property
    def tick(self) -> int: ...

    @property
    def period(self) -> float: ...

    @property
    def labels(self) -> list[str]: ...

    def about(self) -> Ready:
        """Array sizes, settings and names."""
        ...

    def advance(self, ticks: int, /) -> None:
        """Make decisions without sampling them."""

    def step(self) -> Sample:
        """Make one decision and sample it."""
        ...

    def sample(self) -> Sample:
        """Sample the present moment; rewards and gradients are those of the last decision sampled."""
        ...

    def tally(self) -> list[Tally]:
        """Return the means of each body since the last call, and begin new ones."""
        ...

    @property
    def state(self) -> PyTree:
        """A copy of everything that determines the future."""
        ...

    def restore(self, state: PyTree, /) -> None:
        """Restore a state."""

    def begin_again(self) -> None:
        """Return to the start, keeping edits."""

    def edit(self, name: str, value: float) -> None:
        """Change one of `settings`. **Raises** `ValueError` for a value out of range, and then changes nothing."""

    def freeze(self, on: bool) -> None: ...

    def push(self, body: str, force: tuple[float, float, float], seconds: float) -> None: ...

    def compare(self, on: bool) -> None: ...

    def save(self, path: str) -> None: ...

    def read_policy(self, path: str, seed: int | None) -> tuple[Policy, PyTree]:
        """A saved policy and the task's memory, checked to fit."""
        ...

    def set_policy(self, policy: Policy, memory: PyTree) -> None:
        """Continue with another policy."""

    def control(self, actuator: int, value: float) -> None: ...

    def picture(self) -> Picture:
        """The picture of a Gymnasium environment."""
        ...


class View(Protocol):
    """What an order is checked against: a `Session`, whose attributes these are."""

    @property
    def name(self) -> str: ...

    @property
    def task(self) -> Task | None: ...

    @property
    def agent(self) -> Learner | None: ...

    @property
    def model(self) -> mujoco.MjModel | None: ...

    @property
    def rendered(self) -> bool: ...

    @property
    def settings(self) -> Mapping[str, float]: ...

    @property
    def muscles(self) -> list[str]: ...

    @property
    def branches(self) -> tuple[Branch, ...]: ...

    def snapshot(self) -> Snapshot: ...


class Order:
    """A request to a run."""

    def check(self, session: View) -> None:
        """Refuse an order that this `Session` cannot carry out. **Raises** `ValueError`."""


@dataclasses.dataclass(frozen=True)
class Play(Order):
    """Continue."""


@dataclasses.dataclass(frozen=True)
class Pause(Order):
    """Pause between two decisions."""


@dataclasses.dataclass(frozen=True)
class Step(Order):
    """Make a number of decisions, then pause."""

    decisions: int = 1

    def __post_init__(self) -> None:
        whole = isinstance(self.decisions, int) and 1 <= self.decisions <= 1_000_000
        check(whole, "decisions", self.decisions, "an integer from 1 to 1,000,000")


@dataclasses.dataclass(frozen=True)
class Reset(Order):
    """Restart body and learner, keeping edits."""


@dataclasses.dataclass(frozen=True)
class Speed(Order):
    """Set the speed: simulated seconds per second of wall time, at least 0.05; `math.inf` for as fast as possible."""

    factor: float

    def __post_init__(self) -> None:
        fine = isinstance(self.factor, int | float) and self.factor >= MIN_SPEED
        check(fine, "speed", self.factor, f"at least {MIN_SPEED}, or inf for as fast as possible")


@dataclasses.dataclass(frozen=True)
class Scrub(Order):
    """Go back, or forward again, to a decision and pause there; body and learner are restored."""

    decision: int

    def __post_init__(self) -> None:
        check(isinstance(self.decision, int) and self.decision >= 0, "decision", self.decision, "an integer from 0")

    def check(self, session: View) -> None:
        now = session.snapshot()
        fits = now.oldest <= self.decision <= now.newest
        check(fits, "decision", self.decision, f"from {now.oldest:,} to {now.newest:,}")


@dataclasses.dataclass(frozen=True)
class Save(Order):
    """Write the policy to a file (.npz). A `quiet` order reports only a failure."""

    path: str
    quiet: bool = False

    def __post_init__(self) -> None:
        _check_npz(self.path)

    @property
    def saved(self) -> str:
        """The event that reports success."""
        return f"policy saved to {self.path}"

    @property
    def not_saved(self) -> str:
        """How the event that reports a failure begins."""
        return f"policy not saved to {self.path}"


@dataclasses.dataclass(frozen=True)
class Undo(Order):
    """Go back to just before the last intervention, discard everything after it, and pause."""


@dataclasses.dataclass(frozen=True)
class Look(Order):
    """Ask for the picture of a Gymnasium environment, which comes as `Session.picture`."""

    def check(self, session: View) -> None:
        check(session.rendered, "look", session.name, "a Gymnasium environment that has a picture of its own")


class Intervention(Order):
    """An order that changes what follows. Going back repeats it, so the same state must lead to the same effect.

    **Attributes:** `kind`, of the event that reports it.
    """

    kind: ClassVar[str] = "change"

    def resolve(self, subject: Subject) -> Intervention:
        """The order with everything that repeating it needs, such as the contents of a file. By default itself."""
        return self

    def apply(self, subject: Subject) -> str:
        """Change the subject. **Returns** one line for the log. **Raises** `ValueError` where it is refused."""
        raise NotImplementedError


@dataclasses.dataclass(frozen=True)
class Push(Intervention):
    """Push a part of the body: a force in world coordinates at its centre of mass, for some simulated seconds.

    **Arguments:** `body`: its name in the model; `force`: (x, y, z) in N; `seconds`.
    """

    body: str
    force: tuple[float, float, float]
    seconds: float = 0.1

    def __post_init__(self) -> None:
        valid = len(self.force) == 3 and all(math.isfinite(x) and abs(x) <= MAX_FORCE for x in self.force)
        check(valid, "force", self.force, f"three numbers in N, each at most {MAX_FORCE:g}")
        check(0 < self.seconds <= 60, "seconds", self.seconds, "above 0, at most 60")

    def check(self, session: View) -> None:
        model = session.model
        names = [] if model is None else [model.body(i).name for i in range(1, model.nbody)]
        if self.body not in names:
            raise unknown("body", self.body, names)

    def apply(self, subject: Subject) -> str:
        subject.push(self.body, self.force, self.seconds)
        return f"push of ({', '.join(f'{x:g}' for x in self.force)}) N at {self.body} for {self.seconds:g} s"


@dataclasses.dataclass(frozen=True)
class Edit(Intervention):
    """Set one of `Session.settings` to a value."""

    name: str
    value: float

    def __post_init__(self) -> None:
        check(math.isfinite(self.value), self.name, self.value, "a finite number")

    def check(self, session: View) -> None:
        if self.name not in session.settings:
            raise unknown("setting", self.name, session.settings)
        declared_setting(self.name, session.task, session.agent).check(self.name, self.value)

    def apply(self, subject: Subject) -> str:
        before = subject.settings[self.name]
        subject.edit(self.name, self.value)
        return f"{self.name}: {before:.6g} → {self.value:.6g}"


@dataclasses.dataclass(frozen=True)
class Freeze(Intervention):
    """Continue with the present policy, without learning."""

    def apply(self, subject: Subject) -> str:
        subject.freeze(True)
        return "learning frozen"


@dataclasses.dataclass(frozen=True)
class Thaw(Intervention):
    """Resume learning after a `Freeze`."""

    def apply(self, subject: Subject) -> str:
        subject.freeze(False)
        return "learning resumed"


@dataclasses.dataclass(frozen=True)
class Load(Intervention):
    """Load a saved policy (.npz), or that of a run directory: of its first seed, or of `seed`."""

    kind: ClassVar[str] = "loaded"
    path: str
    seed: int | None = None

    def __post_init__(self) -> None:
        if not Path(self.path).is_dir():
            _check_npz(self.path)

    def resolve(self, subject: Subject) -> Intervention:
        return Loaded(self.path, *subject.read_policy(self.path, self.seed))


@dataclasses.dataclass(frozen=True, eq=False)
class Loaded(Intervention):
    """A `Load` whose file was read: its policy, and the task's memory."""

    kind: ClassVar[str] = "loaded"
    path: str
    policy: Policy
    memory: PyTree

    def apply(self, subject: Subject) -> str:
        subject.set_policy(self.policy, self.memory)
        return f"policy loaded from {self.path}"


@dataclasses.dataclass(frozen=True)
class Compare(Intervention):
    """Show or hide an untrained body beside the one that learns; `Alongside` shows that of another branch."""

    on: bool = True

    def apply(self, subject: Subject) -> str:
        subject.compare(self.on)
        return "untrained body shown beside" if self.on else "untrained body removed"


@dataclasses.dataclass(frozen=True)
class Control(Intervention):
    """Set an actuator of a model without a learner, in its own units."""

    actuator: int
    value: float

    def __post_init__(self) -> None:
        check(math.isfinite(self.value), "control", self.value, "a finite number")

    def check(self, session: View) -> None:
        known = 0 <= self.actuator < len(session.muscles) and session.task is None
        check(known, "actuator", self.actuator, f"one of the {len(session.muscles)} of a model without a learner")

    def apply(self, subject: Subject) -> str:
        subject.control(self.actuator, self.value)
        return ""


def _check_npz(path: str) -> None:
    check(Path(path).suffix == ".npz", "path", path, "a file ending in .npz, or a run directory to load from")
