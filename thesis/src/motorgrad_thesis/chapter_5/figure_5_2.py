"""Figure 5.2: the hopper, drawn from its model and labelled."""

import numpy as np

from motorgrad.bodies import Hopper, compile_model
from motorgrad.schema import Range, number, static
from motorgrad_thesis._experiment import Experiment, Values, experiment
from motorgrad_thesis._figures import EXTENSOR, FLEXOR, Axes, Figure, flat_path, new_figure
from motorgrad_thesis.chapter_5._hopper_study import posture
from timsim import draw

COLOURS = {"flexor": FLEXOR, "extensor": EXTENSOR}
SENSOR = "#2e8b57"
SIZE = "0.35"
REACH = 1.7  # half the width of a panel, in link lengths


@experiment("fig-5.2", "the hopper", "figure 5.2")
class HopperBody(Experiment):
    """The hopper: four links in a closed loop under a load that slides on a vertical harness, with a foot, and with a
    flexor in front of and an extensor behind each knee. Observations are labelled in green.
    """

    angle: float = number(
        100.0, 40, 150, unit="degrees", help="angle of the knees in the large drawing, between their stops"
    )
    others: tuple[float, float] = static(
        (50.0, 145.0), allowed=Range(40, 150), unit="degrees", help="angles of the knees in the small drawings"
    )

    def figure(self, values: Values) -> Figure:
        body = Hopper()
        figure = new_figure(9.5, 5.6)
        panels = figure.subplot_mosaic([["large", "first"], ["large", "second"]], width_ratios=[2.05, 1])
        _hopper(panels["large"], body, self.angle)
        _labels(panels["large"], body, np.radians(self.angle))
        for name, angle, words in zip(("first", "second"), self.others, ("flexed", "extended"), strict=True):
            _hopper(panels[name], body, angle)
            panels[name].set_title(f"{words}: {angle:.0f}°", fontsize=10)
        return figure


def _hopper(axes: Axes, body: Hopper, degrees: float) -> None:
    """The body at rest on the ground, each muscle in the colour of its group."""
    reach = REACH * body.link_length
    axes.set(xlim=(-reach, reach), ylim=(-0.2 * body.link_length, 2.75 * body.link_length), aspect="equal")
    silent = np.zeros(len(body.muscles))
    # slightly transparent, because an opaque muscle has a dark rim
    drawing = draw(axes, compile_model(body), posture(body, np.radians(degrees)), silent, alpha=0.99)
    # drawn again with their arcs: MuJoCo's paths have only the end points of an arc
    drawing.muscles.set_visible(False)
    load, knee, foot = _joints(body, np.radians(degrees))
    for mirror in (-1, 1):
        fixed = (body.attachment_distance * (end - knee) / body.link_length * (mirror, 1) for end in (load, foot))
        origin, insertion = fixed
        for group, way in (("flexor", -1), ("extensor", 1)):
            outward = np.array([1.5 * way * mirror * body.capsule_radius, 0.0])
            path = flat_path(origin, insertion, body.capsule_radius, outward) + knee * (mirror, 1)
            axes.plot(*path.T, color=COLOURS[group], linewidth=3, solid_capstyle="round", zorder=5)
    axes.set_aspect("equal", adjustable="box")
    axes.set_axis_off()


def _joints(body: Hopper, interior: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions of the load, the right knee and the ankle in the body's plane, `(2,)` each."""
    across = body.link_length * np.cos(interior / 2)
    up = body.link_length * np.sin(interior / 2)
    ankle = np.array([0.0, 2 * body.foot_size[2]])
    return ankle + np.array([0.0, 2 * up]), ankle + np.array([across, up]), ankle


def _labels(axes: Axes, body: Hopper, interior: float) -> None:
    """Names and numbers of the parts, from the body's own fields."""
    from matplotlib.patches import Arc

    link = body.link_length
    half = interior / 2
    radius = body.capsule_radius
    grip = body.attachment_distance
    load, knee, ankle = _joints(body, interior)
    top = knee + grip * (load - knee) / link

    def label(words: str, at: np.ndarray, place: tuple[float, float], colour: str = "0.15") -> None:
        axes.annotate(
            words,
            tuple(at),
            place,
            ha="left" if place[0] > at[0] else "right",
            va="center",
            fontsize=9,
            color=colour,
            arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 0.8, "shrinkA": 2, "shrinkB": 2},
            zorder=8,
        )

    label("harness: a vertical slide", np.array([0.0, 2.6 * link]), (0.25 * link, 2.6 * link))
    label(f"load, {body.load_mass:g} kg", load, (0.5 * link, load[1] + 0.25 * link))
    thigh = knee + 0.72 * (load - knee)
    label(f"four links, {link:g} m, {body.link_mass:g} kg each", thigh * (-1, 1), (-0.5 * link, load[1] + 0.1 * link))
    label(
        f"extensor,\n{body.extensor_strength:g} N",
        (knee + np.array([radius, 0.2 * radius])) * (-1, 1),
        (-1.1 * link, knee[1] + 0.45 * link),
        EXTENSOR,
    )
    inside = (-top[0] + 0.05 * link, knee[1])
    axes.text(
        *inside, f"flexor, {body.flexor_strength:g} N", rotation=90, ha="left", va="center", color=FLEXOR, fontsize=9
    )
    label(f"capsule, radius\n{100 * radius:g} cm", knee + np.array([radius, 0.0]), (knee[0] + 0.42 * link, knee[1]))
    label(f"foot, {body.foot_mass:g} kg", np.array([-body.foot_size[0], ankle[1] / 2]), (-0.6 * link, 0.25 * link))
    label("foot contact\n(+1 or −1)", np.array([0.8 * body.foot_size[0], 0.0]), (0.6 * link, 0.2 * link), SENSOR)
    _dimension(axes, knee, top, np.array([np.sin(half), np.cos(half)]) * 0.3 * link, f"{100 * grip:g} cm")
    turn = np.degrees(half)
    size = 1.35 * radius
    axes.add_patch(Arc(tuple(knee), 2 * size, 2 * size, theta1=180 - turn, theta2=180 + turn, color=SENSOR, zorder=7))
    seen = knee + size * np.array([np.cos(np.pi + 0.7 * half), np.sin(np.pi + 0.7 * half)])
    label("knee angle\nand its rate", seen, (knee[0] + 0.42 * link, knee[1] - 0.42 * link), SENSOR)


def _dimension(axes: Axes, start: np.ndarray, stop: np.ndarray, offset: np.ndarray, words: str) -> None:
    """A labelled distance between two points, drawn beside them."""
    ends = [tuple(point + offset) for point in (start, stop)]
    axes.annotate("", ends[0], ends[1], arrowprops={"arrowstyle": "<->", "color": SIZE, "linewidth": 0.9}, zorder=7)
    for point, end in zip((start, stop), ends, strict=True):
        axes.plot(*zip(point, end, strict=True), color=SIZE, linewidth=0.5, linestyle=":", zorder=7)
    place = (start + stop) / 2 + 1.12 * offset
    axes.text(place[0], place[1], words, ha="left", va="bottom", fontsize=9, color=SIZE)
