"""The editable numbers of a model: of its muscles, of its parts, and of the world around them."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import mujoco
import numpy as np

from motorgrad._errors import check
from motorgrad.bodies import hill_actuators

HILL_FIELDS = ("max_isometric_force", "optimal_fiber_length", "tendon_slack_length")
"""The editable numbers of a Hill-type muscle, in their order in `actuator_biasprm`."""
MUSCLE_FIELDS = (*HILL_FIELDS, "strength", "rest_length", "damping")
WORLD = "world"
"""What numbers are called that belong to all that stands still."""
TIMESTEP = f"body.{WORLD}.timestep"
GRAVITY = f"body.{WORLD}.gravity_"
TERRAIN = f"body.{WORLD}.terrain_height"
GEOM_TYPES: Any = mujoco.mjtGeom
SIZES: dict[int, tuple[str, ...]] = {
    GEOM_TYPES.mjGEOM_SPHERE: ("radius",),
    GEOM_TYPES.mjGEOM_CAPSULE: ("radius", "half_length"),
    GEOM_TYPES.mjGEOM_CYLINDER: ("radius", "half_length"),
    GEOM_TYPES.mjGEOM_ELLIPSOID: ("half_width_x", "half_width_y", "half_width_z"),
    GEOM_TYPES.mjGEOM_BOX: ("half_width_x", "half_width_y", "half_width_z"),
}
"""The editable sizes of a geom by its type, in their order in `geom_size`."""
PART_FIELDS = ("mass", "friction", *dict.fromkeys(name for names in SIZES.values() for name in names))
WORLD_FIELDS = ("gravity_x", "gravity_y", "gravity_z", "timestep", "terrain_height", "friction")
FIELDS = {*MUSCLE_FIELDS, *PART_FIELDS, *WORLD_FIELDS}
END = re.compile(r"\.(\w+)(?:\[([^\[\]]+)\])?$")
"""The end of a number's name: its field, and the geom that a size may have."""
POSITIVE = "above 0"
NOT_NEGATIVE = "at least 0"
ANY = "a finite number"
MAX_TIMESTEP = 0.1  # s


class Number(NamedTuple):
    """How to read a number from a model and write it there.

    - `get`, `apply`: both take the model. What `apply` writes depends on the value alone, so that going back to a value
      restores the model bit for bit.
    - `allowed`: of values: `POSITIVE`, `NOT_NEGATIVE` or `ANY`.
    - `inertial`: whether constants that MuJoCo derives from the model depend on it.
    """

    get: Callable[[Any], float]
    apply: Callable[[Any, float], None]
    allowed: str = NOT_NEGATIVE
    inertial: bool = False


def editable_numbers(model: mujoco.MjModel) -> dict[str, Number]:
    """All editable numbers of a model by name: `body.`, the part, the muscle or `world`, and the field."""
    return part_numbers(model) | world_numbers(model) | muscle_numbers(model)


def owned(names: Iterable[str], owner: str) -> list[str]:
    """The names of the numbers of a part, a muscle or `world`."""
    found = [(name, END.search(name)) for name in names if name.startswith(f"body.{owner}.")]
    return [name for name, end in found if end and end.start() == len(f"body.{owner}") and end[1] in FIELDS]


def field_of(name: str) -> str:
    """The field of a number's name, without the geom that a size may have."""
    end = END.search(name)
    return end[1] if end else ""


def geom_of(name: str) -> str:
    """The geom that a size's name has where its part has several; otherwise empty."""
    end = END.search(name)
    return end[2] or "" if end else ""


def check_number(name: str, number: Number, value: float, period: float) -> None:
    """Refuse a value that the number cannot have, and a time step of which no whole number makes a decision of `period`
    seconds. **Raises** `ValueError`.
    """
    fine = {POSITIVE: value > 0, NOT_NEGATIVE: value >= 0, ANY: np.isfinite(value)}[number.allowed]
    check(fine, name, value, number.allowed)
    if name == TIMESTEP:
        steps = period / value
        fine = value <= MAX_TIMESTEP and steps > 0.5 and abs(steps - round(steps)) < 1e-6
        check(fine, name, value, f"a decision of {period:g} s divided by a whole number, at most {MAX_TIMESTEP} s")


def write_numbers(model: mujoco.MjModel, numbers: Mapping[str, Number], values: Mapping[str, float]) -> bool:
    """Write values to a model, those of parts first. **Returns** whether any value changed."""
    changed = False
    for inertial in (True, False):
        some = [name for name, number in numbers.items() if number.inertial == inertial]
        some = [name for name in some if numbers[name].get(model) != values[name]]
        for name in some:
            numbers[name].apply(model, values[name])
        if inertial and some:
            mujoco.mj_setConst(model, mujoco.MjData(model))
        changed |= bool(some)
    return changed


def muscle_numbers(model: mujoco.MjModel) -> dict[str, Number]:
    """The editable numbers of every muscle by name, such as `body.flexor.strength` (N), `.rest_length` (m) and
    `.damping` (N s/m).

    A muscle is an actuator on a tendon whose gain is this library's, MuJoCo's `muscle`, or a constant pull; or a
    Hill-type muscle, whose numbers have the names of `motorgrad.bodies.Hill`.
    """
    kinds = mujoco.mjtGain
    found = {}
    hill = hill_actuators(model)
    for i in range(model.nu):
        if model.actuator_trntype[i] != mujoco.mjtTrn.mjTRN_TENDON:
            continue
        name = f"body.{model.actuator(i).name or i}"
        gain = model.actuator_gaintype[i]
        tendon = int(model.actuator_trnid[i, 0])
        if hill[i]:
            for place, field in enumerate(HILL_FIELDS):
                found[f"{name}.{field}"] = _at("actuator_biasprm", (i, place), allowed=POSITIVE)
            continue
        if gain == kinds.mjGAIN_USER:
            found[f"{name}.strength"] = _at("actuator_gainprm", (i, 0), -1.0)
            found[f"{name}.rest_length"] = _at("actuator_gainprm", (i, 1), allowed=POSITIVE)
        elif gain == kinds.mjGAIN_FIXED and model.actuator_gainprm[i, 0] < 0:
            found[f"{name}.strength"] = _at("actuator_gainprm", (i, 0), -1.0)
        elif gain == kinds.mjGAIN_MUSCLE:
            found[f"{name}.strength"] = _strength(i)
            if model.actuator_lengthrange[i, 0] == 0:  # as this library makes them: the upper end is the rest length
                found[f"{name}.rest_length"] = _at("actuator_lengthrange", (i, 1), allowed=POSITIVE)
        else:
            continue
        first = (tendon, 0) if model.tendon_damping.ndim == 2 else (tendon,)
        found[f"{name}.damping"] = _at("tendon_damping", first)
    return found


def _at(field: str, place: tuple[int, ...], sign: float = 1.0, allowed: str = NOT_NEGATIVE) -> Number:
    def apply(model: mujoco.MjModel, value: float) -> None:
        getattr(model, field)[place] = sign * value

    return Number(lambda model: sign * float(getattr(model, field)[place]), apply, allowed)


def _strength(actuator: int) -> Number:
    """The peak force of MuJoCo's muscle, given by `scale` where it is negative; the passive force has a copy."""

    def get(model: mujoco.MjModel) -> float:
        given, scale = model.actuator_gainprm[actuator, 2:4]
        return float(given if given >= 0 else scale / max(model.actuator_acc0[actuator], mujoco.mjMINVAL))

    def apply(model: mujoco.MjModel, value: float) -> None:
        model.actuator_gainprm[actuator, 2] = value
        if model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_MUSCLE:
            model.actuator_biasprm[actuator, 2] = value

    return Number(get, apply)


def part_numbers(model: mujoco.MjModel) -> dict[str, Number]:
    """The mass (kg) of every moving part with its inertia in proportion, the sliding friction of what touches, and the
    sizes (m) of its geoms, such as `body.foot.radius`; where there are several geoms, `body.foot.radius[toe]`.

    Mass and inertia stay as they are when a size changes.
    """
    found = {}
    for body in range(1, model.nbody):
        if model.body_weldid[body] == 0:
            continue
        name = f"body.{model.body(body).name or body}"
        if model.body_mass[body] > 0:
            found[f"{name}.mass"] = _mass(model, body)
        geoms = np.arange(model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body])
        if len(touching := geoms[_touches(model)[geoms]]):
            found[f"{name}.friction"] = _friction(model, touching)
        bounds = _Bounds(model, body)
        sized = [int(geom) for geom in geoms if int(model.geom_type[geom]) in SIZES]
        for number, geom in enumerate(sized):
            named = re.fullmatch(r"[^\[\]]+", model.geom(geom).name)
            which = f"[{named[0] if named else number + 1}]" if len(sized) > 1 else ""
            for place, field in enumerate(SIZES[int(model.geom_type[geom])]):
                found[f"{name}.{field}{which}"] = _size(bounds, geom, place)
    return found


def world_numbers(model: mujoco.MjModel) -> dict[str, Number]:
    """Gravity (m/s²), the time step (s), the height of a terrain (m), and the friction of everything fixed."""
    found = {f"{GRAVITY}{axis}": _gravity(place) for place, axis in enumerate("xyz")}
    found[TIMESTEP] = Number(
        lambda model: float(model.opt.timestep), lambda model, value: setattr(model.opt, "timestep", value), POSITIVE
    )
    if len(fields := np.flatnonzero(model.geom_type == GEOM_TYPES.mjGEOM_HFIELD)):
        found[TERRAIN] = _terrain(model, int(fields[0]))
    still = np.flatnonzero((model.body_weldid[model.geom_bodyid] == 0) & _touches(model))
    if len(still):
        found[f"body.{WORLD}.friction"] = _friction(model, still)
    return found


def _touches(model: mujoco.MjModel) -> np.ndarray:
    return (model.geom_contype | model.geom_conaffinity) != 0


def _mass(model: mujoco.MjModel, body: int) -> Number:
    mass = float(model.body_mass[body])
    inertia = np.array(model.body_inertia[body])

    def apply(model: mujoco.MjModel, value: float) -> None:
        model.body_mass[body] = value
        model.body_inertia[body] = inertia * (value / mass)

    return Number(lambda model: float(model.body_mass[body]), apply, POSITIVE, inertial=True)


def _friction(model: mujoco.MjModel, geoms: np.ndarray) -> Number:
    """The sliding friction of the first geom; that of the others changes in proportion."""
    own = np.array(model.geom_friction[geoms, 0])

    def apply(model: mujoco.MjModel, value: float) -> None:
        model.geom_friction[geoms, 0] = own * (value / own[0]) if own[0] > 0 else own + value
        model.geom_friction[geoms[0], 0] = value

    return Number(lambda model: float(model.geom_friction[geoms[0], 0]), apply)


class _Bounds:
    """MuJoCo's initial bounds for finding contacts of a part."""

    def __init__(self, model: mujoco.MjModel, body: int) -> None:
        first = int(model.body_geomadr[body])
        count = int(model.body_geomnum[body])
        self._geoms = range(first, first + count)
        self._kinds = model.geom_type
        self._sizes = np.array(model.geom_size)
        self._radii = np.array(model.geom_rbound)
        self._boxes = np.array(model.geom_aabb)
        self._nodes = _nodes(model, body)
        self._tree = np.array(model.bvh_aabb[self._nodes, 3:])

    def fit(self, model: mujoco.MjModel, geom: int) -> None:
        """Change them with the present size of a geom."""
        kind = self._kinds[geom]
        own = self._sizes[geom]
        size = model.geom_size[geom]
        model.geom_rbound[geom] = self._radii[geom] + (_radius(kind, size) - _radius(kind, own))
        model.geom_aabb[geom, 3:] = self._boxes[geom, 3:] + (_extent(kind, size) - _extent(kind, own))
        grown = [
            _extent(self._kinds[i], model.geom_size[i]) - _extent(self._kinds[i], self._sizes[i]) for i in self._geoms
        ]
        model.bvh_aabb[self._nodes, 3:] = self._tree + np.linalg.norm(np.maximum(grown, 0.0), axis=1).max()


def _nodes(model: mujoco.MjModel, body: int) -> slice:
    """The rows of a body's tree of bounds."""
    first = int(model.body_bvhadr[body])
    return slice(first, first + int(model.body_bvhnum[body])) if first >= 0 else slice(0)


def _size(bounds: _Bounds, geom: int, place: int) -> Number:
    def apply(model: mujoco.MjModel, value: float) -> None:
        model.geom_size[geom, place] = value
        bounds.fit(model, geom)

    return Number(lambda model: float(model.geom_size[geom, place]), apply, POSITIVE, inertial=True)


def _radius(kind: int, size: np.ndarray) -> float:
    """The radius of a ball around a geom's centre that holds it."""
    if kind == GEOM_TYPES.mjGEOM_CAPSULE:
        return float(size[0] + size[1])
    if kind == GEOM_TYPES.mjGEOM_CYLINDER:
        return float(np.hypot(size[0], size[1]))
    return float(np.linalg.norm(size)) if kind == GEOM_TYPES.mjGEOM_BOX else float(size.max())


def _extent(kind: int, size: np.ndarray) -> np.ndarray:
    """Half the sides of the box around a geom, along its own axes."""
    if kind == GEOM_TYPES.mjGEOM_SPHERE:
        return np.full(3, size[0])
    if kind in (GEOM_TYPES.mjGEOM_CAPSULE, GEOM_TYPES.mjGEOM_CYLINDER):
        round_end = size[0] if kind == GEOM_TYPES.mjGEOM_CAPSULE else 0.0
        return np.array([size[0], size[0], size[1] + round_end])
    return np.array(size)


def _gravity(axis: int) -> Number:
    def apply(model: mujoco.MjModel, value: float) -> None:
        model.opt.gravity[axis] = value

    return Number(lambda model: float(model.opt.gravity[axis]), apply, ANY)


def _terrain(model: mujoco.MjModel, geom: int) -> Number:
    """The elevation of the highest possible point of a height field, to which all others are in proportion."""
    field = int(model.geom_dataid[geom])
    radius = float(model.geom_rbound[geom])
    box = np.array(model.geom_aabb[geom])
    nodes = _nodes(model, int(model.geom_bodyid[geom]))
    tree = np.array(model.bvh_aabb[nodes, 3:])
    wide, deep, own, base = (float(each) for each in model.hfield_size[field])

    def reach(tall: float) -> float:
        return float(np.linalg.norm([wide, deep, max(tall, base)]))

    def apply(model: mujoco.MjModel, value: float) -> None:
        model.hfield_size[field, 2] = value
        model.geom_rbound[geom] = radius + reach(value) - reach(own)
        model.geom_aabb[geom, [2, 5]] = box[[2, 5]] + (value - own) / 2
        model.bvh_aabb[nodes, 3:] = tree + max(value - own, 0.0)

    return Number(lambda model: float(model.hfield_size[field, 2]), apply, POSITIVE)
