"""What a body does at a moment: angles, torques, lengths and forces of muscles, contacts, by name and with units."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt
from jaxtyping import Float
from mujoco import batch as mujoco_batch

from motorgrad._errors import check
from motorgrad.bodies._batch import BodyBatch
from motorgrad.bodies._body import Body, WrappedBody, compile_model
from motorgrad.bodies.muscles._hill import hill_actuators

_JOINT, _TRANSMISSION = mujoco.mjtJoint, mujoco.mjtTrn
_TURNS = ("rad", "rad/s", "N m")
_MOVES = ("m", "m/s", "N")
"""The units of a position, its velocity and its force."""
_FREE = (_MOVES,) * 3 + (("1", "rad/s", "N m"),) * 4
_UNITS = {
    "m": ("RANGEFINDER", "TENDONPOS", "TENDONLIMITPOS", "FRAMEPOS", "SUBTREECOM", "GEOMDIST", "GEOMNORMAL"),
    "m/s": ("VELOCIMETER", "TENDONVEL", "FRAMELINVEL", "SUBTREELINVEL", "TENDONLIMITVEL"),
    "m/s²": ("ACCELEROMETER", "FRAMELINACC"),
    "rad/s": ("GYRO", "BALLANGVEL", "FRAMEANGVEL"),
    "rad/s²": ("FRAMEANGACC",),
    "N": ("TOUCH", "FORCE", "TENDONACTFRC", "TENDONLIMITFRC"),
    "N m": ("TORQUE",),
    "kg m²/s": ("SUBTREEANGMOM",),
    "J": ("E_POTENTIAL", "E_KINETIC"),
    "s": ("CLOCK",),
    "T": ("MAGNETOMETER",),
    "1": ("BALLQUAT", "FRAMEQUAT", "FRAMEXAXIS", "FRAMEYAXIS", "FRAMEZAXIS", "INSIDESITE"),
}
_SENSOR_UNITS = {getattr(mujoco.mjtSensor, f"mjSENS_{kind}", None): u for u, kinds in _UNITS.items() for kind in kinds}
_OF_JOINTS = {"JOINTPOS": 0, "JOINTLIMITPOS": 0, "JOINTVEL": 1, "JOINTLIMITVEL": 1}
_OF_JOINTS |= {"JOINTACTFRC": 2, "JOINTLIMITFRC": 2}
_OF_ACTUATORS = {"ACTUATORPOS": 0, "ACTUATORVEL": 1, "ACTUATORFRC": 2}
_TOUCHED = "contact force on "
_NET_FORCE = (1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE), 3, 1)
"""What a contact sensor reports: the force alone, summed over all contacts, in world coordinates."""


class Column(NamedTuple):
    """The name of a quantity, as `family: part`, and its SI unit: `1` for a pure number, empty where it is unknown."""

    name: str
    unit: str = ""


class _Part(NamedTuple):
    """Some columns: the field of MuJoCo's data, the places in it, a factor for each."""

    field: str
    places: np.ndarray
    factors: np.ndarray
    columns: tuple[Column, ...]


class BodyReader:
    """Reads what the bodies of a batch do at a moment, computed on copies, so that the batch goes on bit for bit.

    After a step, MuJoCo's forces are those of the moment before it. So all quantities are computed again here, by
    `mj_forward` of the present state with the present controls.

    **Arguments:** the `batch`; `threads`, as there; `every`, physics steps from one reading to the next.

    **Attributes:** `columns`; `readings`, those of the last decision, each (seeds, columns): before its first physics
    step, with its controls, and then every `every` steps, without its end, which `end` reads.

    **Raises** `ValueError` for a batch whose bodies differ by seed.
    """

    def __init__(self, batch: BodyBatch, threads: int = 0, every: int | None = None):
        alike = len(set(map(id, batch.models))) == 1
        check(alike, "batch", f"{len(set(map(id, batch.models)))} models", "of one body; read each body by itself")
        self.every = batch.substeps if every is None else every
        self.readings: list[np.ndarray] = []
        self._of = batch
        self.model = compile_model(_WithContacts(batch.body))
        self._batch = mujoco_batch.Batch(self.model, batch.seeds, threads)
        self._held = batch.physics.copy()
        self._gravity = None if batch.gravity is None else self._batch.expand("opt.gravity")
        self._held_gravity = None if batch.gravity is None else np.array(batch.gravity)
        self._parts = [part for part in _parts(self.model, batch.body) if part.columns]
        self.columns = tuple(column for part in self._parts for column in part.columns)
        self._sources = [self._batch.bind(part.field) for part in self._parts]
        self._control = self._batch.bind("ctrl")
        clamped = not self.model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL
        limited = (np.array(self.model.actuator_ctrllimited, bool) & clamped)[:, None]
        self._limits = np.where(limited, self.model.actuator_ctrlrange, (-np.inf, np.inf)).T

    def __call__(self, made: int) -> None:
        """Called by the batch at `made` physics steps of a decision."""
        if made == 0:
            self.readings = []
        if made < self._of.substeps:
            self.readings.append(self.read())
            return
        # kept because a new episode may begin before its end is read
        np.copyto(self._held, self._of.physics)
        if self._of.gravity is not None and self._held_gravity is not None:
            np.copyto(self._held_gravity, self._of.gravity)

    def read(self) -> Float[np.ndarray, "seeds columns"]:
        """The quantities of all bodies now."""
        return self._computed(self._of.physics, self._of.gravity)

    def end(self) -> Float[np.ndarray, "seeds columns"]:
        """The quantities at the end of the last decision, before any new episode, with the controls that led there."""
        return self._computed(self._held, self._held_gravity)

    def _computed(self, physics: np.ndarray, gravity: np.ndarray | None) -> np.ndarray:
        np.copyto(self._batch.state, physics)
        if self._gravity is not None and gravity is not None:
            np.copyto(self._gravity, gravity)
        np.clip(self._control, *self._limits, out=self._control)  # as MuJoCo does within a step
        lost = np.zeros(0, int)
        try:
            self._batch.forward()
        except mujoco_batch.SimulationError as error:
            lost = error.ids
        found = np.empty((len(physics), len(self.columns)))
        first = 0
        for part, source in zip(self._parts, self._sources, strict=True):
            last = first + len(part.columns)
            np.multiply(source[:, part.places], part.factors, out=found[:, first:last])
            first = last
        found[lost] = np.nan
        return found


class _WithContacts(WrappedBody):
    """A body with a sensor for the contact force on each of its moving parts that can touch anything."""

    def spec(self) -> mujoco.MjSpec:
        spec = self.body.spec()
        paired = {name for pair in spec.pairs for name in (pair.geomname1, pair.geomname2)}
        for number, part in enumerate(spec.bodies):
            can_touch = any(geom.contype or geom.conaffinity or geom.name in paired for geom in part.geoms)
            if number == 0 or not can_touch:
                continue
            part.name = part.name or f"body {number}"
            kind, of = mujoco.mjtSensor.mjSENS_CONTACT, mujoco.mjtObj.mjOBJ_BODY
            sensor = spec.add_sensor(name=_TOUCHED + part.name, type=kind, objtype=of, objname=part.name)
            sensor.intprm[:3] = _NET_FORCE
        return spec


def _parts(model: mujoco.MjModel, body: Body) -> Iterator[_Part]:
    """All quantities of a body, in the order of the columns."""
    yield from _joint_parts(model)
    actuators = range(model.nu)
    muscles = muscular(model, body)
    kinds = ["muscle" if muscle else "actuator" for muscle in muscles]
    names = [model.actuator(i).name or f"actuator {i + 1}" for i in actuators]
    units = [actuator_units(model, i) for i in actuators]
    # a muscle's force is the pull on its path, which MuJoCo has as a negative number
    signs = np.where(muscles, -1.0, 1.0)
    for place, (field, what, factors) in enumerate(
        (("actuator_length", "length", 1.0), ("actuator_velocity", "velocity", 1.0), ("actuator_force", "force", signs))
    ):
        named = [(f"{kind} {what}", name, u[place]) for kind, name, u in zip(kinds, names, units, strict=True)]
        yield _part(field, actuators, named, factors)
    yield from _activations(model, muscles, kinds, names)
    yield _part(
        "ctrl",
        actuators,
        [(f"{kind} control", name, "1" if kind == "muscle" else "") for kind, name in zip(kinds, names, strict=True)],
    )
    touching = [i for i in range(model.nsensor) if model.sensor(i).name.startswith(_TOUCHED)]
    places = [int(model.sensor_adr[i]) + axis for i in touching for axis in range(3)]
    on = [model.sensor(i).name.removeprefix(_TOUCHED) for i in touching]
    # MuJoCo's sensor has the force that the part exerts
    yield _part("sensordata", places, [("contact force", f"{name} {axis}", "N") for name in on for axis in "xyz"], -1.0)
    sensed = [i for i in range(model.nsensor) if i not in touching]
    places = [int(model.sensor_adr[i]) + k for i in sensed for k in range(int(model.sensor_dim[i]))]
    yield _part("sensordata", places, [column for i in sensed for column in sensor_columns(model, i)])


def joint_columns(model: mujoco.MjModel) -> list[Column]:
    """The columns of all generalised positions of a model, then of all velocities."""
    found = [part.columns for part in _joint_parts(model)]
    return [*found[0], *found[1]]


def _joint_parts(model: mujoco.MjModel) -> Iterator[_Part]:
    positions = list(_joint_numbers(model, 0))
    velocities = list(_joint_numbers(model, 1))
    angles = [("joint angle" if units is _TURNS else "joint position", name, units[0]) for name, units in positions]
    yield _part("qpos", range(len(angles)), angles)
    yield _part("qvel", range(model.nv), [("joint velocity", name, units[1]) for name, units in velocities])
    for field, what in (("qfrc_actuator", "joint"), ("qfrc_passive", "passive")):
        named = [(f"{what} {'torque' if u[2] == 'N m' else 'force'}", name, u[2]) for name, u in velocities]
        yield _part(field, range(model.nv), named)


def _part(
    field: str, places: Sequence[int], named: Sequence[tuple[str, str, str]], factors: npt.ArrayLike = 1.0
) -> _Part:
    columns = tuple(Column(f"{family}: {name}", unit) for family, name, unit in named)
    return _Part(field, np.array(places, int), np.broadcast_to(np.asarray(factors, float), len(columns)), columns)


def _activations(
    model: mujoco.MjModel, muscles: np.ndarray, kinds: Sequence[str], names: Sequence[str]
) -> Iterator[_Part]:
    """The activation of each muscle, which is its control where it has no dynamics; states of other actuators; lengths
    of fibers that are states."""
    last = model.actuator_actadr + model.actuator_actnum - 1
    active = [i for i in range(model.nu) if model.actuator_actadr[i] >= 0]
    named = [(f"{kinds[i]} activation", names[i], "1" if muscles[i] else "") for i in active]
    yield _part("act", [int(last[i]) for i in active], named)
    at_once = [i for i in range(model.nu) if muscles[i] and i not in active]
    yield _part("ctrl", at_once, [("muscle activation", names[i], "1") for i in at_once])
    fibers = [int(i) for i in np.flatnonzero(hill_actuators(model)) if model.actuator_actnum[i] == 2]
    optimal = [float(model.actuator_biasprm[i, 1]) for i in fibers]
    named = [("fiber length", names[i], "m") for i in fibers]
    yield _part("act", [int(model.actuator_actadr[i]) for i in fibers], named, optimal or 1.0)


def muscular(model: mujoco.MjModel, body: Body) -> np.ndarray:
    """Which actuators are muscles, of this library or MuJoCo's."""
    own = {muscle.name for muscle in body.muscles}
    named = np.array([model.actuator(i).name in own for i in range(model.nu)], bool)
    native = model.actuator_gaintype == int(mujoco.mjtGain.mjGAIN_MUSCLE)
    native |= model.actuator_dyntype == int(mujoco.mjtDyn.mjDYN_MUSCLE)
    return named | native | hill_actuators(model)


def _joint_numbers(model: mujoco.MjModel, of: int) -> Iterator[tuple[str, tuple[str, str, str]]]:
    """The name and the units of each generalised position (`of` = 0) or velocity (1)."""
    for i in range(model.njnt):
        name = model.joint(i).name or f"joint {i + 1}"
        kind = _JOINT(int(model.jnt_type[i]))
        if kind in (_JOINT.mjJNT_HINGE, _JOINT.mjJNT_SLIDE):
            yield name, _TURNS if kind == _JOINT.mjJNT_HINGE else _MOVES
            continue
        units = _FREE if kind == _JOINT.mjJNT_FREE else _FREE[3:]
        for k, each in enumerate(units[: len(units) - of]):
            yield f"{name} {k + 1}", each


def actuator_units(model: mujoco.MjModel, i: int) -> tuple[str, str, str]:
    """The units of an actuator's length, velocity and force."""
    target = int(model.actuator_trnid[i, 0])
    match _TRANSMISSION(int(model.actuator_trntype[i])):
        case _TRANSMISSION.mjTRN_JOINT | _TRANSMISSION.mjTRN_JOINTINPARENT:
            return _of_joint(model, target)
        case _TRANSMISSION.mjTRN_TENDON:
            first = int(model.tendon_adr[target])
            number = int(model.tendon_num[target])
            if int(model.wrap_type[first]) != int(mujoco.mjtWrap.mjWRAP_JOINT):
                return _MOVES
            kinds = {_of_joint(model, int(joint)) for joint in model.wrap_objid[first : first + number]}
            return kinds.pop() if len(kinds) == 1 else ("", "", "")
        case _TRANSMISSION.mjTRN_SLIDERCRANK:
            return _MOVES
    return "", "", ""


def _of_joint(model: mujoco.MjModel, joint: int) -> tuple[str, str, str]:
    return _MOVES if int(model.jnt_type[joint]) == int(_JOINT.mjJNT_SLIDE) else _TURNS


def sensor_columns(model: mujoco.MjModel, i: int) -> list[tuple[str, str, str]]:
    """The columns of a sensor of the body's own."""
    kind = mujoco.mjtSensor(int(model.sensor_type[i]))
    size = int(model.sensor_dim[i])
    name = model.sensor(i).name
    short = kind.name.removeprefix("mjSENS_")
    target = int(model.sensor_objid[i])
    if short in _OF_JOINTS:
        unit = _of_joint(model, target)[_OF_JOINTS[short]]
    elif short in _OF_ACTUATORS:
        unit = actuator_units(model, target)[_OF_ACTUATORS[short]]
    else:
        unit = _SENSOR_UNITS.get(kind, "")
    name = name or f"sensor {i + 1}"
    axes = "xyz" if size == 3 else [str(k + 1) for k in range(size)]
    return [("sensor", name, unit)] if size == 1 else [("sensor", f"{name} {axis}", unit) for axis in axes]
