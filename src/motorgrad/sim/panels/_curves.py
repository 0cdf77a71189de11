"""Live curves, drawn by the browser (uPlot)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

FAINT, STRONG, SECOND = "#b9c3cf", "#0b6bcb", "#d9730d"
SMOOTH = 0.04
"""Of a curve's points over which its strong line is the mean."""


class Plot:
    """A chart whose curves are renewed.

    **Arguments:** viser's GUI; the curves' names and colours; `height` in pixels.
    """

    def __init__(self, gui: Any, names: Sequence[str], colours: Sequence[str], height: int, legend: bool) -> None:
        from viser import uplot

        self._legend = legend
        self._series = lambda names: (
            uplot.Series(label="time (s)"),
            *(
                uplot.Series(label=name, stroke=colour, width=1 if colour == FAINT else 2, points={"show": False})
                for name, colour in zip(names, colours, strict=True)
            ),
        )
        empty = np.array([0.0, 1.0])
        self._handle = gui.add_uplot(
            (empty, *(0 * empty for _ in names)),
            self._series(names),
            scales={"x": uplot.Scale(time=False), "y": uplot.Scale(auto=True)},
            axes=self._axes(names[-1] if not legend else ""),
            legend=uplot.Legend(show=legend, live=False),
            cursor=uplot.Cursor(drag={"x": True, "y": False}),
            height=height,
            padding=(10, 14, 0, 0),
        )

    def put(self, x: np.ndarray, curves: Sequence[np.ndarray]) -> None:
        """Renew the curves; points at which one is not known are left out."""
        known = np.isfinite(x) & np.all([np.isfinite(curve) for curve in curves], axis=0)
        if np.count_nonzero(known) >= 2:
            self._handle.data = tuple(np.ascontiguousarray(row[known], float) for row in (x, *curves))

    @staticmethod
    def _axes(label: str) -> tuple[dict[str, Any], ...]:
        words = {"labelSize": 18, "font": "11px sans-serif", "labelFont": "11px sans-serif"}
        look = words | {"ticks": {"size": 4, "width": 1}}
        up = look | {"size": 52} | ({"label": label} if label else {})
        return look | {"label": "simulated time (s)", "size": 34}, up


class CurvePlot(Plot):
    """A learning curve: every point faint, their mean over a stretch strong."""

    def __init__(self, gui: Any) -> None:
        super().__init__(gui, ("each", "smoothed"), (FAINT, STRONG), 200, legend=False)
        self._name = ""

    def show(self, seconds: np.ndarray, values: np.ndarray, name: str) -> None:
        known = np.isfinite(values)
        if name != self._name:
            self._name = name
            self._handle.axes = self._axes(name)
        self.put(seconds[known], (values[known], smoothed(values[known])))


class TracePlot(Plot):
    """What happened just now."""

    def __init__(self, gui: Any, names: Sequence[str]) -> None:
        colours = (FAINT, STRONG) if len(names) == 2 else (SECOND,)
        super().__init__(gui, names, colours, 160, legend=True)

    def show(self, seconds: np.ndarray, values: np.ndarray) -> None:
        self.put(seconds, list(values.T))


def smoothed(values: np.ndarray) -> np.ndarray:
    """Running means over a share of all points, shorter at the ends, so that no point is made up."""
    reach = max(1, round(SMOOTH * len(values) / 2))
    total = np.concatenate([[0.0], np.cumsum(values)])
    place = np.arange(len(values))
    low, high = np.maximum(place - reach, 0), np.minimum(place + reach + 1, len(values))
    return (total[high] - total[low]) / (high - low)
