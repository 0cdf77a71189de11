"""What a worker can simulate: something with decisions that can be advanced, looked at, saved and restored."""

from typing import Any, NamedTuple, Protocol

import numpy as np

from motorgrad.sim.live._replies import Ready

Look = dict[str, np.ndarray]
"""One moment by the names of `Snapshot`, each with a leading axis of bodies; and `action`, `contacts`."""


class Tally(NamedTuple):
    """What happened since the last tally: the mean reward of a decision, the task's readings, and their counts."""

    values: np.ndarray
    counts: np.ndarray


class Subject(Protocol):
    """A learner (`Learner`) or a bare model (`Passive`).

    - `decision`: decisions made; `period`: simulated seconds of one; `frozen`.
    - `settings`: what can be edited, with its value; `fields`: the model's arrays that edits change.
    """

    frozen: bool
    settings: dict[str, float]

    @property
    def decision(self) -> int: ...

    @property
    def period(self) -> float: ...

    @property
    def fields(self) -> dict[str, np.ndarray]: ...

    def about(self) -> Ready:
        """Sizes and names."""
        ...

    def skip(self, decisions: int) -> None:
        """Make decisions without looking."""

    def step(self) -> Look:
        """Make one decision and look at it."""
        ...

    def look(self) -> Look:
        """The present moment; what belongs to a decision is that of the last one looked at."""
        ...

    def tally(self) -> Tally:
        """Take what was counted since the last call."""
        ...

    @property
    def state(self) -> Any:
        """Everything the future depends on, copied."""
        ...

    def restore(self, state: Any) -> None:
        """Put a state back."""

    def begin_again(self) -> None:
        """As at the start, edits kept."""

    def edit(self, name: str, value: float) -> None:
        """Change one of `settings`. **Raises** `ValueError` for an impossible value; nothing is changed then."""

    def freeze(self, on: bool) -> None: ...

    def push(self, body: str, force: tuple[float, float, float], seconds: float) -> None: ...

    def compare(self, on: bool) -> None: ...

    def save(self, path: str) -> None: ...

    def load(self, path: str, seed: int | None) -> None: ...

    def control(self, actuator: int, value: float) -> None: ...
