"""Figure 2.1: the partially observable Markov decision process as a diagram."""

import math

from motorgrad_thesis._experiment import Experiment, Values, experiment
from motorgrad_thesis._figures import Axes, Figure, Point, draw_arrow, subplots

HIDDEN = "#3b6fb6"
SEEN = "#c8452f"
OURS = "#2e8b57"
RADIUS = 0.33
# name: (position, formula, colour)
NODES: dict[str, tuple[Point, str, str]] = {
    "before": ((0.0, 2.0), r"$x_{t-1}$", HIDDEN),
    "state": ((2.6, 2.0), r"$x_t$", HIDDEN),
    "after": ((5.2, 2.0), r"$x_{t+1}$", HIDDEN),
    "reward": ((2.6, 3.5), r"$r_t$", SEEN),
    "observation": ((2.6, 0.5), r"$y_t$", SEEN),
    "action": ((4.4, 0.5), r"$a_t$", SEEN),
    "parameters": ((4.4, -0.9), r"$\theta$", OURS),
}
# from, to: (distribution, colour, offset of the formula from the middle of the arrow)
ARROWS: dict[tuple[str, str], tuple[str, str, Point]] = {
    ("before", "state"): ("", HIDDEN, (0, 0)),
    ("state", "after"): (r"$p(x_{t+1} \mid x_t, a_t)$", HIDDEN, (0.0, 0.22)),
    ("state", "reward"): (r"$p(r_t \mid x_t)$", HIDDEN, (0.62, 0.0)),
    ("state", "observation"): (r"$p(y_t \mid x_t)$", HIDDEN, (-0.64, 0.0)),
    ("observation", "action"): (r"$p(a_t \mid y_t, \theta)$", OURS, (0.0, 0.24)),
    ("action", "after"): ("", HIDDEN, (0, 0)),
    ("parameters", "action"): ("", OURS, (0, 0)),
}


@experiment("fig-2.1", "the decision process", "figure 2.1")
class Process(Experiment):
    """Dependencies in a partially observable Markov decision process. The state evolves unseen; each state yields an
    observation and a reward; the policy chooses the action from the observation alone."""

    def figure(self, values: Values) -> Figure:
        figure, axes = subplots(7, 5)
        for place, formula, colour in NODES.values():
            _node(axes, place, formula, colour)
        for (start, end), (formula, colour, offset) in ARROWS.items():
            _arrow(axes, NODES[start][0], NODES[end][0], colour)
            (x, y) = NODES[start][0]
            (u, v) = NODES[end][0]
            middle = ((x + u) / 2 + offset[0], (y + v) / 2 + offset[1])
            axes.text(*middle, formula, ha="center", va="center", color=colour)
        for side in (-1.3, 6.5):
            axes.text(side, 2.0, r"$\cdots$", ha="center", va="center", fontsize=16, color=HIDDEN)
        for line, (what, colour) in enumerate((("hidden", HIDDEN), ("observed", SEEN), ("adapted by the agent", OURS))):
            axes.text(-1.3, -0.35 - 0.32 * line, f"● {what}", color=colour, va="center")
        axes.set(xlim=(-1.6, 6.9), ylim=(-1.4, 4.0), aspect="equal")
        axes.set_axis_off()
        return figure


def _node(axes: Axes, place: Point, formula: str, colour: str) -> None:
    from matplotlib.patches import Circle

    axes.add_patch(Circle(place, RADIUS, facecolor=f"{colour}22", edgecolor=colour, linewidth=1.6))
    axes.text(*place, formula, ha="center", va="center", fontsize=13, color=colour)


def _arrow(axes: Axes, start: Point, end: Point, colour: str) -> None:
    gap = (RADIUS + 0.06) / math.dist(start, end)
    draw_arrow(axes, _along(start, end, gap), _along(start, end, 1 - gap), colour, size=14, width=1.4)


def _along(start: Point, end: Point, fraction: float) -> Point:
    """The point at this fraction of the way."""
    return start[0] + fraction * (end[0] - start[0]), start[1] + fraction * (end[1] - start[1])
