"""The branches of a run, one of which is current."""

import functools
import time
from collections.abc import Callable, Sequence
from typing import Any

from motorgrad._errors import check, unknown
from timlab.diagram import Diagram, Record, loads, numbered_names
from timlab.editor._branch import Branch, checked_log
from timlab.editor._compilation import Compilation
from timlab.editor._program import Program, Values, outputs, parameters
from timlab.engine import MAX_SEEDS, MAX_TICKS, RunFault, Timeline

Event = dict[str, Any]
MAX_BRANCHES = 64
POLL = 0.03  # seconds between checks for other commands on the way to a tick


class Tree:
    """A run with all of its branches.

    **Arguments:** the diagram, which is compiled when it is first needed; a function that takes events; one that
    reports the state of the run; one that tells whether no other command is waiting; one that tells whether to stop
    compiling.
    """

    def __init__(
        self,
        diagram: Diagram,
        emit: Callable[[Event], None],
        report: Callable[..., None],
        idle: Callable[[], bool],
        stopped: Callable[[], bool],
    ):
        self.diagram = diagram
        """The diagram of the document, compiled or not."""
        self.stale = False
        self._emit, self._report, self._idle = emit, report, idle
        self._compilation = Compilation(
            stopped,
            lambda seconds: report(compiling=seconds),
            lambda message: emit({"event": "error", "message": message}),
        )
        self._branches: dict[str, Branch] = {}
        self._now: Branch | None = None
        self._seeds = [0]
        self._watch = []
        self._values: Values = {}
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
        return self._now.timeline.tick if self._now else 0

    @property
    def step(self) -> float:
        """The length of a tick in seconds."""
        return self._now.program.diagram.tick if self._now else self.diagram.tick

    @property
    def signature(self) -> Any:
        return self.now.program.signature

    @property
    def place(self) -> Event:
        """The current branch, tick and time."""
        if self._now is None:
            return {"branch": None, "tick": 0, "time": 0.0, "head": 0}
        head = self.now.timeline.end
        return {"branch": self.now.name, "tick": self.tick, "time": self.tick * self.step, "head": head}

    def summary(self) -> Event:
        """Everything else that clients show of the run."""
        return {
            "seeds": self._seeds if len(self._seeds) <= 100 else len(self._seeds),
            "watch": self._watch,
            "branches": [branch.summary() for branch in self._branches.values()],
            "stale": self.stale,
            "fixed": self._now.program.fixed if self._now else None,
            "overrides": self._overrides(),
            "fresh": self._fresh,
            "faults": self._now.faults.list if self._now else [],
        }

    def resend(self, send: Callable[[Event], None]) -> None:
        """Send what all branches recorded."""
        for branch in self._branches.values():
            send({"event": "samples", "branch": branch.name, "fresh": True, "signals": branch.traces.all()})

    def begin(self) -> None:
        """Start at tick 0 with the current diagram, and discard all branches."""
        program = self._compiled(self.diagram)
        self.close()
        self._branches = {}
        self._fresh = []
        self.stale = False
        self._values = parameters(self.diagram)
        self._add_branch("main", program, None)

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
        program = self._compiled(self.diagram)
        if program.fixed is not None:
            self.begin()
            return
        self._fresh = program.run.restore_matching(old.run.state)
        self.stale = False
        self._values = parameters(self.diagram)
        self._add_branch("edit", program, old, edited=True)

    def set_watches(self, addresses: Sequence[str]) -> None:
        """Record these outputs too."""
        known = outputs(self.diagram)
        for address in addresses:
            if address not in known:
                raise unknown("output", address, known)
        self._watch = list(dict.fromkeys(addresses))
        if self._now is not None:
            self._recompile_watches()

    def update_parameters(self, values: Values) -> None:
        """Apply the parameters of the document that changed."""
        changed = {a: value for a, value in values.items() if a not in self._values or self._values[a] != value}
        self._values = values
        if not changed:
            return
        timeline = self.now.timeline
        if self.tick < timeline.end or (timeline.log and timeline.log[-1].tick > self.tick):
            self.fork(self.now.name, None, None)  # the known future is kept, in its own branch
        self.now.set_parameters(changed)

    def advance(self, ticks: int) -> None:
        """Run a number of ticks, repeating the known ones."""
        branch, timeline = self.now, self.now.timeline
        stop = self.tick + ticks
        check(stop <= MAX_TICKS, "ticks", stop, f"at most {MAX_TICKS:,}")
        if self.tick < timeline.end:
            timeline.advance(min(stop, timeline.end) - self.tick)
        if self.tick < stop:
            try:
                self._show(branch, timeline.advance(stop - self.tick))
            except RunFault as fault:
                branch.faults.stop(fault)
                if fault.record is not None:
                    self._show(branch, fault.record)
                raise
            known = branch.faults.list
            if new := branch.faults.observe(branch.run):
                self._emit({"event": "error", "message": str(new[0])})
            if new or known != branch.faults.list:
                self._report(whole=True)
        branch.run.wait()

    def _show(self, branch: Branch, record: Record) -> None:
        signals = branch.traces.add(record)
        if signals:
            self._emit({"event": "samples", "branch": branch.name, "fresh": False, "signals": signals})

    def seek(self, name: str, tick: int) -> None:
        """Go to a known tick: restore the last snapshot before it, and repeat what followed."""
        branch = self._branch(name)
        end = self._branch(name).timeline.end
        check(0 <= tick <= end, "tick", tick, f"an integer from 0 to {end}, the ticks that {name!r} has reached")
        check(branch.program.fixed is None, "scrub", name, f"a run that can go back; {branch.program.fixed}")
        while tick < branch.first:
            assert branch.parent is not None
            branch = branch.parent
        self._now = branch
        if branch.program.watch != self._watch:
            self._recompile_watches()
        nearest = max(known for known in branch.timeline.snapshots if known <= tick)
        if tick < self.tick or nearest > self.tick:
            branch.timeline.seek(nearest)
        self._advance_unless_interrupted(tick)

    def fork(self, name: str, tick: int | None, to: str | None) -> None:
        """Begin a new branch at a tick of another one, and make it current."""
        check(
            len(self._branches) < MAX_BRANCHES, "branches", len(self._branches), f"at most {MAX_BRANCHES}: delete some"
        )
        check(to is None or (to and to not in self._branches), "name", to, "a new name")
        parent = self._branch(name)
        check(parent.program.fixed is None, "fork", name, f"a run that can be saved; {parent.program.fixed}")
        if tick is not None:
            self.seek(name, tick)
            check(self.tick == tick, "fork", name, "not interrupted before it arrives")
            parent = self.now
        timeline = parent.timeline.fork()
        timeline.forget()
        self._add_branch(to or parent.name, parent.program, parent, timeline=timeline)

    def prune(self, name: str) -> None:
        """Delete a branch."""
        branch = self._branch(name)
        check(len(self._branches) > 1, "branch", name, "one of several")
        below = [each.name for each in self._branches.values() if each.parent is branch]
        check(not below, "branch", name, f"a branch without branches of its own; it has {', '.join(below)}")
        if branch is self._now:
            assert branch.parent is not None
            self._now = branch.parent
        branch.run.close()
        del self._branches[name]

    def log(self, name: str | None) -> Event:
        """Everything that determines a branch's numbers, up to its current tick."""
        return (self.now if name is None else self._branch(name)).log()

    def replay(self, log: Event) -> Event:
        """Replay a log. **Returns** `branch`, `tick`, and whether the state `matches` the log's digest bit for bit."""
        log = checked_log(log)
        parts = log["parts"]
        self.diagram = loads(parts[0]["diagram"])
        self.reseed(log["seeds"])
        for part in parts:
            if part is not parts[0]:
                self.diagram = loads(part["diagram"])
                self.stale = True
                self.ensure_compiled()
            for change in part["changes"]:
                self._advance_to(change["tick"])
                self.now.timeline[change["address"]] = change["value"]
                self._values[change["address"]] = change["value"]
            self._advance_to(part["until"])
        again = self.now.log()["digest"]
        matches = None if again is None or log["digest"] is None else again == log["digest"]
        return {"branch": self.now.name, "tick": self.tick, "matches": matches}

    def close(self) -> None:
        """Release simulators."""
        for branch in self._branches.values():
            branch.run.close()

    def _advance_to(self, tick: int) -> None:
        """Advance to a tick. **Raises** `ValueError` if another command interrupts it."""
        self._advance_unless_interrupted(tick)
        check(self.tick == tick, "replay", self.tick, f"not interrupted before tick {tick}")

    def _advance_unless_interrupted(self, to: int) -> None:
        """Advance to a tick, unless another command arrives."""
        ticks = 1
        while self.tick < to and self._idle():
            start = time.perf_counter()
            self.advance(min(ticks, to - self.tick))
            if time.perf_counter() - start < POLL:
                ticks *= 2

    def _add_branch(
        self,
        like: str,
        program: Program,
        parent: Branch | None,
        edited: bool = False,
        timeline: Timeline | None = None,
    ) -> None:
        name = next(each for each in numbered_names(like) if each not in self._branches)
        self._now = self._branches[name] = Branch(name, program, parent, edited, timeline)
        self._emit({"event": "samples", "branch": name, "fresh": True, "signals": {}})

    def _recompile_watches(self) -> None:
        """Make the current branch record the watched outputs."""
        old = self.now.program
        check(old.fixed is None, "watch", self.now.name, f"set before the run starts; {old.fixed}")
        self.now.switch_program(self._compiled(old.diagram))

    def _compiled(self, diagram: Diagram) -> Program:
        self._report(compiling=0.0)
        made = self._compilation(lambda: Program(diagram, self._seeds, self._watch))
        made.run.search = functools.partial(self._compilation, what="the search for what went wrong")
        made.run.warn = lambda message: None  # the page shows what the run tells
        return made

    def _branch(self, name: str) -> Branch:
        if name not in self._branches:
            raise unknown("branch", name, self._branches)
        return self._branches[name]

    def _overrides(self) -> Values:
        """The parameters of the run that differ from the document."""
        return {} if self._now is None or self.stale else self._now.overrides(self._values)
