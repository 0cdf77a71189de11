"""Parts of the body: choose one by a click, see its numbers, and edit them while it moves."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

from __future__ import annotations

from typing import ClassVar

import mujoco
import numpy as np
import viser

from motorgrad._errors import counted
from timsim.live import WORLD, Event, Session, Snapshot, owned
from timsim.panels._joints import joint_table, joints_of
from timsim.panels._panel import Panel, brief, table
from timsim.panels._run import weight_of
from timsim.panels._settings_form import SettingsForm
from timsim.scene import Pose, touches

LISTED = 6  # muscles of a part that are named
SHAPES = {
    mujoco.mjtGeom.mjGEOM_SPHERE: "ball",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_BOX: "box",
    mujoco.mjtGeom.mjGEOM_MESH: "mesh",
}
Rows = list[tuple[str, str]]


class PartsPanel(Panel):
    """A part of the body: its shape, its place, the forces on it and its settings; and the settings of the world.

    **Attributes:** `chosen`: the number of the body that someone has chosen; −1 before.
    """

    title: ClassVar[str] = "Body"
    rate: ClassVar[float] = 5.0

    @classmethod
    def applies(cls, session: Session) -> bool:
        return session.model is not None and session.model.nbody > 1

    def fill(self, gui: viser.GuiApi) -> None:
        model = self.model
        moving = [body for body in range(1, model.nbody) if model.body_weldid[body] != 0]
        self._bodies = {model.body(body).name or str(body): body for body in moving} | {WORLD: 0}
        self._muscles = muscles_of(model)
        self.chosen = -1
        gui.add_markdown("Click a part of the body, or a muscle, or choose here. `U` undoes the last change.")
        names = (*self._bodies,)
        self._which = gui.add_dropdown("Part", names, initial_value=names[0], hint="world: all that stands still.")
        self._said = gui.add_html("")
        self._form = SettingsForm(self, "Settings of this part")
        largest = max(names, key=lambda name: len(self._settings_of(name)))
        self._form.fill(gui, self._settings_of(largest))
        self._form.point_at(self._settings_of(names[0]))
        self._which.on_update(self._select)

    def choose(self, body: int) -> None:
        """Choose a part by the number of its body; anything fixed belongs to the world."""
        name = next((name for name, number in self._bodies.items() if number == body), WORLD)
        self._which.value = name
        self.chosen = self._bodies[name]

    def show(self, snapshot: Snapshot, pose: Pose) -> None:
        del snapshot
        if pose.bodies:
            body = self._bodies[self._which.value]
            facts = world_facts(self.model, pose.bodies[0]) if body == 0 else self._facts(body, pose.bodies[0])
            self._said.content = table(facts)
        self._form.refresh()

    def tell(self, events: list[Event]) -> None:
        if any(event.kind == "error" for event in events):
            self._form.refused()

    def _facts(self, body: int, data: mujoco.MjData) -> Rows:
        muscles = [self.session.muscles[row] for row in self._muscles.get(body, ())]
        more = f" and {len(muscles) - LISTED} more" if len(muscles) > LISTED else ""
        attached = [("muscles", ", ".join(muscles[:LISTED]) + more)] if muscles else []
        return part_facts(self.model, data, body) + attached

    def _settings_of(self, name: str) -> list[str]:
        return owned(self.session.settings, name)

    def _select(self, _: viser.GuiEvent) -> None:
        self.chosen = self._bodies[self._which.value]
        self._form.point_at(self._settings_of(self._which.value))
        self.renew()


def part_facts(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> Rows:
    """Mass, shapes, friction, place, speed and forces of a part, after `mj_forward`, with their units."""
    mass = float(model.body_mass[body])
    total = float(np.sum(model.body_mass[model.body_weldid != 0])) or 1.0
    rows = [("mass", f"{brief(mass)} kg, {mass / total:.0%} of the body")]
    first = int(model.body_geomadr[body])
    geoms = range(first, first + int(model.body_geomnum[body]))
    rows += [("shape", words) for geom in geoms if (words := shape_words(model, geom))]
    touching = [geom for geom in geoms if model.geom_contype[geom] or model.geom_conaffinity[geom]]
    rows.append(
        ("friction", brief(float(model.geom_friction[touching[0], 0])) if touching else "none: it touches nothing")
    )
    velocity = np.zeros(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, body, velocity, 0)
    rows.append(("centre of mass", f"{', '.join(f'{x:.3f}'.replace('-', '−') for x in data.xipos[body])} m"))
    rows.append(("speed", f"{brief(float(np.linalg.norm(velocity[3:])))} m/s"))
    force, count = contact_force(model, data, body)
    contacts = f"{brief(force)} N in {counted(count, 'contact')}" if count else "none"
    rows.append(("contact force", contacts))
    pushed = float(np.linalg.norm(data.xfrc_applied[body, :3]))
    rows += [("push", f"{brief(pushed)} N")] if pushed else []
    for joint in range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body]):
        rows += joint_facts(model, data, joint)
    return rows


def world_facts(model: mujoco.MjModel, data: mujoco.MjData) -> Rows:
    """Gravity, weight, time step and contacts."""
    gravity = float(np.linalg.norm(model.opt.gravity))
    return [
        ("gravity", f"{brief(gravity)} m/s²"),
        ("weight of the body", f"{brief(weight_of(model) if gravity else 0.0)} N"),
        ("time step", f"{brief(1e3 * float(model.opt.timestep))} ms"),
        ("contacts", str(len(touches(model, data).point))),
    ]


def shape_words(model: mujoco.MjModel, geom: int) -> str:
    """A geom's shape and sizes in words; empty if it has none."""
    kind = int(model.geom_type[geom])
    size = 1e3 * np.array(model.geom_size[geom])
    kinds = mujoco.mjtGeom
    if kind not in SHAPES:
        return ""
    if kind == kinds.mjGEOM_MESH:
        return SHAPES[kind]
    if kind == kinds.mjGEOM_SPHERE:
        return f"ball, radius {brief(float(size[0]))} mm"
    if kind in (kinds.mjGEOM_CAPSULE, kinds.mjGEOM_CYLINDER):
        return f"{SHAPES[kind]}, radius {brief(float(size[0]))} mm, half length {brief(float(size[1]))} mm"
    return f"{SHAPES[kind]}, {' × '.join(brief(float(2 * side)) for side in size)} mm"


def contact_force(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> tuple[float, int]:
    """The size in N of the sum of all contact forces on a part, and the number of contacts under pressure."""
    total = np.zeros(3)
    count = 0
    wrench = np.zeros(6)
    for index in range(data.ncon):
        contact = data.contact[index]
        sides = [geom >= 0 and model.geom_bodyid[geom] == body for geom in contact.geom]
        if sides[0] == sides[1]:
            continue
        mujoco.mj_contactForce(model, data, index, wrench)
        if wrench[0] > 0:  # the contact's x points to the second geom, on which the force acts
            total += (1.0 if sides[1] else -1.0) * wrench[:3] @ contact.frame.reshape(3, 3)
            count += 1
    return float(np.linalg.norm(total)), count


def joint_facts(model: mujoco.MjModel, data: mujoco.MjData, number: int) -> Rows:
    """Position, limits and speed of a joint, and the force of its actuators."""
    name = model.joint(number).name or f"joint {number}"
    joint = joints_of(model).get(name)
    if joint is None:
        return [(name, "free" if int(model.jnt_type[number]) == mujoco.mjtJoint.mjJNT_FREE else "ball joint")]
    facts = dict(joint_table(model, data, joint))
    limits = "" if facts["limits"] == "none" else f" ({facts['limits']})"
    return [(name, f"{facts[joint.what]}{limits}, {facts['speed']}"), ("by actuators", facts["by actuators"])]


def muscles_of(model: mujoco.MjModel) -> dict[int, list[int]]:
    """The actuators whose path runs over each body, by the body's number."""
    found: dict[int, list[int]] = {}
    for row in range(model.nu):
        if model.actuator_trntype[row] != mujoco.mjtTrn.mjTRN_TENDON:
            continue
        tendon = int(model.actuator_trnid[row, 0])
        for place in range(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon]):
            if model.wrap_type[place] == mujoco.mjtWrap.mjWRAP_SITE:
                body = int(model.site_bodyid[model.wrap_objid[place]])
                if row not in found.setdefault(body, []):
                    found[body].append(row)
    return found
