"""Figure A.1: the geometry of a muscle that wraps around a joint's capsule."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from motorgrad.bodies import wrapped_length, wrapped_rate, wrapping_angle
from motorgrad.schema import count, number
from motorgrad.statistics import exact
from motorgrad_thesis._claims import Claim, at_most
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import EXTENSOR, FLEXOR, Axes, Figure, draw_bones, draw_path, flat_path, new_figure

Shape = tuple[float, float, float]
"""Distances of A and B from the capsule's centre, and its radius, in m."""

STEP = 1e-6  # step of finite differences, rad
ALPHA = "#2e8b57"
BETA = EXTENSOR
THETA = "0.25"
WRAPPED, STRAIGHT = EXTENSOR, FLEXOR


@experiment("fig-a.1", "a muscle wraps around a joint", "figure A.1")
class Wrapping(Experiment):
    """The path of a muscle from A to B past a joint's capsule with centre C. It wraps around the capsule if the angle θ
    is less than θ_c, leaving it along tangents, and is straight otherwise. Only the angle β of the wrapped part depends
    on θ.
    """

    origin_distance: float = number(0.13, 0, 100, open_high=True, unit="m", help="distance from C to A in the drawing")
    insertion_distance: float = number(
        0.1, 0, 100, open_high=True, unit="m", help="distance from C to B in the drawing"
    )
    radius: float = number(
        0.045, 0, 10, open_low=True, open_high=True, unit="m", help="radius of the capsule in the drawing"
    )
    geometries: int = count(
        500, 1, 100_000, help="number of further, random geometries for which the claims are checked"
    )
    seed: int = count(0, help="seed of the random geometries")

    def validate(self) -> None:
        super().validate()
        least = 1.01 * self.radius
        self.check_least(origin_distance=least, insertion_distance=least)

    quick = smoke(geometries=20)

    @property
    def shape(self) -> Shape:
        """Distances of A and B from C, and the radius."""
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

    def figure(self, values: Values) -> Figure:
        figure = new_figure(9.5, 7.2)
        halves: Any = figure.subfigures(2, 1, height_ratios=[1.35, 1])
        above, below = halves
        critical = float(wrapping_angle(*self.shape))
        panels = above.subplots(1, 2, sharex=True, sharey=True)
        for axes, angle in zip(panels, (np.radians(110), critical + 0.4 * (2 * np.pi - critical)), strict=True):
            draw_geometry(axes, angle, self.shape)
        draw_length(below.subplots(1, 2), values, self.shape)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        count = len(values["jump"])
        over = f"The greatest deviation over {count:,} geometries: the one drawn and random ones."
        yield _zero("A path touches its capsule if θ is less than θ_c = 2π − α_A − α_B.", values["onset"], "rad", over)
        yield _zero("The length of a path is that of two tangents and an arc.", values["parts"], "m", over)
        yield _zero("The length is continuous where wrapping begins.", values["jump"], "m", over)
        yield _zero(
            "The length of a wrapped path changes at the rate −r dθ/dt.", values["wrapped_rate"], "m/s", over, 1e-8
        )
        yield _zero(
            "The length of a straight path changes at the rate D·dD/dt / |D|.",
            values["straight_rate"],
            "m/s",
            over,
            1e-8,
        )
        yield _zero(
            "All distances and angles in the drawing except β are independent of the joint angle.",
            values["constant"],
            "m or rad",
            over,
        )


def _zero(statement: str, errors: np.ndarray, unit: str, note: str, within: float = 1e-9) -> Claim:
    if within > 1e-9:
        note = f"{note} Compared with finite differences, which are exact to about 1e-9."
    return at_most(
        within, statement, exact(np.max(errors)), "greatest difference", unit, note=note, source="appendix A.2"
    )


def ends(angle: float, shape: Shape) -> np.ndarray:
    """A and B about the origin, `(2, 2)`: the angle θ between them opens downwards, the muscle passes above."""
    left = -np.pi / 2 - angle / 2
    right = -np.pi / 2 + angle / 2
    return np.array([shape[0] * turned(left), shape[1] * turned(right)])


def turned(angle: float) -> np.ndarray:
    """The unit vector at an angle, anticlockwise from the right."""
    return np.array([np.cos(angle), np.sin(angle)])


def path_at(angle: float, shape: Shape, arc: int = 2) -> np.ndarray:
    """The muscle's path at θ: two points if it is straight, else `arc + 2`."""
    start, stop = ends(angle, shape)
    return flat_path(start, stop, shape[2], np.array([0.0, 1.5 * shape[2]]), arc)


def measure(angle: float, shape: Shape) -> np.ndarray:
    """Measurements of a wrapped path: lengths of its tangent at A, its arc and its tangent at B (m), and the angles
    α_A, β and α_B at the centre (rad)."""
    start, touches, leaves, stop = path_at(angle, shape)
    beta = _angle(touches, leaves)
    lengths = (np.linalg.norm(touches - start), shape[2] * beta, np.linalg.norm(stop - leaves))
    return np.array([*lengths, _angle(start, touches), beta, _angle(leaves, stop)])


def _angle(first: np.ndarray, then: np.ndarray) -> float:
    """Clockwise angle from one direction to another, the way the muscle turns from A to B."""
    return float((np.arctan2(first[1], first[0]) - np.arctan2(then[1], then[0])) % (2 * np.pi))


def first_touch(shape: Shape) -> float:
    """The θ below which the path touches the capsule, by bisection."""
    low = 0.5
    high = 2 * np.pi - 1e-3
    while high - low > 1e-12:
        middle = (low + high) / 2
        low, high = (middle, high) if len(path_at(middle, shape)) > 2 else (low, middle)
    return low


def deviations(shape: Shape) -> dict[str, float]:
    """Deviations of the formulas from the path itself, the greatest over angles: `onset` (rad), `parts` (m), `jump`
    (m), `wrapped_rate` and `straight_rate` (m/rad), `constant` (m or rad)."""
    critical = float(wrapping_angle(*shape))
    wrapping = np.linspace(0.2, critical - 0.01, 12)
    straight = np.linspace(critical + 0.01, 2 * np.pi - 0.05, 12)
    seen = np.array([measure(angle, shape) for angle in wrapping])
    slope = (wrapped_length(wrapping + STEP, *shape) - wrapped_length(wrapping - STEP, *shape)) / (2 * STEP)
    apart, before, after = (
        np.array([np.subtract(*ends(angle, shape)) for angle in straight + shift]) for shift in (0.0, -STEP, STEP)
    )
    stated = np.sum(apart * (after - before) / (2 * STEP), axis=1) / np.linalg.norm(apart, axis=1)
    return {
        "onset": abs(first_touch(shape) - critical),
        "parts": float(np.abs(seen[:, :3].sum(axis=1) - wrapped_length(wrapping, *shape)).max()),
        "jump": float(np.ptp(wrapped_length(np.nextafter(critical, (0.0, 7.0)), *shape))),
        "wrapped_rate": float(np.abs(slope + shape[2]).max()),
        "straight_rate": float(np.abs(wrapped_rate(straight, 1.0, *shape) - stated).max()),
        "constant": float(np.ptp(seen[:, [0, 2, 3, 5]], axis=0).max()),
    }


def draw_geometry(axes: Axes, angle: float, shape: Shape) -> None:
    """A muscle at θ, labelled as in appendix A.2."""
    radius = shape[2]
    points = ends(angle, shape)
    path = path_at(angle, shape, arc=80)
    wraps = len(path) > 2
    draw_bones(axes, tuple(points), radius, width=7.0)
    for point in points:
        within = radius / np.linalg.norm(point)
        axes.plot(*zip((0, 0), within * point, strict=True), color="0.6", linewidth=1, zorder=2.6)
    draw_path(axes, path, WRAPPED if wraps else STRAIGHT)
    for name, point in zip("AB", points, strict=True):
        _name(axes, point * (1 + 0.017 / np.linalg.norm(point)), f"${name}$", "black", 13)
    axes.text(0.0, -0.3 * radius, "$C$", ha="center", va="center", fontsize=12, zorder=6)
    left, right = (float(np.arctan2(*point[::-1])) for point in points)
    _arc(axes, 1.35 * radius, -np.pi / 2 - angle / 2, -np.pi / 2 + angle / 2, r"$\theta$", THETA, inside=False)
    for name, point in zip("AB", points, strict=True):
        outward = np.array([-point[1], point[0]]) / np.linalg.norm(point) * (1 if name == "A" else -1)
        _name(axes, 0.66 * point + 0.011 * outward, f"$l_{name}$", "#6d6553", 10)
    if wraps:
        _touching(axes, path, left, right, radius)
        axes.set_title(r"$\theta < \theta_c$: wrapped, $L = L_A + r\beta + L_B$", fontsize=11)
    else:
        middle = path.mean(axis=0)
        axes.text(middle[0], middle[1] + 0.008, r"$L = \|A - B\|$", ha="center", va="bottom", color=STRAIGHT)
        axes.set_title(r"$\theta \geq \theta_c$: straight", fontsize=11)
    reach = 1.15 * max(shape[:2])
    axes.set(xlim=(-reach, reach), ylim=(-0.85 * reach, reach), aspect="equal")
    axes.set_axis_off()


def _touching(axes: Axes, path: np.ndarray, left: float, right: float, radius: float) -> None:
    """The points of contact: radii, right angles, and the angles between them."""
    touches = path[1]
    leaves = path[-2]
    first, last = (float(np.arctan2(*point[::-1])) for point in (touches, leaves))
    for point, end in ((touches, path[0]), (leaves, path[-1])):
        axes.plot(*zip((0, 0), point, strict=True), color="0.4", linewidth=1, linestyle="--", zorder=2.7)
        along = (end - point) / np.linalg.norm(end - point)
        inward = -point / radius
        corner = 0.14 * radius * np.array([along, along + inward, inward]) + point
        axes.plot(*corner.T, color="0.4", linewidth=0.8, zorder=2.7)
    _name(axes, 0.62 * touches + np.array([0.006, 0.003]), "$r$", "0.3", 10)
    _arc(axes, 0.36 * radius, first, left % (2 * np.pi), r"$\alpha_A$", ALPHA)
    _arc(axes, 0.36 * radius, right, last, r"$\alpha_B$", ALPHA)
    _arc(axes, 0.24 * radius, last, first, r"$\beta$", BETA)
    axes.text(0, 1.22 * radius, r"$r\beta$", ha="center", va="center", color=BETA)
    for name, (point, end) in {"A": (touches, path[0]), "B": (leaves, path[-1])}.items():
        middle = (point + end) / 2
        outward = point / radius
        words = rf"$L_{name} = l_{name}\,\sin\alpha_{name}$"
        x, y = middle + 0.008 * outward
        axes.text(x, y, words, ha="right" if name == "A" else "left", va="bottom", color=BETA)


def _arc(axes: Axes, radius: float, start: float, stop: float, name: str, colour: str, inside: bool = True) -> None:
    """An arc about the origin, anticlockwise, labelled at its middle."""
    turn = np.linspace(start, stop, 60)
    axes.plot(radius * np.cos(turn), radius * np.sin(turn), color=colour, linewidth=1.2, zorder=5)
    place = radius * (1.6 if inside else 1.18) * turned((start + stop) / 2)
    _name(axes, place, name, colour, 11)


def _name(axes: Axes, place: np.ndarray, name: str, colour: str, size: float) -> None:
    axes.text(place[0], place[1], name, ha="center", va="center", color=colour, fontsize=size, zorder=6)


def draw_length(panels: Any, values: dict[str, np.ndarray], shape: Shape) -> None:
    """Length and rate against θ, coloured by regime, with θ_c marked."""
    critical = float(wrapping_angle(*shape))
    degrees = np.degrees(values["angle"])
    wraps = values["angle"] < critical
    for axes, quantity, unit in zip(panels, ("length", "rate"), (100, 1000), strict=True):
        for where, colour, words in ((wraps, WRAPPED, "wrapped"), (~wraps, STRAIGHT, "straight")):
            axes.plot(degrees[where], unit * values[quantity][where], color=colour, linewidth=2, label=words)
        axes.axvline(np.degrees(critical), color="0.5", linewidth=1, linestyle="--")
        axes.text(
            np.degrees(critical) + 4,
            0.96,
            rf"$\theta_c = {np.degrees(critical):.0f}°$",
            transform=axes.get_xaxis_transform(),
            va="top",
            color="0.35",
        )
        axes.set(xlabel=r"angle $\theta$ (°)", xlim=(0, 360), xticks=range(0, 361, 60))
    panels[0].set_ylabel("length $L$ (cm)")
    panels[0].legend(loc="lower left")
    panels[1].set_ylabel(r"$\mathrm{d}L/\mathrm{d}\theta$ (mm per rad)")
    panels[1].axhline(-1000 * shape[2], color="0.8", linewidth=1, zorder=0)
    panels[1].text(6, -1000 * shape[2] - 1, "$-r$", va="top", color="0.45")
