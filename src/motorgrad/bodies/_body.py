"""Bodies: descriptions in numbers, from which MuJoCo models and MJCF files are made."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import contextlib
import ctypes
import dataclasses
import math
import pathlib
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import mujoco
import numpy as np

from motorgrad._arrays import Vector
from motorgrad._errors import check, choice, unknown
from motorgrad.bodies.models._read import compile_bare, compile_spec
from motorgrad.bodies.muscles._hill import HillMuscle, set_hill
from motorgrad.bodies.muscles._muscle import Attachment, Motor, Muscle, Servo, set_native_gain

MUSCLE_MODELS = ("thesis", "native")
START = "start"
# one colour per group, repeating
_COLOURS = ((0.20, 0.45, 0.85, 1.0), (0.85, 0.25, 0.20, 1.0), (0.20, 0.65, 0.35, 1.0), (0.85, 0.60, 0.15, 1.0))
_TENDON_WIDTH = 0.008
_SKY = ((0.62, 0.74, 0.86), (0.93, 0.95, 0.98))
_TILES = ((0.78, 0.80, 0.80), (0.70, 0.73, 0.74))
_DOUBLE_DIGITS = 17
# more digits than MuJoCo writes by default, as in a number without a short decimal form
_LONG_NUMBER = re.compile(r"-?\d+\.\d{8,}(?:e[-+]?\d+)?|-?\d+(?:\.\d+)?e[-+]?\d+")
_COLOUR = re.compile(r'(?<=rgba=")[^"]*')


class Body(Protocol):
    """A muscle-driven body: numbers from which a MuJoCo model is built.

    A body is a frozen dataclass, so `dataclasses.replace(body, number=...)` makes a variant. To write a new one,
    provide these members, build the skeleton with `mujoco.MjSpec` (with a keyframe "start"), and pass it to
    `add_muscles`. A body with motors may also have a property `servos`, a tuple of `Servo`; one with actuators of any
    other kind has a property `actuators`, which replaces both, a tuple of `Actuator`. A property `start` names another
    keyframe to start in; `None` stands for the first, or the reference pose where there are none.
    """

    @property
    def muscles(self) -> tuple[Muscle | HillMuscle, ...]:
        """All muscles, in the order of the model's actuators."""
        ...

    @property
    def groups(self) -> tuple[str, ...]:
        """The groups in order of first appearance; an action has one number from 0 to 1 per group."""
        ...

    @property
    def sensor_components(self) -> Mapping[str, int]:
        """For a vector sensor of which only one component is used (such as a height), that component's index."""
        ...

    def spec(self) -> mujoco.MjSpec:
        """A new, editable description of the whole body."""
        ...


class Actuator(NamedTuple):
    """What drives a body, of whatever kind.

    - `name`: name of the actuator in the model.
    - `group`: the component of the action that is its control.
    """

    name: str
    group: str


@dataclasses.dataclass(frozen=True)
class WrappedBody:
    """A body in other surroundings. Subclasses define `spec`; everything else is the body's own.

    **Arguments:**

    - `body`: the body.
    """

    body: Body

    @property
    def muscles(self) -> tuple[Muscle | HillMuscle, ...]:
        """The body's muscles."""
        return self.body.muscles

    @property
    def servos(self) -> tuple[Servo, ...]:
        """The body's servos, if any."""
        return getattr(self.body, "servos", ())

    @property
    def actuators(self) -> tuple[Any, ...]:
        """Everything that an action drives."""
        return actuators_of(self.body)

    @property
    def start(self) -> str | None:
        """The keyframe in which the body starts."""
        return getattr(self.body, "start", START)

    @property
    def timestep(self) -> float:
        """The body's time step of the physics, in s."""
        return self.body.timestep  # type: ignore[attr-defined]

    @property
    def groups(self) -> tuple[str, ...]:
        """The body's groups."""
        return self.body.groups

    @property
    def sensor_components(self) -> Mapping[str, int]:
        """The body's sensor components."""
        return self.body.sensor_components


def actuators_of(body: Body) -> tuple[Muscle | HillMuscle | Servo | Motor | Actuator, ...]:
    """Everything an action drives, in the order of the model's actuators: muscles, then servos; or actuators."""
    own = getattr(body, "actuators", None)
    return (*body.muscles, *getattr(body, "servos", ())) if own is None else own


def group_places(body: Body) -> list[int]:
    """For each actuator of a body, the place of its group, which is the component of an action that drives it."""
    place = {group: index for index, group in enumerate(body.groups)}
    return [place[each.group] for each in actuators_of(body)]


def compile_model(body: Body | mujoco.MjSpec) -> mujoco.MjModel:
    """Compile the MuJoCo model of a body, with the muscle law in place.

    **Arguments:** `body`: a body, or a description such as `body.spec()` that you have edited.

    **Returns:** the model. If it has muscles of the "thesis" model or Hill-type muscles, their callbacks are installed
    and verified.

    **Raises:** `RuntimeError` if another callback is installed; `ValueError` for a description that MuJoCo refuses
    or that is beyond the limits of size, which the page on bodies lists.

    ```python
    model = mg.bodies.compile_model(mg.bodies.Hopper(load_mass=3.0))
    ```
    """
    spec = body if isinstance(body, mujoco.MjSpec) else body.spec()
    return compile_spec(spec)


def add_muscles(spec: mujoco.MjSpec, muscles: Sequence[Muscle | HillMuscle], muscle_model: str = "thesis") -> None:
    """Add muscles to a skeleton: for each, two sites, a spatial tendon (path and damper) and an actuator.

    **Arguments:**

    - `spec`: the skeleton, modified in place.
    - `muscles`: at least one; their bodies, geoms and sites must exist in `spec`.
    - `muscle_model`: of those that are a `Muscle`: "thesis" for the exact law through a callback; "native" for MuJoCo's
      own muscle gain (`native_force_length`), which other back ends support too. A `HillMuscle` has a law of its own.

    **Raises:** `ValueError` for a name that is taken or unknown.
    """
    choice("muscle_model", muscle_model, MUSCLE_MODELS)
    check(len(muscles) > 0, "muscles", tuple(muscles), "at least one muscle")
    add_paths(spec, muscles)
    for muscle in muscles:
        # the range makes MuJoCo clamp the policy's output to 0 … 1
        actuator = spec.add_actuator(name=muscle.name, ctrllimited=True, ctrlrange=(0.0, 1.0))
        actuator.trntype = mujoco.mjtTrn.mjTRN_TENDON
        actuator.target = muscle.name
        if isinstance(muscle, HillMuscle):
            set_hill(actuator, muscle.hill)
        elif math.isinf(muscle.shape):  # a force independent of the length needs only MuJoCo's plain gain
            actuator.gainprm[0] = -muscle.strength
        elif muscle_model == "native":
            set_native_gain(actuator, muscle)
        else:
            actuator.gaintype = mujoco.mjtGain.mjGAIN_USER
            actuator.gainprm[:3] = (-muscle.strength, muscle.rest_length, muscle.shape)


def add_paths(spec: mujoco.MjSpec, muscles: Sequence[Muscle | HillMuscle]) -> None:
    """Add what is passive about muscles to a skeleton: for each, two sites and a spatial tendon, its path and damper.

    The arguments and errors are those of `add_muscles`.
    """
    names = [muscle.name for muscle in muscles]
    for name in names:
        check(names.count(name) == 1, "Muscle.name", name, "different from every other muscle's name")
    groups = list(dict.fromkeys(muscle.group for muscle in muscles))
    for muscle in muscles:
        _add_site(spec, f"{muscle.name}_origin", muscle.origin)
        _add_site(spec, f"{muscle.name}_insertion", muscle.insertion)
        tendon = spec.add_tendon(name=muscle.name, damping=muscle.damping, width=_TENDON_WIDTH)
        tendon.rgba = _COLOURS[groups.index(muscle.group) % len(_COLOURS)]
        tendon.wrap_site(f"{muscle.name}_origin")
        if muscle.wrap is not None:
            _known("geom", muscle.wrap.geom, [geom.name for geom in spec.geoms])
            _known("site", muscle.wrap.side_site, [site.name for site in spec.sites])
            tendon.wrap_geom(muscle.wrap.geom, muscle.wrap.side_site)
        tendon.wrap_site(f"{muscle.name}_insertion")


def add_geom(
    body: mujoco.MjsBody, name: str, kind: mujoco.mjtGeom, size: Vector, position: Vector, mass: float, colour: Vector
) -> mujoco.MjsGeom:
    """Add a geom without collisions to a body."""
    return body.add_geom(
        name=name, type=kind, size=size, pos=position, mass=mass, rgba=colour, contype=0, conaffinity=0
    )


def about(axis: Sequence[float], angle: float) -> tuple[float, ...]:
    """The quaternion of a rotation by `angle` (rad) about a unit axis."""
    return (math.cos(angle / 2.0), *(math.sin(angle / 2.0) * part for part in axis))


def add_sensors(spec: mujoco.MjSpec, kind: str, of: str, names: Mapping[str, str]) -> None:
    """Add sensors of one `kind`, such as "JOINTPOS". `names` maps each to the object it observes, such as a "JOINT"."""
    sensor = getattr(mujoco.mjtSensor, f"mjSENS_{kind}")
    target = getattr(mujoco.mjtObj, f"mjOBJ_{of}")
    for name, object_name in names.items():
        spec.add_sensor(name=name, type=sensor, objtype=target, objname=object_name)


def add_scenery(spec: mujoco.MjSpec, rail: tuple[float, float] | None, target: str) -> None:
    """Add a checkered floor at z = 0 (the only geom that can be touched), light, sky, a rail, and cameras.

    A body on a rail is seen from the side: the camera "side" tracks it, "stand" is fixed and shows hops of up to 1 m. A
    free body is tracked from above by the camera "above".

    **Arguments:** `spec`, modified in place; `rail`: (x, y) in m of the vertical rail drawn behind a body that is held
    by one, or None; `target`: name of an existing body for the cameras to track.
    """
    spec.visual.headlight.ambient = (0.4, 0.4, 0.4)
    spec.visual.headlight.diffuse = (0.4, 0.4, 0.4)
    spec.visual.global_.offwidth = 1280
    spec.visual.global_.offheight = 960
    builtin = mujoco.mjtBuiltin
    for name, kind, pattern, colours in (
        ("sky", mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin.mjBUILTIN_GRADIENT, _SKY),
        ("tiles", mujoco.mjtTexture.mjTEXTURE_2D, builtin.mjBUILTIN_CHECKER, _TILES),
    ):
        spec.add_texture(name=name, type=kind, builtin=pattern, rgb1=colours[0], rgb2=colours[1], width=128, height=128)
    floor_material = spec.add_material(name="floor", texrepeat=(4, 4), texuniform=True)
    floor_material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "tiles"
    world = spec.worldbody
    light = world.add_light(pos=(-1.0, -2.0, 3.0), dir=(0.35, 0.6, -1.0), diffuse=(0.55, 0.55, 0.55), castshadow=True)
    light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    world.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=(0, 0, 0.5),
        material="floor",
        contype=0,
        conaffinity=1,
        solref=(0.005, 1.0),
    )
    if rail is None:
        above = spec.body(target).add_camera(name="above", mode=mujoco.mjtCamLight.mjCAMLIGHT_TRACK, fovy=40.0)
        above.pos = (0.0, 0.0, 2.2)
        return
    world.add_geom(
        name="rail",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=(0.008, 1.25, 0),
        pos=(*rail, 1.25),
        rgba=(0.55, 0.58, 0.62, 1.0),
        contype=0,
        conaffinity=0,
    )
    follow = spec.body(target).add_camera(name="side", mode=mujoco.mjtCamLight.mjCAMLIGHT_TRACK, fovy=40.0)
    follow.pos = (0.0, -2.2, -0.1)
    stay = world.add_camera(name="stand", pos=(0.0, -3.0, 0.75), fovy=40.0)
    for camera in (follow, stay):
        # x to the right, z up, seen from negative y
        camera.quat = (0.5**0.5, 0.5**0.5, 0.0, 0.0)


def to_mjcf(body: Body | mujoco.MjSpec) -> str:
    """Write a body as MJCF, MuJoCo's XML format, with all digits.

    **Arguments:** `body`: a body, or a description such as `body.spec()`.

    **Returns:** the document. A model loaded from it moves exactly like the original. Muscles of the "thesis" model
    need the gain callback wherever the file is loaded (`install_muscle_callback`); use `muscle_model="native"` to
    export for programs without it.
    """
    spec = body if isinstance(body, mujoco.MjSpec) else body.spec()
    compile_bare(spec)  # the writer requires resolved references
    with _all_digits():
        xml = spec.to_xml()
    # colours are stored in single precision, so 0.9 would be written with 17 digits
    xml = _COLOUR.sub(lambda found: " ".join(str(np.float32(x)) for x in found.group().split()), xml)
    return _LONG_NUMBER.sub(lambda found: repr(float(found.group())), xml)


def _add_site(spec: mujoco.MjSpec, name: str, attachment: Attachment) -> None:
    _known("body", attachment.body, [body.name for body in spec.bodies])
    spec.body(attachment.body).add_site(name=name, pos=attachment.position, size=(0.008, 0.008, 0.008), group=2)


def _known(kind: str, name: str, names: list[str]) -> None:
    if name not in names:
        raise unknown(kind, name, filter(None, names))


@contextlib.contextmanager
def _all_digits() -> Iterator[None]:
    """Make MuJoCo write 17 digits within the context. With its default of six, the hopper ends up elsewhere within a
    second.

    The setting has no public name; where a library lacks it, six digits are written.
    """
    try:
        paths = sorted(pathlib.Path(mujoco.__file__).parent.glob("*mujoco*.*"))
        library = ctypes.CDLL(str(next(p for p in paths if p.suffix in (".dll", ".dylib") or ".so." in p.name)))
        get, put = library._mjPRIVATE__get_xml_precision, library._mjPRIVATE__set_xml_precision
    except (StopIteration, OSError, AttributeError):
        yield
        return
    before = get()
    put(_DOUBLE_DIGITS)
    try:
        yield
    finally:
        put(before)
