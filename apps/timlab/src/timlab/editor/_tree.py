"""The branches of a run, one of which is current."""

from collections.abc import Callable, Sequence
from typing import Any

from motorgrad._errors import check, unknown
from timlab.diagram import Diagram, numbered_names
from timlab.editor._branch import Branch, timeline_of
from timlab.editor._program import Program, Values, outputs, parameters
from timlab.engine import MAX_SEEDS, Timeline

Event = dict[str, Any]
MAX_BRANCHES = 64


class Tree:
    """A run with all of its branches.

    **Arguments:** the diagram, which is compiled when it is first needed; a function that compiles a diagram for some
    seeds, to record some outputs; one that takes the events of branches that begin.
    """

    def __init__(
        self,
        diagram: Diagram,
        compile: Callable[[Diagram, list[int], list[str]], Program],
        emit: Callable[[Event], None],
    ):
        self.diagram = diagram
        """The diagram of the document, compiled or not."""
        self.stale = False
        self.values: Values = {}
        """The parameters of the document, as the run last took them."""
        self._compile, self._emit = compile, emit
        self._branches: dict[str, Branch] = {}
        self._now: Branch | None = None
        self._seeds = [0]
        self._watch: list[str] = []
        self._fresh: list[str] = []

    @property
    def running(self) -> bool:
        """Whether anything is compiled."""
        return self._now is not None

    @property
    def now(self) -> Branch:
        """The current branch. **Raises** `ValueError` before anything runs."""
        if self._now is None:
            raise ValueError("run: nothing is running: play first")
        return self._now

    @property
    def tick(self) -> int:
        """The current tick."""
        return self._now.timeline.tick if self._now else 0

    @property
    def step(self) -> float:
        """The length of a tick in seconds."""
        return self._now.program.diagram.tick if self._now else self.diagram.tick

    def branch(self, name: str) -> Branch:
        """The branch with this name."""
        if name not in self._branches:
            raise unknown("branch", name, self._branches)
        return self._branches[name]

    def place(self) -> Event:
        """The current branch, tick and time."""
        name, head = (None, 0) if self._now is None else (self._now.name, self._now.timeline.end)
        return {"branch": name, "tick": self.tick, "time": self.tick * self.step, "head": head}

    def summary(self) -> Event:
        """Everything else that clients show of the run."""
        now = self._now
        return {
            "seeds": self._seeds if len(self._seeds) <= 100 else len(self._seeds),
            "watch": self._watch,
            "branches": [branch.summary() for branch in self._branches.values()],
            "stale": self.stale,
            "fixed": now.program.fixed if now else None,
            "overrides": {} if now is None or self.stale else now.overrides(self.values),
            "fresh": self._fresh,
            "faults": now.faults if now else [],
        }

    def samples(self) -> list[Event]:
        """What all branches recorded."""
        return [
            {"event": "samples", "branch": branch.name, "fresh": True, "signals": branch.traces.all()}
            for branch in self._branches.values()
        ]

    def begin(self) -> None:
        """Start at tick 0 with the current diagram, and discard all branches."""
        program = self._compile(self.diagram, self._seeds, self._watch)
        self.close()
        self._branches = {}
        self._fresh = []
        self.stale = False
        self.values = parameters(self.diagram)
        self._add("main", program, None, timeline_of(program))

    def discard(self, diagram: Diagram) -> None:
        """Discard everything, for another document."""
        self.close()
        self.diagram = diagram
        self._branches = {}
        self._now = None
        self._fresh = []
        self._watch = []
        self.stale = False

    def reseed(self, seeds: int | Sequence[int]) -> None:
        """Restart with other seeds."""
        if isinstance(seeds, int):
            check(1 <= seeds <= MAX_SEEDS, "n", seeds, f"an integer from 1 to {MAX_SEEDS:,}")
        chosen = list(range(seeds) if isinstance(seeds, int) else seeds)
        before, self._seeds = self._seeds, chosen
        try:
            self.begin()
        except Exception:  # memory that there is not, too
            self._seeds = before
            raise

    def ensure_compiled(self) -> None:
        """Compile the current diagram if it changed. The run then continues in a new branch, with the states of all
        blocks that are still the same.
        """
        if self._now is None:
            self.begin()
            return
        if not self.stale:
            return
        old = self._now
        if old.program.fixed is not None or (old.parent is None and old.timeline.end == 0):
            self.begin()
            return
        program = self._compile(self.diagram, self._seeds, self._watch)
        if program.fixed is not None:
            self.begin()
            return
        self._fresh = program.run.restore_matching(old.run.state)
        self.stale = False
        self.values = parameters(self.diagram)
        self._add("edit", program, old, timeline_of(program), edited=True)

    def set_watches(self, addresses: Sequence[str]) -> None:
        """Record these outputs too."""
        known = outputs(self.diagram)
        for address in addresses:
            if address not in known:
                raise unknown("output", address, known)
        self._watch = list(dict.fromkeys(addresses))
        if self._now is not None:
            self._recompile_watches()

    def update_parameters(self) -> None:
        """Apply the parameters of the document that changed."""
        values = parameters(self.diagram)
        changed = {a: value for a, value in values.items() if a not in self.values or self.values[a] != value}
        self.values = values
        if not changed:
            return
        timeline = self.now.timeline
        if self.tick < timeline.end or (timeline.log and timeline.log[-1].tick > self.tick):
            self.fork(self.forkable(self.now.name, None), None)  # the known future is kept, in its own branch
        self.now.set_parameters(changed)

    def approach(self, name: str, tick: int) -> None:
        """Make the branch current in which another one was at a known tick, at that tick or at a snapshot before it."""
        branch = self.branch(name)
        end = branch.timeline.end
        check(0 <= tick <= end, "tick", tick, f"an integer from 0 to {end}, the ticks that {name!r} has reached")
        check(branch.program.fixed is None, "scrub", name, f"a run that can go back; {branch.program.fixed}")
        while tick < min(branch.timeline.snapshots):
            assert branch.parent is not None
            branch = branch.parent
        self._now = branch
        if branch.program.watch != self._watch:
            self._recompile_watches()
        nearest = max(known for known in branch.timeline.snapshots if known <= tick)
        if tick < self.tick or nearest > self.tick:
            branch.timeline.seek(nearest)

    def forkable(self, name: str, to: str | None) -> Branch:
        """The branch with this name. **Raises** `ValueError` if no branch called `to` may begin there."""
        count = len(self._branches)
        check(count < MAX_BRANCHES, "branches", count, f"at most {MAX_BRANCHES}: delete some")
        check(to is None or (to and to not in self._branches), "name", to, "a new name")
        branch = self.branch(name)
        check(branch.program.fixed is None, "fork", name, f"a run that can be saved; {branch.program.fixed}")
        return branch

    def fork(self, parent: Branch, to: str | None) -> None:
        """Begin a new branch at the current tick of a `forkable` one, and make it current."""
        timeline = parent.timeline.fork()
        timeline.forget()
        self._add(to or parent.name, parent.program, parent, timeline)

    def prune(self, name: str) -> None:
        """Delete a branch."""
        branch = self.branch(name)
        check(len(self._branches) > 1, "branch", name, "one of several")
        below = [each.name for each in self._branches.values() if each.parent is branch]
        check(not below, "branch", name, f"a branch without branches of its own; it has {', '.join(below)}")
        if branch is self._now:
            assert branch.parent is not None
            self._now = branch.parent
        branch.run.close()
        del self._branches[name]

    def close(self) -> None:
        """Release simulators."""
        for branch in self._branches.values():
            branch.run.close()

    def _add(
        self, like: str, program: Program, parent: Branch | None, timeline: Timeline, edited: bool = False
    ) -> None:
        name = next(each for each in numbered_names(like) if each not in self._branches)
        self._now = self._branches[name] = Branch(name, program, parent, edited, timeline)
        self._emit({"event": "samples", "branch": name, "fresh": True, "signals": {}})

    def _recompile_watches(self) -> None:
        """Make the current branch record the watched outputs."""
        old = self.now.program
        check(old.fixed is None, "watch", self.now.name, f"set before the run starts; {old.fixed}")
        self.now.switch_program(self._compile(old.diagram, self._seeds, self._watch))
