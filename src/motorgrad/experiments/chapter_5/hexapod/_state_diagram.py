"""The state machine of a leg as a diagram, from a controller's own numbers."""

from typing import TYPE_CHECKING, Any

from motorgrad.bodies import LegState, TripodController
from motorgrad.experiments.chapter_5.hexapod._walk_record import STATE_COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Point = tuple[float, float]
WIDE, HIGH = 2.5, 1.15
PLACES: dict[LegState, Point] = {
    LegState.STANCE: (0.0, 0.0),
    LegState.WAIT: (0.0, 3.6),
    LegState.SWING: (5.0, 3.6),
    LegState.DROP: (5.0, 0.0),
}
MENDED = "#A0307A"


def draw_machine(axes: "Axes", controller: TripodController) -> None:
    """Boxes are the states with the velocities that they set, arrows the conditions on which a leg goes on."""
    for state, place in PLACES.items():
        _state(axes, place, state, controller)
    _arrow(axes, (0.0, HIGH / 2), (0.0, 3.6 - HIGH / 2))
    _arrow(axes, (WIDE / 2, 3.6), (5.0 - WIDE / 2, 3.6))
    _arrow(axes, (5.0, 3.6 - HIGH / 2), (5.0, HIGH / 2))
    _arrow(axes, (5.0 - WIDE / 2, 0.0), (WIDE / 2, 0.0))
    look: dict[str, Any] = {"fontsize": 8.5, "zorder": 5}
    axes.text(0.15, 1.8, f"the leg is back\nbeyond {_degrees(controller.back)}", ha="left", va="center", **look)
    axes.text(4.85, 1.8, f"the leg is forward\nbeyond {_degrees(controller.forward)}", ha="right", va="center", **look)
    axes.text(
        2.5, 3.6 + HIGH / 2 + 0.1, "more than one leg of the\nopposing tripod is in stance",
        ha="center", va="bottom", **look,
    )  # fmt: skip
    axes.text(
        2.5, -HIGH / 2 - 0.1, f"the foot touches the ground\nwith more than {controller.contact:g} N",
        ha="center", va="top", **look,
    )  # fmt: skip
    if controller.mended:
        waits = "or: all six legs wait,\nand it is of the\nfirst tripod"
        axes.text(2.5, 3.6 - 0.2, waits, ha="center", va="top", color=MENDED, **look)
        lowest = f"or: it is within {_degrees(controller.margin)}\nof its lower limit"
        axes.text(2.5, 0.2, lowest, ha="center", va="bottom", color=MENDED, **look)
        axes.text(-WIDE / 2, -1.5, "● ours, which ends its deadlocks", ha="left", va="center", color=MENDED, **look)
    axes.set(xlim=(-WIDE / 2 - 0.1, 5.0 + WIDE / 2 + 0.1), ylim=(-1.7, 5.0), aspect="equal")
    axes.set_axis_off()


def _state(axes: "Axes", place: Point, state: LegState, controller: TripodController) -> None:
    from matplotlib.patches import FancyBboxPatch

    turning, colour = controller.turning[state], STATE_COLOURS[state]
    corner = (place[0] - WIDE / 2, place[1] - HIGH / 2)
    look: dict[str, Any] = {"boxstyle": "round,pad=0,rounding_size=0.15", "edgecolor": colour, "linewidth": 2}
    axes.add_patch(FancyBboxPatch(corner, WIDE, HIGH, facecolor="white", zorder=3, **look))
    x, y = place
    axes.text(x, y + 0.31, state.name.lower(), ha="center", va="center", fontsize=11, weight="bold", zorder=4)
    words = f"lateral {_rate(turning.lateral)}\nvertical {_rate(turning.vertical)}"
    axes.text(x, y - 0.17, words, ha="center", va="center", fontsize=8.5, zorder=4)


def _arrow(axes: "Axes", start: Point, end: Point) -> None:
    from matplotlib.patches import FancyArrowPatch

    look: dict[str, Any] = {"mutation_scale": 15, "linewidth": 1.4, "shrinkA": 2, "shrinkB": 2, "color": "0.25"}
    axes.add_patch(FancyArrowPatch(start, end, arrowstyle="-|>", zorder=2, **look))


def _rate(value: float) -> str:
    return f"{value:+g} rad/s".replace("-", "−") if value else "0"


def _degrees(value: float) -> str:
    return f"{value:g}°".replace("-", "−")
