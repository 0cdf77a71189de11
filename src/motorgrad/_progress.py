"""A progress bar for long computations."""

import math
import sys
from collections import deque
from time import perf_counter
from types import TracebackType
from typing import Any, Self

from rich.console import Console
from rich.progress import BarColumn, ProgressColumn, Task, TextColumn
from rich.progress import Progress as Bar
from rich.table import Column
from rich.text import Text

RECENT = 30.0  # seconds, from which the time left is estimated
MIN_RECENT_COUNT = 20  # times something was done, likewise, where they took longer
ENOUGH = 0.5  # seconds, before which an estimate would be a guess


class Progress:
    """A progress bar on a terminal; elsewhere an occasional line. The bar has the time left, or the time since the
    beginning as long as nothing is known of what is left.

    **Arguments:** what is in progress; the unit that is `counted`, in the plural, such as `"decisions"`; the counts at
    the end (`total`) and at the `start`; whether anything is `shown`; what the bar says `at_first`, until it has the
    time left.
    """

    LINES = 10  # printed in total without a terminal

    def __init__(self, name: str, counted: str, total: int, start: int, shown: bool, at_first: str = ""):
        self.name, self.counted, self.total, self.shown, self.at_first = name, counted, total, shown, at_first
        self.console = Console(file=sys.stderr)
        self._bar = Bar(
            TextColumn("[bold]{task.description}"),
            BarColumn(bar_width=12),
            TextColumn("{task.percentage:>3.0f}%"),
            _Time(table_column=Column(no_wrap=True, min_width=9)),
            # facts that do not fit are cut off at the end
            TextColumn("{task.fields[facts]}", table_column=Column(ratio=1, no_wrap=True, overflow="ellipsis")),
            expand=True,
            console=self.console,
            disable=not (shown and self.console.is_terminal),
        )
        self._id = self._bar.add_task(name, facts=at_first, left=None)
        self._updated = False
        self.begin(start, total)

    def begin(self, start: int, total: int) -> None:
        """Continue from another count, to another total."""
        self.total = total
        self._line = start * self.LINES // max(total, 1)
        self._bar.update(self._id, completed=start, total=total)
        if start >= total:
            self._bar.update(self._id, facts="")
        self._done = start
        self._since = perf_counter()
        self._recent = deque[tuple[float, int]]()  # seconds, and how much was done in them
        # the sums
        self._seconds = 0.0
        self._made = 0

    def update(self, done: int, facts: str, usual: bool = True) -> None:
        """Show that `done` is reached, with some `facts`. Unless it was `usual`, the time since the last update says
        nothing about the time left."""
        if not self.shown:
            return
        left = self._time_left(done, usual)
        self._updated = True
        waiting = left is None and done < self.total
        in_bar = " · ".join(filter(None, [self.at_first if waiting else "", facts]))
        self._bar.update(self._id, completed=done, facts=in_bar, left=left)
        number = done * self.LINES // max(self.total, 1)
        if not self.console.is_terminal and number > self._line:
            self._line = number
            said = f"{self.name}: {done:,}/{self.total:,} {self.counted}"
            remaining = "" if left is None or done >= self.total else f"{left:.0f} s left"
            self.console.print(" · ".join(filter(None, [said, facts, remaining])), soft_wrap=True)

    def _time_left(self, done: int, usual: bool) -> float | None:
        """Seconds left at the pace of late, or `None` as long as it is not known."""
        now = perf_counter()
        made = done - self._done
        if made > 0:
            if usual:
                self._note(now - self._since, made)
            self._done, self._since = done, now
        return None if self._seconds < ENOUGH else (self.total - done) * self._seconds / self._made

    def _note(self, seconds: float, made: int) -> None:
        """Take something done into the estimate, and leave out what was done longest ago."""
        recent = self._recent
        recent.append((seconds, made))
        self._seconds = self._seconds + seconds
        self._made = self._made + made
        while len(recent) > MIN_RECENT_COUNT and self._seconds - recent[0][0] >= RECENT:
            seconds, made = recent.popleft()
            self._seconds = self._seconds - seconds
            self._made = self._made - made

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> Any:
        # a bar of work that never began would stand above the error as if it had
        self._bar.live.transient = error is not None and not self._updated
        self._bar.stop()


class _Time(ProgressColumn):
    """The time left, if it is known and something is left; else the time since the beginning."""

    def render(self, task: Task) -> Text:
        left = task.fields["left"]
        if task.finished or left is None:
            elapsed = (task.finished_time if task.finished else task.elapsed) or 0.0
            return Text(_clock(elapsed), style="progress.elapsed")
        return Text(f"{_clock(math.ceil(left))} left", style="progress.remaining")


def _clock(seconds: float) -> str:
    minutes, seconds = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02}" if hours else f"{minutes}:{seconds:02}"
