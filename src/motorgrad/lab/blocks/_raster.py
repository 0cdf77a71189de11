"""Which of many fired when, and how often a signal had which value."""

import dataclasses
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np

from motorgrad._errors import check
from motorgrad.lab._block import Ports
from motorgrad.lab._parameter import Setting
from motorgrad.lab._port import Port
from motorgrad.lab._record import Record
from motorgrad.lab.blocks._viewer import Viewer, check_limits

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclasses.dataclass(frozen=True)
class Raster(Viewer):
    """Shows which of many units fired when: a dash for every tick at which a number is not 0; seed by seed."""

    name: ClassVar[str] = "raster"
    drawing: ClassVar[str] = "raster"

    shape: Annotated[tuple[int, ...], Setting("shape of the signal: how many units there are")] = (1,)

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape)}

    def figure(self, record: Record, path: str) -> "Figure":
        from matplotlib.ticker import MaxNLocator

        from motorgrad.lab.blocks._figure import picture

        fired = self.seen(record, path, "u") != 0
        times = record.times(f"{path}.u")
        rows = fired.transpose(0, 2, 1).reshape(-1, len(times))
        figure, axes = picture(height=max(1.5, min(6.0, 1.0 + 0.12 * len(rows))))
        axes.eventplot([times[row] for row in rows], colors="#26292e", linelengths=0.8, linewidths=0.8)
        axes.set(
            xlabel="time (s)", ylabel="unit" if len(fired) == 1 else "unit, seed by seed", ylim=(len(rows) - 0.5, -0.5)
        )
        axes.set_xlim(times[0], times[-1] + record.every[f"{path}.u"] * record.tick)
        axes.yaxis.set_major_locator(MaxNLocator(integer=True))
        return figure


@dataclasses.dataclass(frozen=True)
class Histogram(Viewer):
    """Shows how often a signal had which value: the part of the samples of all seeds in each of the bins."""

    name: ClassVar[str] = "histogram"
    drawing: ClassVar[str] = "histogram"

    shape: Annotated[tuple[int, ...], Setting("shape of the signal")] = ()
    bins: Annotated[int, Setting("how many bins there are")] = 30
    limits: Annotated[tuple[float, float] | None, Setting("where bins begin and end; None for all")] = None

    def validate(self) -> None:
        whole = isinstance(self.bins, int) and not isinstance(self.bins, bool)
        check(whole and 1 <= self.bins <= 10_000, "bins", self.bins, "a whole number in 1 … 10000")
        check_limits("limits", self.limits)

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape)}

    def parts(self, record: Record, path: str) -> tuple[np.ndarray, np.ndarray]:
        """The part of all samples that is in each bin, and the edges of the bins."""
        values = self.seen(record, path, "u").ravel()
        counts, edges = np.histogram(values[np.isfinite(values)], self.bins, self.limits)
        return counts / len(values), edges

    def figure(self, record: Record, path: str) -> "Figure":
        from motorgrad.lab.blocks._figure import COLOURS, picture

        parts, edges = self.parts(record, path)
        figure, axes = picture()
        axes.stairs(parts, edges, fill=True, color=COLOURS[0], alpha=0.8)
        axes.set(xlabel="u", ylabel="part of the samples", xlim=(edges[0], edges[-1]))
        return figure
