"""Tables: data files as sources, and look-up tables."""

import dataclasses
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar, Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from motorgrad._errors import check, shown, unknown
from motorgrad._limits import MAX_TABLE_BYTES
from motorgrad._parquet import parquet_in
from motorgrad._reading import arrays_in, content_of, csv_in, numbers_in
from motorgrad.schema import number, static
from timlab.blocks._base import MAX_LISTED_NAMES, Shaped
from timlab.diagram import (
    Block,
    Moment,
    Port,
    Ports,
    Signals,
    Timing,
    dtype_of,
)

SUFFIXES = (".csv", ".parquet", ".npz")


def read_columns(path: str, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Columns of a table in a CSV, Parquet or NPZ file, each `(rows,)` in double precision.

    **Raises** `ValueError` that names the file and the reason: it cannot be read, lacks a column, or a column has no
    rows or a value that is not finite in single precision.
    """
    if Path(path).suffix.lower() not in SUFFIXES:
        raise ValueError(f"path = {shown(path)}: must be a file whose name ends in {', '.join(SUFFIXES)}")
    try:
        table = _table(Path(path).suffix.lower(), content_of(Path(path), MAX_TABLE_BYTES))
        for name in names:
            if name not in table:
                raise unknown("column", name, table)
        columns = {name: _numbers(name, table[name]) for name in names}
        lengths = {name: len(column) for name, column in columns.items()}
        if len(set(lengths.values())) > 1:
            raise ValueError(f"columns of different lengths: {', '.join(f'{n} {m}' for n, m in lengths.items())}")
    except OSError as error:
        raise ValueError(f"path = {shown(path)}: cannot be read: {error.strerror or error}") from None
    except ValueError as error:
        raise ValueError(f"path = {shown(path)}: {' '.join(str(error).splitlines())}") from None
    return columns


def _table(kind: str, content: bytes) -> dict[str, Any]:
    if kind == ".npz":
        try:
            return arrays_in(content, MAX_TABLE_BYTES)
        except ValueError as error:
            raise ValueError(f"not an NPZ file of arrays: {error}") from None
    table = (parquet_in if kind == ".parquet" else csv_in)(content, MAX_TABLE_BYTES)
    for name, times in Counter(table.column_names).items():
        check(times == 1, "column", name, "given once")
    return dict(zip(table.column_names, table.columns, strict=True))


def _numbers(name: str, column: Any) -> np.ndarray:
    if not isinstance(column, np.ndarray):
        import pyarrow.types as kinds

        plain = any(is_(column.type) for is_ in (kinds.is_boolean, kinds.is_integer, kinds.is_floating))
        column = column.to_numpy() if plain else np.zeros(0)  # texts would become objects, each of many bytes
    if column.ndim != 1 or column.dtype.kind not in "biuf" or len(column) == 0:
        raise ValueError(f"column {name}: must be a list of at least one number")
    numbers = numbers_in(column, MAX_TABLE_BYTES)
    with np.errstate(over="ignore"):
        wrong = np.flatnonzero(~np.isfinite(numbers.astype(np.float32)))
    if wrong.size:
        raise ValueError(f"column {name}, row {wrong[0]}: must be a finite number, not {numbers[wrong[0]]}")
    return numbers


@dataclasses.dataclass(frozen=True)
class DataFile(Block):
    """Plays back columns of a table from a CSV (with a header), Parquet or NPZ file. The file is read when the block is
    made.

    With a column of times, in increasing seconds, it outputs the last row at or before the current time (`"hold"`), or
    interpolates to the next row (`"linear"`). Without, it outputs one row per evaluation. Before the first row it
    outputs the first; after the last row it stays there (`"stay"`) or starts again (`"repeat"`; with times, the first
    row then coincides with the last one's time).
    """

    name: ClassVar[str] = "data file"
    category: ClassVar[str] = "sources"

    path: str = static(help="path of a .csv, .parquet or .npz file, relative to the working folder")
    columns: tuple[str, ...] = static(("y",), help="the columns to play back, each at an output of its name")
    time: str | None = static(None, help="the column of times in seconds, if any")
    between: Literal["hold", "linear"] = static("hold", help="the output between two rows")
    after: Literal["stay", "repeat"] = static("stay", help="the output after the last row")

    def validate(self) -> None:
        check(self.path and "\0" not in self.path, "path", self.path, "a path")
        named = all(self.columns)
        check(
            named and 1 <= len(self.columns) <= MAX_LISTED_NAMES,
            "columns",
            self.columns,
            f"a list of 1 … {MAX_LISTED_NAMES} names",
        )
        check(len(set(self.columns)) == len(self.columns), "columns", self.columns, "different names")
        check(
            not any("." in name for name in self.columns),
            "columns",
            self.columns,
            "names without '.', like those of ports",
        )
        check(
            self.time is None or (isinstance(self.time, str) and self.time),
            "time",
            self.time,
            "None or the name of a column",
        )
        timed = self.time is not None
        check(timed or self.between == "hold", "between", self.between, "'hold' without a column of times")
        columns = read_columns(self.path, (*self.columns, *([self.time] if self.time else [])))
        times = columns[self.time] if self.time else np.zeros(0)
        if not np.all(np.diff(times) > 0):
            raise ValueError(f"path = {self.path!r}: column {self.time}: must increase from row to row")
        long = not timed or self.after == "stay" or len(times) > 1
        check(long, "after", self.after, "'stay' for a file with one row")
        object.__setattr__(self, "_data", np.stack([columns[name] for name in self.columns]))
        object.__setattr__(self, "_times", times)
        alike = np.unique(times.astype(np.float32), return_counts=True)[1] if timed else [1]
        object.__setattr__(self, "_alike", int(max(alike)))  # rows whose times single precision does not tell apart

    def values(self) -> dict[str, np.ndarray]:
        """The table in place of parameters, so that blocks with other tables of the same size are evaluated
        together. Times are the sums of `_times` and `_rests`, which are exact also where signals have single precision.
        """
        real = dtype_of("float")
        exact = self.__dict__["_times"]
        times = np.asarray(exact, real)
        return {
            "_data": np.asarray(self.__dict__["_data"], real),
            "_times": times,
            "_rests": (exact - times).astype(real),
        }

    @property
    def structure(self) -> Any:
        return (*super().structure, self.__dict__["_alike"])

    @property
    def outputs(self) -> Ports:
        return {name: Port(()) for name in self.columns}

    @property
    def timing(self) -> Timing:
        return "continuous" if self.time and self.every == 1 and self.period is None else "discrete"

    def init(self, uniforms: Array) -> PyTree[Array]:
        return () if self.time else jnp.zeros((), jnp.int32)

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        data = self.__dict__["_data"]
        rows = data.shape[1]
        if self.time is None:
            return dict(zip(self.columns, data[:, state], strict=True))
        if self.between == "linear":
            row, part = now.doubled(lambda start: self._beyond(self._place(now, start) + now.within - now.begun))
            values = (1 - part) * data[:, row] + part * data[:, jnp.minimum(row + 1, rows - 1)]
        else:
            values = data[:, now.doubled(lambda start: self._beyond(self._place(now, start))[0])]
        return dict(zip(self.columns, values, strict=True))

    def next_jump(self, now: Moment) -> Array:
        last = self.__dict__["_times"].shape[0] - 1

        def jump(start: Array) -> Array:
            place = self._place(now, start)
            if self.between == "linear":  # it jumps only where it starts again
                row = last
                ends = self.after == "stay"
            else:
                below = self._rows_until(place)
                row = jnp.minimum(below, last)
                ends = below > last
            return jnp.where(ends, jnp.inf, start + (self._time(row) - (place - now.blur)))

        return now.doubled(jump)

    def _time(self, row: Array | int) -> Array:
        time, rest = (self.__dict__[name][row].astype(jnp.float64) for name in ("_times", "_rests"))
        return time + rest

    def _place(self, now: Moment, start: Array) -> Array:
        """The time in the table at which the current step begins; what misses a row by rounding counts as on it."""
        time = start + now.blur
        if self.after == "stay":
            return time
        first = self._time(0)
        last = self._time(-1)
        return jnp.where(time < first, time, first + (time - first) % (last - first))

    def _rows_until(self, time: Array) -> Array:
        """The number of rows up to a time: found in single precision, and among rows that it does not tell apart, by
        bisection in double precision.
        """
        times = self.__dict__["_times"]
        alike = self.__dict__["_alike"]
        high = jnp.searchsorted(times, time.astype(times.dtype), side="right").astype(jnp.int32)
        low = jnp.maximum(high - alike, 0)
        last = times.shape[0] - 1
        for _ in range(alike.bit_length()):
            middle = (low + high) // 2
            before = (low < high) & (self._time(jnp.minimum(middle, last)) <= time)
            low = jnp.where(before, middle + 1, low)
            high = jnp.where(before, high, middle)
        return low

    def _beyond(self, time: Array) -> tuple[Any, Any]:
        """The row that is current at a time, and how far the way to the next one is gone, from 0 to 1."""
        last = self.__dict__["_times"].shape[0] - 1
        row = jnp.maximum(self._rows_until(time) - 1, 0)
        begin = self._time(row)
        end = self._time(jnp.minimum(row + 1, last))
        part = jnp.where(end > begin, (time - begin) / jnp.where(end > begin, end - begin, 1.0), 0.0)
        return row, jnp.clip(part, 0.0, 1.0).astype(self.__dict__["_data"].dtype)

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        if self.time:
            return state
        rows = self.__dict__["_data"].shape[1]
        return (state + 1) % rows if self.after == "repeat" else jnp.minimum(state + 1, rows - 1)


BEYOND = "the output beyond the table: the value at its end, or linear extrapolation"


def _check_points(name: str, points: Sequence[float]) -> None:
    rising = np.ndim(points) == 1 and len(points) >= 2 and np.all(np.diff(np.asarray(points, np.float32)) > 0)
    check(rising, name, points, "a list of at least two numbers that increase, in single precision")


def _locate(u: Array, points: Array, beyond: str) -> tuple[Any, Any]:
    """The index of the point below a number, and the fraction of the way to the next point."""
    lower = jnp.clip(jnp.searchsorted(points, u, side="right") - 1, 0, points.shape[0] - 2)
    part = (u - points[lower]) / (points[lower + 1] - points[lower])
    return lower, part if beyond == "extend" else jnp.clip(part, 0.0, 1.0)


@dataclasses.dataclass(frozen=True)
class LookUp(Shaped):
    """Piecewise linear function of one input, given at increasing points; element by element."""

    name: ClassVar[str] = "look-up table"
    category: ClassVar[str] = "nonlinear"

    points: Any = number((0.0, 1.0), help="the points of the table, increasing")
    results: Any = number((0.0, 1.0), help="the values at these points")
    beyond: Literal["stay", "extend"] = static("stay", help=BEYOND)

    def validate(self) -> None:
        _check_points("points", self.points)
        check(
            np.shape(self.results) == np.shape(self.points),
            "results",
            self.results,
            f"{len(self.points)} numbers, as many as points",
        )

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape)}

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        lower, part = _locate(inputs["u"], self.points, self.beyond)
        return {"y": (1 - part) * self.results[lower] + part * self.results[lower + 1]}


@dataclasses.dataclass(frozen=True)
class LookUp2D(Shaped):
    """Bilinear function of two inputs, given on a grid; element by element."""

    name: ClassVar[str] = "look-up table 2-D"
    category: ClassVar[str] = "nonlinear"

    points1: Any = number((0.0, 1.0), help="the grid points along u1, increasing")
    points2: Any = number((0.0, 1.0), help="the grid points along u2, increasing")
    results: Any = number(((0.0, 0.0), (0.0, 1.0)), help="the values on the grid: one row per point of u1")
    beyond: Literal["stay", "extend"] = static("stay", help=BEYOND)

    def validate(self) -> None:
        for name in ("points1", "points2"):
            _check_points(name, getattr(self, name))
        rows = len(self.points1)
        columns = len(self.points2)
        check(
            np.shape(self.results) == (rows, columns),
            "results",
            self.results,
            f"{rows} rows of {columns} numbers, to match the points",
        )

    @property
    def inputs(self) -> Ports:
        return {"u1": Port(self.shape), "u2": Port(self.shape)}

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        row, down = _locate(inputs["u1"], self.points1, self.beyond)
        column, along = _locate(inputs["u2"], self.points2, self.beyond)
        upper = (1 - along) * self.results[row, column] + along * self.results[row, column + 1]
        lower = (1 - along) * self.results[row + 1, column] + along * self.results[row + 1, column + 1]
        return {"y": (1 - down) * upper + down * lower}
