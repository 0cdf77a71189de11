"""Where on its curves a muscle is: force against length, and against velocity."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from motorgrad.sim.panels import _svg
from motorgrad.sim.panels._curves import FAINT, STRONG
from motorgrad.sim.panels._law import Law

POINTS = 61
LEAST = 0.1  # m/s, of the velocities that are shown
HALF = (34.0, 8.0, 164.0, 140.0)
OTHER = (210.0, 8.0, _svg.WIDTH - 8, 140.0)
HERE = "#d0021b"


class Range(NamedTuple):
    """The limits of both curves, which follow what the muscle does."""

    length: tuple[float, float]
    speed: float

    def holding(self, length: float, velocity: float, rest: float) -> Range:
        """The range widened to hold a moment."""
        if np.isfinite(rest):
            low, high = min(self.length[0], 0.4 * rest), max(self.length[1], 1.6 * rest)
        else:
            low, high = self.length
        room = 0.1 * abs(length) + 1e-3  # what is driven without a path may have a negative length
        low, high = min(low, length - room), max(high, length + room)
        return Range((low, high), max(self.speed, 1.15 * abs(velocity), LEAST))


def draw_operating(law: Law, activation: float, length: float, velocity: float, where: Range) -> str:
    """Both curves as SVG: at full activation faint, at the present one strong, with the point where the muscle is."""
    lengths = np.linspace(*where.length, POINTS)
    speeds = np.linspace(-where.speed, where.speed, POINTS)
    now = float(law.force(activation, np.array(length), np.array(velocity)))
    still = np.zeros(POINTS)
    along = [law.force(a, lengths, still + velocity) for a in (1.0, activation)]
    across = [law.force(a, still + length, speeds) for a in (1.0, activation)]
    every = np.concatenate([*along, *across, [0.0, now]])
    room = 0.06 * max(float(np.ptp(every)), 1e-9)
    up = (float(every.min()) - room, float(every.max()) + room)
    parts: list[str] = []
    for x, curves, here, words, box, side in (
        (lengths, along, length, "length (m)", HALF, "force (N)"),
        (speeds, across, velocity, "velocity (m/s)", OTHER, ""),
    ):
        chart = _svg.Chart((float(x[0]), float(x[-1])), up, words, side, (box[0] + 12, *box[1:]) if side else box)
        chart.line(np.array([x[0], x[-1]]), np.zeros(2), _svg.INK, 0.6, 'stroke-opacity=".4"')
        chart.line(x, curves[0], FAINT, 1.6)
        chart.line(x, curves[1], STRONG, 2.0)
        chart.dot(here, now, HERE)
        parts += chart.elements()
    parts.append(_svg.text(46, 180, "— fully active", extra=f'style="fill:{FAINT}"'))
    parts.append(_svg.text(136, 180, f"— as active as now ({activation:.0%})", extra=f'style="fill:{STRONG}"'))
    return _svg.document(_svg.WIDTH, 190, parts, "force against length and against velocity")
