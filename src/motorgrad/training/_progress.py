"""Progress of a long run: decisions per second, simulated time, the latest reward, the time left."""

from collections.abc import Mapping

from motorgrad._progress import Progress
from motorgrad.tasks import Task


class Report(Progress):
    """A progress bar on a terminal; where there is none, a line now and then. `shown=False` is silent."""

    def __init__(self, task: Task, seeds: int, steps: int, start: int, shown: bool):
        super().__init__(task.name, "decisions", steps, start, shown)
        self.task, self.seeds = task, seeds
        self._latest: dict[str, float] = {}

    def report(self, decision: int, rate: float, latest: Mapping[str, float]) -> None:
        """At `decision`, at `rate` decisions per second of one seed; the `latest` means, where there are new ones."""
        self._latest |= latest
        facts = [f"{name} {value:.4g}" for name, value in reversed(self._latest.items())]
        facts += [f"{rate * self.seeds:,.0f} decisions/s"]
        facts += [f"{decision * self.task.period:,.0f} s simulated"] if self.task.period != 1 else []
        left = (self.total - decision) / rate if rate else 0
        said = " · ".join([*facts, f"{self.seeds} seed{'s' * (self.seeds > 1)}"])
        self.update(decision, said, without_bar=f"{left:.0f} s left")
