"""Drawings of the hexapod: its body in three views with labels, and records of a walk."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco have no types)

from typing import Any

import mujoco
import numpy as np

from motorgrad.bodies import LEGS, TRIPODS, Hexapod, LegState, TripodController, compile_model
from motorgrad_thesis._figures import Axes
from timsim import draw

FRONT = {"azimuth": 180.0}
ABOVE = {"elevation": -90.0}
SIDE = {"elevation": 0.0}
AXES = {"side": (0, 2), "front": (1, 2), "above": (0, 1)}
"""The world axes that point right and up in each view."""

VIEW_ANGLES: dict[str, dict[str, float]] = {"side": SIDE, "front": FRONT, "above": ABOVE}
SIZE = "0.35"
FREEDOM = "#2e8b57"
ORDER = [leg for tripod in TRIPODS for leg in tripod]
"""Legs in drawing order, the first tripod on top."""

TRIPOD_COLOURS = ("#0072B2", "#D55E00")
STATE_COLOURS = {LegState.STANCE: "0.25", LegState.WAIT: "#E69F00", LegState.SWING: "#56B4E9", LegState.DROP: "#009E73"}
TOUCH = TripodController().contact  # N


def draw_view(axes: Axes, hexapod: Hexapod, view: str, linewidth: float = 1.6) -> None:
    """The hexapod in its start pose with firing retractors and depressors; axes in metres, hidden.

    **Arguments:** `view`: "side" and "above" have the head on the right, "front" looks at the head.
    """
    model = compile_model(hexapod)
    firing = np.array([float(name.startswith(("retractor", "depressor"))) for name in hexapod.groups])
    draw(axes, model, model.key(0).qpos, firing, linewidth=linewidth, ground=view != "above", **VIEW_ANGLES[view])  # type: ignore[arg-type]
    axes.set_aspect("equal", adjustable="box")
    axes.set_axis_off()


class Places:
    """Positions of a hexapod's parts in its start pose, in the plane of a view, in m."""

    def __init__(self, hexapod: Hexapod, view: str) -> None:
        model = compile_model(hexapod)
        self._data = mujoco.MjData(model)
        self._view = list(AXES[view])
        self._data.qpos[:] = model.key(0).qpos
        mujoco.mj_kinematics(model, self._data)
        self._hexapod = hexapod

    def _seen(self, point: Any) -> np.ndarray:
        return np.array(point)[self._view]

    def joint(self, part: str) -> np.ndarray:
        """The inner end of a bone such as `femur_left_front`, or the centre of a section."""
        return self._seen(self._data.body(part).xpos)

    def tip(self, leg: str) -> np.ndarray:
        """The outer end of a foot."""
        foot = self._data.body(f"foot_{leg}")
        section = self._hexapod.sections[leg.partition("_")[2]]
        return self._seen(foot.xpos + foot.xmat.reshape(3, 3) @ (section.leg.foot.length, 0.0, 0.0))

    def muscle(self, name: str, fraction: float = 0.5) -> np.ndarray:
        """The point of a muscle at this fraction of the way from origin to insertion."""
        origin, insertion = (self._data.site(f"{name}_{end}").xpos for end in ("origin", "insertion"))
        return self._seen(origin + fraction * (insertion - origin))


def name_part(
    axes: Axes, words: str, at: np.ndarray, offset: tuple[float, float], colour: str = "0.15", size: float = 8.5
) -> None:
    """A label `offset` metres from a part, with a line to it."""
    place = (at[0] + offset[0], at[1] + offset[1])
    axes.annotate(
        words,
        tuple(at),
        place,
        ha="center" if abs(offset[0]) < 0.02 else "left" if offset[0] > 0 else "right",
        va="center" if abs(offset[0]) >= 0.02 else "bottom" if offset[1] > 0 else "top",
        fontsize=size,
        color=colour,
        arrowprops={"arrowstyle": "-", "color": "0.45", "linewidth": 0.8, "shrinkA": 1, "shrinkB": 1},
        zorder=8,
    )


def dimension(axes: Axes, start: Any, stop: Any, words: str, away: tuple[float, float], colour: str = SIZE) -> None:
    """A labelled distance between two points; the label is `away` metres from the middle of the arrow."""
    style = {"arrowstyle": "<->", "color": colour, "linewidth": 0.9, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", tuple(start), tuple(stop), zorder=7, arrowprops=style)
    x, y = (np.asarray(start) + stop) / 2 + away
    axes.text(x, y, words, ha="center", va="center", fontsize=8.5, color=colour, zorder=8)


def freedom(axes: Axes, joint: np.ndarray, rest: float, span: tuple[float, float], radius: float, words: str) -> None:
    """The range of a joint as an arc, in degrees from `rest`, itself measured from the right."""
    from matplotlib.patches import Arc

    least, greatest = sorted(rest + np.array(span))
    axes.add_patch(
        Arc(tuple(joint), 2 * radius, 2 * radius, theta1=least, theta2=greatest, color=FREEDOM, linewidth=1.4, zorder=7)
    )
    for angle in np.radians([least, greatest]):
        ray = np.array([np.cos(angle), np.sin(angle)])
        axes.plot(*np.transpose([joint, joint + 1.08 * radius * ray]), ":", color=FREEDOM, linewidth=0.9, zorder=7)
    x, y = joint + 1.14 * radius * np.array([np.cos(np.radians(greatest)), np.sin(np.radians(greatest))])
    axes.text(x, y, words, ha="center", va="bottom", fontsize=8.5, color=FREEDOM, zorder=8)


def tripod_colour(leg: str) -> str:
    """The colour of a leg's tripod."""
    return TRIPOD_COLOURS[leg not in TRIPODS[0]]


def draw_states(axes: Axes, time: np.ndarray, states: np.ndarray) -> None:
    """States (decisions, 6) of the legs as bars; each decision began one period before its time in s."""
    from matplotlib.patches import Patch

    for row, leg in enumerate(ORDER):
        for state, colour in STATE_COLOURS.items():
            _bars(axes, row, time, states[:, LEGS.index(leg)] == state, colour)
    _rows(axes)
    shown = [Patch(color=colour, label=state.name.lower()) for state, colour in STATE_COLOURS.items()]
    axes.legend(handles=shown, ncols=4, loc="lower left", bbox_to_anchor=(0, 1), fontsize=8, handlelength=1.2)


def draw_angles(axes: Axes, time: np.ndarray, lateral: np.ndarray) -> None:
    """Lateral angles (decisions, 6) in rad, coloured by tripod."""
    for leg in ORDER:
        axes.plot(time, np.degrees(lateral[:, LEGS.index(leg)]), color=tripod_colour(leg), linewidth=1)
    axes.set_ylabel("lateral angle (°)")


def draw_contacts(axes: Axes, time: np.ndarray, contact: np.ndarray) -> None:
    """Bars while a foot presses on the ground with more than `TOUCH`, for forces (decisions, 6) in N."""
    for row, leg in enumerate(ORDER):
        _bars(axes, row, time, contact[:, LEGS.index(leg)] > TOUCH, tripod_colour(leg))
    _rows(axes)


def _rows(axes: Axes) -> None:
    axes.set(yticks=np.arange(6) + 0.4, yticklabels=[leg.replace("_", " ") for leg in ORDER], ylim=(6, -0.2))


def _bars(axes: Axes, row: int, time: np.ndarray, holds: np.ndarray, colour: str) -> None:
    """A bar over every run of decisions after which a condition holds."""
    period = time[1] - time[0]
    ends = np.diff(np.concatenate([[0], holds.astype(int), [0]]))
    first = np.flatnonzero(ends > 0)
    last = np.flatnonzero(ends < 0)
    spans = list(zip(time[first] - period, period * (last - first), strict=True))
    axes.broken_barh(spans, (row, 0.8), color=colour, linewidth=0)
