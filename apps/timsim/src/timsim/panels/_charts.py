"""Charts: SVG diagrams in the page's colours, and live curves drawn by the browser (uPlot)."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Sequence
from typing import Any

import numpy as np
import viser
from PIL import Image
from viser import uplot

WIDTH = 340.0
"""Width of a diagram in its own units; on the page it is as wide as the panel."""
INK = "currentColor"
SIZE = 10.5
LETTER = 0.56  # width of a digit, as a share of its size
MARGIN = 7.0  # right of a box, which labels do not leave


def document(width: float, height: float, parts: Sequence[str], label: str) -> str:
    """Wrap SVG elements in HTML that fills the panel's width; `label` describes the diagram to screen readers."""
    return (
        f'<div style="padding:0 8px 6px"><svg role="img" aria-label="{html.escape(label)}" '
        f'viewBox="0 0 {width:g} {height:g}" style="width:100%;display:block" '
        f'font-size="{SIZE}" fill="{INK}">{"".join(parts)}</svg></div>'
    )


def text(x: float, y: float, words: str, anchor: str = "start", extra: str = "") -> str:
    """Text at a place: `anchor` is start, middle or end; `y` is the vertical middle."""
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" dy=".34em" text-anchor="{anchor}" stroke="none" {extra}>'
        f"{html.escape(words)}</text>"
    )


def picture(pixels: np.ndarray, x: float, y: float, width: float, height: float, smooth: bool = False) -> str:
    """An image `(rows, columns, 3 or 4)`, uint8, its first row on top."""
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    data = base64.b64encode(buffer.getvalue()).decode()
    style = "" if smooth else ' style="image-rendering:pixelated"'
    return (
        f'<image x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" preserveAspectRatio="none"'
        f'{style} href="data:image/png;base64,{data}"/>'
    )


class Chart:
    """A box with two axes. All drawing uses their units.

    **Arguments:** `across`, `up`: limits of the axes; `label`, `side`: their labels; `box`: left, top, right, bottom in
    the diagram's units; `names` instead of numbers along the vertical axis, from below, with `letters` as their font
    size.
    """

    def __init__(
        self,
        across: tuple[float, float],
        up: tuple[float, float],
        label: str = "",
        side: str = "",
        box: tuple[float, float, float, float] = (46, 8, WIDTH - 8, 170),
        names: Sequence[str] = (),
        letters: float = SIZE,
    ) -> None:
        self.across = _wide(across)
        self.up = _wide(up)
        self.box = box
        self.under: list[str] = []
        self.parts: list[str] = []
        self._label, self._side, self._names, self._letters = label, side, names, letters

    def x(self, value: np.ndarray | float) -> np.ndarray:
        """Horizontal positions in the diagram's units."""
        low, high = self.across
        return self.box[0] + (np.asarray(value) - low) / (high - low) * (self.box[2] - self.box[0])

    def y(self, value: np.ndarray | float) -> np.ndarray:
        """Vertical positions in the diagram's units, downwards."""
        low, high = self.up
        return self.box[3] - (np.asarray(value) - low) / (high - low) * (self.box[3] - self.box[1])

    def line(self, x: np.ndarray, y: np.ndarray, colour: str, width: float = 1.4, extra: str = "") -> None:
        """Draw a line through the finite points."""
        good = np.isfinite(x) & np.isfinite(y)
        places = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(self.x(x)[good], self.y(y)[good], strict=True))
        self.parts.append(f'<polyline points="{places}" fill="none" stroke="{colour}" stroke-width="{width}" {extra}/>')

    def dot(self, x: float, y: float, colour: str, radius: float = 4.0) -> None:
        """Draw a point with a white rim."""
        if np.isfinite(x) and np.isfinite(y):
            self.parts.append(
                f'<circle cx="{self.x(x):.1f}" cy="{self.y(y):.1f}" r="{radius}" fill="{colour}" stroke="white"/>'
            )

    def bar(self, x0: float, x1: float, y0: float, y1: float, colour: str) -> None:
        """Draw a filled rectangle."""
        left = self.x(x0)
        right = self.x(x1)
        top = self.y(y1)
        bottom = self.y(y0)
        self.parts.append(
            f'<rect x="{left:.1f}" y="{top:.1f}" width="{max(right - left, 0.4):.1f}" '
            f'height="{bottom - top:.1f}" fill="{colour}"/>'
        )

    def image(self, pixels: np.ndarray, smooth: bool = False) -> None:
        """Fill the box with an image in the background, its first row on top."""
        left, top, right, bottom = self.box
        self.under.append(picture(pixels, left, top, right - left, bottom - top, smooth))

    def elements(self) -> list[str]:
        """All elements, clipped to the box, with its axes."""
        left, top, right, bottom = self.box
        clip = f"c{id(self):x}"
        frame = f'x="{left}" y="{top}" width="{right - left}" height="{bottom - top}"'
        return [
            f'<clipPath id="{clip}"><rect {frame}/></clipPath>',
            *self.under,
            f'<g clip-path="url(#{clip})">{"".join(self.parts)}</g>',
            f'<rect {frame} fill="none" stroke="{INK}" stroke-opacity=".45" stroke-width=".8"/>',
            *self._ticks(),
        ]

    def _ticks(self) -> list[str]:
        left, top, right, bottom = self.box
        found = []
        pale = 'opacity=".8"'
        for value in fitting_ticks(*self.across, right - left):
            place = float(self.x(value))
            found.append(f'<path d="M{place:.1f} {bottom}v3" stroke="{INK}" stroke-opacity=".5"/>')
            label = tick_label(value)
            inside = right + MARGIN - LETTER * SIZE * len(label) / 2  # or the picture's edge would cut the last one
            found.append(text(min(place, inside), bottom + 10, label, "middle", pale))
        if self._names:
            rows = [(self.y(row + 0.5), name) for row, name in enumerate(self._names)]
        else:
            rows = [(self.y(value), tick_label(value)) for value in ticks(*self.up, 4)]
        for place, name in rows:
            found.append(text(left - 4, float(place), name, "end", f'{pale} font-size="{self._letters}"'))
        found.append(text((left + right) / 2, bottom + 23, self._label, "middle"))
        middle = (top + bottom) / 2
        if self._side:
            found.append(text(9, middle, self._side, "middle", f'transform="rotate(-90 9 {middle})"'))
        return found


def ticks(low: float, high: float, count: int) -> list[float]:
    """Round values between two limits."""
    from matplotlib.ticker import MaxNLocator

    values = MaxNLocator(count, steps=[1, 2, 5, 10]).tick_values(low, high)
    room = 1e-9 * (high - low)
    return [float(value) for value in values if low - room <= value <= high + room]


def fitting_ticks(low: float, high: float, room: float) -> list[float]:
    """Round values between two limits, at most five, whose labels fit side by side in `room` diagram units."""
    values: list[float] = []
    for count in (5, 3, 2, 1):
        values = ticks(low, high, count)
        places = [(value - low) / (high - low) * room for value in values]
        widths = [LETTER * SIZE * (len(tick_label(value)) + 1) for value in values]
        if all(b - a >= (v + w) / 2 for a, b, v, w in zip(places, places[1:], widths, widths[1:], strict=False)):
            return values
    return values[:1]


def tick_label(value: float) -> str:
    """The text of a tick."""
    return f"{value:.6g}".replace("-", "−")


def _wide(limits: tuple[float, float]) -> tuple[float, float]:
    """Finite limits that differ."""
    low, high = (float(value) if np.isfinite(value) else 0.0 for value in limits)
    return (low, high) if high > low else (low - 0.5, low + 0.5)


FAINT = "#b9c3cf"
STRONG = "#0b6bcb"
SECOND = "#d9730d"
SMOOTH = 0.04
"""Share of a curve's points over which its strong line is averaged."""


class Plot:
    """A chart whose curves are updated.

    **Arguments:** `gui`: viser's; `names` and `colours` of the curves; `height` in pixels; `legend`: whether to show
    one.
    """

    def __init__(
        self, gui: viser.GuiApi, names: Sequence[str], colours: Sequence[str], height: int, legend: bool
    ) -> None:
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
        """Update the curves, without points at which one is not finite."""
        known = np.isfinite(x) & np.all([np.isfinite(curve) for curve in curves], axis=0)
        if np.count_nonzero(known) >= 2:
            self._handle.data = tuple(np.ascontiguousarray(row[known], float) for row in (x, *curves))

    @staticmethod
    def _axes(label: str) -> tuple[uplot.Axis, ...]:
        words = {"labelSize": 18, "font": "11px sans-serif", "labelFont": "11px sans-serif"}
        style: Any = words | {"ticks": {"size": 4, "width": 1}}
        up = style | {"size": 52} | ({"label": label} if label else {})
        return style | {"label": "simulated time (s)", "size": 34}, up


class CurvePlot(Plot):
    """A learning curve: every point faint, their running mean strong."""

    def __init__(self, gui: viser.GuiApi) -> None:
        super().__init__(gui, ("each", "smoothed"), (FAINT, STRONG), 200, legend=False)
        self._name = ""

    def show(self, seconds: np.ndarray, values: np.ndarray, name: str) -> None:
        known = np.isfinite(values)
        if name != self._name:
            self._name = name
            self._handle.axes = self._axes(name)
        self.put(seconds[known], (values[known], smoothed(values[known])))


class TracePlot(Plot):
    """Recent values over time."""

    def __init__(self, gui: viser.GuiApi, names: Sequence[str]) -> None:
        colours = (FAINT, STRONG) if len(names) == 2 else (SECOND,)
        super().__init__(gui, names, colours, 160, legend=True)

    def show(self, seconds: np.ndarray, values: np.ndarray) -> None:
        self.put(seconds, list(values.T))


class NamedPlot(Plot):
    """Recent values of one quantity over time, with its name at the axis."""

    def __init__(self, gui: viser.GuiApi, colour: str) -> None:
        super().__init__(gui, ("value",), (colour,), 185, legend=False)
        self._name = ""

    def show(self, seconds: np.ndarray, values: np.ndarray, name: str) -> None:
        if name != self._name:
            self._name = name
            self._handle.axes = self._axes(name)
        self.put(seconds, (values,))


def time_before(last: float, now: float, period: float) -> str:
    """The label of an axis that ends with the `last` decision sampled, in s; of a fast run it may be long past."""
    return "time before now (s)" if now - last < 1.5 * period else f"time (s) before {last:.2f} s of the run"


def smoothed(values: np.ndarray) -> np.ndarray:
    """Running means over a share of all points, and over fewer at the ends."""
    reach = max(1, round(SMOOTH * len(values) / 2))
    total = np.concatenate([[0.0], np.cumsum(values)])
    place = np.arange(len(values))
    low = np.maximum(place - reach, 0)
    high = np.minimum(place + reach + 1, len(values))
    return (total[high] - total[low]) / (high - low)
