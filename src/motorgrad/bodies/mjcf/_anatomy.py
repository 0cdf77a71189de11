"""The parts of a body by name: where their numbers are, and sensors for what MuJoCo computes only on request."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt
from jaxtyping import Bool, Float, Int

from motorgrad._errors import check, unknown
from motorgrad.bodies._body import Body, WrappedBody, actuators_of, group_places
from motorgrad.bodies.mjcf._mjcf import Mjcf
from motorgrad.bodies.mjcf._to_hill import matching
from motorgrad.bodies.models._read import compile_spec
from motorgrad.bodies.muscles._hill import hill_actuators

_POSITIONS = {int(mujoco.mjtJoint.mjJNT_FREE): 7, int(mujoco.mjtJoint.mjJNT_BALL): 4}
_VELOCITIES = {int(mujoco.mjtJoint.mjJNT_FREE): 6, int(mujoco.mjtJoint.mjJNT_BALL): 3}
_PLACED = ("site", "body", "geom")
"""What has a place in the world, in the order in which a name is looked up."""


@dataclasses.dataclass(frozen=True)
class Sensor:
    """A MuJoCo sensor to add to a model.

    - `kind`: its type, such as `"FRAMEPOS"`.
    - `of`, `target`: the kind of object that it observes, such as `"SITE"`, and its name.
    - `whole`: its integer parameters, where it has any.
    """

    name: str
    kind: str
    of: str
    target: str
    whole: tuple[int, ...] = ()


@dataclasses.dataclass(frozen=True)
class WithSensors(WrappedBody):
    """A body with further sensors.

    **Arguments:** the `body`; the `sensors`.
    """

    sensors: tuple[Sensor, ...] = ()

    def spec(self) -> mujoco.MjSpec:
        """A new description of the body with its sensors."""
        spec = self.body.spec()
        for each in self.sensors:
            kind = getattr(mujoco.mjtSensor, f"mjSENS_{each.kind}")
            of = getattr(mujoco.mjtObj, f"mjOBJ_{each.of}")
            sensor = spec.add_sensor(name=each.name, type=kind, objtype=of, objname=each.target)
            if each.whole:
                sensor.intprm[: len(each.whole)] = each.whole
        return spec


class Anatomy:
    """The parts of a body by name.

    A name may be a pattern such as `flexor*`, or several. A name that matches nothing raises a `ValueError` with the
    nearest one.

    **Arguments:** `body`: a body.

    **Attributes:** `model`, the compiled model, for reading; `sensors`, those that were asked for so far.
    """

    def __init__(self, body: Body):
        self.body = body
        self.model: Any = body.model if isinstance(body, Mjcf) else _compiled(body)
        self.sensors: dict[str, Sensor] = {}

    def named(self, kind: str, patterns: str | Sequence[str]) -> list[str]:
        """The names of the model's parts of a kind, such as `"joint"`, that match; each once, in the model's order for
        each pattern."""
        each = (patterns,) if isinstance(patterns, str) else patterns
        return list(dict.fromkeys(name for pattern in each for name in matching(kind, pattern, self._names(kind))))

    def positions(self, joints: str | Sequence[str] = "*") -> tuple[list[str], Int[np.ndarray, " numbers"]]:
        """Names of the generalised positions of these joints, and their places in `BodyState.position`."""
        return self._numbers(joints, "jnt_qposadr", _POSITIONS)

    def velocities(self, joints: str | Sequence[str] = "*") -> tuple[list[str], Int[np.ndarray, " numbers"]]:
        """Names of the generalised velocities of these joints, and their places in `BodyState.velocity`."""
        return self._numbers(joints, "jnt_dofadr", _VELOCITIES)

    def activations(self, actuators: str | Sequence[str] = "*") -> tuple[list[str], Int[np.ndarray, " numbers"]]:
        """Names of these actuators, and the places of their activations in `BodyState.activation`. A pattern means
        those that have one."""
        model = self.model
        last = model.actuator_actadr + model.actuator_actnum - 1
        active = {model.actuator(i).name: int(last[i]) for i in range(model.nu) if model.actuator_actadr[i] >= 0}
        names = self.named("actuator", actuators)
        exact = {actuators} if isinstance(actuators, str) else set(actuators)
        for name in names:
            if name in exact and name not in active:
                raise unknown("actuator with an activation", name, active)
        chosen = [name for name in names if name in active]
        if not chosen:
            raise unknown("actuator with an activation", actuators, active)
        return chosen, np.array([active[name] for name in chosen], int)

    def groups(self, actuators: str | Sequence[str] = "*") -> Int[np.ndarray, " numbers"]:
        """The places in an action of these actuators, or of their groups, each once."""
        places = {
            each.name: place for each, place in zip(actuators_of(self.body), group_places(self.body), strict=True)
        }
        names = self.named("actuator", actuators)
        return np.array(list(dict.fromkeys(places[name] for name in names if name in places)), int)

    @property
    def control_range(self) -> Float[np.ndarray, "groups 2"]:
        """The lowest and highest control of each group: the range in the model, and −1 to 1 where there is none; for a
        muscle the part of it between 0 and 1, or all of that where there is none."""
        model = self.model
        found = np.tile((-1.0, 1.0), (len(self.body.groups), 1))
        for each, place in zip(actuators_of(self.body), group_places(self.body), strict=True):
            i = model.actuator(each.name).id
            if model.actuator_ctrllimited[i]:
                found[place] = model.actuator_ctrlrange[i]
            if model.actuator_dyntype[i] == mujoco.mjtDyn.mjDYN_MUSCLE:  # MuJoCo cuts excitations off there
                found[place] = np.clip(found[place], 0.0, 1.0)
        return found

    @property
    def muscles(self) -> Bool[np.ndarray, " groups"]:
        """Whether each group has the dynamics of muscles, MuJoCo's or Hill's."""
        model = self.model
        found = np.zeros(len(self.body.groups), bool)
        dynamic = (model.actuator_dyntype == mujoco.mjtDyn.mjDYN_MUSCLE) | hill_actuators(model)
        for each, place in zip(actuators_of(self.body), group_places(self.body), strict=True):
            found[place] = dynamic[model.actuator(each.name).id]
        return found

    def sensor(self, kind: str, of: str, target: str, *whole: int) -> str:
        """Ask for a sensor of a kind, such as `"FRAMEPOS"`, `of` an object such as a `"SITE"`. Returns its name."""
        name = f"{kind.lower()} of {of.lower()} {target}"
        self.sensors[name] = Sensor(name, kind, of, target, whole)
        return name

    def place(self, name: str) -> tuple[str, str]:
        """The kind of the site, body or geom of this name, as sensors have it, and the name."""
        check(name, "part", name, "the name of a site, body or geom")
        for kind in _PLACED:
            if name in self._names(kind):
                return ("XBODY" if kind == "body" else kind.upper()), name
        raise unknown("site, body or geom", name, [each for kind in _PLACED for each in self._names(kind)])

    @property
    def sensed(self) -> Body:
        """The body with all sensors that were asked for."""
        return WithSensors(self.body, tuple(self.sensors.values())) if self.sensors else self.body

    def _names(self, kind: str) -> list[str]:
        if kind not in self._known:
            count = {"joint": "njnt", "actuator": "nu", "body": "nbody"}.get(kind, f"n{kind}")
            part = getattr(self.model, kind)
            self._known[kind] = [name for i in range(getattr(self.model, count)) if (name := part(i).name)]
        return self._known[kind]

    @functools.cached_property
    def _known(self) -> dict[str, list[str]]:
        return {}

    def _numbers(self, joints: str | Sequence[str], field: str, sizes: dict[Any, int]) -> tuple[list[str], np.ndarray]:
        names = []
        places = []
        for name in self.named("joint", joints):
            i = self.model.joint(name).id
            first = int(getattr(self.model, field)[i])
            size = sizes.get(int(self.model.jnt_type[i]), 1)
            places += range(first, first + size)
            names += [name] if size == 1 else [f"{name} {k + 1}" for k in range(size)]
        return names, np.array(places, int)


def actuator_levels(
    model: mujoco.MjModel, control: npt.ArrayLike, activation: npt.ArrayLike | None = None
) -> Float[np.ndarray, "... nu"]:
    """How active each actuator is, from 0 to 1, for display: its activation, or its control as a share of the greatest.

    **Arguments:** `model`; `control` (..., nu) and `activation` (..., na), MuJoCo's `ctrl` and `act`. Without
    activations, controls stand for them.
    """
    level = np.array(control, float)
    if activation is not None and model.na:
        last = model.actuator_actadr + model.actuator_actnum - 1
        has_state = model.actuator_actadr >= 0
        level[..., has_state] = np.asarray(activation)[..., last[has_state]]
    else:
        has_state = np.zeros(model.nu, bool)
    most = np.abs(model.actuator_ctrlrange).max(axis=1)
    bounded = (model.actuator_ctrllimited > 0) & (most > 0) & ~has_state
    return np.clip(np.abs(np.where(bounded, level / np.where(bounded, most, 1), level)), 0, 1)


@functools.lru_cache(maxsize=32)
def _compiled(body: Body) -> mujoco.MjModel:
    return compile_spec(body.spec())
