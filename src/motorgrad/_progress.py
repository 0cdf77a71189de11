"""A progress bar for long computations."""

import sys
from types import TracebackType
from typing import Any, Self

from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar
from rich.table import Column


class Progress:
    """A progress bar on a terminal; elsewhere an occasional line.

    **Arguments:**

    - `name`: what is in progress.
    - `counted`: the unit, in the plural, such as `"decisions"`.
    - `total`: the count at the end.
    - `start`: the count at the beginning.
    - `shown`: `False` prints nothing.
    """

    LINES = 10  # printed in total without a terminal

    def __init__(self, name: str, counted: str, total: int, start: int, shown: bool):
        self.name, self.counted, self.total, self.shown = name, counted, total, shown
        self.console = Console(file=sys.stderr)
        self._line = start * self.LINES // max(total, 1)
        self._bar = Bar(
            TextColumn("[bold]{task.description}"),
            BarColumn(bar_width=12),
            TextColumn("{task.percentage:>3.0f}%"),
            TimeRemainingColumn(table_column=Column(no_wrap=True, min_width=7)),
            # facts that do not fit are cut off at the end
            TextColumn("{task.fields[facts]}", table_column=Column(ratio=1, no_wrap=True, overflow="ellipsis")),
            expand=True,
            console=self.console,
            disable=not (shown and self.console.is_terminal),
        )
        self._id = self._bar.add_task(name, total=total, completed=start, facts="")

    def update(self, done: int, facts: str, without_bar: str = "") -> None:
        """Show that `done` is reached, with some `facts`; lines printed without a bar append `without_bar`."""
        if not self.shown:
            return
        self._bar.update(self._id, completed=done, facts=facts)
        number = done * self.LINES // max(self.total, 1)
        if not self.console.is_terminal and number > self._line:
            self._line = number
            said = f"{self.name}: {done:,}/{self.total:,} {self.counted}"
            self.console.print(" · ".join(filter(None, [said, facts, without_bar])), soft_wrap=True)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> Any:
        self._bar.stop()
