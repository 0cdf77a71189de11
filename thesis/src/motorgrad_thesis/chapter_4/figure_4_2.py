"""Figure 4.2: the recruitment task as a diagram."""

from typing import Any

from motorgrad.schema import count
from motorgrad_thesis._experiment import Experiment, Values, experiment
from motorgrad_thesis._figures import FLEXOR, Axes, Figure, Point, draw_arrow, subplots

NEURON = FLEXOR
MUSCLE = "#a33b2e"
SEEN = "0.25"
OURS = "#2e8b57"
# positions of the columns
POOL = 2.0
UNITS = 4.4
FORCE = 6.5
MIDDLE = 2.0
BELOW = -0.55


@experiment("fig-4.2", "the recruitment task", "figure 4.2")
class RecruitmentTask(Experiment):
    """The recruitment task as a loop. The input reaches all motoneurons of a pool; those that fire activate their motor
    units, whose forces add up. All of them receive the same reward, which depends on the force.
    """

    units: int = count(4, 2, 8, help="number of units drawn")

    def figure(self, values: Values) -> Figure:
        from matplotlib.patches import FancyBboxPatch

        figure, axes = subplots(8, 4.4)
        gap = 3.2 / self.units
        heights = [MIDDLE + gap * ((self.units - 1) / 2 - unit) for unit in range(self.units)]
        for place, width, words, colour in (
            (POOL, 1.3, "motoneuron pool", NEURON),
            (UNITS, 1.6, "motor units", MUSCLE),
        ):
            style: dict[str, Any] = {"boxstyle": "round,pad=0.12", "facecolor": f"{colour}11", "edgecolor": colour}
            corner = (place - width / 2, heights[-1] - gap / 2)
            axes.add_patch(FancyBboxPatch(corner, width, gap * self.units, linewidth=1.2, **style))
            axes.text(place, heights[0] + gap / 2 + 0.3, words, ha="center", color=colour)
        middle = (POOL + UNITS) / 2 - 0.1
        for unit, height in enumerate(heights):
            _neuron(axes, (POOL, height), 0.34 * min(1, gap), unit, self.units)
            _fibre(axes, (UNITS, height), 0.5, 0.13 * min(1, gap))
            draw_arrow(axes, (0.55, MIDDLE), (POOL - 0.4 * min(1, gap), height), SEEN)
            draw_arrow(axes, (POOL + 0.4 * min(1, gap), height), (UNITS - 0.6, height), NEURON)
            axes.text(middle, height + 0.1, rf"$a^{{({unit + 1})}}$", ha="center", fontsize=9, color=NEURON)
            draw_arrow(axes, (UNITS + 0.6, height), (FORCE - 0.6, MIDDLE), MUSCLE)
        for place, words, colour in (
            ((0.15, MIDDLE), "input\n$y$", SEEN), ((FORCE + 0.1, MIDDLE), "force\n$f(\\sum w^{(i)} a^{(i)})$", MUSCLE),
        ):  # fmt: skip
            axes.text(*place, words, ha="center", va="center", fontsize=11, color=colour)
        axes.text(middle, heights[-1] - 0.4, "0 or 1", ha="center", fontsize=8, color="0.45")
        _box(axes, (FORCE + 0.1, BELOW), "task: was that\nthe right force?", SEEN)
        draw_arrow(axes, (FORCE + 0.1, MIDDLE - 0.42), (FORCE + 0.1, BELOW + 0.36), MUSCLE)
        draw_arrow(axes, (FORCE - 0.8, BELOW), (POOL, BELOW), OURS, head=False)
        draw_arrow(axes, (POOL, BELOW), (POOL, heights[-1] - gap / 2 - 0.17), OURS)
        axes.text((POOL + FORCE) / 2 - 0.3, BELOW + 0.12, "one reward $r$, the same for all", ha="center", color=OURS)
        axes.text(0.15, MIDDLE - 0.75, "the load\nto be lifted", ha="center", va="center", fontsize=9, color="0.45")
        axes.set(xlim=(-0.5, FORCE + 1.3), ylim=(BELOW - 0.5, heights[0] + gap / 2 + 0.65), aspect="equal")
        axes.set_axis_off()
        return figure


def _neuron(axes: Axes, place: Point, radius: float, unit: int, units: int) -> None:
    """A circle with the unit's sigmoid in it; later units have their threshold further to the right."""
    import numpy as np
    from matplotlib.patches import Circle

    axes.add_patch(Circle(place, radius, facecolor="white", edgecolor=NEURON, linewidth=1.4, zorder=3))
    along = np.linspace(-1, 1, 41)
    threshold = 1.6 * ((unit + 0.5) / units - 0.5)
    rise = 1 / (1 + np.exp(-9 * (along - threshold)))
    axes.plot(place[0] + 0.62 * radius * along, place[1] + 0.8 * radius * (rise - 0.5), color=NEURON, zorder=4)


def _fibre(axes: Axes, place: Point, half: float, thick: float) -> None:
    """A bundle of fibres: a spindle with stripes."""
    import numpy as np

    along = np.linspace(-1, 1, 61)
    belly = thick * np.sqrt(np.clip(1 - along**2, 0, 1))
    axes.fill_between(place[0] + half * along, place[1] - belly, place[1] + belly, color=f"{MUSCLE}55", linewidth=0)
    for part in (-0.9, -0.45, 0.0, 0.45, 0.9):
        axes.plot(place[0] + half * along, place[1] + part * belly, color=MUSCLE, linewidth=0.7)


def _box(axes: Axes, place: Point, words: str, colour: str) -> None:
    style = {"boxstyle": "round,pad=0.45", "facecolor": "white", "edgecolor": colour, "linewidth": 1.3}
    axes.text(*place, words, ha="center", va="center", color=colour, bbox=style, zorder=3)
