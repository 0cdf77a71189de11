"""What a training shows while it runs."""

from collections.abc import Mapping

from motorgrad._compiler import compilations
from motorgrad._errors import counted
from motorgrad._progress import Progress
from motorgrad.learning import Choice
from motorgrad.tasks import Task


class TrainingProgress(Progress):
    """Progress of a training: the latest means, decisions per second, simulated time."""

    def __init__(self, task: Task, seeds: int, steps: int, shown: bool):
        super().__init__(task.name, "decisions", steps, 0, shown, at_first="compiling")
        self.task, self.seeds = task, seeds
        self._latest: dict[str, float] = {}
        self._rate: float | None = None
        self._compiled = compilations()

    def tell_choice(self, choice: Choice | None) -> None:
        """Say which preset the task got by itself, and why; nothing for a task or a user that named the learner."""
        if choice is not None and self.shown:
            self.console.print(f"{self.name}: {choice}", soft_wrap=True, highlight=False)

    def report(self, decision: int, rate: float, latest: Mapping[str, float]) -> None:
        """Show progress at a `decision`, the `rate` in decisions per second and seed, and new means of the metrics."""
        self._latest |= latest
        before = self._compiled
        self._compiled = compilations()
        usual = self._compiled == before
        if usual:
            self._rate = rate
        facts = [f"{name} {value:.4g}" for name, value in reversed(self._latest.items())]
        if self._rate is not None:
            facts.append(f"{self._rate * self.seeds:,.0f} decisions/s")
        facts += [f"{decision * self.task.period:,.0f} s simulated"] if self.task.period != 1 else []
        self.update(decision, " · ".join([*facts, counted(self.seeds, "seed")]), usual)
