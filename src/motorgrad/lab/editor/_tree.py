"""The branches of a run, and which of them moves."""

import time
from collections.abc import Callable
from typing import Any

from motorgrad._errors import check, unknown
from motorgrad.lab._diagram import Diagram, numbered
from motorgrad.lab._files import loads
from motorgrad.lab._run import MOST_SEEDS, MOST_TICKS
from motorgrad.lab.editor._branch import FORMAT, Branch, Change
from motorgrad.lab.editor._program import Program, Values, digest, outputs, parameters

Event = dict[str, Any]
MOST = 64  # branches
LOOK = 0.03  # seconds, on the way to a tick, after which it looks whether something else is asked for


class Tree:
    """A run with all that it was and might have been.

    **Arguments:** the diagram, which is compiled when it is first needed; what takes events; what says how the run
    stands; what tells whether nothing else is asked for meanwhile.
    """

    def __init__(
        self, diagram: Diagram, tell: Callable[[Event], None], say: Callable[..., None], idle: Callable[[], bool]
    ):
        self.diagram = diagram
        """As it is in the document, compiled or not."""
        self.stale = False
        self._tell, self._say, self._idle = tell, say, idle
        self._branches: dict[str, Branch] = {}
        self._now: Branch | None = None
        self._seeds, self._watch = [0], []
        self._values: Values = {}
        self._fresh: list[str] = []

    @property
    def running(self) -> bool:
        """Whether anything is compiled."""
        return self._now is not None

    @property
    def now(self) -> Branch:
        """The branch that moves. **Raises** `ValueError` before anything runs."""
        if self._now is None:
            raise ValueError("run: nothing runs yet: play first")
        return self._now

    @property
    def tick(self) -> int:
        return self._now.program.run.tick if self._now else 0

    @property
    def step(self) -> float:
        """The seconds of a tick."""
        return self._now.program.diagram.tick if self._now else self.diagram.tick

    @property
    def warm(self) -> bool:
        """Whether what moves it was compiled before."""
        return self.now.program.run.compilations > 0

    @property
    def signature(self) -> Any:
        return self.now.program.signature

    @property
    def place(self) -> Event:
        """Where the run is."""
        if self._now is None:
            return {"branch": None, "tick": 0, "time": 0.0, "head": 0}
        return {"branch": self.now.name, "tick": self.tick, "time": self.tick * self.step, "head": self.now.head}

    def summary(self) -> Event:
        """All that clients show beside."""
        return {
            "seeds": self._seeds if len(self._seeds) <= 100 else len(self._seeds),
            "watch": self._watch,
            "branches": [branch.summary() for branch in self._branches.values()],
            "stale": self.stale,
            "fixed": self._now.program.fixed if self._now else None,
            "overrides": self._overrides(),
            "fresh": self._fresh,
        }

    def resend(self, send: Callable[[Event], None]) -> None:
        """Send what all branches saw."""
        for branch in self._branches.values():
            send({"event": "samples", "branch": branch.name, "fresh": True, "signals": branch.traces.all()})

    def begin(self) -> None:
        """Begin at tick 0 with the diagram as it stands, and forget all branches."""
        program = self._compiled(self.diagram)
        self.close()
        self._branches, self._fresh, self.stale = {}, [], False
        self._values = parameters(self.diagram)
        self._grow("main", program, None)

    def drop(self, diagram: Diagram) -> None:
        """Forget all, for another document."""
        self.close()
        self.diagram, self._branches, self._now = diagram, {}, None
        self._fresh, self._watch, self.stale = [], [], False

    def reseed(self, seeds: int | list[int]) -> None:
        """Begin again with other seeds."""
        if isinstance(seeds, int):
            check(1 <= seeds <= MOST_SEEDS, "n", seeds, f"a whole number in 1 … {MOST_SEEDS:,}")
        chosen = list(range(seeds)) if isinstance(seeds, int) else seeds
        before, self._seeds = self._seeds, chosen
        try:
            self.begin()
        except ValueError:
            self._seeds = before
            raise

    def ready(self) -> None:
        """See that what is compiled is the diagram as it stands: otherwise go on with that, as far as its blocks are
        the same, in a branch of its own."""
        if self._now is None:
            self.begin()
            return
        if not self.stale:
            return
        old = self._now
        if old.program.fixed is not None or (old.parent is None and old.head == 0):
            self.begin()
            return
        program = self._compiled(self.diagram)
        if program.fixed is not None:
            self.begin()
            return
        self._fresh = program.run.adopt(old.program.run.state)
        self.stale, self._values = False, parameters(self.diagram)
        self._grow("edit", program, old, edited=True)

    def watch_at(self, addresses: list[str]) -> None:
        """Record these outputs too."""
        known = outputs(self.diagram)
        for address in addresses:
            if address not in known:
                raise unknown("output", address, known)
        self._watch = list(dict.fromkeys(addresses))
        if self._now is not None:
            self._look(self.now)

    def retune(self, values: Values) -> None:
        """Take in the parameters of the document that changed."""
        changed = {a: value for a, value in values.items() if a not in self._values or self._values[a] != value}
        self._values = values
        changed = {a: value for a, value in changed.items() if a.rpartition(".")[0] in self.now.program.known}
        if not changed:
            return
        if self.tick < self.now.head or any(change.tick > self.tick for change in self.now.changes):
            self.fork(self.now.name, None, None)  # what was to come stays, in its own branch
        self.now.program.put(changed)
        self.now.changes += [Change(self.tick, address, value) for address, value in changed.items()]

    def advance(self, ticks: int) -> None:
        """Make ticks, with the changes that are known to come."""
        branch, run = self.now, self.now.program.run
        stop = run.tick + ticks
        check(stop <= MOST_TICKS, "ticks", stop, f"at most {MOST_TICKS:,}")
        while run.tick < stop:
            self._apply(branch)
            ends = [stop, branch.next_change(run.tick) or stop, *([branch.head] if run.tick < branch.head else [])]
            new = run.tick >= branch.head
            if not self.warm:
                self._say(compiling=True)
            record = run.advance(min(ends) - run.tick)
            if not new:
                continue
            branch.head = run.tick
            if branch.wants(run.tick):
                branch.keep(run.tick, run.state)
            signals = branch.traces.take(record)
            if signals:
                self._tell({"event": "samples", "branch": branch.name, "fresh": False, "signals": signals})
        self._apply(branch)

    def go(self, name: str, tick: int) -> None:
        """Go to a tick that was made: by the last state before it, and from there as it went."""
        branch = self._named(name)
        check(0 <= tick <= branch.head, "tick", tick, f"a whole number in 0 … {branch.head}, where {name!r} has been")
        while tick < branch.start:
            assert branch.parent is not None
            branch = branch.parent
        check(branch.program.fixed is None, "scrub", name, f"a run that can go back; {branch.program.fixed}")
        if branch is not self._now or tick != self.tick:
            self._settle(branch)
            branch.program.run.restore(branch.before(tick))
            self._travel(tick)
        self._apply(branch)

    def fork(self, name: str, tick: int | None, to: str | None) -> None:
        """A new branch, at a tick of one; it is the one that moves then."""
        parent = self._named(name)
        check(len(self._branches) < MOST, "branches", len(self._branches), f"at most {MOST}: forget some")
        check(to is None or (to and to not in self._branches), "name", to, "a new one")
        if tick is None:
            tick = self.tick if parent is self._now else parent.head
        if parent is not self._now or tick != self.tick:
            self.go(name, tick)
            check(self.tick == tick, "fork", name, "left alone until it is there")
        parent = self.now
        check(parent.program.fixed is None, "fork", name, f"a run that can be saved; {parent.program.fixed}")
        self._grow(to or parent.name, parent.program, parent)

    def prune(self, name: str) -> None:
        """Forget a branch."""
        branch = self._named(name)
        check(len(self._branches) > 1, "branch", name, "one of several")
        below = [each.name for each in self._branches.values() if each.parent is branch]
        check(not below, "branch", name, f"one without branches of its own; it has {', '.join(below)}")
        if branch is self._now:
            assert branch.parent is not None
            self.go(branch.parent.name, branch.start)
        del self._branches[name]

    def log(self, name: str | None) -> Event:
        """All that a branch's numbers follow from, up to where it is now, or to its head."""
        branch = self.now if name is None else self._named(name)
        if branch is self._now:
            state = None if branch.program.fixed else branch.program.run.state
            return branch.log(self.tick, state)
        return branch.log(branch.head, None)

    def replay(self, log: Event) -> Event:
        """Run a log again. **Returns** `branch`, `tick`, and whether it `matches` the log's digest bit for bit."""
        log = checked_log(log)
        parts = log["parts"]
        self.diagram, self._seeds = loads(parts[0]["diagram"]), log["seeds"]
        self.begin()
        for part, following in zip(parts, [*parts[1:], None], strict=True):
            if part is not parts[0]:
                self.diagram, self.stale = loads(part["diagram"]), True
                self.ready()
            self.now.changes = [Change(**change) for change in part["changes"]]
            end = log["tick"] if following is None else following["from"]
            self._travel(end)
            check(self.tick == end, "replay", self.tick, f"left alone until tick {end}")
        self._values |= self.now.values_at(self.tick)
        fixed = self.now.program.fixed is not None
        matches = None if fixed or log["digest"] is None else digest(self.now.program.run.state) == log["digest"]
        return {"branch": self.now.name, "tick": self.tick, "matches": matches}

    def close(self) -> None:
        """Let simulators go."""
        for program in {id(branch.program): branch.program for branch in self._branches.values()}.values():
            program.run.close()

    def _travel(self, to: int) -> None:
        """Advance to a tick, unless something else is asked for meanwhile."""
        ticks = 1
        while self.tick < to and self._idle():
            start = time.perf_counter()
            self.advance(min(ticks, to - self.tick))
            if time.perf_counter() - start < LOOK:
                ticks *= 2

    def _grow(self, like: str, program: Program, parent: Branch | None, edited: bool = False) -> None:
        name = next(each for each in numbered(like) if each not in self._branches)
        run = program.run
        state = None if program.fixed is not None else run.state
        self._now = self._branches[name] = Branch(name, program, run.tick, state, parent, edited)

    def _settle(self, branch: Branch) -> None:
        """Let another branch move. Of the one before, where it ends is kept."""
        old = self.now
        if self.tick == old.head and old.program.fixed is None:
            old.states[old.head] = old.program.run.state
        self._now = branch
        if branch.program.watch != self._watch:
            self._look(branch)

    def _look(self, branch: Branch) -> None:
        """Have a branch record what is watched now: compiled again, in the same state."""
        old = branch.program
        check(old.fixed is None, "watch", branch.name, f"asked for before it runs; {old.fixed}")
        branch.program = self._compiled(old.diagram)
        branch.program.run.restore(old.run.state)

    def _apply(self, branch: Branch) -> None:
        """What changes at this tick."""
        branch.program.put({change.address: change.value for change in branch.at(self.tick)})

    def _compiled(self, diagram: Diagram) -> Program:
        self._say(compiling=True)
        return Program(diagram, self._seeds, self._watch)

    def _named(self, name: str) -> Branch:
        if name not in self._branches:
            raise unknown("branch", name, self._branches)
        return self._branches[name]

    def _overrides(self) -> Values:
        """The parameters of the run that are otherwise in the document."""
        return {} if self._now is None or self.stale else self._now.program.otherwise(self._values)


def checked_log(log: Any) -> Event:
    """A log, seen to be one. **Raises** `ValueError` that says what is wrong with it."""
    check(isinstance(log, dict) and log.get("format") == FORMAT, "format", log.get("format"), f"{FORMAT!r}")
    check(log.get("version") == 1, "version", log.get("version"), "1, which this release reads")
    seeds, parts, tick = log.get("seeds"), log.get("parts"), log.get("tick")
    check(isinstance(seeds, list) and seeds, "seeds", seeds, "a list of integers")
    check(isinstance(tick, int) and 0 <= tick <= MOST_TICKS, "tick", tick, "a whole number from 0")
    check(isinstance(parts, list) and parts, "parts", parts, "a list of at least one part")
    start = 0
    for part in parts or ():
        check(isinstance(part, dict) and isinstance(part.get("diagram"), str), "part", part, "with a diagram")
        check(isinstance(part.get("from"), int) and start <= part["from"] <= tick, "from", part.get("from"), "in order")
        check(isinstance(part.get("changes"), list), "changes", part.get("changes"), "a list")
        start = part["from"]
        for change in part["changes"]:
            known = isinstance(change, dict) and set(change) == {"tick", "address", "value"}
            check(known and isinstance(change["tick"], int), "change", change, "a tick, an address and a value")
    check(parts[0]["from"] == 0, "from", parts[0]["from"], "0 in the first part")  # type: ignore[index]
    return {"digest": None, **log}
