"""When muscles fire: activations over time, a row for each muscle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from motorgrad.sim import _muscles
from motorgrad.sim.panels import _svg

SECONDS = 4.0
COLUMNS = 320
ROW, LOW = 15.0, 216.0
"""The height of a row, and of all rows where they are many, in the diagram's units."""


def draw_raster(seconds: np.ndarray, level: np.ndarray, names: Sequence[str], period: float, chosen: int = -1) -> str:
    """The last seconds as SVG: the stronger the red, the more active; nothing where the run was not watched.

    **Arguments:** `seconds` `(n,)` at which `level` `(n, muscles)`, in [0, 1], begins; `period` of a decision, s;
    `chosen`, the row to mark.
    """
    count = len(names)
    row = min(ROW, max(LOW / count, 2.5))
    named = row >= 7
    left = 12 + min(124.0, 0.53 * min(row, _svg.SIZE) * max(map(len, names), default=0)) if named else 30.0
    end = (seconds[-1] if len(seconds) else 0.0) + period
    start = end - SECONDS
    box = (left, 6.0, _svg.WIDTH - 8, 6 + row * count)
    side = "" if named else f"{count} muscles, the first on top"
    labels = [*reversed(names)] if named else [""]
    chart = _svg.Chart(
        (start - end, 0.0), (0.0, float(count)), "time before now (s)", side, box, labels, min(row, 10.5)
    )
    chart.image(_pixels(seconds, level, start, end, period))
    if 0 <= chosen < count:
        height = float(count - chosen)
        edge = np.array([height, height])
        span = np.array([start - end, 0.0])
        for side in (edge, edge - 1):
            chart.line(span, side, _svg.INK, 0.8, 'stroke-opacity=".8"')
    return _svg.document(_svg.WIDTH, box[3] + 30, chart.elements(), "activation of the muscles over time")


def _pixels(seconds: np.ndarray, level: np.ndarray, start: float, end: float, period: float) -> np.ndarray:
    """Colours `(muscles, COLUMNS, 4)`: of what began last before each column, if that was not too long before."""
    at = start + (np.arange(COLUMNS) + 0.5) / COLUMNS * (end - start)
    row = np.searchsorted(seconds, at, side="right") - 1
    known = (row >= 0) & (at - seconds[np.maximum(row, 0)] <= 1.5 * period) if len(seconds) else np.zeros(COLUMNS, bool)
    shown = np.clip(level[np.maximum(row, 0)], 0, 1) if len(seconds) else np.zeros((COLUMNS, level.shape[1]))
    colour = _muscles.colour(shown.T.ravel()).reshape(level.shape[1], COLUMNS, 3)
    strength = np.where(known, 0.10 + 0.90 * shown.T, 0.0)
    return np.round(255 * np.concatenate([colour, strength[..., None]], axis=2)).astype(np.uint8)
