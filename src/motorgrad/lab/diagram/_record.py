"""Recorded signals."""

import dataclasses
import itertools
from collections.abc import Iterable

import numpy as np
from jaxtyping import Float

from motorgrad._errors import check, unknown


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


def join(records: Iterable[Record]) -> Record:
    """Concatenate records of consecutive ticks. **Raises** `ValueError` where ticks or signals do not continue."""
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
