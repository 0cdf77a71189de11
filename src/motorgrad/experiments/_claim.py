"""Claims: what a source says, beside what was measured."""

import dataclasses
import math
from typing import Any

import numpy as np

from motorgrad._errors import check

LEVEL = 0.95
"""Of every interval: were the study repeated, so many of its intervals would hold the true value."""


@dataclasses.dataclass(frozen=True)
class Measured:
    """A number with its interval.

    **Arguments:** `value`; `low`, `high`, the ends of the 95 % interval (equal to `value` where nothing is random);
    `count`, the seeds or runs that it is over, 0 where nothing is random; `kind`, what the number is, in words.
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


def exact(value: float) -> Measured:
    """A number in which nothing is random."""
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
    """Median over seeds, with the interval of order statistics (no assumption about the distribution; it is as wide as
    the sample where that is too small for the level)."""
    from scipy import stats

    values = np.sort(_finite(values))
    count = len(values)
    rank = int(stats.binom.ppf((1 - LEVEL) / 2, count, 0.5))
    # the interval from the (rank)th least to the (rank)th greatest; 0 would ask for one beyond the sample
    lowest = max(rank, 1) - 1
    return Measured(float(np.median(values)), float(values[lowest]), float(values[count - 1 - lowest]), count, "median")


def share_of(happened: Any) -> Measured:
    """The share of seeds in which something happened, with Wilson's interval."""
    from scipy import stats

    happened = np.asarray(happened, bool)
    check(happened.size > 0, "seeds", 0, "at least one")
    found = stats.binomtest(int(happened.sum()), happened.size).proportion_ci(LEVEL, method="wilson")
    return Measured(float(happened.mean()), float(found.low), float(found.high), happened.size, "share")


def _finite(values: Any) -> np.ndarray:
    """All values, as a vector. What never occurred (NaN) must be decided about before: it cannot be averaged."""
    values = np.asarray(values, float).ravel()
    check(values.size > 0 and bool(np.isfinite(values).all()), "values", values, "at least one, all finite")
    return values


@dataclasses.dataclass(frozen=True)
class Claim:
    """A statement, and whether what was measured bears it out.

    **Arguments:** `statement`, in our own words; `source`, where it is said; `expected`, the number or the relation
    that it names, in words; `measured`; `unit`; `holds`; `note`, what a reader must know to judge it.
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
