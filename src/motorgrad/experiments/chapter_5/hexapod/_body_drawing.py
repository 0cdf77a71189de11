"""The hexapod drawn from its model, from the side, from the front and from above, with its parts named."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from motorgrad.bodies import Hexapod, compile_model
from motorgrad.sim import draw

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FRONT, ABOVE, SIDE = {"azimuth": 180.0}, {"elevation": -90.0}, {"elevation": 0.0}
AXES = {"side": (0, 2), "front": (1, 2), "above": (0, 1)}
"""Which world axes a view has to the right and up."""
LOOKS: dict[str, dict[str, float]] = {"side": SIDE, "front": FRONT, "above": ABOVE}
SIZE, FREEDOM = "0.35", "#2e8b57"


def draw_view(axes: "Axes", hexapod: Hexapod, view: str, linewidth: float = 1.6) -> None:
    """The hexapod in its start pose, retractors and depressors firing; the axes in metres, hidden.

    **Arguments:** `view`: "side" and "above" have its head to the right, "front" looks at it from its head.
    """
    model = compile_model(hexapod)
    firing = np.array([float(name.startswith(("retractor", "depressor"))) for name in hexapod.groups])
    draw(axes, model, model.key(0).qpos, firing, linewidth=linewidth, ground=view != "above", **LOOKS[view])  # type: ignore[arg-type]
    axes.set_aspect("equal", adjustable="box")
    axes.set_axis_off()


class Places:
    """Where the parts of a hexapod in its start pose are, in the plane of a view, in m."""

    def __init__(self, hexapod: Hexapod, view: str) -> None:
        model = compile_model(hexapod)
        self._data, self._view = mujoco.MjData(model), list(AXES[view])
        self._data.qpos[:] = model.key(0).qpos
        mujoco.mj_kinematics(model, self._data)
        self._hexapod = hexapod

    def _seen(self, point: Any) -> np.ndarray:
        return np.array(point)[self._view]

    def joint(self, part: str) -> np.ndarray:
        """The inner end of a bone such as `femur_left_front`, or the middle of a section."""
        return self._seen(self._data.body(part).xpos)

    def tip(self, leg: str) -> np.ndarray:
        """The outer end of a foot."""
        foot, section = self._data.body(f"foot_{leg}"), self._hexapod.sections[leg.partition("_")[2]]
        return self._seen(foot.xpos + foot.xmat.reshape(3, 3) @ (section.leg.foot.length, 0.0, 0.0))

    def muscle(self, name: str, part: float = 0.5) -> np.ndarray:
        """A point of a muscle, a `part` of the way from its origin to its insertion."""
        origin, insertion = (self._data.site(f"{name}_{end}").xpos for end in ("origin", "insertion"))
        return self._seen(origin + part * (insertion - origin))


def name_part(
    axes: "Axes", words: str, at: np.ndarray, offset: tuple[float, float], colour: str = "0.15", size: float = 8.5
) -> None:
    """Words beside a part, `offset` metres away from it, with a line to it."""
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


def dimension(axes: "Axes", start: Any, stop: Any, words: str, away: tuple[float, float], colour: str = SIZE) -> None:
    """A length from one point to another, its number `away` metres from the middle of the arrow."""
    look = {"arrowstyle": "<->", "color": colour, "linewidth": 0.9, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", tuple(start), tuple(stop), zorder=7, arrowprops=look)
    x, y = (np.asarray(start) + stop) / 2 + away
    axes.text(x, y, words, ha="center", va="center", fontsize=8.5, color=colour, zorder=8)


def freedom(axes: "Axes", joint: np.ndarray, rest: float, span: tuple[float, float], radius: float, words: str) -> None:
    """The range of a joint as an arc about it, in degrees from `rest`, itself from the right."""
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
