"""Detect interventions that break the simulation or throw the body away."""

import numpy as np

from timsim.live._messages import Subject
from timsim.live._snapshot import Sample

FAR = 1e5  # m or rad; whatever moves farther after an intervention was thrown
WATCHED = 60.0  # s of simulated time after an intervention


class InterventionGuard:
    """Watches a subject for a minute of simulated time after each intervention."""

    def __init__(self):
        self._since: tuple[int, np.ndarray, int] | None = None
        """Of the last intervention: its decision, the position, and how often the simulation had broken down."""

    def begin(self, subject: Subject, sample: Sample) -> None:
        """Watch what follows an intervention; `sample` is the moment right after it."""
        self._since = subject.tick, sample["position"].copy(), subject.diverged

    def forget(self) -> None:
        """Stop watching: the run has jumped elsewhere."""
        self._since = None

    def problem(self, subject: Subject, sample: Sample) -> str | None:
        """The problem that the last intervention caused, returned once; None if there is none."""
        if self._since is None:
            return None
        decision, position, diverged = self._since
        if subject.tick < decision or (subject.tick - decision) * subject.period > WATCHED:
            self.forget()
            return None
        moved = np.abs(sample["position"][0] - position[0]).max(initial=0.0)
        broken = subject.diverged > diverged or not np.isfinite(moved)
        if not broken and moved <= FAR:
            return None
        self.forget()
        how = "the simulation broke down" if broken else f"the body was thrown away, by {moved:.1e} m or rad"
        return f"{how} after decision {decision:,}; Undo goes back to before it"
