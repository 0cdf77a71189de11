"""The numbers of learning curves: quantities over an axis, smoothing, quartiles over seeds."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, Protocol, get_args

import numpy as np
import pyarrow as pa
from jaxtyping import Bool, Float, Int

from motorgrad._errors import check, choice
from motorgrad.tasks import TASKS

Axis = Literal["decisions", "simulated", "wall", "cpu"]
UNITS = {
    "decisions": "decisions",
    "simulated": "s of simulated time",
    "wall": "s of wall time",
    "cpu": "s of processor time",
}


class Plotted(Protocol):
    """The attributes of a run that plots use."""

    @property
    def config(self) -> dict[str, Any]: ...

    @property
    def decision(self) -> int: ...

    @property
    def metrics(self) -> pa.Table: ...

    @property
    def path(self) -> Path | None: ...

    @property
    def seeds(self) -> list[int]: ...

    @property
    def broken(self) -> Bool[np.ndarray, " seeds"]: ...

    def curve(self, quantity: str) -> tuple[np.ndarray, np.ndarray]: ...


@dataclasses.dataclass(frozen=True, eq=False)
class Curve:
    """One quantity of one run, as it is drawn.

    - `label`: the name of the run.
    - `quantity`: a column of its metrics.
    - `x`: where each record ends, in the units of the figure's x axis.
    - `values`: each seed's, after smoothing; NaN where nothing occurred.
    - `window`: decisions per record.
    - `done`: the share of its decisions that the run has made.
    - `broken`: the number of seeds whose policy is not finite in the end, and has no values from then on.
    - `unit`: of the values: `1` of a pure number, empty where it is unknown.
    """

    label: str
    quantity: str
    x: Float[np.ndarray, " records"]
    values: Float[np.ndarray, "seeds records"]
    window: int
    done: float
    broken: int = 0
    unit: str = ""

    @property
    def seen(self) -> Int[np.ndarray, " records"]:
        """The number of seeds in which the quantity occurred, of which median and quartiles are taken."""
        return np.isfinite(self.values).sum(axis=0)

    @property
    def quartiles(self) -> Float[np.ndarray, "3 records"]:
        """Lower quartile, median and upper quartile over the seeds; NaN where no seed has a value."""
        found = np.full((3, len(self.x)), np.nan)
        seen = self.seen > 0
        if seen.any():
            found[:, seen] = np.nanpercentile(self.values[:, seen], [25, 50, 75], axis=0)
        return found

    def table(self) -> dict[str, Any]:
        """The numbers as a plain table; `None` for what never occurred."""
        low, median, high = ([v if math.isfinite(v) else None for v in row] for row in self.quartiles.tolist())
        return {
            "label": self.label,
            "quantity": self.quantity,
            "window": self.window,
            "seeds": len(self.values),
            "x": self.x.tolist(),
            "median": median,
            "lower_quartile": low,
            "upper_quartile": high,
            "seeds_seen": self.seen.tolist(),
            "broken": self.broken,
        }


def curve_of(run: Plotted, quantity: str, axis: Axis, smooth: float | None, label: str) -> Curve:
    """A quantity of a run over an axis. Each point is the mean over the last `smooth` units of the axis."""
    values = run.curve(quantity)[1]
    values = np.where(np.isfinite(values), values, np.nan)
    column = {"decisions": "decision", "simulated": "simulated_time", "wall": "wall_time", "cpu": "cpu_time"}[axis]
    x = run.metrics[column].to_numpy()[:: len(values)].astype(float)
    if smooth is not None:
        values = trailing_mean(x, values, weights_of(run, quantity), smooth)
    window = run.config["run"]["window"]
    steps = run.config["run"]["steps"]
    broken = int(np.count_nonzero(run.broken))
    return Curve(label, quantity, x, values, window, min(1.0, run.decision / steps), broken, unit_of(run, quantity))


def unit_of(run: Plotted, quantity: str) -> str:
    """The unit of a quantity as the records have it; those of earlier releases have none, and the task's class may
    know it."""
    metadata = run.metrics.schema.field(quantity).metadata or {}
    known = getattr(TASKS.get(run.config["task"]["name"]), "metric_units", {})
    fallback = known.get(quantity, "") if isinstance(known, Mapping) else ""
    return metadata[b"unit"].decode(errors="replace") if b"unit" in metadata else fallback


def trailing_mean(
    x: Float[np.ndarray, " records"],
    values: Float[np.ndarray, "seeds records"],
    weights: Float[np.ndarray, "#seeds records"],
    span: float,
) -> Float[np.ndarray, "seeds records"]:
    """At every record the weighted mean over the records that end in (x − span, x], of those that are not NaN."""
    first = np.searchsorted(x, x - span * (1 - 1e-9), side="right")  # a multiple of the record counts whole records
    weights = np.where(np.isfinite(values), weights, 0.0)

    def total(terms: np.ndarray) -> np.ndarray:
        sums = np.concatenate([np.zeros((len(terms), 1)), np.cumsum(terms, axis=1)], axis=1)
        return sums[:, 1:] - sums[:, first]

    weight = total(weights)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(weight > 0, total(np.where(weights > 0, values, 0.0) * weights) / weight, np.nan)


def axis_for(runs: Sequence[Plotted], x: Axis | None) -> Axis:
    """The given axis; by default simulated time where all runs are of one task that has it, else decisions."""
    timeless = [run.config["task"]["name"] for run in runs if not _timed(run)]
    if x is None:
        tasks = {run.config["task"]["name"] for run in runs}
        return "simulated" if len(tasks) == 1 and not timeless else "decisions"
    choice("x", x, get_args(Axis))
    allowed = "decisions, wall or cpu: the task " + f"{timeless[0] if timeless else ''} has no simulated time"
    check(x != "simulated" or not timeless, "x", x, allowed)
    return x


def check_smooth(smooth: float | None, axis: Axis, curves: Sequence[Curve]) -> None:
    """Refuse a smoothing of at most one record, which would have no effect."""
    if smooth is None:
        return
    record = min(float(np.diff(curve.x, prepend=0.0)[1:].min(initial=curve.x[0])) for curve in curves)
    more = f"more than a record, which is {record:,.4g} {UNITS[axis]}"
    check(smooth > record, "smooth", smooth, more)


def _timed(run: Plotted) -> bool:
    """Whether the task has simulated time; without it, its period is one second."""
    metrics = run.metrics
    return metrics.num_rows > 0 and metrics["simulated_time"][0].as_py() != metrics["decision"][0].as_py()


def is_total(quantity: str) -> bool:
    """Whether records hold the sum of the quantity over their decisions, not a mean or a state."""
    return quantity in ("episodes", "diverged") or quantity.endswith("_count")


def weights_of(run: Plotted, quantity: str) -> Float[np.ndarray, "lanes records"]:
    """The weight of each record, such that the weighted mean of records is the mean over what occurred in them: how
    often the quantity did, or how many decisions were made."""
    decision, values = run.curve(quantity)
    names = run.metrics.column_names
    if f"{quantity}_count" in names:
        return run.curve(f"{quantity}_count")[1]
    lengths = np.broadcast_to(np.diff(decision, prepend=0).astype(float), values.shape)
    if quantity == "reward" and "diverged" in names:
        return lengths - run.curve("diverged")[1]
    return np.ones_like(lengths) if is_total(quantity) else lengths


def mean_of_last(run: Plotted, quantity: str, records: int) -> Float[np.ndarray, " lanes"]:
    """The mean of a quantity over all that occurred in the last `records`; NaN where it occurred in none, and for
    policies that are not finite."""
    values = run.curve(quantity)[1][:, -records:]
    weights = np.where(np.isnan(values), 0.0, weights_of(run, quantity)[:, -records:])
    with np.errstate(invalid="ignore", divide="ignore"):
        means = np.where(weights > 0, values * weights, 0.0).sum(axis=1) / weights.sum(axis=1)
    return np.where(run.broken, np.nan, means)
