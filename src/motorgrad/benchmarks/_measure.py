"""Measuring: two pieces of work in turn, and the ratio of each pair."""

import dataclasses
import time
from collections.abc import Callable

import numpy as np


@dataclasses.dataclass(frozen=True)
class Row:
    """A line of the speed table: `ours` and `other` in `unit`, and their ratio's median with its least and greatest.

    Machines drift in speed, so ratios are of pairs measured one after the other; single figures are medians.
    """

    name: str
    ours: float
    other: float | None
    unit: str
    ratio: float | None
    spread: tuple[float, float] | None
    wanted: str = ""


def in_turn(
    name: str,
    unit: str,
    amount: float,
    ours: Callable[[], object],
    other: Callable[[], object],
    other_amount: float | None = None,
    pairs: int = 5,
    wanted: str = "",
) -> Row:
    """Time `ours` and `other` in turn; `amount` is what a call gets through, so rates are in `unit` (per second)."""
    rates = np.empty((pairs, 2))
    for pair in range(pairs):
        for column, (work, size) in enumerate(((ours, amount), (other, other_amount or amount))):
            start = time.perf_counter()
            work()
            rates[pair, column] = size / (time.perf_counter() - start)
    ratios = rates[:, 0] / rates[:, 1]
    median = np.median(rates, axis=0)
    spread = (float(ratios.min()), float(ratios.max()))
    return Row(name, float(median[0]), float(median[1]), unit, float(np.median(ratios)), spread, wanted)
