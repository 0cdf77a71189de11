"""Sinks that show signals: scopes, portraits, rasters, histograms."""

import abc
import dataclasses
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from jaxtyping import Float

from motorgrad._errors import check
from motorgrad.schema import Range, count, static
from timlab.blocks._base import check_names
from timlab.diagram import Port, Ports, Record, Sink

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclasses.dataclass(frozen=True)
class Viewer(Sink):
    """Base class of sinks that show what they recorded. `drawing` tells an editor how to draw it from the settings."""

    category: ClassVar[str] = "sinks"
    drawing: ClassVar[str]

    @abc.abstractmethod
    def figure(self, record: Record, path: str) -> "Figure":
        """The recorded signals as a matplotlib figure that displays itself in a notebook.

            Scope(("u",)).figure(run.advance(1000), "scope")

        **Arguments:** a record of a run; the sink's `path` in the diagram, such as `"scope"`. **Raises** `ValueError`
        if the record contains nothing of this sink.
        """

    def recorded(self, record: Record, path: str, port: str) -> Float[np.ndarray, "seeds samples numbers"]:
        """The signal recorded at a port, with its elements flattened."""
        signal = record[f"{path}.{port}"]
        check(signal.shape[1] > 0, f"{path}.{port}", signal.shape, "a record of at least one sample")
        return signal.reshape(*signal.shape[:2], -1).astype(float)


@dataclasses.dataclass(frozen=True)
class Labelled(Viewer):
    """Base class of sinks with user-named inputs of one shape."""

    labels: tuple[str, ...] = static(("u",), help="names of the inputs")
    shape: tuple[int, ...] = static((), help="shape of each signal")

    def validate(self) -> None:
        check_names("labels", self.labels, least=1)

    @property
    def inputs(self) -> Ports:
        return {label: Port(self.shape) for label in self.labels}

    def columns(self) -> list[str]:
        """A name for every number, such as `u` or `u[0]`."""
        places = [f"[{','.join(map(str, place))}]" if place else "" for place in np.ndindex(self.shape)]
        return [f"{label}{place}" for label in self.labels for place in places]


def check_limits(name: str, limits: tuple[float, float] | None) -> None:
    """Check that limits are `None` or two finite increasing numbers."""
    check(limits is None or limits[0] < limits[1], name, limits, "None, or a list of two numbers, the lower first")


@dataclasses.dataclass(frozen=True)
class Scope(Labelled):
    """Plot signals over time: one line per number; for several seeds, the median and a band between the quartiles."""

    name: ClassVar[str] = "scope"
    drawing: ClassVar[str] = "lines"

    limits: tuple[float, float] | None = static(None, help="range of the vertical axis; None for automatic")
    window: float = static(10.0, allowed=Range(0, open_low=True), unit="s", help="time shown during a run")
    unit: str = static("", help="unit of the signals, for the vertical axis")

    def validate(self) -> None:
        super().validate()
        check_limits("limits", self.limits)

    def figure(self, record: Record, path: str) -> "Figure":
        from timlab.blocks._figure import draw_series, finish, picture

        names = self.columns()
        seeds = 1
        place = 0
        signals = [(f"{path}.{label}", self.recorded(record, path, label)) for label in self.labels]
        figure, axes = picture()
        for address, signal in signals:
            seeds = len(signal)
            for number in range(signal.shape[-1]):
                draw_series(axes, record.times(address), signal[..., number], place, names[place])
                place += 1
        axes.margins(x=0)
        if self.limits is not None:
            axes.set_ylim(*self.limits)
        label = f"{names[0]} ({self.unit})" if self.unit and len(names) == 1 else self.unit
        finish(axes, "time (s)", label, seeds, names)
        return figure


@dataclasses.dataclass(frozen=True)
class Portrait(Viewer):
    """Plot one signal against another: a path in the plane with a dot at its end, one per seed."""

    name: ClassVar[str] = "XY portrait"
    drawing: ClassVar[str] = "portrait"

    shape: tuple[int, ...] = static((), help="shape of the signals: one path per element")
    across: tuple[float, float] | None = static(None, help="range of the x axis; None for automatic")
    up: tuple[float, float] | None = static(None, help="range of the y axis; None for automatic")

    def validate(self) -> None:
        check_limits("across", self.across)
        check_limits("up", self.up)

    @property
    def inputs(self) -> Ports:
        return {"x": Port(self.shape), "y": Port(self.shape)}

    def figure(self, record: Record, path: str) -> "Figure":
        from timlab.blocks._figure import COLOURS, picture

        x = self.recorded(record, path, "x")
        y = self.recorded(record, path, "y")
        paths = [(x[seed, :, number], y[seed, :, number]) for number in range(x.shape[-1]) for seed in range(len(x))]
        figure, axes = picture(4.5, 4.0)
        strength = max(0.15, min(0.9, 5 / len(paths)))
        for place, (across, up) in enumerate(paths):
            colour = COLOURS[place // len(x) % len(COLOURS)]
            axes.plot(across, up, color=colour, linewidth=1.0, alpha=strength)
            axes.plot(across[-1:], up[-1:], "o", color=colour, markersize=4)
        for setter, limits in ((axes.set_xlim, self.across), (axes.set_ylim, self.up)):
            if limits is not None:
                setter(*limits)
        axes.set(xlabel="x", ylabel="y")
        return figure


@dataclasses.dataclass(frozen=True)
class Raster(Viewer):
    """Raster plot of events: a dash at every tick at which a number is not 0; one row per unit and seed."""

    name: ClassVar[str] = "raster"
    drawing: ClassVar[str] = "raster"

    shape: tuple[int, ...] = static((1,), help="shape of the signal: one row per element")
    window: float = static(10.0, allowed=Range(0, open_low=True), unit="s", help="time shown during a run")

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape)}

    def figure(self, record: Record, path: str) -> "Figure":
        from matplotlib.ticker import MaxNLocator

        from timlab.blocks._figure import picture

        fired = np.nan_to_num(self.recorded(record, path, "u")) != 0
        times = record.times(f"{path}.u")
        rows = fired.transpose(0, 2, 1).reshape(-1, len(times))
        figure, axes = picture(height=max(1.5, min(6.0, 1.0 + 0.12 * len(rows))))
        axes.eventplot([times[row] for row in rows], colors="#26292e", linelengths=0.8, linewidths=0.8)
        axes.set(
            xlabel="time (s)",
            ylabel="unit" if len(fired) == 1 else "unit, grouped by seed",
            ylim=(len(rows) - 0.5, -0.5),
        )
        axes.set_xlim(times[0], times[-1] + record.every[f"{path}.u"] * record.tick)
        axes.yaxis.set_major_locator(MaxNLocator(integer=True))
        return figure


@dataclasses.dataclass(frozen=True)
class Histogram(Viewer):
    """Histogram of a signal's values: the fraction of all samples of all seeds in each bin."""

    name: ClassVar[str] = "histogram"
    drawing: ClassVar[str] = "histogram"

    shape: tuple[int, ...] = static((), help="shape of the signal")
    bins: int = count(30, 1, 10_000, help="number of bins")
    limits: tuple[float, float] | None = static(None, help="range of the bins; None for automatic")

    def validate(self) -> None:
        check_limits("limits", self.limits)

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape)}

    def parts(self, record: Record, path: str) -> tuple[np.ndarray, np.ndarray]:
        """The fraction of all samples in each bin, and the edges of the bins."""
        values = self.recorded(record, path, "u").ravel()
        counts, edges = np.histogram(values[np.isfinite(values)], self.bins, self.limits)
        return counts / len(values), edges

    def figure(self, record: Record, path: str) -> "Figure":
        from timlab.blocks._figure import COLOURS, picture

        parts, edges = self.parts(record, path)
        figure, axes = picture()
        axes.stairs(parts, edges, fill=True, color=COLOURS[0], alpha=0.8)
        axes.set(xlabel="u", ylabel="part of the samples", xlim=(edges[0], edges[-1]))
        return figure
