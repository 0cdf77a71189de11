"""Progress of a long run: decisions per second, simulated time, the latest reward, the time left."""

import sys
from collections.abc import Mapping
from types import TracebackType
from typing import Any, Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Column

from motorgrad.tasks import Task


class Report:
    """A progress bar on a terminal; where there is none, a line now and then. `shown=False` is silent."""

    LINES = 10  # without a terminal

    def __init__(self, task: Task, seeds: int, steps: int, start: int, shown: bool):
        self.task, self.seeds, self.steps, self.shown = task, seeds, steps, shown
        self.console = Console(file=sys.stderr)
        self._latest: dict[str, float] = {}
        self._line = start * self.LINES // max(steps, 1)
        self._bar = Progress(
            TextColumn("[bold]{task.description}"),
            BarColumn(bar_width=12),
            TextColumn("{task.percentage:>3.0f}%"),
            TimeRemainingColumn(table_column=Column(no_wrap=True, min_width=7)),
            # what does not fit is cut from the end of the facts
            TextColumn("{task.fields[facts]}", table_column=Column(ratio=1, no_wrap=True, overflow="ellipsis")),
            expand=True,
            console=self.console,
            disable=not (shown and self.console.is_terminal),
        )
        self._id = self._bar.add_task(task.name, total=steps, completed=start, facts="")

    def update(self, decision: int, rate: float, latest: Mapping[str, float]) -> None:
        """At `decision`, at `rate` decisions per second of one seed; the `latest` means, where there are new ones."""
        if not self.shown:
            return
        self._latest |= latest
        facts = [f"{name} {value:.4g}" for name, value in reversed(self._latest.items())]
        facts += [f"{rate * self.seeds:,.0f} decisions/s"]
        facts += [f"{decision * self.task.period:,.0f} s simulated"] if self.task.period != 1 else []
        facts = " · ".join([*facts, f"{self.seeds} seed{'s' * (self.seeds > 1)}"])
        self._bar.update(self._id, completed=decision, facts=facts)
        line = decision * self.LINES // max(self.steps, 1)
        if not self.console.is_terminal and line > self._line:
            self._line = line
            left = (self.steps - decision) / rate if rate else 0
            self.console.print(
                f"{self.task.name}: {decision:,}/{self.steps:,} decisions · {facts} · {left:.0f} s left", soft_wrap=True
            )

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> Any:
        self._bar.stop()
