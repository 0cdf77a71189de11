"""Where local units are."""

import dataclasses
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

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
class PolicyMap(Viewer):
    """Shows Gaussian units over two of their inputs: an ellipse of one standard deviation about each centre, with an
    arrow where its force is given, as they are at the end of the record; and the path that was taken.

    Connect the outputs `parameters` of the block "gaussians" or "growing gaussians", of the latter also `units`, how
    many there are; and to `place` what the units observe. It shows the first seed, or the one that is asked for.
    """

    name: ClassVar[str] = "policy map"
    drawing: ClassVar[str] = "map"

    units: Annotated[int, Setting("how many there are at most")] = 1
    observed: Annotated[int, Setting("how many numbers they see")] = 2
    axes: Annotated[tuple[int, int], Setting("which of these are shown across and up, from 0")] = (0, 1)
    forces: Annotated[Any, Setting("two numbers for each unit: where it pushes; None for no arrows")] = None
    across: Annotated[tuple[float, float] | None, Setting("what is shown across; None for all")] = None
    up: Annotated[tuple[float, float] | None, Setting("what is shown up; None for all")] = None

    def validate(self) -> None:
        for name, least in (("units", 1), ("observed", 2)):
            value = getattr(self, name)
            whole = isinstance(value, int) and not isinstance(value, bool)
            check(whole and least <= value <= 10_000, name, value, f"a whole number in {least} … 10000")
        places = isinstance(self.axes, tuple) and all(isinstance(n, int) for n in self.axes) and len(self.axes) == 2
        valid = places and len({*self.axes}) == 2 and all(0 <= n < self.observed for n in self.axes)
        check(valid, "axes", self.axes, f"two different whole numbers in 0 … {self.observed - 1}")
        try:
            forces = np.zeros((self.units, 2)) if self.forces is None else np.asarray(self.forces, float)
        except (TypeError, ValueError):  # no numbers, or lists of different lengths
            forces = np.zeros(0)
        valid = forces.shape == (self.units, 2) and np.all(np.isfinite(forces))
        check(valid, "forces", self.forces, f"None, or {self.units} rows of two numbers")
        check_limits("across", self.across)
        check_limits("up", self.up)

    @property
    def inputs(self) -> Ports:
        return {
            "parameters": Port((2 * self.units * self.observed,), help="centres, and logarithms of widths"),
            "units": Port((), "int", default=0.0, help="how many there are; 0 for all"),
            "place": Port((self.observed,), default=0.0, help="what the units observe"),
        }

    def figure(self, record: Record, path: str, seed: int = 0) -> "Figure":
        from motorgrad import policies, sim
        from motorgrad.lab.blocks._figure import picture

        seen = {name: self.seen(record, path, name) for name in self.inputs}
        seeds = len(seen["units"])
        check(isinstance(seed, int) and 0 <= seed < seeds, "seed", seed, f"a whole number in 0 … {seeds - 1}")
        centres, widths = seen["parameters"][seed, -1].reshape(2, self.units, self.observed)[:, :, list(self.axes)]
        count = int(seen["units"][seed, -1, 0]) or self.units
        there = np.arange(self.units) < count
        place = seen["place"][seed][:, list(self.axes)]
        figure, axes = picture(4.5, 4.5)
        moved = np.any(np.ptp(place, axis=0) > 0)
        points = np.concatenate([(centres + d * np.exp(widths))[there] for d in (-1.1, 1.1)] + [place] * bool(moved))
        least, most = points.min(0), points.max(0)
        axes.set_xlim(self.across or (least[0], most[0]))
        axes.set_ylim(self.up or (least[1], most[1]))
        forces = np.zeros((self.units, 2)) if self.forces is None else np.asarray(self.forces, float)
        if moved:
            sim.draw_paths(axes, [place])
        sim.draw_units(axes, policies.LocalGaussians(centres, widths), forces, there)
        axes.set(xlabel=f"observation {self.axes[0]}", ylabel=f"observation {self.axes[1]}")
        axes.set_aspect("equal")
        return figure
