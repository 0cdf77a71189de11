"""A row of the speed table before it is measured, and how rows are asked for."""

import dataclasses
import fnmatch
from collections.abc import Callable, Iterable, Sequence

from motorgrad._errors import check, unknown
from motorgrad.benchmarks._measure import Figures


@dataclasses.dataclass(frozen=True)
class Goal:
    """What a row is to reach: at least this ratio, by wall time; or, with a `unit`, this figure of ours."""

    number: float
    unit: str = ""
    at_most: bool = False

    def met(self, found: Figures) -> bool:
        """Whether the figures reach it. **Raises** `ValueError` for figures without a ratio, or in another unit."""
        of = found.ours if self.unit else found.ratio
        check(
            of is not None and self.unit in ("", found.unit), "figures", found, f"{self.unit or 'a ratio'} for {self}"
        )
        assert of is not None
        return of <= self.number if self.at_most else of >= self.number

    def __str__(self) -> str:
        return f"{'≤' if self.at_most else '≥'} {self.number:,.10g} {self.unit}".strip()


@dataclasses.dataclass(frozen=True)
class Row:
    """A row of the speed table.

    - `id`: a short name that stays, by which the row is asked for and stored.
    - `name`: what it compares, in words.
    - `measure`: measures it: a function of whether to be quick, and of how many pairs. **Raises** `MissingExtra`
      without a package that it needs.
    - `quick`: whether it takes a few seconds at most where asked to be quick; others are then left out.
    """

    id: str
    name: str
    measure: Callable[[bool, int], Figures]
    goal: Goal | None = None
    quick: bool = True


def chosen(rows: Iterable[Row], patterns: Sequence[str] = ()) -> list[Row]:
    """The rows whose id is, or matches, one of the patterns, such as "hopper-*"; without any, all. **Raises**
    `ValueError` for a pattern that none matches."""
    rows = list(rows)
    ids = [row.id for row in rows]
    for pattern in patterns:
        if not fnmatch.filter(ids, pattern):
            raise unknown("row", pattern, ids)
    return [row for row in rows if not patterns or any(fnmatch.fnmatch(row.id, each) for each in patterns)]
