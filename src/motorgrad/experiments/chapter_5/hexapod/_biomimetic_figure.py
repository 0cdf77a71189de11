"""The figure of the biomimetic hexapod: drawn, and how its feet matter."""

from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.bodies import Hexapod
from motorgrad.experiments._claim import mean_of
from motorgrad.experiments._experiment import Values
from motorgrad.experiments.chapter_5.hexapod._body_drawing import Places, draw_view, name_part

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = {"front": "#0072B2", "behind": "#D55E00"}
WORDS = {"front": "front feet", "behind": "middle and rear feet"}


def draw_biomimetic(values: Values, body: Hexapod, highest: float) -> "Figure":
    """The body from the side and from above; speed and slip over the friction of its feet; clear and low front legs."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.2, 8.8), layout="constrained")
    panels: Any = figure.subplot_mosaic(
        [["side"] * 3, ["above"] * 3, ["speed", "slip", "clear"]], height_ratios=[0.75, 1.6, 1.1]
    )
    for view in ("side", "above"):
        draw_view(panels[view], body, view)
    panels["side"].set(xlim=(-1.0, 1.0), ylim=(-0.06, 0.32))
    _names(panels["above"], body)
    for quantity, words in (("speed", "speed along the heading (m/s)"), ("slip", "slip of middle and rear feet (m/s)")):
        _over_friction(panels[quantity], values, quantity)
        panels[quantity].set_ylabel(words)
        panels[quantity].set_ylim(0, None)
    panels["speed"].legend(loc="lower left", fontsize=8.5, title="changed:", title_fontsize=8.5)
    _clear(panels["clear"], values, body, highest)
    return figure


def _names(axes: "Axes", body: Hexapod) -> None:
    places = Places(body, "above")
    for name, offset, words in (
        ("front", (0.16, 0.06), "short, reach forward"),
        ("middle", (0.1, 0.13), "as on the plain hexapod"),
        ("rear", (-0.13, 0.02), "long and strong, reach back"),
    ):
        leg = body.sections[name].leg
        lengths = " + ".join(f"{part.length:g}" for part in (leg.coxa, leg.femur, leg.foot))
        splay = f", {abs(leg.splay):g}°" if leg.splay else ""
        lines = f"{name} legs: {words}{splay}\n{lengths} m, friction {leg.friction:g}"
        name_part(axes, lines, places.tip(f"left_{name}"), offset)
        pair, other = leg.lateral_muscles, leg.vertical_muscles
        strengths = (
            f"protractor {pair.protractor:g} N, retractor {pair.retractor:g} N\n"
            f"levator {other.levator:g} N, depressor {other.depressor:g} N"
        )
        down = {"front": (0.2, -0.03), "middle": (0.12, -0.14), "rear": (-0.13, -0.02)}[name]
        name_part(axes, strengths, places.tip(f"right_{name}"), down)
    for name in body.sections:
        section, centre = body.sections[name], places.joint(name)
        words = f"{section.length:g} m ×\n{section.width:g} m,\n{section.mass:g} kg"
        axes.text(centre[0], centre[1], words, ha="center", va="center", fontsize=8, color="white", zorder=8)
    axes.set(xlim=(-1.0, 1.0), ylim=(-0.55, 0.55))


def _over_friction(axes: "Axes", values: Values, quantity: str) -> None:
    for which, colour in COLOURS.items():
        measured = [mean_of(values[f"{which} {friction:g} {quantity}"]) for friction in values["friction"]]
        _errorbar(axes, values["friction"], measured, colour, WORDS[which])
    axes.set(xlabel="friction of the changed feet", xlim=(0, None))


def _clear(axes: "Axes", values: Values, body: Hexapod, highest: float) -> None:
    """Speeds with front legs that are clear in the swing, and that are not."""
    rough, own = f"{values['friction'][-1]:g}", f"{body.front.leg.friction:g}"
    for row, names in enumerate((("as it is", "low"), (f"front {rough}", "rough low"))):
        measured = [mean_of(values[f"{name} speed"]) for name in names]
        colour = ("0.2", "#CC79A7")[row]
        _errorbar(axes, np.array([0, 1]) + 0.06 * (2 * row - 1), measured, colour, (own, rough)[row])
    axes.set_xticks([0, 1], ["clear", f"rise to {highest:g}° only"])
    axes.set(xlim=(-0.4, 1.4), ylim=(0, None), xlabel="front legs in the swing")
    axes.legend(loc="lower left", fontsize=8.5, title="friction of front feet:", title_fontsize=8.5)


def _errorbar(axes: "Axes", x: np.ndarray, measured: list[Any], colour: str, words: str) -> None:
    centre = np.array([each.value for each in measured])
    ends = np.array([[each.value - each.low, each.high - each.value] for each in measured]).T
    axes.errorbar(x, centre, ends, fmt="o-", color=colour, markersize=4, linewidth=1.2, label=words)
