"""Means, medians and shares with their intervals, and when something first happened."""

import dataclasses
import math
from typing import SupportsFloat

import numpy as np
import numpy.typing as npt

from motorgrad._errors import check, shown

LEVEL = 0.95
"""Confidence level of an interval, by default."""


@dataclasses.dataclass(frozen=True)
class Measured:
    """A number with its interval.

    **Arguments:**

    - `value`: the number, NaN if it is unknown.
    - `low`, `high`: the ends of the interval, equal to `value` if nothing is random.
    - `count`: the number of seeds or runs behind it, 0 if nothing is random.
    - `kind`: the statistic, such as "mean".
    - `level`: the confidence level that the interval reaches; 1 if it is no estimate.
    """

    value: float
    low: float
    high: float
    count: int
    kind: str
    level: float = LEVEL

    def words(self, unit: str = "") -> str:
        """The number with its interval, its unit, and what it is; and the level of the interval, if below 95 %."""
        ends = "" if self.level == 1 else f" [{_number(self.low)} … {_number(self.high)}]"
        of = "" if self.kind == "exact" else f", {self.kind} of {self.count or 'none'}"
        short = "" if self.level >= LEVEL else f" (interval at {100 * self.level:.3g} %)"
        return f"{_number(self.value)}{ends}{f' {unit}' if unit else ''}{of}{short}"

    def __str__(self) -> str:
        return self.words()


def exact(value: SupportsFloat) -> Measured:
    """A number that is not random."""
    return Measured(float(value), float(value), float(value), 0, "exact", 1.0)


def mean_of(values: npt.ArrayLike, level: float = LEVEL) -> Measured:
    """Mean of independent finite numbers, with Student's interval of a level in (0, 1), unbounded for a single one."""
    count = np.size(values)
    values = finite(values, level)
    centre = float(values.mean())
    half = math.inf
    if count > 1:
        from scipy import stats

        half = float(stats.t.ppf(0.5 + level / 2, count - 1) * values.std(ddof=1) / math.sqrt(count))
    return Measured(centre, centre - half, centre + half, count, "mean", level)


def ratio_of(above: npt.ArrayLike, below: npt.ArrayLike, level: float = LEVEL) -> Measured:
    """Pairwise ratio of two sets of positive numbers: geometric mean, with Student's interval of the logarithms.
    **Raises** `ValueError` for numbers that are not above 0, or are not as many in each set."""
    sets = {"above": finite(above, level, "above"), "below": finite(below, level, "below")}
    for name, each in sets.items():
        check((each > 0).all(), name, each[~(each > 0)].tolist(), "above 0, to have a ratio")
    sizes = tuple(each.size for each in sets.values())
    check(len(set(sizes)) == 1, "above, below", sizes, "as many numbers in each")
    logs = mean_of(np.log(sets["above"]) - np.log(sets["below"]), level)
    value, low, high = (math.exp(each) for each in (logs.value, logs.low, logs.high))
    return Measured(value, low, high, logs.count, "geometric mean", level)


def difference_of(one: npt.ArrayLike, other: npt.ArrayLike, level: float = LEVEL) -> Measured:
    """Difference of the means of two independent samples, at least two numbers each, with Welch's interval."""
    from scipy import stats

    one = finite(one, level)
    other = finite(other, level)
    check(min(len(one), len(other)) > 1, "values", (len(one), len(other)), "at least two numbers in each sample")
    found = stats.ttest_ind(one, other, equal_var=False).confidence_interval(level)
    difference = float(one.mean() - other.mean())
    return Measured(difference, float(found.low), float(found.high), len(one), "difference", level)


def median_of(values: npt.ArrayLike, level: float = LEVEL) -> Measured:
    """Median of independent finite numbers, with the interval of order statistics, which assumes nothing about their
    distribution. It spans the whole sample if that is too small: at 95 %, if it has fewer than six numbers. `level` of
    the result is then the level that it reaches, and its words say so."""
    from scipy import stats

    values = np.sort(finite(values, level))
    count = len(values)
    rank = int(stats.binom.ppf((1 - level) / 2, count, 0.5))
    # from the rank-th smallest to the rank-th greatest; rank 0 would point beyond the sample
    lowest = max(rank, 1) - 1
    reached = level if rank else 1 - 0.5 ** (count - 1)
    low = float(values[lowest])
    high = float(values[count - 1 - lowest])
    return Measured(float(np.median(values)), low, high, count, "median", reached)


def share_of(happened: npt.ArrayLike, level: float = LEVEL) -> Measured:
    """Share of independent cases in which something happened, a boolean for each, with Wilson's interval. The share of
    no cases is unknown: NaN, from 0 to 1."""
    happened = np.asarray(happened, bool)
    check_level(level)
    if not happened.size:
        return Measured(math.nan, 0.0, 1.0, 0, "share", level)
    from scipy import stats

    found = stats.binomtest(int(happened.sum()), happened.size).proportion_ci(level, method="wilson")
    return Measured(float(happened.mean()), float(found.low), float(found.high), happened.size, "share", level)


def tally_of(happened: npt.ArrayLike) -> Measured:
    """Share of the cases at hand in which something happened: a fact about these, without an interval for others."""
    happened = np.asarray(happened, bool)
    check(happened.size > 0, "happened", happened, "at least one case")
    share = float(happened.mean())
    return Measured(share, share, share, happened.size, "share", 1.0)


def per_case(total: npt.ArrayLike, cases: npt.ArrayLike) -> np.ndarray:
    """Totals over the numbers of their cases, in shapes that fit; NaN where there are none."""
    total, cases = np.broadcast_arrays(np.asarray(total, float), cases)
    return np.divide(total, cases, out=np.full(total.shape, math.nan), where=cases > 0)


def first_time(time: np.ndarray, happened: np.ndarray, never: float = math.nan) -> np.ndarray:
    """When something first happened: the `time` `(records,)` of the first record by which it `happened` `(…, records)`,
    as `(…)`; `never` where it did not."""
    return np.where(happened.any(-1), time[happened.argmax(-1)], never)


def moving_mean(values: np.ndarray, records: int) -> np.ndarray:
    """Trailing moving average over this number of records: `(…, n)` to `(…, n + 1 − records)`."""
    return np.lib.stride_tricks.sliding_window_view(values, records, axis=-1).mean(-1)


def finite(values: npt.ArrayLike, level: float, name: str = "values") -> np.ndarray:
    """All values as a vector. A time that was never reached (NaN) has no mean: the caller must replace it first."""
    check_level(level)
    try:
        numbers = np.asarray(values, float).ravel()
    except (TypeError, ValueError):  # words, or rows of different lengths
        raise ValueError(f"{name} = {shown(values)}: must be numbers, as many in each row") from None
    check(numbers.size > 0 and bool(np.isfinite(numbers).all()), name, numbers, "at least one, all finite")
    return numbers


def check_level(level: float) -> None:
    check(isinstance(level, int | float) and 0 < level < 1, "level", level, "between 0 and 1")


def _number(value: float) -> str:
    if math.isnan(value):
        return "unknown"
    return f"{value:.4g}" if math.isfinite(value) else "∞" if value > 0 else "−∞"
