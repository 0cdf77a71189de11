"""A map of local units."""

import dataclasses
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from motorgrad._errors import check
from motorgrad.schema import count, static
from timlab.blocks._scopes import Viewer, check_limits
from timlab.diagram import Port, Ports, Record

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclasses.dataclass(frozen=True)
class PolicyMap(Viewer):
    """Show Gaussian units over two of their inputs at the end of a record: an ellipse of one standard deviation around
    each centre, and an arrow where its force is given; and the path of `place`.

    Connect the output `parameters` of the block "gaussians" or "growing gaussians", for the latter also `units`, the
    number of units; and to `place` what the units observe. It shows the first seed, or the requested one.
    """

    name: ClassVar[str] = "policy map"
    drawing: ClassVar[str] = "map"

    units: int = count(1, 1, 10_000, help="largest number of units")
    observed: int = count(2, 2, 10_000, help="number of observed quantities")
    axes: tuple[int, int] = static((0, 1), help="indices of the observations on the x and y axes, from 0")
    forces: Any = static(None, help="force of each unit, two numbers; None for no arrows")
    across: tuple[float, float] | None = static(None, help="range of the x axis; None for automatic")
    up: tuple[float, float] | None = static(None, help="range of the y axis; None for automatic")

    def validate(self) -> None:
        valid = len({*self.axes}) == 2 and all(0 <= n < self.observed for n in self.axes)
        check(valid, "axes", self.axes, f"two different integers from 0 to {self.observed - 1}")
        try:
            forces = np.zeros((self.units, 2)) if self.forces is None else np.asarray(self.forces, float)
        except (TypeError, ValueError):  # not numbers, or ragged lists
            forces = np.zeros(0)
        valid = forces.shape == (self.units, 2) and np.all(np.isfinite(forces))
        check(valid, "forces", self.forces, f"None, or {self.units} rows of two numbers")
        check_limits("across", self.across)
        check_limits("up", self.up)

    @property
    def inputs(self) -> Ports:
        return {
            "parameters": Port((2 * self.units * self.observed,), help="centres, then logarithms of widths"),
            "units": Port((), "int", default=0.0, help="number of units in use; 0 for all"),
            "place": Port((self.observed,), default=0.0, help="what the units observe"),
        }

    def figure(self, record: Record, path: str, seed: int = 0) -> "Figure":
        from motorgrad import plane, policies
        from timlab.blocks._figure import picture

        shown = {name: self.recorded(record, path, name) for name in self.inputs}
        seeds = len(shown["units"])
        check(isinstance(seed, int) and 0 <= seed < seeds, "seed", seed, f"an integer from 0 to {seeds - 1}")
        centres, widths = shown["parameters"][seed, -1].reshape(2, self.units, self.observed)[:, :, list(self.axes)]
        count = int(shown["units"][seed, -1, 0]) or self.units
        there = np.arange(self.units) < count
        place = shown["place"][seed][:, list(self.axes)]
        figure, axes = picture(4.5, 4.5)
        moved = np.any(np.ptp(place, axis=0) > 0)
        points = np.concatenate([(centres + d * np.exp(widths))[there] for d in (-1.1, 1.1)] + [place] * bool(moved))
        least = points.min(0)
        most = points.max(0)
        axes.set_xlim(self.across or (least[0], most[0]))
        axes.set_ylim(self.up or (least[1], most[1]))
        forces = np.zeros((self.units, 2)) if self.forces is None else np.asarray(self.forces, float)
        if moved:
            plane.draw_paths(axes, [place])
        plane.draw_units(axes, policies.LocalGaussians(centres, widths), forces, there)
        axes.set(xlabel=f"observation {self.axes[0]}", ylabel=f"observation {self.axes[1]}")
        axes.set_aspect("equal")
        return figure
