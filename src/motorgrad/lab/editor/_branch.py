"""One course of events: where it came from, what was changed in it, and states to go back to."""

import dataclasses
from typing import Any

from motorgrad.lab._files import loads
from motorgrad.lab._state import State
from motorgrad.lab.editor._program import Program, digest, size_of
from motorgrad.lab.editor._traces import Traces

KEPT = 256  # states of a branch; with more, every other one goes
LARGEST = 256 * 2**20  # bytes of them
FORMAT = "motorgrad log"


@dataclasses.dataclass(frozen=True)
class Change:
    """A parameter that has another value from a tick on."""

    tick: int
    address: str
    value: Any


class Branch:
    """A branch of a run, from the tick `start` to the tick `head`.

    **Arguments:** its name; the program that moves it; the tick and the state in which it begins, `None` where states
    cannot be kept; the branch it comes from.
    """

    def __init__(
        self, name: str, program: Program, start: int, state: State | None, parent: "Branch | None", edited: bool
    ):
        self.name, self.program, self.parent, self.edited = name, program, parent, edited
        self.start = self.head = start
        self.changes: list[Change] = []
        self.taken = 0 if parent is None else sum(change.tick <= start for change in parent.changes)
        """How many of the parent's changes came before it."""
        self.states: dict[int, State] = {} if state is None else {start: state}
        self.traces = Traces(program)
        self._spacing = 1

    def keep(self, tick: int, state: State) -> None:
        """Keep a state; of too many, every other one goes."""
        self.states[tick] = state
        while len(self.states) > 2 and (len(self.states) > KEPT or len(self.states) * size_of(state) > LARGEST):
            ticks = sorted(self.states)
            self.states = {tick: self.states[tick] for tick in ticks[::2]}
            self._spacing *= 2

    def wants(self, tick: int) -> bool:
        """Whether a state at this tick, the latest so far, should be kept."""
        return bool(self.states) and tick - max(self.states) >= self._spacing

    def before(self, tick: int) -> State:
        """The last state that is kept at or before a tick."""
        return self.states[max(kept for kept in self.states if kept <= tick)]

    def at(self, tick: int) -> list[Change]:
        """The changes at a tick."""
        return [change for change in self.changes if change.tick == tick]

    def next_change(self, tick: int) -> int | None:
        """The first tick after this one at which something changes."""
        return min((change.tick for change in self.changes if change.tick > tick), default=None)

    @property
    def line(self) -> list["Branch"]:
        """This branch and all before it, the first first."""
        return [*([] if self.parent is None else self.parent.line), self]

    def values_at(self, tick: int) -> dict[str, Any]:
        """What has been set, by address, since the diagram was compiled, at a tick of this branch."""
        return self.values_of(sum(change.tick <= tick for change in self.changes))

    def values_of(self, count: int) -> dict[str, Any]:
        """As `values_at`, after so many of its changes."""
        found = {} if self.parent is None or self.edited else self.parent.values_of(self.taken)
        return found | {change.address: change.value for change in self.changes[:count]}

    def log(self, tick: int, state: State | None) -> dict[str, Any]:
        """All that the state at a tick follows from, as plain data, and a digest of it."""
        parts = []
        line = self.line
        for branch, following in zip(line, [*line[1:], None], strict=True):
            until = len(branch.changes) if following is None else following.taken
            fresh = branch.parent is None or branch.edited
            changes = [dataclasses.asdict(change) for change in branch.changes[:until] if change.tick <= tick]
            if fresh:
                parts.append({"from": branch.start, "diagram": branch.program.text, "changes": changes})
            else:
                parts[-1]["changes"] += changes
        own = {"format": FORMAT, "version": 1, "seeds": list(self.program.seeds), "parts": parts, "tick": tick}
        return own | {"digest": None if state is None else digest(state)}

    def summary(self) -> dict[str, Any]:
        """What clients show of it."""
        return {
            "name": self.name,
            "parent": None if self.parent is None else self.parent.name,
            "start": self.start,
            "head": self.head,
            "edited": self.edited,
            "changes": [dataclasses.asdict(change) for change in self.changes],
        }


def diagram_of(log: dict[str, Any]) -> Any:
    """The last diagram of a log."""
    return loads(log["parts"][-1]["diagram"])
