"""Claims about measured numbers, and the statistics behind them: intervals, and summaries of learning curves."""

import dataclasses
import functools
import math
from typing import Any

import numpy as np

from motorgrad._errors import check
from motorgrad.training import Run, learning_curves

LEVEL = 0.95
"""Confidence level of every interval."""


@dataclasses.dataclass(frozen=True)
class Measured:
    """A number with its interval.

    **Arguments:** `value`; `low`, `high`, the ends of the 95 % interval (equal to `value` if nothing is random);
    `count`, the number of seeds or runs behind it, 0 if nothing is random; `kind`, the statistic, such as "mean".
    """

    value: float
    low: float
    high: float
    count: int
    kind: str

    def __str__(self) -> str:
        if not self.count:
            return f"{self.value:.4g}"
        return f"{self.value:.4g} [{self.low:.4g} … {self.high:.4g}], {self.kind} of {self.count}"


@dataclasses.dataclass(frozen=True)
class Claim:
    """A statement, and whether the measurement supports it.

    **Arguments:** `statement`, in our own words; `source`, where it is made; `expected`, the criterion in words;
    `measured`; `holds`, the verdict; `unit`; `note`, what a reader must know to judge it.
    """

    statement: str
    source: str
    expected: str
    measured: Measured
    holds: bool
    unit: str = ""
    note: str = ""

    def __post_init__(self) -> None:
        # NumPy's own booleans cannot be written to a file
        object.__setattr__(self, "holds", bool(self.holds))


def above(
    bound: float, statement: str, source: str, expected: str, measured: Measured, unit: str = "", note: str = ""
) -> Claim:
    """A claim that holds if the whole interval lies above `bound`; the other arguments are those of `Claim`."""
    return Claim(statement, source, expected, measured, measured.low > bound, unit, note)


def below(
    bound: float, statement: str, source: str, expected: str, measured: Measured, unit: str = "", note: str = ""
) -> Claim:
    """A claim that holds if the whole interval lies below `bound`; the other arguments are those of `Claim`."""
    return Claim(statement, source, expected, measured, measured.high < bound, unit, note)


positive = functools.partial(above, 0)
"""A claim that holds if the whole interval lies above 0."""
negative = functools.partial(below, 0)
"""A claim that holds if the whole interval lies below 0."""
more_than_half = functools.partial(above, 0.5)
"""A claim that holds if the whole interval lies above one half: of the seeds, most often."""


def exact(value: float) -> Measured:
    """A number that is not random."""
    return Measured(float(value), float(value), float(value), 0, "exact")


def mean_of(values: Any) -> Measured:
    """Mean over seeds, with Student's interval."""
    values = _finite(values)
    centre, count = float(values.mean()), len(values)
    if count == 1:
        return Measured(centre, -math.inf, math.inf, 1, "mean")
    from scipy import stats

    half = float(stats.t.ppf(0.5 + LEVEL / 2, count - 1) * values.std(ddof=1) / math.sqrt(count))
    return Measured(centre, centre - half, centre + half, count, "mean")


def median_of(values: Any) -> Measured:
    """Median over seeds, with the interval of order statistics.

    The interval assumes nothing about the distribution. It spans the whole sample if that is too small for the level.
    """
    from scipy import stats

    values = np.sort(_finite(values))
    count = len(values)
    rank = int(stats.binom.ppf((1 - LEVEL) / 2, count, 0.5))
    # from the rank-th smallest to the rank-th greatest; rank 0 would point beyond the sample
    lowest = max(rank, 1) - 1
    return Measured(float(np.median(values)), float(values[lowest]), float(values[count - 1 - lowest]), count, "median")


def share_of(happened: Any) -> Measured:
    """Share of seeds in which something happened, with Wilson's interval."""
    from scipy import stats

    happened = np.asarray(happened, bool)
    check(happened.size > 0, "seeds", 0, "at least one")
    found = stats.binomtest(int(happened.sum()), happened.size).proportion_ci(LEVEL, method="wilson")
    return Measured(float(happened.mean()), float(found.low), float(found.high), happened.size, "share")


def _finite(values: Any) -> np.ndarray:
    """All values as a vector. A time that was never reached (NaN) has no mean: the caller must replace it first."""
    values = np.asarray(values, float).ravel()
    check(values.size > 0 and bool(np.isfinite(values).all()), "values", values, "at least one, all finite")
    return values


def final(run: Run, quantity: str, share: float = 0.25) -> np.ndarray:
    """Mean of a quantity over the last `share` of training, `(seeds,)`."""
    values = run.curve(quantity)[1]
    return values[:, -max(1, round(share * values.shape[1])) :].mean(axis=1)


def first_time(decision: np.ndarray, happened: np.ndarray) -> np.ndarray:
    """When something first happened, NaN if it never did: `(records,)` and `(…, records)` to `(…)`."""
    return np.where(happened.any(-1), decision[happened.argmax(-1)], np.nan)


def moving_mean(values: np.ndarray, records: int) -> np.ndarray:
    """Trailing moving average over so many records: `(…, n)` to `(…, n + 1 − records)`."""
    return np.lib.stride_tricks.sliding_window_view(values, records, axis=-1).mean(-1)


def practice_curve(run: Run, quantity: str, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """A quantity during practice, averaged over the last `seconds` of simulated time (at least two records).

    **Returns** simulated seconds `(records,)` and values `(seeds, records)`.
    """
    record = run.config["run"]["window"] * run.task.period
    shown: Any = learning_curves([run], quantity, x="simulated", smooth=max(seconds, 2 * record))
    (curve,) = shown.curves
    return curve.x, curve.values
