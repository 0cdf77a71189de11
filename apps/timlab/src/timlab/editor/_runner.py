"""Play a session's run in its own thread, and report to clients.

The event `run` has `state` (`"empty"`, `"paused"`, `"playing"` or `"compiling"`), `branch`, `tick`, `time`, `head` (the
last tick of the branch), the requested `speed` and the one `achieved`, `seeds`, `watch` and `branches`; `stale`: the
structure of the diagram changed since it was compiled, and the run will continue with the new one in a new branch;
`waited`: for how many seconds it has been compiling, or `null`; `fixed`: why it cannot go back in time, or `null`;
`overrides`: parameters of this branch that differ from the diagram; `fresh`: blocks that started anew at the last
compilation; `faults`: what stopped this branch, as NaN in a block, and what its run warned of, as problems. Missing
fields have not changed.
"""

import functools
import math
import queue
import threading
import time
from collections.abc import Callable
from typing import Any

from motorgrad._errors import check
from motorgrad.pages import Clock
from timlab.diagram import Diagram, DiagramError, Record, loads
from timlab.editor import _protocol as ask
from timlab.editor._branch import Branch, checked_log
from timlab.editor._compilation import Compilation
from timlab.editor._page import page
from timlab.editor._program import Program, learns, signature
from timlab.editor._tree import Tree
from timlab.engine import MAX_TICKS, RunFault

FRAME = 1 / 30  # seconds
POLL = 0.03  # seconds between checks for other commands on the way to a tick
MAX_REAL_TIME_TICK = 0.1  # seconds; nobody wants to wait for longer ones
Event = dict[str, Any]
Done = Callable[[Exception | None], None]
Command = Callable[[], None]


class Runner:
    """Plays a diagram.

    **Arguments:** the diagram, and a function that takes its events, in the thread of the run.
    """

    def __init__(self, diagram: Diagram, emit: Callable[[Event], None]):
        self._emit = emit
        self._commands: queue.SimpleQueue[Command | None] = queue.SimpleQueue()
        self._newest: ask.RunOperation | None = None
        self._stops: queue.SimpleQueue[None] = queue.SimpleQueue()
        """One for each command in the queue that must not wait for the compiler."""
        self._compilation = Compilation(
            lambda: not self._stops.empty(), lambda seconds: self._report(compiling=seconds), self._say
        )
        self._tree = Tree(diagram, self._compile, emit)
        self._chosen = speed_for(diagram)
        """The speed at which it plays; single ticks are made as fast as possible."""
        self._clock = Clock(diagram.tick, self._chosen, slice=FRAME)
        self._until: int | None = None
        self._finish: list[Done] = []
        self._next = 0.0
        self.status: Event = {"event": "run"}
        """The last complete `run` event."""
        self._report(whole=True)
        self._thread = threading.Thread(target=self._work, name="motorgrad-lab-run", daemon=True)
        self._thread.start()

    def submit(self, operation: ask.RunOperation, done: Done, answer: Callable[[Event], None]) -> None:
        """Queue an operation; `done` is called when it is performed, with the error if it failed."""

        def perform() -> None:
            try:
                if self._perform(operation, done, answer):
                    done(None)
            except Exception as error:  # a block's own code may raise anything; it must not end the thread
                self._pause()
                done(error)

        self._newest = operation
        self._queue(perform, stops=isinstance(operation, ask.Pause | ask.Reset))

    def edit(self, diagram: Diagram, fresh: bool = False) -> None:
        """Continue with a changed diagram; a `fresh` one discards the previous run."""

        def begin_anew() -> None:
            self._tree.discard(diagram)
            self._chosen = speed_for(diagram)
            self._pause()

        self._queue(begin_anew if fresh else lambda: self._apply_edit(diagram), stops=fresh)

    def greet(self, send: Callable[[Event], None]) -> None:
        """Send the current state and all recorded signals to a client that joins later."""
        send(dict(self.status))

        def resend() -> None:
            for event in self._tree.samples():
                send(event)

        self._commands.put(resend)

    def close(self) -> None:
        """End the thread after the current tick."""
        self._stops.put(None)
        self._commands.put(None)
        self._thread.join(60)

    def _queue(self, command: Command, stops: bool) -> None:
        """Queue a command; for one that `stops`, the compiler is left to itself."""

        def stop() -> None:
            self._stops.get()
            command()

        if stops:
            self._stops.put(None)
        self._commands.put(stop if stops else command)

    def _work(self) -> None:
        while True:
            command = self._next_command()
            if command is None:
                self._tree.close()
                return
            command()

    def _next_command(self) -> Command | None:
        """The next command, or a frame if none arrives in time."""
        if not self._clock.playing:
            return self._commands.get()
        try:
            return self._commands.get(timeout=max(0.0, self._next - time.monotonic()))
        except queue.Empty:
            return self._frame

    def _perform(self, operation: ask.RunOperation, done: Done, answer: Callable[[Event], None]) -> bool:
        """Perform an operation. **Returns** whether it is done at once."""
        tree = self._tree
        match operation:
            case ask.Play():
                self._start(operation.speed)
                return True
            case ask.Tick():
                check(operation.n >= 1, "n", operation.n, "an integer from 1")
                if self._until is None:
                    self._start(None, operation.n)
                else:
                    self._until += operation.n
                self._finish.append(done)
                self._frame()  # at once, so that the next operation finds these ticks made
                return False
            case ask.Speed():
                self._chosen = self._clock.speed = _checked_speed(operation.speed)
            case ask.Pause():
                self._pause()
            case ask.Reset():
                self._pause()
                tree.begin()
            case ask.Seeds():
                playing, until = self._clock.playing, self._until
                self._pause()
                tree.reseed(operation.n)
                if playing and until is None:  # it goes on with the new seeds
                    self._start(None if math.isinf(self._chosen) else self._chosen)
            case ask.Watch():
                tree.set_watches(operation.addresses)
            case ask.Scrub():
                self._pause()
                if self._newest is operation or not isinstance(self._newest, ask.Scrub):
                    self._seek(operation.branch, operation.tick)
            case ask.Fork():
                parent = tree.forkable(operation.branch, operation.name)
                if operation.tick is not None:
                    self._seek(operation.branch, operation.tick)
                    check(tree.tick == operation.tick, "fork", operation.branch, "not interrupted before it arrives")
                    parent = tree.now
                tree.fork(parent, operation.name)
                self._clock.restart()
            case ask.Prune():
                tree.prune(operation.branch)
            case ask.Log():
                branch = tree.now if operation.branch is None else tree.branch(operation.branch)
                answer({"event": "log", "log": branch.log()})
            case ask.Page():
                run = {**self.status, **tree.summary()}
                answer({"event": "page", "text": page(tree.diagram, run, tree.samples())})
            case ask.Replay():
                self._pause()
                self._emit({"event": "replayed", **self._replay(operation.log)})
        self._report(whole=True)
        return True

    def _start(self, speed: float | None, ticks: int | None = None) -> None:
        """Start playing, for a number of ticks or until paused."""
        wanted = _checked_speed(speed)
        self._pause()
        self._tree.ensure_compiled()
        self._until = None if ticks is None else self._tree.tick + ticks
        self._chosen = wanted if ticks is None else self._chosen
        self._clock.period, self._clock.speed = self._tree.step, wanted
        self._clock.play()
        self._report(whole=True)

    def _pause(self) -> None:
        self._clock.pause()
        self._until = None
        finished = self._finish
        self._finish = []
        self._report(whole=True)
        for done in finished:
            done(None)

    def _frame(self) -> None:
        """Run the ticks that are due, but no more than leave the thread responsive."""
        tree, clock = self._tree, self._clock
        self._next = time.monotonic() + (0.0 if math.isinf(clock.speed) else FRAME)
        ticks = clock.due()
        if self._until is not None:
            ticks = min(ticks, self._until - tree.tick)
        ticks = min(ticks, MAX_TICKS - tree.tick)
        try:
            if ticks > 0:
                start = time.perf_counter()
                self._advance(ticks)
                clock.record(ticks, time.perf_counter() - start)
        except Exception as error:
            self._say(error)
            self._pause()
            return
        over = tree.tick >= MAX_TICKS
        if over:
            self._say(f"tick {tree.tick:,} is the last of a run; reset it")
        if over or (self._until is not None and tree.tick >= self._until):
            self._pause()
        else:
            self._report()

    def _advance(self, ticks: int) -> None:
        """Run a number of ticks, repeating the known ones, and show what is new."""
        branch = self._tree.now
        stop = self._tree.tick + ticks
        check(stop <= MAX_TICKS, "ticks", stop, f"at most {MAX_TICKS:,}")
        known = branch.faults
        warned = len(branch.warned)
        try:
            self._show(branch, branch.advance(ticks))
        except RunFault as fault:
            self._show(branch, fault.record)
            raise
        for problem in branch.warned[warned : warned + 1]:
            self._say(problem)
        if branch.faults != known:
            self._report(whole=True)
        branch.run.wait()

    def _show(self, branch: Branch, record: Record | None) -> None:
        signals = {} if record is None else branch.traces.add(record)
        if signals:
            self._emit({"event": "samples", "branch": branch.name, "fresh": False, "signals": signals})

    def _seek(self, branch: str, tick: int) -> None:
        """Go to a known tick: restore the last snapshot before it, and repeat what followed."""
        self._tree.approach(branch, tick)
        self._advance_unless_interrupted(tick)

    def _advance_unless_interrupted(self, to: int) -> None:
        """Advance to a tick, unless another command arrives."""
        ticks = 1
        while self._tree.tick < to and self._commands.empty():
            start = time.perf_counter()
            self._advance(min(ticks, to - self._tree.tick))
            if time.perf_counter() - start < POLL:
                ticks *= 2

    def _replay(self, log: Event) -> Event:
        """Replay a log. **Returns** `branch`, `tick`, and whether the state `matches` the log's digest bit for bit.

        **Raises** `ValueError` if another command interrupts it.
        """
        tree = self._tree

        def advance(tick: int) -> None:
            self._advance_unless_interrupted(tick)
            check(tree.tick == tick, "replay", tree.tick, f"not interrupted before tick {tick}")

        log = checked_log(log)
        for number, part in enumerate(log["parts"]):
            tree.diagram = loads(part["diagram"])
            if number == 0:
                tree.reseed(log["seeds"])
            else:
                tree.stale = True
                tree.ensure_compiled()
            for change in part["changes"]:
                advance(change["tick"])
                tree.now.timeline[change["address"]] = change["value"]
                tree.values[change["address"]] = change["value"]
            advance(part["until"])
        again = tree.now.log()["digest"]
        matches = None if again is None or log["digest"] is None else again == log["digest"]
        return {"branch": tree.now.name, "tick": tree.tick, "matches": matches}

    def _compile(self, diagram: Diagram, seeds: list[int], watch: list[str]) -> Program:
        """Compile a diagram, unless a command that must not wait arrives."""
        self._report(compiling=0.0)
        made = self._compilation(lambda: Program(diagram, seeds, watch))
        made.run.search = functools.partial(self._compilation, what="the search for what went wrong")
        made.run.warn = lambda message: None  # the page shows what the run tells
        return made

    def _say(self, message: object) -> None:
        """Tell all clients of an error."""
        self._emit({"event": "error", "message": " ".join(str(message).splitlines())})

    def _apply_edit(self, diagram: Diagram) -> None:
        """Apply a changed diagram: new parameters at once; a new structure when it next runs, or at once while it
        plays.
        """
        tree = self._tree
        tree.diagram = diagram
        if not tree.running:
            return
        try:
            same = signature(diagram) == tree.now.program.signature
        except DiagramError:
            same = False
            if self._clock.playing:
                self._pause()
        stale = tree.stale
        tree.stale = not same
        try:
            if same:
                tree.update_parameters()
            elif self._clock.playing:
                tree.ensure_compiled()
                self._clock.period = tree.step
                self._clock.restart()
        except Exception as error:
            self._say(error)
            self._pause()
        if same or stale != tree.stale or self._clock.playing:
            self._report(whole=True)

    def _report(self, whole: bool = False, compiling: float | None = None) -> None:
        """Report the state of the run; while it is `compiling`, for how many seconds so far."""
        tree, clock = self._tree, self._clock
        quiet = "playing" if clock.playing else "paused" if tree.running else "empty"
        event: Event = {"event": "run", "state": quiet if compiling is None else "compiling", "waited": compiling}
        event |= {**tree.place(), "achieved": clock.achieved(tree.tick) or None}
        if whole:
            event |= {"speed": None if math.isinf(self._chosen) else self._chosen, **tree.summary()}
        self.status = self.status | event
        self._emit(event)


def speed_for(diagram: Diagram) -> float:
    """The speed at which a diagram begins: as fast as possible if something in it learns or its ticks are long,
    otherwise real time.
    """
    return math.inf if learns(diagram) or diagram.tick > MAX_REAL_TIME_TICK else 1.0


def _checked_speed(speed: float | None) -> float:
    """The speed in simulated seconds per second; infinite for None."""
    check(speed is None or 0 < speed <= 1e9, "speed", speed, "a number above 0, or null for the highest speed")
    return math.inf if speed is None else speed
