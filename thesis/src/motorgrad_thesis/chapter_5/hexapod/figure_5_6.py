"""Figure 5.6: the hexapod, drawn from its model and labelled."""

from typing import Any

import numpy as np

from motorgrad.bodies import Hexapod
from motorgrad_thesis._experiment import Experiment, Values, experiment
from motorgrad_thesis._figures import EXTENSOR, Axes, Figure, new_figure
from motorgrad_thesis.chapter_5.hexapod._drawing import FREEDOM, Places, dimension, draw_view, freedom, name_part

LEG = "left_middle"


@experiment("fig-5.6", "the hexapod", "figure 5.6")
class HexapodBody(Experiment):
    """The hexapod: three sections in a row, joined by two joints with a range of a few degrees, each with two legs of
    three segments and four muscles per leg. Side, front and top view, with its numbers."""

    def figure(self, values: Values) -> Figure:

        body = Hexapod()
        figure = new_figure(9.8, 7.6)
        panels: Any = figure.subplot_mosaic(
            [["side", "front"], ["above", "above"]], width_ratios=[1.12, 1], height_ratios=[1, 1.75]
        )
        for view, axes in panels.items():
            draw_view(axes, body, view)
            axes.set_title({"side": "from the side", "front": "from its head", "above": "from above"}[view], fontsize=9)
        _side(panels["side"], body)
        _front(panels["front"], body)
        _above(panels["above"], body)
        return figure


def _side(axes: Axes, body: Hexapod) -> None:
    places = Places(body, "side")
    section = body.middle
    front, middle, rear = (places.joint(name) for name in ("front", "middle", "rear"))
    high = middle[1] + section.height / 2
    ends = [rear - (body.rear.length / 2, 0.0), np.add(front, (body.front.length / 2, 0.0))]
    level = high + 0.15
    dimension(axes, (ends[0][0], level), (ends[1][0], level), f"{body.length:g} m", (0.0, 0.03))
    level = high + 0.07
    dimension(axes, (rear[0], level), (middle[0], level), f"{body.spacing:g} m", (0.0, 0.03))
    beside = ends[1][0] + 0.05
    dimension(axes, (beside, 0.0), (beside, middle[1]), f"{middle[1]:.2g} m", (0.075, 0.0))
    beside = ends[0][0] - 0.05
    half = section.height / 2
    dimension(axes, (beside, rear[1] - half), (beside, rear[1] + half), f"{body.rear.height:g} m", (-0.085, 0.0))
    axes.set(xlim=(-0.56, 0.56), ylim=(-0.06, level + 0.15))


def _front(axes: Axes, body: Hexapod) -> None:
    places = Places(body, "front")
    leg = body.middle.leg
    vertical = places.joint(f"femur_{LEG}")
    ankle = places.joint(f"foot_{LEG}")
    tip = places.tip(LEG)
    freedom(axes, vertical, 0.0, leg.vertical.range, 0.19, f"{_span(leg.vertical.range)}")
    name_part(axes, f"ankle, a spring,\n{_span(leg.ankle.range)}", ankle, (-0.05, -0.09))
    dimension(axes, np.add(ankle, (0.045, 0.0)), np.add(tip, (0.045, 0.0)), f"{leg.foot.length:g} m", (0.075, 0.0))
    muscles = leg.vertical_muscles
    other = "right_middle"
    name_part(axes, f"levator, {muscles.levator:g} N", places.muscle(f"levator_{other}"), (-0.12, 0.1))
    wrapped = places.joint(f"femur_{other}") - (0.0, muscles.radius)
    name_part(axes, f"depressor, {muscles.depressor:g} N,\naround its capsule", wrapped, (0.03, -0.07), EXTENSOR)
    axes.set(xlim=(-0.56, 0.56), ylim=(-0.06, 0.42))


def _above(axes: Axes, body: Hexapod) -> None:
    places = Places(body, "above")
    section = body.front
    leg, lateral = section.leg, section.leg.lateral_muscles
    name = "left_front"
    hip, vertical, ankle = (places.joint(f"{bone}_{name}") for bone in ("coxa", "femur", "foot"))
    tip = places.tip(name)
    words = f"foot, {leg.foot.length:g} m, {leg.foot.mass:g} kg, friction {leg.friction:g}"
    name_part(axes, words, (ankle + 2 * tip) / 3, (0.14, 0.03))
    name_part(axes, f"femur, {leg.femur.length:g} m, {leg.femur.mass:g} kg", (vertical + ankle) / 2, (0.14, 0.02))
    name_part(axes, f"coxa, {leg.coxa.length:g} m, {leg.coxa.mass:g} kg", hip + 0.4 * (vertical - hip), (0.14, 0.045))
    name_part(axes, f"protractor, {lateral.protractor:g} N", places.muscle(f"protractor_{name}", 0.3), (0.1, -0.005))
    retractor = places.muscle("retractor_left_rear", 0.4)
    name_part(axes, f"retractor, {lateral.retractor:g} N", retractor, (-0.12, 0.03), EXTENSOR)
    # of a right leg, towards the other side
    turned = places.joint("coxa_right_rear")
    freedom(axes, turned, -90.0, leg.lateral.range, 0.3, "")
    words = _span(leg.lateral.range)
    axes.text(turned[0] - 0.19, turned[1] - 0.27, words, ha="right", va="center", fontsize=8.5, color=FREEDOM)
    middle = places.joint("middle")
    front = places.joint("front")
    joint = (middle + front) / 2
    name_part(axes, f"joint between sections,\n{body.spine_axis}, {_span(body.spine.range)}", joint, (0.0, -0.42))
    across = np.array([0.0, section.width / 2])
    inside = np.add(front, (0.02, 0.0))
    dimension(axes, inside - across, inside + across, f"{section.width:g} m", (-0.06, 0.0), "white")
    name_part(
        axes, f"section, {section.length:g} m long, {section.mass:g} kg", np.add(front, (0.08, -0.08)), (0.16, -0.02)
    )
    axes.set(xlim=(-0.95, 0.95), ylim=(-0.52, 0.42))


def _span(span: tuple[float, float]) -> str:
    """A range of angles in words."""
    low, high = span
    return f"±{high:g}°" if np.isclose(-low, high) else f"{low:g} … {high:g}°".replace("-", "−")
