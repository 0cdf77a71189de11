"""What sinks saw."""

import dataclasses
import itertools
from collections.abc import Iterable

import numpy as np
from jaxtyping import Float

from motorgrad._errors import check, unknown


@dataclasses.dataclass(frozen=True, eq=False)
class Record:
    """What the sinks saw in some ticks, one after the other.

    `signals` has an array `(seeds, samples, …)` for every input of a sink by its address, such as `"scope.u"`, and for
    every watched output by its own. `first` is the first tick and `ticks` their number, `tick` their length in seconds;
    `every` says how many ticks lie between a signal's samples.
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
        """When a signal's samples were taken, in seconds."""
        if address not in self.every:
            raise unknown("signal", address, self.every)
        return sampled(self.first, self.ticks, self.every[address]) * self.tick


def join(records: Iterable[Record]) -> Record:
    """Records of ticks that follow each other, as one. **Raises** `ValueError` where they do not."""
    parts = list(records)
    check(parts, "records", parts, "at least one")
    for before, after in itertools.pairwise(parts):
        check(after.first == before.first + before.ticks, "first", after.first, f"{before.first + before.ticks}")
        check(after.every == before.every, "signals", list(after.every), f"{list(before.every)}")
    signals = {name: np.concatenate([part.signals[name] for part in parts], axis=1) for name in parts[0].signals}
    return Record(parts[0].first, sum(part.ticks for part in parts), parts[0].tick, signals, parts[0].every)


def sampled(first: int, ticks: int, every: int) -> np.ndarray:
    """Those of the ticks from `first` on that are multiples of `every`."""
    return np.arange(-(-first // every) * every, first + ticks, every)
