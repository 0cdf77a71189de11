"""Figure 4.5: the arm that lifts loads, and the capability of its muscle at each angle."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from motorgrad._errors import check
from motorgrad.bodies import Arm, compile_model
from motorgrad.experiments._claims import Claim, positive, within
from motorgrad.experiments._experiment import Experiment, Values, Workspace, experiment
from motorgrad.experiments._figures import EXTENSOR, FLEXOR, Axes, Figure, new_figure
from motorgrad.sim import draw
from motorgrad.statistics import exact

NEAR = 5.0  # degrees: tolerance of the angle of greatest advantage


@experiment("fig-4.5", "the arm", "figure 4.5")
class ArmBody(Experiment):
    """The simulated arm: hanging, half way, and at its stop. Below, moment arms of muscle and load about the elbow, and
    the forces that hold and throw the load, at each angle.

    **Arguments:**

    - `load` (kg): in the hand.
    """

    load: float = 8.0

    def __post_init__(self) -> None:
        check(0 < self.load <= 20, "load", self.load, "above 0, at most 20 kg")

    @property
    def body(self) -> Arm:
        return Arm(load=self.load)

    def run(self, work: Workspace) -> Values:
        body, flexion = self.body, np.linspace(0.0, self.body.most_flexion, 281)
        # at the hanging rest position no force is needed
        throw = np.concatenate([[0.0], np.asarray(body.ballistic_force(flexion[1:]))])
        return {
            "angle": 90 - np.rad2deg(flexion),
            "muscle arm": np.asarray(body.moment_arm(flexion)),
            "load arm": body.bone_length * np.sin(flexion),
            "holds": np.asarray(body.balance(flexion)),
            "throws": throw,
        }

    def figure(self, values: Values) -> Figure:
        figure, body = new_figure(8, 4.9), self.body
        grid = figure.add_gridspec(2, 6, height_ratios=[1.1, 1])
        for place, share in enumerate((0.0, 0.5, 1.0)):
            panel = figure.add_subplot(grid[0, 2 * place : 2 * place + 2])
            _posture(panel, body, share * body.most_flexion)
            if place == 0:
                _names(panel, body)
        arms, force = figure.add_subplot(grid[1, :3]), figure.add_subplot(grid[1, 3:])
        angle = values["angle"]
        arms.plot(angle, 100 * values["muscle arm"], color=FLEXOR, label="of the muscle")
        arms.plot(angle, 100 * values["load arm"], color=EXTENSOR, label="of the load")
        arms.set(ylabel="moment arm (cm)", ylim=(0, 100 * body.bone_length))
        force.plot(angle, values["holds"], color="C1", label="holds it there")
        force.plot(angle, values["throws"], color="C2", label="throws it there from rest")
        force.axhline(body.strength, color="0.3", linestyle="--", linewidth=0.9, label="full activation")
        force.set(ylabel="force (N)", ylim=(0, None))
        force.set_title(f"with {body.load:g} kg", fontsize=9)
        for panel in (arms, force):
            panel.set(xlabel="interior angle of the elbow (°)", xlim=(angle[0], angle[-1]))
            panel.legend(fontsize=8, loc="upper left" if panel is arms else "lower right")
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        arm, angle = values["muscle arm"], values["angle"]
        most = float(angle[np.argmax(arm)])
        yield positive(
            "The muscle's torque is always greater than zero.",
            exact(100 * arm.min()),
            unit="cm, the least",
            source="section 4.3.2",
        )
        yield within(
            90 - NEAR,
            90 + NEAR,
            "The muscle's mechanical advantage is greatest at a right angle of the joint.",
            exact(most),
            unit="degrees",
            note=f"The arm bends from {angle[0]:g}° to {angle[-1]:g}°. A straight muscle attached at equal distances "
            "from the joint has its greatest moment arm at full flexion; here it grows by "
            f"{arm.max() / arm.min() - 1:.0%} from the hanging position to the stop.",
            source="section 4.3.2",
        )


def _posture(axes: Axes, body: Arm, flexion: float) -> None:
    length = body.bone_length
    axes.set(
        xlim=(-1.65 * length, 0.65 * length), ylim=(body.elbow_height - 1.4 * length, body.elbow_height + 0.4 * length)
    )
    draw(axes, compile_model(body), np.array([flexion]), np.array([float(flexion > 0)]), linewidth=3, ground=False)
    axes.set_aspect("equal", adjustable="box")
    axes.set_title(f"{90 - np.rad2deg(flexion):.0f}°", fontsize=10)
    axes.set_axis_off()


def _names(axes: Axes, body: Arm) -> None:
    """Labels of the parts, placed for the hanging arm."""
    length, top = body.bone_length, body.elbow_height
    for words, at, place, colour in (
        ("fixed in\na harness", (-length, top), (-1.38 * length, top - 0.4 * length), "0.2"),
        ("upper arm", (-0.5 * length, top), (-0.42 * length, top + 0.28 * length), "0.2"),
        ("elbow", (0.0, top), (0.38 * length, top + 0.2 * length), "0.2"),
        (
            f"flexor,\n{body.strength:g} N",
            (-0.27 * length, top - 0.27 * length),
            (-0.55 * length, top - 0.85 * length),
            FLEXOR,
        ),
        (f"load,\n{body.load:g} kg", (0.0, top - length), (0.45 * length, top - 0.8 * length), "0.2"),
    ):
        line: dict[str, Any] = {"arrowstyle": "-", "color": colour, "linewidth": 0.8}
        axes.annotate(words, at, place, ha="center", va="center", fontsize=8, color=colour, arrowprops=line, zorder=8)
