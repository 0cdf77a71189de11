"""The reports that callbacks receive from `train`, and the callback that ends training early."""

import dataclasses
import functools
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad._errors import check, counted, unknown
from motorgrad.schema import Settings, count, number, static

if TYPE_CHECKING:
    from motorgrad.policies import Policy
    from motorgrad.training._run import Run


@dataclasses.dataclass(frozen=True, eq=False)
class Report:
    """One record of a training: the means over a window of decisions.

    - `task`: the name of the task; `seeds`: the seeds, in the order of every array.
    - `decision`: the last decision of the window; `steps`: the number of decisions of the whole training, per seed.
    - `metrics`: the record's columns by name, such as `reward`, `wall_time` and the task's metrics, each `(seeds,)`;
      in a sweep `(settings × seeds,)`. A metric that did not occur in the window is NaN. `docs/training.md` lists the
      columns; `parameters` is left out.
    - `path`: the run directory, `None` for a run in memory.
    - `whole`: whether the window is complete. The last one of a run may not be: more steps then make its record again.
    """

    task: str
    seeds: list[int]
    decision: int
    steps: int
    metrics: Mapping[str, np.ndarray]
    path: Path | None = None
    whole: bool = True
    make_run: Callable[[], "Run"] | None = dataclasses.field(default=None, repr=False)

    @functools.cached_property
    def run(self) -> "Run":
        """The run as it is now, in memory and without records: its present policies are in `run.policies`, in the order
        of every array, and `mg.evaluate(report.run, episodes=10)` evaluates them. Made when first asked for. **Raises**
        `ValueError` for a report that was made by hand."""
        if self.make_run is None:
            raise ValueError("run: this report was not made by train, so it has none")
        return self.make_run()

    def policy(self, seed: int | None = None) -> "Policy":
        """The present policy of one seed, by default the first, as `Run.policy`."""
        return self.run.policy(seed)

    def mean(self, quantity: str) -> float:
        """The mean of a column over the seeds in which it occurred; NaN if in none. **Raises** `ValueError` for an
        unknown one."""
        if quantity not in self.metrics:
            raise unknown("quantity", quantity, self.metrics)
        values = np.asarray(self.metrics[quantity], float)
        found = values[np.isfinite(values)]
        return float(found.mean()) if len(found) else float("nan")

    def means(self) -> dict[str, float]:
        """The mean of every column that occurred, by name: what experiment trackers log."""
        found = {name: self.mean(name) for name in self.metrics if name not in ("seed", "setting")}
        return {name: value for name, value in found.items() if np.isfinite(value)}


Callback = Callable[[Report], Any]
"""A function that gets every record of a training; training ends early where it returns True."""


def check_callbacks(callbacks: Callback | Iterable[Callback]) -> tuple[Callback, ...]:
    """The callbacks as a tuple. **Raises** `ValueError` for anything that is not callable."""
    several = isinstance(callbacks, Iterable) and not callable(callbacks)
    found = tuple(callbacks) if several else (callbacks,)  # type: ignore[arg-type]
    for callback in found:
        check(callable(callback), "callbacks", callback, "functions of a Report, or one such function")
    return found  # type: ignore[return-value]


@dataclasses.dataclass
class EarlyStopping(Settings):
    """A callback that ends training when a quantity reaches a goal, or no longer improves.

    The quantity is its mean over the seeds, at each record. Records in which it did not occur are skipped, except for
    `patience` those without any reward, in which no policy is finite.

    `best` is the best value so far, and `why` says why training ended.

    ```python
    stop = mg.training.EarlyStopping("reward", patience=20)
    run = mg.train("three-state", steps=50_000, seeds=4, callbacks=stop)
    print(run.decision, stop.why)
    ```
    """

    quantity: str = static("reward", help="a column of the metrics")
    goal: float | None = number(None, help="training ends at the first record that reaches it; `None` for no goal")
    patience: int | None = count(None, 1, help="records without a new best value that end training; `None` for no end")
    least_gain: float = number(0.0, 0, help="how much better than the best a value must be to count, in its own units")
    larger_is_better: bool = static(True, help="whether the quantity is to grow")
    best: float | None = dataclasses.field(default=None, init=False)
    why: str = dataclasses.field(default="", init=False)
    _since: int = dataclasses.field(default=0, init=False, repr=False)

    def validate(self) -> None:
        given = (self.goal, self.patience)
        check(given != (None, None), "goal, patience", given, "at least one of the two")

    def __call__(self, report: Report) -> bool:
        value = report.mean(self.quantity)
        if not np.isfinite(value) and np.isfinite(report.mean("reward")):
            return False
        sign = 1.0 if self.larger_is_better else -1.0
        if self.goal is not None and sign * value >= sign * self.goal:
            self.why = f"{self.quantity} reached {value:.4g} at decision {report.decision:,}"
        if np.isfinite(value) and (self.best is None or sign * (value - self.best) > self.least_gain):
            self.best = value
            self._since = 0
        else:
            self._since += 1
        if not self.why and self.patience is not None and self._since >= self.patience:
            before = "" if self.best is None else f" on {self.best:.4g}"
            self.why = f"{self.quantity} has not improved{before} for {counted(self._since, 'record')}"
        return bool(self.why)
