"""Recorded signals."""

import dataclasses
import itertools
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from motorgrad._arguments import check_arguments
from motorgrad._errors import check, unknown

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure


@dataclasses.dataclass(frozen=True, eq=False)
class Record:
    """What the sinks recorded in consecutive ticks.

        record = run.advance(100)
        record["scope.u"]         # (seeds, samples, …)
        record.times("scope.u")   # seconds

    `signals` maps the address of every sink input, such as `"scope.u"`, and of every watched output to an array
    `(seeds, samples, …)`. `first` is the first tick, `ticks` their number, and `tick` their length in seconds; `every`
    is the number of ticks between the samples of a signal.
    """

    first: int
    ticks: int
    tick: float
    signals: dict[str, np.ndarray]
    every: dict[str, int]

    def __getitem__(self, address: str) -> np.ndarray:
        if address not in self.signals:
            raise unknown("signal", address, self.signals)
        return self.signals[address]

    def times(self, address: str) -> Float[np.ndarray, " samples"]:
        """The times of a signal's samples, in seconds."""
        if address not in self.every:
            raise unknown("signal", address, self.every)
        return sampled(self.first, self.ticks, self.every[address]) * self.tick

    def plot(self, *addresses: str) -> "Figure":
        """The signals over time as a matplotlib figure that displays itself in a notebook: one below the other, for
        several seeds the median and a band between the quartiles.

            run.advance(1000).plot("scope.u")

        **Arguments:** the addresses of the signals, by default all. **Raises** `ValueError` for an unknown one, and for
        a record of nothing.
        """
        from timlab.blocks._figure import draw_series, finish, picture

        chosen = addresses or tuple(self.signals)
        check(chosen, "signals", list(self.signals), "at least one: wire a scope, or watch an output")
        given = {address: self[address] for address in chosen}
        figure, rows = picture(6.5, min(12.0, 1.0 + 1.8 * len(chosen)), rows=len(chosen))
        for number, (axes, (address, signal)) in enumerate(zip(np.atleast_1d(rows), given.items(), strict=True)):
            check(signal.shape[1] > 0, address, signal.shape, "a record of at least one sample")
            columns = _columns(address, signal)
            for place, (name, values) in enumerate(columns.items()):
                draw_series(axes, self.times(address), values.astype(float), place, name)
            axes.margins(x=0)
            last = number == len(chosen) - 1
            finish(axes, "time (s)" if last else "", address, len(signal) if number == 0 else 1, list(columns))
        return figure

    def to_pandas(self) -> "pandas.DataFrame":
        """The signals as a table of pandas: a row for each sample, by `time` in seconds; columns by `signal` and
        `seed`, the row of the run. The elements of an array are columns of their own, such as `"scope.u[1]"`. A signal
        that is sampled less often has NaN in between.

            run.advance(1000).to_pandas()["scope.u"].mean(axis=1)
        """
        import pandas

        parts = []
        for address, signal in self.signals.items():
            columns = {
                (name, seed): values[seed]
                for name, values in _columns(address, signal).items()
                for seed in range(len(values))
            }
            parts.append(pandas.DataFrame(columns, index=pandas.Index(self.times(address), name="time")))
        table = pandas.concat(parts, axis=1) if parts else pandas.DataFrame(columns=pandas.MultiIndex.from_tuples([]))
        table.columns = table.columns.set_names(["signal", "seed"]) if parts else table.columns
        return table.sort_index()


def _columns(address: str, signal: np.ndarray) -> dict[str, np.ndarray]:
    """The numbers of a signal `(seeds, samples, …)` by name, each `(seeds, samples)`."""
    places = list(np.ndindex(signal.shape[2:]))
    names = [f"{address}[{','.join(map(str, place))}]" if place else address for place in places]
    return {name: signal[:, :, *place] for name, place in zip(names, places, strict=True)}


def join(records: Iterable[Record]) -> Record:
    """Concatenate records of consecutive ticks. **Raises** `ValueError` where ticks or signals do not continue."""
    check_arguments(join, locals())
    parts = list(records)
    check(parts, "records", parts, "at least one")
    for before, after in itertools.pairwise(parts):
        check(after.first == before.first + before.ticks, "first", after.first, f"{before.first + before.ticks}")
        check(after.every == before.every, "signals", list(after.every), f"{list(before.every)}")
    signals = {name: np.concatenate([part.signals[name] for part in parts], axis=1) for name in parts[0].signals}
    return Record(parts[0].first, sum(part.ticks for part in parts), parts[0].tick, signals, parts[0].every)


def sampled(first: int, ticks: int, every: int) -> np.ndarray:
    """The multiples of `every` among `ticks` ticks from `first` on."""
    return np.arange(-(-first // every) * every, first + ticks, every)
