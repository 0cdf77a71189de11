"""A footfall diagram: a bar for each leg wherever its foot is on the ground."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from motorgrad.sim.panels import _svg

SECONDS = 4.0
ROW = 19.0
FIRST, SECOND = "#3b6fb6", "#c8452f"
"""Colours of the two tripods."""


def draw_footfall(
    seconds: np.ndarray, contact: np.ndarray, names: Sequence[str], tripod: Sequence[bool], period: float
) -> str:
    """The last seconds as SVG.

    **Arguments:** `seconds` `(n,)` at which `contact` `(n, legs)` begins; the legs' names, from above; whether each is
    of the first tripod; `period` of a decision, s.
    """
    end = (float(seconds[-1]) if len(seconds) else 0.0) + period
    count = len(names)
    box = (86.0, 6.0, _svg.WIDTH - 8, 6 + ROW * count)
    chart = _svg.Chart((-SECONDS, 0.0), (0.0, float(count)), "time before now (s)", "", box, [*reversed(names)])
    recent = seconds >= end - SECONDS - period
    time, touching = seconds[recent] - end, contact[recent]
    for leg in range(count):
        row = count - 1 - leg
        for start, stop in _stretches(time, touching[:, leg], period):
            chart.bar(start, stop, row + 0.16, row + 0.84, FIRST if tripod[leg] else SECOND)
    parts = chart.elements()
    low = box[3] + 38
    parts += [
        _svg.text(86, low, "▬ first tripod", extra=f'style="fill:{FIRST}"'),
        _svg.text(176, low, "▬ second tripod", extra=f'style="fill:{SECOND}"'),
    ]
    return _svg.document(_svg.WIDTH, low + 8, parts, "footfall diagram")


def _stretches(time: np.ndarray, touching: np.ndarray, period: float) -> list[tuple[float, float]]:
    """From when to when a foot is on the ground without a break in what is known."""
    if not len(time):
        return []
    gap = np.concatenate([[True], np.diff(time) > 1.5 * period])
    group = np.cumsum(gap | np.concatenate([[True], touching[1:] != touching[:-1]]))
    found = []
    for number in np.unique(group[touching.astype(bool)]):
        rows = np.flatnonzero(group == number)
        found.append((float(time[rows[0]]), float(time[rows[-1]]) + period))
    return found
