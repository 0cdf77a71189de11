"""The run of a session, in a thread of its own: what is played, and how clients hear of it.

The event `run` says how it stands: `state` (`"empty"`, `"paused"`, `"playing"` or `"compiling"`), `branch`, `tick`,
`time`, `head` (the last tick of the branch), `speed` as wanted and `achieved`, `seeds`, `watch`, `branches`;
`stale`, whether the diagram was changed in structure since it was compiled: it goes on with the new one, as a branch
of its own, when next played; `fixed`, why it cannot go back in time, or `null`; `overrides`, parameters that are
otherwise in this branch than in the diagram; `fresh`, blocks that began anew when it was last compiled. Fields that are
missing have not changed.
"""

import queue
import threading
import time
from collections.abc import Callable
from typing import Any

from motorgrad._errors import check
from motorgrad.lab._diagram import Diagram
from motorgrad.lab._problems import DiagramError
from motorgrad.lab.editor import _run_protocol as run
from motorgrad.lab.editor._program import parameters, signature
from motorgrad.lab.editor._protocol import Operation
from motorgrad.lab.editor._tree import Tree

FRAME = 1 / 30  # seconds
Event = dict[str, Any]
Done = Callable[[Exception | None], None]
Command = Callable[[], None]


class Runner:
    """Plays a diagram.

    **Arguments:** the diagram, and what takes its events, in the thread of the run.
    """

    def __init__(self, diagram: Diagram, tell: Callable[[Event], None]):
        self._tell = tell
        self._commands: queue.SimpleQueue[Command | None] = queue.SimpleQueue()
        self._newest: Operation | None = None
        self._tree = Tree(diagram, self._tell, self._say, self._commands.empty)
        self._playing, self._until = False, None
        self._finish: list[Done] = []
        self._speed: float | None = 1.0
        self._rate, self._since, self._begun = 0.0, 0.0, 0
        self._next, self._span = 0.0, (0.0, 0)
        self.status: Event = {"event": "run"}
        """The last event `run`, whole."""
        self._say(whole=True)
        self._thread = threading.Thread(target=self._live, name="motorgrad-lab-run", daemon=True)
        self._thread.start()

    def put(self, operation: Operation, done: Done, answer: Callable[[Event], None]) -> None:
        """Have an operation performed; `done` hears when it was, or why not."""

        def perform() -> None:
            try:
                if self._perform(operation, done, answer):
                    done(None)
            except Exception as error:  # whatever a block's own code raises must not end the thread
                self._pause()
                done(error)

        self._newest = operation
        self._commands.put(perform)

    def edit(self, diagram: Diagram, fresh: bool = False) -> None:
        """Go on with a diagram that was changed; with a `fresh` one nothing of the run before is left."""

        def follow() -> None:
            if fresh:
                self._tree.drop(diagram)
                self._pause()
            else:
                self._follow(diagram)

        self._commands.put(follow)

    def welcome(self, send: Callable[[Event], None]) -> None:
        """Tell a client that comes later how things are, and were."""
        send(dict(self.status))
        self._commands.put(lambda: self._tree.resend(send))

    def close(self) -> None:
        """End the thread, after the tick that is being made."""
        self._commands.put(None)
        self._thread.join(60)

    def _live(self) -> None:
        while True:
            command = self._awaited()
            if command is None:
                self._tree.close()
                return
            command()

    def _awaited(self) -> Command | None:
        """The next command; a frame, where none comes in time."""
        if not self._playing:
            return self._commands.get()
        try:
            return self._commands.get(timeout=max(0.0, self._next - time.monotonic()))
        except queue.Empty:
            return self._frame

    def _perform(self, operation: Operation, done: Done, answer: Callable[[Event], None]) -> bool:
        """Do it. **Returns** whether it is done at once."""
        tree = self._tree
        match operation:
            case run.Play():
                self._go(operation.speed)
                return True
            case run.Tick():
                check(operation.n >= 1, "n", operation.n, "a whole number from 1")
                if self._until is None:
                    self._go(None, operation.n)
                else:
                    self._until += operation.n
                self._finish.append(done)
                self._frame()  # at once: what is asked for next finds them made
                return False
            case run.Speed():
                self._speed = _checked(operation.speed)
                self._rebase()
            case run.Pause():
                self._pause()
            case run.Reset():
                self._pause()
                tree.begin()
            case run.Seeds():
                self._pause()
                tree.reseed(operation.n)
            case run.Watch():
                tree.watch_at(operation.addresses)
            case run.Scrub():
                self._pause()
                if self._newest is operation or not isinstance(self._newest, run.Scrub):
                    tree.go(operation.branch, operation.tick)
            case run.Fork():
                tree.fork(operation.branch, operation.tick, operation.name)
                self._rebase()
            case run.Prune():
                tree.prune(operation.branch)
            case run.Log():
                answer({"event": "log", "log": tree.log(operation.branch)})
            case run.Replay():
                self._pause()
                self._tell({"event": "replayed", **tree.replay(operation.log)})
        self._say(whole=True)
        return True

    def _go(self, speed: float | None, ticks: int | None = None) -> None:
        """Begin to play, for so many ticks or until told otherwise."""
        speed = _checked(speed)
        self._pause()
        self._tree.ready()
        self._speed = speed
        self._playing, self._until = True, None if ticks is None else self._tree.tick + ticks
        self._rebase()
        self._say(whole=True)

    def _pause(self) -> None:
        self._playing, self._until = False, None
        finished, self._finish = self._finish, []
        self._say(whole=True)
        for done in finished:
            done(None)

    def _frame(self) -> None:
        """As many ticks as are due by now, and no more than leave the thread free to listen."""
        now, tree = time.monotonic(), self._tree
        self._next = now + (FRAME if self._speed else 0.0)
        most = max(1, int(self._rate * FRAME))
        due = most
        if self._speed:
            wanted = self._begun + (now - self._since) * self._speed / tree.step
            due = int(wanted) - tree.tick
            if due > 3 * most:  # it cannot keep up: what was missed is not caught up with
                self._rebase()
        ticks = min(due, most)
        if self._until is not None:
            ticks = min(ticks, self._until - tree.tick)
        try:
            if ticks > 0:
                warm, start = tree.warm, time.perf_counter()
                tree.advance(ticks)
                if warm:
                    rate = ticks / max(1e-6, time.perf_counter() - start)
                    self._rate = min(rate, 4 * self._rate) if self._rate else min(rate, 1000.0)
        except Exception as error:
            self._tell({"event": "error", "message": " ".join(str(error).splitlines())})
            self._pause()
            return
        if self._until is not None and tree.tick >= self._until:
            self._pause()
        else:
            self._say()

    def _rebase(self) -> None:
        """Count what is due from here."""
        self._since, self._begun = time.monotonic(), self._tree.tick
        self._span = self._since, self._begun

    def _follow(self, diagram: Diagram) -> None:
        """Take in a changed diagram: new parameters at once, a new structure when it next runs, or now if it does."""
        tree = self._tree
        tree.diagram = diagram
        if not tree.running:
            return
        try:
            same = signature(diagram) == tree.signature
        except DiagramError:
            same = False
            if self._playing:
                self._pause()
        stale, tree.stale = tree.stale, not same
        try:
            if same:
                tree.retune(parameters(diagram))
            elif self._playing:
                tree.ready()
                self._rebase()
        except Exception as error:
            self._tell({"event": "error", "message": " ".join(str(error).splitlines())})
            self._pause()
        if same or stale != tree.stale or self._playing:
            self._say(whole=True)

    def _say(self, whole: bool = False, compiling: bool = False) -> None:
        """Tell how the run stands."""
        tree = self._tree
        state = "compiling" if compiling else "playing" if self._playing else "paused" if tree.running else "empty"
        event: Event = {"event": "run", "state": state, **tree.place, "achieved": self._achieved()}
        if whole:
            event |= {"speed": self._speed, **tree.summary()}
        self.status = self.status | event
        self._tell(event)

    def _achieved(self) -> float | None:
        """The speed of the last second or so."""
        if not self._playing:
            return None
        now, (since, begun) = time.monotonic(), self._span
        seconds = now - since
        if seconds > 2:
            self._span = now, self._tree.tick
        return None if seconds < 0.2 else (self._tree.tick - begun) * self._tree.step / seconds


def _checked(speed: float | None) -> float | None:
    check(speed is None or 0 < speed <= 1e9, "speed", speed, "a number above 0, or null for the greatest")
    return speed
