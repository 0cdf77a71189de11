"""Figures of a run at any size, for a page or a strip of plots, with one line for each body in view."""

from __future__ import annotations

import html
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from motorgrad._errors import check
from motorgrad._labels import with_unit
from timsim.live import Session, Trail
from timsim.panels import _charts
from timsim.panels._joints import joints_of
from timsim.scene import BODY_COLOURS, main_metric, observation_units, unit_of

SCALE = 1.25  # pixels of a unit of a chart, whose letters are then 13 pixels high
POINTS = 700  # of a line, at most
MAX_FIGURES = 24  # at a time
# pixels, of a side
MIN_SIDE = 120
MAX_SIDE = 4_000
SPAN = 8.0  # s of simulated time that traces show, at most

Line = tuple[np.ndarray, np.ndarray]


class Figure(NamedTuple):
    """One figure: the `name` in the list, its `group`, and a function that returns the line of the body in a row."""

    name: str
    group: str
    line: Callable[[int], Line]
    noisy: bool = False


class Figures:
    """All figures of a session: learning curves, and over the last 8 simulated seconds rewards, joints, muscles,
    contact forces, observations and firing.

    **Attributes:** `all`: the figures, in the order of the list; `first`: the numbers of those shown at first.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._trails: dict[int, Trail] = {}
        self._decision = 0  # up to which figures are drawn
        found: list[Figure] = []
        if session.agent is not None:
            best = main_metric(session.metrics)
            names = [best, *(name for name in ("reward", *session.metrics) if name != best)]
            for name in names:
                words = "reward of a decision, mean" if name == "reward" else self._with_unit(name)
                found.append(Figure(words, "Learning", lambda row, name=name: self._curve(row, name), True))
            found.append(Figure("reward of each decision", "Rewards", lambda row: self._trace(row, "reward")))
        if session.model is not None:
            for name, joint in joints_of(session.model).items():
                words = f"{joint.what} of {name} ({joint.unit})"
                found.append(Figure(words, "Joints", self._column("position", joint.place, joint.factor)))
            for column, name in enumerate(session.muscles):
                found.append(Figure(f"control of {name}", "Muscles", self._column("activation", column)))
        for column, name in enumerate(session.feet):
            found.append(Figure(f"contact force of {name} (N)", "Contacts", self._column("contacts", column)))
        seen = zip(session.observations, observation_units(session.task, session.observations), strict=True)
        for column, (name, unit) in enumerate(seen):
            words = with_unit(f"observation: {name}", unit)
            found.append(Figure(words, "Observations", self._column("observation", column)))
        for column, name in enumerate(session.actions):
            found.append(Figure(f"probability of {name}", "Policy", self._column("probability", column)))
        self.all = found
        groups = [figure.group for figure in found]
        self.first = [groups.index(group) for group in ("Learning", "Joints", "Contacts") if group in groups]
        self.first = self.first or list(range(min(3, len(found))))

    def about(self) -> dict[str, Any]:
        """What a page needs to list the figures: names by group, and those shown first."""
        listed = [{"name": figure.name, "group": figure.group} for figure in self.all]
        return {"title": self._session.name, "figures": listed, "first": self.first}

    def draw(self, chosen: list[int], width: int, height: int) -> dict[str, Any]:
        """Some figures as SVG of a size in pixels, the bodies with their colours, and the time.

        **Raises** `ValueError` for figures that do not exist, too many of them, or an impossible size.
        """
        check(len(chosen) <= MAX_FIGURES, "number of figures", len(chosen), f"at most {MAX_FIGURES}")
        for number in chosen:
            check(0 <= number < len(self.all), "figure", number, f"from 0 to {len(self.all) - 1}")
        for name, side in (("width", width), ("height", height)):
            check(MIN_SIDE <= side <= MAX_SIDE, name, side, f"from {MIN_SIDE} to {MAX_SIDE}")
        moment = self._session.snapshot()
        self._trails = {}
        self._decision = moment.decision
        drawn = {str(number): self._svg(self.all[number], len(moment.labels), width, height) for number in chosen}
        bodies = [
            {"label": label, "colour": BODY_COLOURS[row % len(BODY_COLOURS)]} for row, label in enumerate(moment.labels)
        ]
        return {"seconds": moment.seconds, "playing": moment.playing, "bodies": bodies, "drawn": drawn}

    def curves(self, name: str, labels: Sequence[str], decision: int) -> str:
        """The learning curves up to a decision of all bodies in view in one figure as wide as its place, with their
        labels.
        """
        self._decision = decision
        figure = Figure(self._with_unit(name), "Learning", lambda row: self._curve(row, name), True)
        drawn = self._svg(figure, len(labels), 425, 230)
        fluid = drawn.replace(' width="425" height="230"', ' style="width:100%;display:block"', 1)
        names = " &ensp;".join(
            f'<span style="white-space:nowrap"><b style="color:{BODY_COLOURS[row % len(BODY_COLOURS)]}">—</b> '
            f"{html.escape(label)}</span>"
            for row, label in enumerate(labels)
        )
        return f'{fluid}<div style="font-size:12px;line-height:1.4;margin-left:10px">{names}</div>'

    def _with_unit(self, name: str) -> str:
        return with_unit(name, unit_of(name, self._session.task))

    def _svg(self, figure: Figure, bodies: int, width: int, height: int) -> str:
        wide = width / SCALE
        high = height / SCALE
        lines = [figure.line(row) for row in range(bodies)]
        known = [np.isfinite(x) & np.isfinite(y) for x, y in lines]
        lines = [(x[good], y[good]) for (x, y), good in zip(lines, known, strict=True)]
        whole = [np.concatenate([line[axis] for line in lines]) for axis in (0, 1)]
        title = _charts.text(6, 8, figure.name, extra='font-weight="600"')
        body = [title]
        if len(whole[0]) < 2:
            body.append(_charts.text(wide / 2, high / 2, "nothing to show yet", "middle", 'opacity=".6"'))
        else:
            low = float(whole[1].min())
            top = float(whole[1].max())
            room = 0.06 * (top - low) or 0.05 * abs(top) or 1.0
            box = (52.0, 18.0, wide - 10, high - 30)
            limits = float(whole[0].min()), float(whole[0].max())
            chart = _charts.Chart(limits, (low - room, top + room), "simulated time (s)", box=box)
            for row, (x, y) in enumerate(lines):
                colour = BODY_COLOURS[row % len(BODY_COLOURS)] if row else "var(--first, #0b6bcb)"
                if figure.noisy and len(y) > 8:
                    if bodies == 1:
                        chart.line(*thinned(x, y), "var(--faint, #b9c3cf)", 1.0)
                    y = _charts.smoothed(y)
                chart.line(*thinned(x, y), colour, 1.8)
            body += chart.elements()
        return (
            f'<svg role="img" aria-label="{html.escape(figure.name)}" viewBox="0 0 {wide:.1f} {high:.1f}" '
            f'width="{width}" height="{height}" font-size="{_charts.SIZE}" fill="currentColor">{"".join(body)}</svg>'
        )

    def _curve(self, row: int, name: str) -> Line:
        curve = self._session.curve(row).until(self._decision)
        return curve.seconds, curve.values[name]

    def _trail(self, row: int) -> Trail:
        if row not in self._trails:
            self._trails[row] = self._session.trail(row)
        return self._trails[row]

    def _trace(self, row: int, name: str) -> Line:
        trail = self._trail(row)
        recent = trail.seconds > trail.seconds[-1:].sum() - SPAN
        return trail.seconds[recent], getattr(trail, name)[recent]

    def _column(self, name: str, column: int, factor: float = 1.0) -> Callable[[int], Line]:
        def line(row: int) -> Line:
            seconds, values = self._trace(row, name)
            return seconds, factor * values[:, column]

        return line


def thinned(x: np.ndarray, y: np.ndarray) -> Line:
    """A line of fewer points that keeps its extremes: the least and the greatest value of each stretch."""
    if len(x) <= POINTS:
        return x, y
    step = -(-len(x) // (POINTS // 2))
    starts = np.arange(0, len(x), step)
    rows = [(at + int(np.argmin(y[at : at + step])), at + int(np.argmax(y[at : at + step]))) for at in starts]
    kept = np.unique(np.array(rows).ravel())
    return x[kept], y[kept]
