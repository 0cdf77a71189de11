"""Recording the decisions of an engine."""

import numpy as np

from motorgrad._errors import check
from motorgrad._random import BLOCK
from motorgrad.tasks import HostTask
from motorgrad.training.engines import Stepper
from motorgrad.training.rollouts._probes import Probe

MAX_RECORDING_BYTES = 4 * 2**30
"""They are held in memory."""


class Recording:
    """All decisions of an engine from now on, as it makes them, and what a `probe` reads of its dynamics, so many
    `readings` in a decision.

    A decision begins at a moment and leads to the next one. Its observation and its action belong to the first, its
    reward to the second, which is the first of the next decision, or the last of the episode.

    **Attributes:** `parts`, what `transition` says, by name, and `ended`, whether it ended an episode, `(decisions,
    seeds, …)`; `read`, what the probe has read, `(decisions, seeds, readings, columns)`; `ends`, by decision, the
    readings at its end, where it ended an episode or is the last; `info`, for each decision, what the probe was told.
    """

    def __init__(self, stepper: Stepper, probe: Probe | None, readings: int = 1):
        self.stepper, self.probe, self.readings = stepper, probe, readings
        self._parts: dict[str, _Stack] = {}
        self._ended = _Stack()
        self._read = _Stack()
        self.ends: dict[int, np.ndarray] = {}
        self.info: list[dict[str, np.ndarray]] = []
        stepper.watcher = self._watch  # type: ignore[attr-defined]

    def run(self, decisions: int, episodes: bool) -> None:
        """Make this many decisions, or fewer where every lane has ended an episode and `episodes` are wanted.
        **Raises** `ValueError` where they need more memory than there may be."""
        at_once = 1 if isinstance(self.stepper.task, HostTask) else BLOCK
        over = np.zeros(len(self.stepper.seeds), bool)
        while self._ended.count < decisions and not (episodes and over.all()):
            known = self._ended.count
            self.stepper.advance(min(at_once, decisions - known))
            self._check_size(self._ended.count if episodes else decisions)
            over |= self._ended.all[known:].any(axis=0)
        if self.probe is not None:
            self.ends[self._ended.count - 1] = self.probe.end()

    @property
    def parts(self) -> dict[str, np.ndarray]:
        return {name: stack.all for name, stack in self._parts.items()}

    @property
    def ended(self) -> np.ndarray:
        return self._ended.all

    @property
    def read(self) -> np.ndarray:
        return self._read.all

    def _watch(self, block: dict[str, np.ndarray]) -> None:
        ended = block["terminated"] | block["truncated"] | block.get("diverged", False)
        if self.probe is not None:  # dynamics on the host make one decision at a time
            read = self.probe.read(bool(ended.any()))
            self._read.add(read.before[None])
            self.info.append(self.probe.info())
            if read.end is not None:
                self.ends[self._ended.count] = read.end
        for name, part in block.items():
            self._parts.setdefault(name, _Stack()).add(part)
        self._ended.add(ended)

    def _check_size(self, decisions: int) -> None:
        """Refuse so many decisions if they need too much memory."""
        each = sum(stack.each for stack in (*self._parts.values(), self._read))
        most = MAX_RECORDING_BYTES // max(each, 1)
        wanted = f"at most {most:,}, which fill 4 GiB here: take fewer seeds, or fewer at a time"
        check(decisions <= most, "decisions", decisions, wanted)


class _Stack:
    """Arrays of decisions, one after the other, with room for more."""

    def __init__(self) -> None:
        self._room = np.empty((0,))
        self.count = 0

    @property
    def all(self) -> np.ndarray:
        """What was added, along the leading axis."""
        return self._room[: self.count]

    @property
    def each(self) -> int:
        """The bytes of one decision."""
        return self._room.nbytes // max(len(self._room), 1)

    def add(self, block: np.ndarray) -> None:
        """Add some decisions, along the leading axis."""
        end = self.count + len(block)
        if end > len(self._room):
            room = np.empty((max(BLOCK, end, 2 * len(self._room)), *block.shape[1:]), block.dtype)
            if self.count:
                room[: self.count] = self.all
            self._room = room
        self._room[self.count : end] = block
        self.count = end
