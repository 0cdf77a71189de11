"""What every body is, and how a description of it becomes a MuJoCo model."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import math
from collections.abc import Mapping, Sequence
from typing import Protocol

import mujoco

from motorgrad._errors import check, choice, unknown
from motorgrad.bodies._callback import check_muscle_callback, install_muscle_callback
from motorgrad.bodies._muscle import Attachment, Muscle
from motorgrad.bodies._native import set_native_gain
from motorgrad.bodies._servo import Servo

MUSCLE_MODELS = ("thesis", "native")
START = "start"

# one colour for each group in turn, so that the muscles of a group are seen to belong together
_COLOURS = ((0.20, 0.45, 0.85, 1.0), (0.85, 0.25, 0.20, 1.0), (0.20, 0.65, 0.35, 1.0), (0.85, 0.60, 0.15, 1.0))
_TENDON_WIDTH = 0.008


class Body(Protocol):
    """A muscle-driven body: numbers from which a MuJoCo model is built.

    A body is a frozen dataclass, so that `dataclasses.replace(body, number=...)` gives another one. To write a new one,
    provide these members, build the skeleton with `mujoco.MjSpec` (with a keyframe "start") and hand it to
    `add_muscles`. A body with motors may have a property `servos` besides, a tuple of `Servo`.
    """

    @property
    def muscles(self) -> tuple[Muscle, ...]:
        """Every muscle, in the order of the model's actuators."""
        ...

    @property
    def groups(self) -> tuple[str, ...]:
        """The groups in order of first appearance; an action is one number from 0 to 1 for each."""
        ...

    @property
    def sensor_components(self) -> Mapping[str, int]:
        """For a vector sensor of which one component is meant (a height), that component's index."""
        ...

    def spec(self) -> mujoco.MjSpec:
        """A fresh, editable description of the whole body."""
        ...


def actuators_of(body: Body) -> tuple[Muscle | Servo, ...]:
    """Everything that an action drives, in the order of the model's actuators: muscles, then servos."""
    return (*body.muscles, *getattr(body, "servos", ()))


def add_muscles(spec: mujoco.MjSpec, muscles: Sequence[Muscle], muscle_model: str = "thesis") -> None:
    """Add muscles to a skeleton: for each, two sites, a spatial tendon (the path and the damper) and an actuator.

    **Arguments:**

    - `spec`: the skeleton, changed in place.
    - `muscles`: at least one; their bodies, geoms and sites must exist in `spec`.
    - `muscle_model`: "thesis" for the exact law through a callback, "native" for MuJoCo's own muscle gain
      (`native_force_length`), which other back ends know too.

    **Raises:** `ValueError` for a name that is taken or unknown.
    """
    choice("muscle_model", muscle_model, MUSCLE_MODELS)
    check(len(muscles) > 0, "muscles", tuple(muscles), "at least one muscle")
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
        # the range makes MuJoCo clamp what the policy sends to 0 … 1
        actuator = spec.add_actuator(name=muscle.name, ctrllimited=True, ctrlrange=(0.0, 1.0))
        actuator.trntype = mujoco.mjtTrn.mjTRN_TENDON
        actuator.target = muscle.name
        if math.isinf(muscle.shape):  # one force at every length needs no law: MuJoCo's plain gain
            actuator.gainprm[0] = -muscle.strength
        elif muscle_model == "native":
            set_native_gain(actuator, muscle)
        else:
            actuator.gaintype = mujoco.mjtGain.mjGAIN_USER
            actuator.gainprm[:3] = (-muscle.strength, muscle.rest_length, muscle.shape)


def compile_model(body: Body | mujoco.MjSpec) -> mujoco.MjModel:
    """Build the MuJoCo model of a body, and see to it that its muscles pull.

    **Arguments:** `body`: a body, or a description such as `body.spec()` that you have edited.

    **Returns:** the model. If it has muscles of the "thesis" model, the gain callback is installed and verified.

    **Raises:** `RuntimeError` if a foreign gain callback is in the way; `ValueError` from MuJoCo for a bad description.
    """
    spec = body if isinstance(body, mujoco.MjSpec) else body.spec()
    # before compiling, which runs the physics for a moment and would run a foreign callback
    if any(actuator.gaintype == mujoco.mjtGain.mjGAIN_USER for actuator in spec.actuators):
        install_muscle_callback()
    model = spec.compile()
    check_muscle_callback(model)
    return model


def _add_site(spec: mujoco.MjSpec, name: str, attachment: Attachment) -> None:
    _known("body", attachment.body, [body.name for body in spec.bodies])
    spec.body(attachment.body).add_site(name=name, pos=attachment.position, size=(0.008, 0.008, 0.008), group=2)


def _known(kind: str, name: str, names: list[str]) -> None:
    if name not in names:
        raise unknown(kind, name, filter(None, names))
