"""Section 5.1.3: muscles compared with motors as actuators of the hopper."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

import mujoco
import numpy as np

from motorgrad import bodies
from motorgrad.statistics import exact, mean_of
from motorgrad.tasks import Hopper
from motorgrad_thesis._claims import Claim, positive
from motorgrad_thesis._experiment import Values, Workspace, experiment
from motorgrad_thesis._figures import EXTENSOR, FLEXOR, Axes, Figure, draw_intervals, new_figure
from motorgrad_thesis.chapter_5._hopper_study import HIGH, posture
from motorgrad_thesis.chapter_5._hopper_variants import HopperVariants, draw_practice

MUSCLES = "muscles"
MOTORS = "motors"
BARE = "bare motors"
LABELS = {MUSCLES: "muscles", MOTORS: "motors, with the muscles' dampers", BARE: "motors without dampers"}
ANGLES = 111
GROUPS = {"flexor": FLEXOR, "extensor": EXTENSOR}


@experiment("sec-5.1.3-motors", "muscles and motors", "section 5.1.3")
class Motors(HopperVariants):
    """Hoppers learn with muscles, and with motors that turn the knees with a constant torque while they are on and do
    the same work between the knee's stops: with the muscles' dampers, and without. The torque of each actuator over
    the angle of the knee, heights of hops during practice, and those of the frozen policies.
    """

    reading: ClassVar[str] = (
        "The thesis compares muscles with torques in words only. Matched in strength are, for us, a muscle and a motor "
        "that do the same work from one stop of the knee to the other."
    )

    @property
    def variants(self) -> Mapping[str, Hopper]:
        motors = dataclasses.replace(self.task.body, drive="motors")
        driven = {MUSCLES: self.task.body, MOTORS: motors, BARE: dataclasses.replace(motors, muscle_damping=0.0)}
        return {name: dataclasses.replace(self.task, body=body) for name, body in driven.items()}

    def run(self, work: Workspace) -> Values:
        found = super().run(work)
        for name in (MUSCLES, MOTORS):
            found |= {f"{name} {quantity}": each for quantity, each in held_torques(self.variants[name].body).items()}
        return found

    def figure(self, values: Values) -> Figure:
        """Torques over the knee's angle; heights during practice; heights of every frozen policy."""
        figure = new_figure(9.8, 6.8)
        panels: Any = figure.subplot_mosaic([["torque", "practice"], ["frozen", "frozen"]], height_ratios=[1.2, 1])
        _torques(panels["torque"], values)
        draw_practice(panels["practice"], values, LABELS)
        panels["practice"].legend(loc="upper left", fontsize=8.5)
        axes = panels["frozen"]
        for row, name in enumerate(LABELS):
            heights = values[f"{name} height"]
            axes.plot(heights, row + np.linspace(-0.2, 0.2, len(heights)), "o", color="0.7", markersize=3.5)
            draw_intervals(axes, [row], [mean_of(heights)], across=True, fmt="o", color="black", capsize=3)
        axes.set_yticks(range(len(LABELS)), [label.replace(", ", ",\n") for label in LABELS.values()])
        axes.set(xlabel="mean height of a frozen policy's hops (m)", xlim=(0, None))
        axes.invert_yaxis()
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        length, tension = (values[f"{MUSCLES} {name}"][0] for name in ("length", "force"))
        rest = self.task.body.flexor_rest_length
        at_rest = float(np.interp(rest, length, tension))
        yield positive(
            "A muscle behaves like a proportional-derivative controller with a set-point at its resting length.",
            exact(tension[-1] - at_rest),
            "how much harder an active flexor pulls at its greatest length than at its resting length",
            "N",
            source="section 5.1.2",
            note=f"Such a controller would pull with nothing at the resting length of {rest:g} m, push below it, and "
            f"pull the harder the longer the muscle. The flexor pulls with {at_rest:.0f} N there, its greatest "
            f"force, with {tension[-1]:.0f} N at {length[-1]:.2f} m and with {tension[0]:.0f} N at {length[0]:.2f} m: "
            "only its damper acts like the derivative part.",
        )
        medians = ", ".join(f"{label} {np.median(values[f'{name} height']):.2f} m" for name, label in LABELS.items())
        for other, words in ((MOTORS, "motors of the same work"), (BARE, "such motors without dampers")):
            yield positive(
                f"Hoppers with muscles hop higher than hoppers with {words}.",
                mean_of(values[f"{MUSCLES} height"] - values[f"{other} height"]),
                "frozen, after the same practice: difference",
                "m",
                note=f"Medians: {medians}.",
                kind="extension",
            )
            passed = (f"{np.median(values[f'{name} passed']):.0f} s" for name in (MUSCLES, other))
            yield positive(
                f"Muscles learn to hop sooner than {words}.",
                mean_of(values[f"{other} passed"] - values[f"{MUSCLES} passed"]),
                f"practice until hops pass {HIGH} m: difference",
                "s",
                note=f"Medians: {' and '.join(passed)}. A seed that never passes counts with the whole practice.",
                kind="extension",
            )


def held_torques(body: bodies.Hopper) -> Values:
    """What the left knee's two actuators do at full activation where the knee is held still.

    **Returns** by name: `angle` `(angles,)`, interior, in degrees, rising; and for flexor and extensor, `(2, angles)`,
    `torque` about the knee in N m, positive when it extends; `length` of the path in m and the pull `force` along it in
    N, of muscles only.
    """
    model = bodies.compile_model(body)
    data = mujoco.MjData(model)
    knee = model.joint("knee_left").dofadr[0]
    degrees = np.linspace(*body.knee_range, ANGLES)
    measured = np.empty((3, 2, ANGLES))
    for column, angle in enumerate(np.radians(degrees)):
        data.qpos[:] = posture(body, angle)
        for row in range(2):
            data.ctrl[:] = 0.0
            data.ctrl[row] = 1.0
            mujoco.mj_forward(model, data)
            pull = -data.actuator_force[row]
            measured[:, row, column] = data.qfrc_actuator[knee], data.actuator_length[row], pull
    found = {"angle": degrees, "torque": measured[0]}
    return {**found, "length": measured[1], "force": measured[2]} if body.muscles else found


def _torques(axes: Axes, values: Values) -> None:
    for row, (group, colour) in enumerate(GROUPS.items()):
        for name, style in ((MUSCLES, "-"), (MOTORS, "--")):
            size = np.abs(values[f"{name} torque"][row])
            label = f"{group}, {'muscle' if name == MUSCLES else 'motor'}"
            axes.plot(values[f"{name} angle"], size, style, color=colour, label=label)
    axes.set(xlabel="interior angle of the knee (°)", ylabel="size of the torque while on (N m)", ylim=(0, None))
    axes.legend(fontsize=8.5)
