"""Which tiles a browser has, and which of them it shows, so that what is wanted comes without holes on the way."""

from collections.abc import Iterable
from typing import NamedTuple

from motorgrad.sim.planet._tree import Key


class Plan(NamedTuple):
    """What to do next: tiles to `send`, the first of them first, to `drop`, and the only ones to `show`."""

    send: list[Key]
    drop: list[Key]
    show: set[Key]


class Cover:
    """The tiles that were sent, and a cut through the tree of those that are shown.

    A tile that has not arrived is stood in for by the nearest one around it that has. So the six faces come first, and
    every tile after the one around it; and what is shown is never more than what is wanted.

    **Arguments:** `cache`: how many tiles beyond those in use are kept; `settle` (s): after how long a sent tile is
    taken to have arrived.
    """

    def __init__(self, cache: int, settle: float):
        self._cache, self._settle = cache, settle
        self._sent: dict[Key, float] = {}
        self._used: dict[Key, None] = {}  # in the order of last use

    @property
    def sent(self) -> set[Key]:
        """The tiles that were sent and not dropped."""
        return set(self._sent)

    def plan(self, wanted: Iterable[Key], now: float) -> Plan:
        """What to do to come to show `wanted`, at the time `now` in s."""
        wanted = list(wanted)
        chain = [(*reversed(key.ancestors), key) for key in wanted]
        needed = dict.fromkeys(key for each in chain for key in each)
        for key in needed:
            self._used.pop(key, None)
            self._used[key] = None
        missing = sorted((key for key in needed if key not in self._sent), key=lambda key: key.level)
        idle = [key for key in self._used if key in self._sent and key not in needed]
        drop = idle[: max(0, len(idle) - self._cache)]
        for key in drop:
            del self._used[key]
        shown = {key for each in chain if (key := self._nearest(each, now)) is not None}
        return Plan(missing, drop, {key for key in shown if not shown.intersection(key.ancestors)})

    def note(self, sent: Iterable[Key], dropped: Iterable[Key], now: float) -> None:
        """Take down what was really done."""
        self._sent |= dict.fromkeys(sent, now)
        for key in dropped:
            del self._sent[key]

    def _nearest(self, chain: tuple[Key, ...], now: float) -> Key | None:
        """The last tile of a chain, from a face down, up to which all have arrived."""
        found = None
        for key in chain:
            if self._sent.get(key, now) > now - self._settle:
                break
            found = key
        return found
