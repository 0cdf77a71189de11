"""A record of a walk: the states of the legs, their lateral angles, and which feet are on the ground."""

from typing import TYPE_CHECKING

import numpy as np

from motorgrad.bodies import LEGS, TRIPODS, LegState, TripodController

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ORDER = [leg for tripod in TRIPODS for leg in tripod]
"""Legs as they are drawn, the first tripod above."""
TRIPOD_COLOURS = ("#0072B2", "#D55E00")
STATE_COLOURS = {
    LegState.STANCE: "0.25",
    LegState.WAIT: "#E69F00",
    LegState.SWING: "#56B4E9",
    LegState.DROP: "#009E73",
}
TOUCH = TripodController().contact  # N


def tripod_colour(leg: str) -> str:
    """The colour of the tripod to which a leg belongs."""
    return TRIPOD_COLOURS[leg not in TRIPODS[0]]


def draw_states(axes: "Axes", time: np.ndarray, states: np.ndarray) -> None:
    """The states (decisions, 6) of the legs as bars, each decision having begun one period before its time in s."""
    from matplotlib.patches import Patch

    for row, leg in enumerate(ORDER):
        for state, colour in STATE_COLOURS.items():
            _bars(axes, row, time, states[:, LEGS.index(leg)] == state, colour)
    _rows(axes)
    shown = [Patch(color=colour, label=state.name.lower()) for state, colour in STATE_COLOURS.items()]
    axes.legend(handles=shown, ncols=4, loc="lower left", bbox_to_anchor=(0, 1), fontsize=8, handlelength=1.2)


def draw_angles(axes: "Axes", time: np.ndarray, lateral: np.ndarray) -> None:
    """The lateral angles (decisions, 6) in rad, in the colours of the tripods."""
    for leg in ORDER:
        axes.plot(time, np.degrees(lateral[:, LEGS.index(leg)]), color=tripod_colour(leg), linewidth=1)
    axes.set_ylabel("lateral angle (°)")


def draw_contacts(axes: "Axes", time: np.ndarray, contact: np.ndarray) -> None:
    """When the feet press on the ground with more than `TOUCH`, of forces (decisions, 6) in N."""
    for row, leg in enumerate(ORDER):
        _bars(axes, row, time, contact[:, LEGS.index(leg)] > TOUCH, tripod_colour(leg))
    _rows(axes)


def _rows(axes: "Axes") -> None:
    axes.set(yticks=np.arange(6) + 0.4, yticklabels=[leg.replace("_", " ") for leg in ORDER], ylim=(6, -0.2))


def _bars(axes: "Axes", row: int, time: np.ndarray, holds: np.ndarray, colour: str) -> None:
    """A bar over every run of decisions after which something holds."""
    period = time[1] - time[0]
    ends = np.diff(np.concatenate([[0], holds.astype(int), [0]]))
    first, last = np.flatnonzero(ends > 0), np.flatnonzero(ends < 0)
    spans = list(zip(time[first] - period, period * (last - first), strict=True))
    axes.broken_barh(spans, (row, 0.8), color=colour, linewidth=0)
