"""Figure 4.5: the arm that lifts loads, and the capability of its muscle at each angle."""

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np

from motorgrad.bodies import Arm, Posture, compile_model
from motorgrad.schema import number
from motorgrad.statistics import exact
from motorgrad_thesis._claims import Claim, at_most, negative, positive, within
from motorgrad_thesis._experiment import Values, Workspace, experiment
from motorgrad_thesis._figures import EXTENSOR, FLEXOR, Axes, SubFigure
from motorgrad_thesis.chapter_4._postures import BothPostures
from timsim import draw

NEAR = 5.0  # degrees: tolerance of the angles of greatest and least advantage
NONE = 1e-9  # cm: a moment arm of rounding errors


@experiment("fig-4.5", "the arm", "figure 4.5")
class ArmBody(BothPostures):
    """The simulated arm, its upper arm held vertically and horizontally: hanging, half way, and at its stop. Below,
    moment arms of muscle and load about the elbow, and the forces that hold and throw the load, at each angle.
    """

    load: float = number(8.0, 0, 20, open_low=True, unit="kg", help="the load in the hand")

    size = (8, 5.4)

    def body(self, posture: Posture) -> Arm:
        """The arm, held so."""
        return Arm(load=self.load, posture=posture)

    def measure(self, work: Workspace, posture: Posture) -> Values:
        body = self.body(posture)
        flexion = np.linspace(0.0, body.most_flexion, 281)
        # at the hanging rest position no force is needed
        throw = np.concatenate([[0.0], np.asarray(body.ballistic_force(flexion[1:]))])
        return {
            "angle": body.hanging - np.rad2deg(flexion),
            "muscle arm": np.asarray(body.moment_arm(flexion)),
            "muscle arm without offset": np.asarray(dataclasses.replace(body, offset=0.0).moment_arm(flexion)),
            "load arm": body.bone_length * np.sin(flexion),
            "holds": np.asarray(body.balance(flexion)),
            "throws": throw,
        }

    def draw(self, figure: SubFigure, values: Values, posture: Posture) -> None:
        body = self.body(posture)
        grid = figure.add_gridspec(2, 6, height_ratios=[1.1, 1])
        for place, share in enumerate((0.0, 0.5, 1.0)):
            panel = figure.add_subplot(grid[0, 2 * place : 2 * place + 2])
            _posture(panel, body, share * body.most_flexion)
            if place == 0:
                _names(panel, body)
        arms = figure.add_subplot(grid[1, :3])
        force = figure.add_subplot(grid[1, 3:])
        angle = values["angle"]
        arms.plot(angle, 100 * values["muscle arm"], color=FLEXOR, label="of the muscle")
        arms.plot(angle, 100 * values["load arm"], color=EXTENSOR, label="of the load")
        arms.set(ylabel="moment arm (cm)", ylim=(0, 100 * body.bone_length))
        force.plot(angle, values["holds"], color="C1", label="holds it there")
        force.plot(angle, values["throws"], color="C2", label="throws it there from rest")
        force.axhline(body.full_force, color="0.3", linestyle="--", linewidth=0.9, label="full activation")
        force.set(ylabel="force (N)", ylim=(0, None))
        force.set_title(f"with {body.load:g} kg", fontsize=9)
        for panel in (arms, force):
            panel.set(xlabel="interior angle of the elbow (°)", xlim=(angle[0], angle[-1]))
            panel.legend(fontsize=8, loc="upper left" if panel is arms else "lower right")

    def judge(self, values: Values, posture: Posture) -> Iterator[Claim]:
        arm = values["muscle arm"]
        angle = values["angle"]
        most = float(angle[np.argmax(arm)])
        least = float(angle[np.argmin(arm)])
        right = float(np.interp(90.0, angle[::-1], arm[::-1]))
        yield positive(
            "The muscle's torque is always greater than zero.",
            exact(100 * arm.min()),
            unit="cm, the least",
            source="section 4.3.2",
        )
        yield at_most(
            NONE,
            "It is greater than zero because the muscle's ends are offset: without that, it would vanish.",
            exact(100 * values["muscle arm without offset"].min()),
            "least moment arm without the offset",
            "cm",
            source="section 4.3.2",
        )
        yield within(
            90 - NEAR,
            90 + NEAR,
            "The muscle's mechanical advantage is greatest at a right angle of the joint.",
            exact(most),
            unit="degrees",
            note=f"The arm bends from {angle[0]:g}° to {angle[-1]:g}°. A straight muscle attached at equal distances "
            "from the joint has its greatest moment arm at full flexion; here it grows from "
            f"{100 * arm.min():.1f} cm in the hanging position to {100 * arm.max():.1f} cm at the stop.",
            source="section 4.3.2",
        )
        yield within(
            180 - NEAR,
            180 + NEAR,
            "It is least at full extension.",
            exact(least),
            unit="degrees",
            note=f"{100 * arm.min():.1f} cm there, {100 * right:.1f} cm at a right angle.",
            source="section 4.3.2",
        )
        yield negative(
            "It is less at full flexion than at a right angle.",
            exact(100 * (arm[-1] - right)),
            "moment arm at the stop minus that at a right angle",
            "cm",
            note="As both attachments are half way along bones of equal length.",
            source="section 4.3.2",
        )


def _posture(axes: Axes, body: Arm, flexion: float) -> None:
    length = body.bone_length
    above = 1.35 if body.posture == "vertical" else 0.4
    bottom = body.elbow_height - 1.4 * length
    top = body.elbow_height + above * length
    axes.set(xlim=(-1.65 * length, 0.65 * length), ylim=(bottom, top))
    draw(axes, compile_model(body), np.array([flexion]), np.array([float(flexion > 0)]), linewidth=3, ground=False)
    axes.set_aspect("equal", adjustable="box")
    axes.set_title(f"{body.hanging - np.rad2deg(flexion):.0f}°", fontsize=10)
    axes.set_axis_off()


def _names(axes: Axes, body: Arm) -> None:
    """Labels of the parts, placed for the hanging arm."""
    length, top = body.bone_length, body.elbow_height
    # in lengths of a bone from the elbow: each part, and its label
    parts = {
        "vertical": (((0.0, 1.0), (-0.75, 1.1)), ((0.0, 0.6), (0.6, 0.6)), ((-0.07, 0.2), (-0.75, 0.25))),
        "horizontal": (((-1.0, 0.0), (-1.38, -0.4)), ((-0.5, 0.0), (-0.42, 0.28)), ((-0.27, -0.27), (-0.55, -0.85))),
    }
    harness, upper, flexor = parts[body.posture]
    for words, at, place, colour in (
        ("fixed in\na harness", *harness, "0.2"),
        ("upper arm", *upper, "0.2"),
        ("elbow", (0.0, 0.0), (0.38, 0.2), "0.2"),
        (f"flexor,\n{body.full_force:g} N", *flexor, FLEXOR),
        (f"load,\n{body.load:g} kg", (0.0, -1.0), (0.45, -0.8), "0.2"),
    ):
        at, place = ((length * x, top + length * z) for x, z in (at, place))
        line: dict[str, Any] = {"arrowstyle": "-", "color": colour, "linewidth": 0.8}
        axes.annotate(words, at, place, ha="center", va="center", fontsize=8, color=colour, arrowprops=line, zorder=8)
