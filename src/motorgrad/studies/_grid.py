"""The points of a study: lists are grids, ranges are drawn."""

import itertools
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple, TypeGuard

import numpy as np

from motorgrad._errors import check, check_finite, unknown

MAX_POINTS = 100_000
Point = dict[str, Any]
"""A table of settings without lists of choices."""


class RangeOfNumbers(NamedTuple):
    """A range of numbers, by its place in the settings."""

    path: str
    low: float
    high: float
    scale: Literal["linear", "log"]

    def at(self, share: float) -> float:
        """The number at a share of the range, from 0 to 1."""
        if self.scale == "linear":
            return self.low + share * (self.high - self.low)
        return math.exp(math.log(self.low) + share * (math.log(self.high) - math.log(self.low)))


def expand(table: Mapping[str, Any], ranges: bool = False) -> list[Point]:
    """All combinations of the lists in a table, the last list changing fastest.

    Below the outermost table, tables come after other settings, as in TOML files, so that a study that was written to a
    file and read again has the same order. A list of tables is a grid over tables, which may hold lists themselves. A
    list within a list is a value.

    **Arguments:** `ranges`: whether a table of `low`, `high` and `scale` is a range, which `draw` replaces.

    **Raises** `ValueError` for an empty list, an entry that occurs twice, and a range without width.
    """
    return [dict(point) for point in _expand(table, "", ranges)]


def draw(points: Sequence[Point], kind: Literal["random", "sobol"], count: int, seed: int) -> list[Point]:
    """Every point with its ranges replaced by `count` draws. All points have the same draws.

    **Raises** `ValueError` where there is no range.
    """
    found = dict.fromkeys(
        value.path for point in points for _, value in leaves(point) if isinstance(value, RangeOfNumbers)
    )
    if not found:
        raise ValueError("design: there is no range to draw from, such as {low = 1e-4, high = 1e-1, scale = 'log'}")
    if kind == "sobol":
        from scipy.stats import qmc

        shares = qmc.Sobol(len(found), rng=np.random.default_rng(seed)).random(count)
    else:
        shares = np.random.default_rng(seed).random((count, len(found)))
    rows = [dict(zip(found, row, strict=True)) for row in shares.tolist()]
    return bounded((_drawn(point, row) for point in points for row in rows), "design.count")


def bounded(points: Iterable[Any], where: str) -> list[Any]:
    """Points as a list. **Raises** `ValueError` where there are too many, before they take up the memory."""
    found = list(itertools.islice(points, MAX_POINTS + 1))
    if len(found) > MAX_POINTS:
        raise ValueError(f"{where}: more settings than a study may have, {MAX_POINTS:,}")
    return found


def at_ends(points: Sequence[Point]) -> list[Point]:
    """Every point twice: with the low ends of all its ranges, and with the high ones."""
    paths = {path for point in points for path, value in leaves(point) if isinstance(value, RangeOfNumbers)}
    return [
        _drawn(point, dict.fromkeys(paths, share)) for point in points for share in ((0.0, 1.0) if paths else (0.0,))
    ]


def leaves(table: object, path: str = "") -> Iterator[tuple[str, Any]]:
    """The settings in nested tables, by path."""
    if isinstance(table, Mapping):
        for name, item in table.items():
            yield from leaves(item, f"{path}.{name}" if path else str(name))
    else:
        yield path, table


def varied(points: Sequence[Mapping[str, Any]]) -> list[str]:
    """The paths whose values differ between points given by path, in the order in which they first occur."""
    paths = dict.fromkeys(path for point in points for path in point)
    return [path for path in paths if len({frozen(point.get(path)) for point in points}) > 1]


def distinctions(tables: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """What distinguishes each of several tables of settings, by path."""
    flat = [dict(leaves(each)) for each in tables]
    paths = varied(flat)
    return [{path: each[path] for path in paths if path in each} for each in flat]


def as_given(value: object) -> Any:
    """Settings in the form of a study, in which a list is a grid."""
    if isinstance(value, Mapping):
        return {name: as_given(item) for name, item in value.items()}
    return [value] if isinstance(value, list) else value


def frozen(value: object) -> str:
    """A value as text, which is equal only for equal values."""
    return json.dumps(value, sort_keys=True)


def _expand(value: object, path: str, ranges: bool) -> list[Any]:
    if isinstance(value, Mapping):
        if ranges and is_range(value):
            return [range_in(value, path)]
        value = in_file_order(value) if path else value
        inner = [_expand(item, f"{path}.{name}" if path else str(name), ranges) for name, item in value.items()]
        size = math.prod(map(len, inner))
        check(size <= MAX_POINTS, path or "the grid", f"{size:,} combinations", f"at most {MAX_POINTS:,}")
        return [dict(zip(value, items, strict=True)) for items in itertools.product(*inner)]
    if not isinstance(value, list | tuple | np.ndarray):
        return [value.item() if isinstance(value, np.generic) else value]
    items = value.tolist() if isinstance(value, np.ndarray) else list(value)
    check(items, path, items, "at least one value; a list is a grid")
    made = (one for item in items for one in (_expand(item, path, ranges) if isinstance(item, Mapping) else [item]))
    found = bounded(made, path)
    found = [list(item) if isinstance(item, tuple) else item for item in found]
    distinct = len({repr(item) for item in found}) == len(found)
    check(distinct, path, items, "without a value that occurs twice; a setting that takes a list stands in a list")
    return found


def in_file_order(table: Mapping[str, Any]) -> dict[str, Any]:
    """A table with its settings in the order in which they are found in a TOML file that is written and read again:
    tables last; lists of tables, which TOML writes before or among the tables, by name."""

    def place(item: tuple[Any, Any]) -> tuple[int, str]:
        name, value = item
        if isinstance(value, Mapping):
            return 2, ""
        tables = isinstance(value, list | tuple) and any(isinstance(each, Mapping) for each in value)
        return (1, str(name)) if tables else (0, "")

    return dict(sorted(table.items(), key=place))


def is_range(value: object) -> TypeGuard[Mapping[str, Any]]:
    """Whether a table describes a range."""
    return isinstance(value, Mapping) and {"low", "high"} <= set(value)


def has_range(value: object) -> bool:
    """Whether there is a range among settings."""
    if isinstance(value, list | tuple):
        return any(map(has_range, value))
    return is_range(value) or (isinstance(value, Mapping) and any(map(has_range, value.values())))


def range_in(table: Mapping[str, Any], path: str) -> RangeOfNumbers:
    """The range that a table of `low`, `high` and `scale` describes. **Raises** `ValueError` for one without width."""
    for name in table:
        if name not in ("low", "high", "scale"):
            raise unknown(f"setting of the range {path}:", name, ("low", "high", "scale"))
    low = table["low"]
    high = table["high"]
    scale = table.get("scale", "linear")
    for name, value in (("low", low), ("high", high)):
        check_finite(f"{path}.{name}", value)
    if scale not in ("linear", "log"):
        raise unknown(f"{path}.scale", scale, ("linear", "log"))
    check(low < high, f"{path}.high", high, f"above low = {low}")
    check(scale == "linear" or low > 0, f"{path}.low", low, "above 0 on a logarithmic scale")
    return RangeOfNumbers(path, float(low), float(high), scale)


def _drawn(value: object, row: Mapping[str, float]) -> Any:
    if isinstance(value, RangeOfNumbers):
        return value.at(row[value.path])
    return {name: _drawn(item, row) for name, item in value.items()} if isinstance(value, dict) else value
