"""Recorded signals in the form that clients draw: few enough points for a screen.

For each signal an event has `ticks`, the ticks of its rows, and `every`, the number of ticks between samples. For one
seed, `rows` are the numbers, for lines the minimum and maximum of every stretch; for several seeds, `low`, `median` and
`high` are the quartiles. For drawings other than lines, `rows` has the numbers of the first `seeds` seeds side by side.
"""

from typing import Any

import numpy as np

from timlab.diagram import Diagram, Record, sampled
from timlab.editor._program import sink_at

STRETCHES = 500  # per window of a scope
WINDOW = 10.0  # seconds, for sinks without a window
FRAME = 100  # stretches per signal and event, before the window
MAX_KEPT_NUMBERS = 1_000_000  # per signal
RESENT = 4000  # rows per signal sent to a client that joins later
SEEDS = 16  # shown side by side
COLUMNS = 4096  # numbers per row

Parts = dict[str, np.ndarray]


class Traces:
    """The recorded signals of one branch.

    **Arguments:** the diagram; the seeds; the number of stretches by which a signal is shown before the last window of
    a scope. For one seed, that window has stretches of its own: however fast a run is, the scope shows true shapes.
    """

    def __init__(self, diagram: Diagram, seeds: list[int], frame: int = FRAME):
        self._diagram, self._seeds, self._frame = diagram, seeds, frame
        self._kept: dict[str, list[Parts]] = {}
        self._every: dict[str, int] = {}

    def add(self, record: Record) -> dict[str, Any]:
        """Keep a record. **Returns** it in the form that clients draw."""
        found = {}
        for address, signal in record.signals.items():
            self._every[address] = record.every[address]
            if signal.shape[1] == 0:
                continue
            parts = self._thinned(address, signal, record)
            kept = self._kept.setdefault(address, [])
            kept.append(parts)
            self._limit(address)
            found[address] = self._event_data(address, parts)
        return found

    def all(self) -> dict[str, Any]:
        """All kept signals, in the form that clients draw."""
        found = {}
        for address, pieces in self._kept.items():
            parts = _joined(pieces)
            self._kept[address] = [parts]
            late = max(0, len(parts["ticks"]) - RESENT // 2)
            some = np.unique(np.linspace(0, late, RESENT // 2, endpoint=False).astype(int)) if late else []
            chosen = np.concatenate([np.asarray(some, int), np.arange(late, len(parts["ticks"]))])
            found[address] = self._event_data(address, {name: array[chosen] for name, array in parts.items()})
        return found

    def _thinned(self, address: str, signal: np.ndarray, record: Record) -> Parts:
        """The rows that show a signal `(seeds, samples, …)`."""
        every = record.every[address]
        drawing = self._drawing(address)
        ticks = sampled(record.first, record.ticks, every)
        seeds, samples = signal.shape[:2]
        numbers = signal.reshape(seeds, samples, -1)[..., :COLUMNS]
        window = getattr(sink_at(self._diagram, address.rpartition(".")[0]), "window", WINDOW)
        seen = max(1, round(window / record.tick / every))  # samples that the scope shows when the record ends
        fine = max(1, round(seen / STRETCHES))
        coarse = -(-samples // self._frame)
        if drawing == "lines" and seeds > 1:
            return _quartiles(ticks, numbers, max(fine, coarse))

        def thinned(part: slice, stretch: int) -> Parts:
            if drawing == "lines":
                return _extremes(ticks[part], numbers[0, part], stretch)
            side = 1 if drawing == "map" else min(seeds, SEEDS)
            rows = numbers[:side, part].transpose(1, 0, 2).reshape(len(ticks[part]), -1)[:, :COLUMNS]
            if drawing == "raster":
                return _events(ticks[part], rows, stretch)
            ends = np.append(np.arange(stretch - 1, len(rows) - 1, stretch), len(rows) - 1)  # of every stretch
            return {"ticks": ticks[part][ends], "rows": rows[ends]}

        earlier = slice(max(0, samples - seen))
        last = slice(max(0, samples - seen), None)
        if samples <= seen or coarse <= fine:
            return thinned(slice(None), fine)
        return _joined([thinned(earlier, coarse), thinned(last, fine)])

    def _drawing(self, address: str) -> str:
        path = address.rpartition(".")[0]
        drawing = getattr(sink_at(self._diagram, path), "drawing", "lines")
        return "lines" if drawing == "table" else drawing

    def _event_data(self, address: str, parts: Parts) -> dict[str, Any]:
        own: dict[str, Any] = {"every": self._every[address]}
        seeds = len(self._seeds)
        if self._drawing(address) != "lines":
            own["seeds"] = 1 if self._drawing(address) == "map" else min(seeds, SEEDS)
        return own | {name: _plain(array) for name, array in parts.items()}

    def _limit(self, address: str) -> None:
        """Halve the resolution of the older half if there are too many points."""
        pieces = self._kept[address]
        if (
            sum(piece["ticks"].size * (piece[next(iter(set(piece) - {"ticks"}))].shape[-1]) for piece in pieces)
            <= MAX_KEPT_NUMBERS
        ):
            return
        parts = _joined(pieces)
        half = len(parts["ticks"]) // 2
        chosen = np.concatenate([np.arange(0, half, 2), np.arange(half, len(parts["ticks"]))])
        self._kept[address] = [{name: array[chosen] for name, array in parts.items()}]


def _quartiles(ticks: np.ndarray, numbers: np.ndarray, stretch: int) -> Parts:
    """The quartiles over seeds at the last sample of every stretch."""
    samples = len(ticks)
    chosen = np.arange(stretch - 1, samples, stretch) if samples >= stretch else np.array([samples - 1])
    low, median, high = np.quantile(numbers[:, chosen].astype(float), (0.25, 0.5, 0.75), axis=0)
    return {"ticks": ticks[chosen], "low": low, "median": median, "high": high}


def _extremes(ticks: np.ndarray, numbers: np.ndarray, stretch: int) -> Parts:
    """The minimum and maximum of every stretch, in order."""
    if stretch <= 2:
        return {"ticks": ticks, "rows": numbers}
    starts = np.arange(0, len(ticks), stretch)
    least = np.minimum.reduceat(numbers, starts)
    most = np.maximum.reduceat(numbers, starts)
    ends = np.append(starts[1:], len(ticks)) - 1
    rising = numbers[ends] >= numbers[starts]
    rows = np.stack([np.where(rising, least, most), np.where(rising, most, least)], axis=1)
    return {"ticks": np.stack([ticks[starts], ticks[ends]], axis=1).ravel(), "rows": rows.reshape(-1, rows.shape[-1])}


def _events(ticks: np.ndarray, numbers: np.ndarray, stretch: int) -> Parts:
    """Whether a number was non-zero in a stretch; NaN is not."""
    starts = np.arange(0, len(ticks), stretch)
    return {
        "ticks": ticks[starts],
        "rows": np.logical_or.reduceat(np.nan_to_num(numbers) != 0, starts).astype(np.float32),
    }


def _joined(pieces: list[Parts]) -> Parts:
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}


def _plain(array: np.ndarray) -> list[Any]:
    """Numbers for JSON: six digits, and `null` for non-finite values."""
    if array.dtype.kind in "iub":
        return array.astype(int).tolist()

    def short(number: float) -> float | None:
        return float(f"{number:.6g}") if np.isfinite(number) else None

    return [[short(number) for number in row] for row in array.tolist()]
