"""Joints: angle, speed and torque of one of them over time, and the moment arms of its muscles over its range."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping
from typing import ClassVar, NamedTuple

import mujoco
import numpy as np
import viser

from timsim.live import Session, Snapshot
from timsim.panels import _charts
from timsim.panels._charts import STRONG, NamedPlot
from timsim.panels._panel import Numbers, Panel, brief, columns_of, table
from timsim.scene import Pose

ANGLES = 41  # postures over the range of a joint
KEPT = 600  # moments of the torque
COLOURS = ("#0b6bcb", "#d9730d", "#2b8a3e", "#9c36b5", "#c92a2a", "#0c8599")
NAMED = len(COLOURS)  # muscles that have a colour of their own; of those with the longest arms
MIN_MOMENT_ARM = 1e-4  # m; shorter arms are left out


class Joint(NamedTuple):
    """A hinge or a slide.

    - `number`; `place`, `freedom`: where it is in `qpos` and in `qvel`.
    - `factor`: from rad or m to `unit`; `what`: an angle or a position.
    - `effort`: the unit of what acts on it.
    """

    number: int
    place: int
    freedom: int
    factor: float
    unit: str
    what: str
    effort: str


def joints_of(model: mujoco.MjModel) -> dict[str, Joint]:
    """The hinges and slides of a model, by name."""
    found = {}
    kinds = mujoco.mjtJoint
    for number in range(model.njnt):
        kind = int(model.jnt_type[number])
        if kind in (kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE):
            words = (180 / np.pi, "°", "angle", "N·m") if kind == kinds.mjJNT_HINGE else (1e3, "mm", "position", "N")
            where = int(model.jnt_qposadr[number]), int(model.jnt_dofadr[number])
            found[model.joint(number).name or f"joint {number}"] = Joint(number, *where, *words)
    return found


def moment_arms(model: mujoco.MjModel, position: np.ndarray, joint: Joint) -> tuple[np.ndarray, np.ndarray]:
    """The moment arms of all actuators about a joint, over its range, all other joints as they are.

    The moment arm is the change of an actuator's length with the angle, negative where it shortens (An et al., 1984),
    with the sign of the joint's torque when a muscle pulls.

    **Arguments:** `position` `(nq,)`: the posture.

    **Returns** the places of the joint `(ANGLES,)` in rad or m, and the arms `(ANGLES, nu)` in m (of a slide: a ratio).
    """
    data = mujoco.MjData(model)
    low, high = model.jnt_range[joint.number] if model.jnt_limited[joint.number] else (-np.pi, np.pi)
    places = np.linspace(low, high, ANGLES)
    arms = np.zeros((ANGLES, model.nu))
    dense = np.zeros((model.nu, model.nv))
    pulls = np.where(model.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON.value, -1.0, 1.0)
    data.qpos[:] = position
    for row, place in enumerate(places):
        data.qpos[joint.place] = place
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_tendon(model, data)
        mujoco.mj_transmission(model, data)
        mujoco.mju_sparse2dense(dense, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind)
        arms[row] = pulls * dense[:, joint.freedom]
    return places, arms


def draw_arms(joint: Joint, places: np.ndarray, arms: Mapping[str, np.ndarray], now: float, most: int = NAMED) -> str:
    """Moment arms in mm over a joint's range as SVG, by the names of the muscles, with the present place marked."""
    longest = sorted(arms, key=lambda name: -float(np.abs(arms[name]).max()))[:most]
    lines = {name: 1e3 * arms[name] for name in longest}
    every = np.concatenate([*lines.values(), [0.0]])
    room = 0.06 * max(float(np.ptp(every)), 1e-9)
    across = joint.factor * places
    limits = (float(across[0]), float(across[-1])), (float(every.min()) - room, float(every.max()) + room)
    chart = _charts.Chart(*limits, f"{joint.what} ({joint.unit})", "moment arm (mm)")
    chart.line(across[[0, -1]], np.zeros(2), _charts.INK, 0.6, 'stroke-opacity=".4"')
    chart.line(np.full(2, joint.factor * now), np.array(limits[1]), _charts.INK, 0.8, 'stroke-dasharray="3 3"')
    parts = []
    for number, (name, line) in enumerate(lines.items()):
        chart.line(across, line, COLOURS[number], 1.8)
        column, row = divmod(number, -(-len(lines) // 2))
        words = name if len(name) <= 24 else f"{name[:23]}…"
        parts.append(
            _charts.text(46 + 148 * column, 206 + 14 * row, f"— {words}", extra=f'style="fill:{COLOURS[number]}"')
        )
    height = 214 + 14 * -(-len(lines) // 2)
    return _charts.document(_charts.WIDTH, height, chart.elements() + parts, "moment arms over the range of the joint")


class JointsPanel(Panel):
    """Position, speed and limits of a joint and what acts on it; position and torque over time; moment arms."""

    title: ClassVar[str] = "Joints"
    rate: ClassVar[float] = 3.0
    share: ClassVar[float] = 0.02
    """Share of a core's time for moment arms, which need the path of every muscle at every angle."""

    @classmethod
    def applies(cls, session: Session) -> bool:
        return session.model is not None and bool(joints_of(session.model))

    def fill(self, gui: viser.GuiApi) -> None:
        self._joints = joints_of(self.model)
        self._which = gui.add_dropdown("Joint", (*self._joints,), initial_value=next(iter(self._joints)))
        self._which.on_update(self.renew)
        self._said = gui.add_html("")
        self._place = NamedPlot(gui, STRONG)
        self._effort = NamedPlot(gui, _charts.SECOND)
        self._arms = gui.add_html("")
        self._efforts: deque[tuple[float, np.ndarray]] = deque(maxlen=KEPT)
        self._arms_due = 0.0
        self._drawn = next(iter(self._joints.values()))

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        seen, now = self._efforts, snapshot.seconds
        if pose.bodies and (not seen or seen[-1][0] != now):
            if seen and now < seen[-1][0]:
                seen.clear()
            seen.append((now, pose.bodies[0].qfrc_actuator.copy()))
        super().update(snapshot, pose)

    def show(self, snapshot: Snapshot, pose: Pose) -> None:
        if not pose.bodies:
            return
        model = self.model
        data = pose.bodies[0]
        joint = self._joints[self._which.value]
        self._said.content = table(joint_table(model, data, joint))
        trail = self.session.trail()
        self._place.show(trail.seconds, joint.factor * trail.position[:, joint.place], f"{joint.what} ({joint.unit})")
        times = np.array([seconds for seconds, _ in self._efforts])
        efforts = np.array([effort[joint.freedom] for _, effort in self._efforts])
        self._effort.show(times, efforts, f"by actuators ({joint.effort})")
        start = time.monotonic()
        if start < self._arms_due and joint is self._drawn:
            self._seen = ()  # later, also of a run that has been paused
            return
        places, arms = moment_arms(model, snapshot.position[0], joint)
        acting = np.flatnonzero(np.abs(arms).max(axis=0) > MIN_MOMENT_ARM) if joint.unit == "°" else []
        by_name = {self.session.muscles[row]: arms[:, row] for row in acting}
        here = float(data.qpos[joint.place])
        self._arms.content = draw_arms(joint, places, by_name, here) if by_name else ""
        now = time.monotonic()
        self._arms_due = now + (now - start) / self.share
        self._drawn = joint

    def numbers(self) -> Numbers:
        trail = self.session.trail()
        joints = self._joints
        places = [joint.factor * trail.position[:, joint.place] for joint in joints.values()]
        speeds = [joint.factor * trail.velocity[:, joint.freedom] for joint in joints.values()]
        units = [f"{name} ({joint.unit})" for name, joint in joints.items()]
        rates = [f"{name} ({joint.unit}/s)" for name, joint in joints.items()]
        columns = columns_of("position", units, np.array(places).T) | columns_of("speed", rates, np.array(speeds).T)
        return {"decision": trail.decision, "seconds": trail.seconds, **columns}


def joint_table(model: mujoco.MjModel, data: mujoco.MjData, joint: Joint) -> list[tuple[str, str]]:
    """Position, speed and limits of a joint and what acts on it, with units."""
    factor, unit, effort, freedom = joint.factor, joint.unit, joint.effort, joint.freedom
    gap = "" if unit == "°" else " "
    low, high = (f"{brief(factor * float(each))}{gap}{unit}" for each in model.jnt_range[joint.number])
    forces = {"actuators": data.qfrc_actuator, "damping and springs": data.qfrc_passive}
    forces |= {"limit, contacts and friction": data.qfrc_constraint}
    return [
        (joint.what, f"{brief(factor * float(data.qpos[joint.place]))}{gap}{unit}"),
        ("limits", f"{low} to {high}" if model.jnt_limited[joint.number] else "none"),
        ("speed", f"{brief(factor * float(data.qvel[freedom]))}{gap}{unit}/s"),
        *((f"by {name}", f"{brief(float(values[freedom]))} {effort}") for name, values in forces.items()),
    ]
