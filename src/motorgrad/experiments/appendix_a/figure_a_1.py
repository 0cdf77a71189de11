"""Figure A.1: the geometry of a muscle that wraps around a joint's capsule."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from motorgrad._errors import check
from motorgrad.bodies import wrapped_length, wrapped_rate, wrapping_angle
from motorgrad.experiments._claim import Claim, exact
from motorgrad.experiments._experiment import Experiment, Values
from motorgrad.experiments._workspace import Workspace
from motorgrad.experiments.appendix_a._wrapping_drawing import draw_geometry, draw_length
from motorgrad.experiments.appendix_a._wrapping_geometry import Shape, deviations

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclasses.dataclass(frozen=True)
class Wrapping(Experiment):
    """How a muscle from A to B passes a joint's capsule with centre C: around it while the angle θ is less than θ_c, on
    tangents to the points where it touches; straight beyond. Only the angle β of the wrapped part depends on θ.

    **Arguments:**

    - `origin_distance` (m): from C to A, as drawn.
    - `insertion_distance` (m): from C to B, as drawn.
    - `radius` (m): of the capsule, as drawn.
    - `geometries`: further ones, drawn at random, over which the claims are checked.
    - `seed`: of the further geometries.
    """

    name: ClassVar[str] = "fig-a.1"
    title: ClassVar[str] = "a muscle wraps around a joint"
    source: ClassVar[str] = "figure A.1"

    origin_distance: float = 0.13
    insertion_distance: float = 0.1
    radius: float = 0.045
    geometries: int = 500
    seed: int = 0

    def __post_init__(self) -> None:
        check(0 < self.radius < 10, "radius", self.radius, "in 0 … 10 m")
        for name in ("origin_distance", "insertion_distance"):
            value = getattr(self, name)
            check(1.01 * self.radius <= value < 100, name, value, f"at least 1.01 times the radius, {self.radius} m")
        check(1 <= self.geometries <= 100_000, "geometries", self.geometries, "in 1 … 100,000")

    @classmethod
    def quick(cls) -> Self:
        return cls(geometries=20)

    @property
    def shape(self) -> Shape:
        """Distances of A and B, and the radius."""
        return self.origin_distance, self.insertion_distance, self.radius

    def run(self, work: Workspace) -> Values:
        drawn = np.random.default_rng(self.seed).uniform((0.05, 0.05, 0.01), (0.3, 0.3, 0.049), (self.geometries, 3))
        checks = [deviations(shape) for shape in [self.shape, *map(tuple, drawn)]]
        angle = np.radians(np.linspace(5, 355, 701))
        return {
            "angle": angle,
            "length": wrapped_length(angle, *self.shape),
            "rate": wrapped_rate(angle, 1.0, *self.shape),
            **{name: np.array([found[name] for found in checks]) for name in checks[0]},
        }

    def figure(self, values: Values) -> "Figure":
        from matplotlib.figure import Figure

        figure = Figure(figsize=(9.5, 7.2), layout="constrained")
        halves: Any = figure.subfigures(2, 1, height_ratios=[1.35, 1])
        above, below = halves
        critical = float(wrapping_angle(*self.shape))
        panels = above.subplots(1, 2, sharex=True, sharey=True)
        for axes, angle in zip(panels, (np.radians(110), critical + 0.4 * (2 * np.pi - critical)), strict=True):
            draw_geometry(axes, angle, self.shape)
        draw_length(below.subplots(1, 2), values, self.shape)
        return figure

    def claims(self, values: Values) -> Sequence[Claim]:
        count = len(values["jump"])
        over = f"The greatest over {count:,} geometries: the one drawn, and others at random."
        return (
            _zero(
                "The angle from which on a path touches its capsule is θ_c = 2π − α_A − α_B.",
                values["onset"],
                "rad",
                over,
            ),
            _zero("The path's length is that of two tangents and an arc.", values["parts"], "m", over),
            _zero("Where wrapping begins the length does not jump.", values["jump"], "m", over),
            _zero("A wrapped path's length changes at the rate −r dθ/dt.", values["wrapped_rate"], "m/s", over, 1e-8),
            _zero("A straight path's changes at D·dD/dt / |D|.", values["straight_rate"], "m/s", over, 1e-8),
            _zero(
                "The distances and angles in the drawing, but for β, are the same at every angle of the joint.",
                values["constant"],
                "m or rad",
                over,
            ),
        )


def _zero(statement: str, errors: np.ndarray, unit: str, note: str, within: float = 1e-9) -> Claim:
    worst = float(np.max(errors))
    if within > 1e-9:
        note = f"{note} Against finite differences, which are exact to about 1e-9."
    expected = f"no difference: at most {within:g}"
    return Claim(statement, "appendix A.2", expected, exact(worst), worst <= within, unit, note)
