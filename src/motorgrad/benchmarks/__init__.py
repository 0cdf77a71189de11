"""The speed table: ratios measured side by side in one run, against bare physics and hand-written loops."""

from collections.abc import Iterator

from motorgrad.benchmarks._measure import Figures, Took, figures, in_turn, kept_in, started, timed
from motorgrad.benchmarks._rows import Goal, Row, chosen

__all__ = [
    "PAIRS",
    "QUICK_PAIRS",
    "ROWS",
    "Figures",
    "Goal",
    "Row",
    "Took",
    "chosen",
    "figures",
    "in_turn",
    "kept_in",
    "speed_table",
    "started",
    "timed",
]

ROWS = "motorgrad.benchmarks"
"""The group of entry points of applications that have rows of their own: functions that return them."""
PAIRS = 7
"""How many pairs a row has."""
QUICK_PAIRS = 2
"""Likewise of a smoke test."""


def speed_table() -> Iterator[Row]:
    """The rows of the speed table: the library's, and then those of the applications that are installed, which are
    imported only once they are reached."""
    from motorgrad._applications import entries
    from motorgrad.benchmarks._table import rows

    yield from rows()
    for offer in entries(ROWS).values():
        yield from offer.load()()
