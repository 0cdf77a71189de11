"""Numbers from a file."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check
from motorgrad.lab._block import Block, Moment, Ports, Signals, Timing
from motorgrad.lab._parameter import Setting
from motorgrad.lab._port import Port, dtype_of
from motorgrad.lab.blocks._named import MOST
from motorgrad.lab.blocks._shaped import ROUNDING
from motorgrad.lab.blocks._table_file import read_columns


@dataclasses.dataclass(frozen=True)
class DataFile(Block):
    """Gives columns of a table in a CSV (with a line of names), Parquet or NPZ file, which is read when it is made.

    With a column of times, in rising seconds, it gives the last row before the time (`"hold"`), or what is between it
    and the next (`"linear"`). Without, one row for each evaluation. Before the first row it gives that one; after the
    last it stays there (`"stay"`) or begins again (`"repeat"`; with times, the first row then comes at the last one's
    time).
    """

    name: ClassVar[str] = "data file"
    category: ClassVar[str] = "sources"

    path: Annotated[str, Setting("a .csv, .parquet or .npz file by its path from the working folder")]
    columns: Annotated[tuple[str, ...], Setting("the columns it gives, each at a port of its name")] = ("y",)
    time: Annotated[str | None, Setting("the column of times in seconds, if there is one")] = None
    between: Annotated[str, Setting("what it gives between two times", choices=("hold", "linear"))] = "hold"
    after: Annotated[str, Setting("what it gives after the last row", choices=("stay", "repeat"))] = "stay"

    def validate(self) -> None:
        check(isinstance(self.path, str) and self.path and "\0" not in self.path, "path", self.path, "a path")
        named = isinstance(self.columns, tuple) and all(isinstance(name, str) and name for name in self.columns)
        check(named and 1 <= len(self.columns) <= MOST, "columns", self.columns, f"a list of 1 … {MOST} names")
        check(len(set(self.columns)) == len(self.columns), "columns", self.columns, "different names")
        check(
            not any("." in name for name in self.columns), "columns", self.columns, "names without '.', as ports' are"
        )
        check(self.time is None or (isinstance(self.time, str) and self.time), "time", self.time, "None or a column")
        timed = self.time is not None
        check(timed or self.between == "hold", "between", self.between, "'hold' where no column of times is given")
        columns = read_columns(self.path, (*self.columns, *([self.time] if self.time else [])))
        times = columns[self.time] if self.time else np.zeros(0)
        rising = np.all(np.diff(times) > 0) and np.all(np.diff(times.astype(np.float32)) > 0)
        if not rising:
            raise ValueError(
                f"path = {self.path!r}: column {self.time}: must rise from row to row, in single precision"
            )
        long = not timed or self.after == "stay" or len(times) > 1
        check(long, "after", self.after, "'stay' for a file of one row")
        object.__setattr__(self, "_data", np.stack([columns[name] for name in self.columns]))
        object.__setattr__(self, "_times", times)

    def values(self) -> dict[str, np.ndarray]:
        """The table in place of parameters, so that blocks with other tables of its size are evaluated as one."""
        real = dtype_of("float")
        return {"_data": np.asarray(self.__dict__["_data"], real), "_times": np.asarray(self.__dict__["_times"], real)}

    @property
    def outputs(self) -> Ports:
        return {name: Port(()) for name in self.columns}

    @property
    def timing(self) -> Timing:
        return "continuous" if self.time and self.every == 1 and self.period is None else "discrete"

    def init(self, uniforms: Any) -> Any:
        return () if self.time else jnp.zeros((), jnp.int32)

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        data, times = self.__dict__["_data"], self.__dict__["_times"]
        if self.time is None:
            return dict(zip(self.columns, data[:, state], strict=True))
        time = now.time + ROUNDING * jnp.abs(now.time)
        if self.after == "repeat":
            time = jnp.where(time < times[0], time, times[0] + (time - times[0]) % (times[-1] - times[0]))
        row = jnp.maximum(jnp.searchsorted(times, time, side="right") - 1, 0)
        interpolated = [jnp.interp(time, times, column) if self.between == "linear" else column[row] for column in data]
        return dict(zip(self.columns, interpolated, strict=True))

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        if self.time:
            return state
        rows = self.__dict__["_data"].shape[1]
        return (state + 1) % rows if self.after == "repeat" else jnp.minimum(state + 1, rows - 1)
