"""Signals over time, and against each other."""

import dataclasses
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np

from motorgrad._errors import check
from motorgrad.lab._block import Ports
from motorgrad.lab._parameter import Setting
from motorgrad.lab._port import Port
from motorgrad.lab._record import Record
from motorgrad.lab.blocks._viewer import Labelled, Viewer, check_limits

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclasses.dataclass(frozen=True)
class Scope(Labelled):
    """Shows signals over time: a line for each number; of many seeds the median, and a band between the quartiles."""

    name: ClassVar[str] = "scope"
    drawing: ClassVar[str] = "lines"

    limits: Annotated[tuple[float, float] | None, Setting("what the vertical axis shows; None for all")] = None
    window: Annotated[float, Setting("so many seconds are shown while it runs")] = 10.0

    def validate(self) -> None:
        super().validate()
        check_limits("limits", self.limits)
        number = isinstance(self.window, int | float) and not isinstance(self.window, bool)
        check(number and 0 < self.window < np.inf, "window", self.window, "a positive number of seconds")

    def figure(self, record: Record, path: str) -> "Figure":
        from motorgrad.lab.blocks._figure import draw_series, finish, picture

        names, seeds, place = self.columns(), 1, 0
        signals = [(f"{path}.{label}", self.seen(record, path, label)) for label in self.labels]
        figure, axes = picture()
        for address, signal in signals:
            seeds = len(signal)
            for number in range(signal.shape[-1]):
                draw_series(axes, record.times(address), signal[..., number], place, names[place])
                place += 1
        axes.margins(x=0)
        if self.limits is not None:
            axes.set_ylim(*self.limits)
        finish(axes, "time (s)", "", seeds, names)
        return figure


@dataclasses.dataclass(frozen=True)
class Portrait(Viewer):
    """Shows one signal against another: a path in the plane, with a dot where it ends; one for each seed."""

    name: ClassVar[str] = "XY portrait"
    drawing: ClassVar[str] = "portrait"

    shape: Annotated[tuple[int, ...], Setting("shape of the signals: how many paths there are")] = ()
    across: Annotated[tuple[float, float] | None, Setting("what the axis of x shows; None for all")] = None
    up: Annotated[tuple[float, float] | None, Setting("what the axis of y shows; None for all")] = None

    def validate(self) -> None:
        check_limits("across", self.across)
        check_limits("up", self.up)

    @property
    def inputs(self) -> Ports:
        return {"x": Port(self.shape), "y": Port(self.shape)}

    def figure(self, record: Record, path: str) -> "Figure":
        from motorgrad.lab.blocks._figure import COLOURS, picture

        x, y = self.seen(record, path, "x"), self.seen(record, path, "y")
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
