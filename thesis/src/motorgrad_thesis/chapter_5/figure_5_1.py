"""Figure 5.1: a flexor and an extensor at several joint angles, their lengths and moment arms."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco have no types)

from collections.abc import Iterator
from typing import Any

import numpy as np

from motorgrad._errors import check
from motorgrad.bodies import Hopper, away_angle, compile_model, tension, wrapped_length, wrapped_rate, wrapping_angle
from motorgrad.schema import Range, count, static
from motorgrad.statistics import exact
from motorgrad_thesis._claims import Claim, at_most, positive, within
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import (
    EXTENSOR,
    FLEXOR,
    Axes,
    Figure,
    bend,
    draw_bones,
    draw_path,
    flat_path,
    new_figure,
)
from motorgrad_thesis.chapter_5._hopper_study import posture

# name: (whether it passes behind the joint, colour)
MUSCLES = {"flexor": (False, FLEXOR), "extensor": (True, EXTENSOR)}


@experiment("fig-5.1", "flexor and extensor", "figure 5.1")
class MusclePair(Experiment):
    """A flexor and an extensor of the hopper's knee at several angles: straight, or wrapped around the joint's capsule.
    Below, their lengths and moment arms over the knee's range, by the closed formula and in MuJoCo.
    """

    angles: tuple[float, ...] = static(
        (50.0, 90.0, 148.0),
        allowed=Range(10, 175),
        unit="degrees",
        help="angles of the knee, at which the muscles are drawn, one to six",
    )
    points: int = count(221, 3, 100_000, help="number of angles evaluated in MuJoCo")

    def validate(self) -> None:
        super().validate()
        check(1 <= len(self.angles) <= 6, "angles", self.angles, "one to six angles")

    quick = smoke(points=12)

    def run(self, work: Workspace) -> Values:
        body = Hopper()
        degrees = np.linspace(*body.knee_range, self.points)
        return {"angle": degrees, **_simulated(body, np.radians(degrees)), **_computed(body, np.radians(degrees))}

    def figure(self, values: Values) -> Figure:
        figure = new_figure(9, 6.6)
        halves: Any = figure.subfigures(2, 1, height_ratios=[1.15, 1])
        above, below = halves
        panels = above.subplots(1, len(self.angles), sharex=True, sharey=True, squeeze=False)[0]
        for axes, angle in zip(panels, self.angles, strict=True):
            _joint(axes, Hopper(), np.radians(angle))
        lengths, arms = below.subplots(1, 2)
        some = np.linspace(0, self.points - 1, min(12, self.points)).round().astype(int)
        for name, (_, colour) in MUSCLES.items():
            for axes, quantity, unit in ((lengths, "length", 100), (arms, "arm", 1000)):
                shown = unit * values[f"{name}_{quantity}"]
                axes.plot(values["angle"], shown, color=colour, label=f"{name}, formula")
                points = unit * values[f"{name}_{quantity}_mujoco"]
                axes.plot(values["angle"][some], points[some], "o", color=colour, mfc="white", label=f"{name}, MuJoCo")
        for axes in (lengths, arms):
            for angle in self.angles:
                axes.axvline(angle, color="0.85", linewidth=1, zorder=0)
            axes.set_xlabel("knee angle (°)")
        lengths.set_ylabel("length of the path (cm)")
        arms.set_ylabel("moment arm (mm)")
        arms.set_ylim(0, None)
        lengths.legend(fontsize=9)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        slopes = {name: np.diff(1000 * values[f"{name}_length"]) / np.diff(values["angle"]) for name in MUSCLES}
        off, hurried, forced = (
            max(np.abs(values[f"{name}_{what}_mujoco"] - values[f"{name}_{what}"]).max() for name in MUSCLES)
            for what in ("length", "arm", "pull")
        )
        begins = float(values["wraps"])
        range_ = values["angle"][[0, -1]]
        flexing = float(slopes["flexor"].min())
        extending = -float(slopes["extensor"].max())
        yield positive(
            "A flexor shortens as the angle between the bones decreases, over the whole range.",
            exact(flexing),
            "least over all angles",
            "mm per degree",
            source="section 5.1.1",
        )
        yield positive(
            "The extensor lengthens at the same time: the two always oppose each other.",
            exact(extending),
            "least over all angles",
            "mm per degree",
            source="section 5.1.1",
        )
        yield within(
            range_[0],
            range_[1],
            "A path is straight, and wraps around the joint only if the joint is highly extended (flexor).",
            exact(begins),
            "angle above which it wraps",
            "degrees",
            note="The extensor, attached at the middle of the bones, wraps at every angle of this knee.",
            source="section 5.1.1",
        )
        yield at_most(
            1e-12,
            "The simulated length is that of appendix A.2.",
            exact(off),
            "greatest difference",
            "m",
            kind="extension",
            source="appendix A.2",
        )
        yield at_most(
            1e-11,
            "So is its rate, and thus the moment arm.",
            exact(hurried),
            "greatest difference",
            "m",
            kind="extension",
            source="appendix A.2",
        )
        yield at_most(
            1e-9,
            "In simulation, an active muscle at rest pulls with f_max exp(−2 d²), where d is its normalised length.",
            exact(forced),
            "greatest difference",
            "N",
            kind="extension",
            source="section 5.1.2",
        )


def _simulated(body: Hopper, interior: np.ndarray) -> Values:
    """Length (m), moment arm (m) and pull (N) of the left knee's muscles in MuJoCo."""
    import mujoco

    model = compile_model(body)
    data = mujoco.MjData(model)
    data.ctrl[:] = 1.0
    rows = [model.tendon(f"{name}_left").id for name in MUSCLES]
    pulls = [model.actuator(f"{name}_left").id for name in MUSCLES]
    found = []
    for angle in interior:
        data.qpos[:] = posture(body, angle)
        # the knees open at 1 rad/s, so that the rate of a length is its derivative
        data.qvel[:] = (0.0, -0.5, 1.0, -0.5, -0.5, 1.0)
        mujoco.mj_forward(model, data)
        found.append((data.ten_length[rows], np.abs(data.ten_velocity[rows]), -data.actuator_force[pulls]))
    columns = np.array(found)
    return {
        f"{name}_{what}_mujoco": columns[:, index, row]
        for row, name in enumerate(MUSCLES)
        for index, what in enumerate(("length", "arm", "pull"))
    }


def _computed(body: Hopper, interior: np.ndarray) -> Values:
    """The same by the closed formula and the force law, and the knee angle in degrees above which the flexor wraps."""
    shape = (body.attachment_distance, body.attachment_distance, body.capsule_radius)
    own = {muscle.group: muscle for muscle in reversed(body.muscles)}
    found: Values = {"wraps": np.degrees(away_angle(wrapping_angle(*shape), behind=False))}
    for name, (behind, _) in MUSCLES.items():
        away = away_angle(interior, behind)
        length = wrapped_length(away, *shape)
        found[f"{name}_length"] = length
        found[f"{name}_arm"] = np.abs(wrapped_rate(away, 1.0, *shape))
        found[f"{name}_pull"] = tension(1.0, length, 0.0, own[name].strength, own[name].rest_length, own[name].shape)
    return found


def _joint(axes: Axes, body: Hopper, interior: float) -> None:
    """Both muscles around a joint at the origin that opens to the right."""
    from matplotlib.patches import Arc

    radius = body.capsule_radius
    draw_bones(axes, bend(interior, body.link_length, body.link_length), radius)
    fixed = bend(interior, body.attachment_distance, body.attachment_distance)
    for behind, colour in MUSCLES.values():
        side = np.array([-1.5 if behind else 1.5, 0.0]) * radius
        draw_path(axes, flat_path(*fixed, radius, side), colour)
    half = np.degrees(interior) / 2
    axes.add_patch(Arc((0, 0), 3.2 * radius, 3.2 * radius, theta1=-half, theta2=half, color="0.4", zorder=2))
    axes.set_title(f"{np.degrees(interior):.0f}°", fontsize=10)
    reach = 1.06 * body.link_length
    axes.set(xlim=(-2 * radius, reach), ylim=(-reach, reach), aspect="equal")
    axes.set_axis_off()
