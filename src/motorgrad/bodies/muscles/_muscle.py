"""Muscles, servos and motors: what drives a joint, and the law of its force."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import dataclasses
import math
from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from motorgrad._arrays import Real
from motorgrad._errors import check
from motorgrad.schema import Settings, inner, number, static


def tension(
    activation: Real,
    length: Real,
    velocity: Real,
    strength: Real,
    rest_length: Real,
    shape: Real = 0.5,
    damping: Real = 0.0,
) -> Any:
    r"""The tension of a muscle, positive when it pulls.

    $$F = a\, f_{max} \exp\left(-\frac{(L/r - 1)^2}{k_{CE}}\right) + k_{SE}\, \dot L$$

    The law is written only here: numba compiles this function for the physics (see `install_muscle_callback`), and
    NumPy evaluates it in tests and figures.

    **Arguments** (floats or NumPy arrays that broadcast together):

    - `activation`: $a$, from 0 to 1.
    - `length`: $L$, the length of the path in m.
    - `velocity`: $\dot L$ in m/s, positive while the muscle is stretched.
    - `strength`: $f_{max}$ in N.
    - `rest_length`: $r$ in m, where the contractile force is greatest.
    - `shape`: $k_{CE}$, dimensionless; larger values flatten the force–length curve.
    - `damping`: $k_{SE}$ in N s/m.

    **Returns:** the tension in N. An inactive muscle that shortens quickly has a negative tension, because the damper
    pushes, as in the source.

    Source: the lumped-parameter muscle of the thesis behind this library, section 5.1.2.
    """
    strain = length / rest_length - 1.0
    return activation * strength * np.exp(-strain * strain / shape) + damping * velocity


def contraction_work(low: float, high: float, strength: float, rest_length: float, shape: float = 0.5) -> float:
    r"""The work of a muscle that contracts at full activation, without its damper: the integral of `tension` over its
    length,

    $$\int_{L_1}^{L_2} f_{max}\, e^{-(L/r - 1)^2 / k_{CE}}\, dL = \tfrac{1}{2} f_{max}\, r \sqrt{\pi k_{CE}}
    \left[\operatorname{erf}\frac{L/r - 1}{\sqrt{k_{CE}}}\right]_{L_1}^{L_2}.$$

    **Arguments:** the lengths `low` and `high` between which it contracts, in m; the others as in `tension`.

    **Returns:** the work in J.
    """
    width = math.sqrt(shape)
    first, last = (math.erf((length / rest_length - 1.0) / width) for length in (low, high))
    return 0.5 * strength * rest_length * math.sqrt(math.pi) * width * (last - first)


@dataclasses.dataclass(frozen=True)
class Attachment(Settings):
    """A point where a muscle is attached."""

    body: str = static(help="name of the body")
    position: tuple[float, float, float] = static(unit="m", help="(x, y, z) in that body's frame")

    def validate(self) -> None:
        check(self.body, "body", self.body, "the name of a body")


@dataclasses.dataclass(frozen=True)
class Wrap(Settings):
    """An obstacle on a muscle's path."""

    geom: str = static(help="name of a sphere or cylinder geom")
    side_site: str = static(
        help="name of the site that tells MuJoCo on which side the path passes; put it near the middle of the arc (the "
        "page on bodies explains why)"
    )

    def validate(self) -> None:
        check(self.geom, "geom", self.geom, "the name of a sphere or cylinder geom")
        check(self.side_site, "side_site", self.side_site, "a site's name")


@dataclasses.dataclass(frozen=True)
class OnPath(Settings):
    """What all muscles have: a name, and two ends of a path."""

    name: str = static(help="unique within the body; also the name of the tendon and of the actuator")
    group: str = static(help="muscles of one group share one component of the action")
    origin: Attachment = inner(help="one end of the path, which is the shortest one between its ends")
    insertion: Attachment = inner(help="the other end")

    def validate(self) -> None:
        for field in ("name", "group"):
            check(getattr(self, field), field, getattr(self, field), "a name that is not empty")


@dataclasses.dataclass(frozen=True)
class Muscle(OnPath):
    """A muscle: its path and its strength. `tension` gives its force."""

    strength: float = number(low=0, open_low=True, unit="N", help="greatest contractile force $f_{max}$")
    rest_length: float = number(low=0, open_low=True, unit="m", help="$r$, at which the contractile force is greatest")
    damping: float = number(8.0, 0, unit="N s/m", help="$k_{SE}$")
    shape: float = number(
        0.5, 0, open_low=True, help="$k_{CE}$; infinite for a contractile force that does not depend on the length"
    )
    wrap: Wrap | None = inner(None, help="the joint capsule around which the path wraps, or None for a straight muscle")

    def __post_init__(self) -> None:
        infinite = self.shape == math.inf  # which a setting otherwise is not
        if infinite:
            object.__setattr__(self, "shape", 1.0)
        super().__post_init__()
        if infinite:
            object.__setattr__(self, "shape", math.inf)


@dataclasses.dataclass(frozen=True)
class Servo(Settings):
    r"""A motor that turns a joint at a desired velocity: $\tau = \mathrm{clip}(k_v (u - \dot q), \pm\tau_{max})$."""

    name: str = static(help="unique within the body")
    group: str = static(help="servos of one group share one component of the action, the desired velocity $u$ in rad/s")
    joint: str = static(help="the name of the hinge")
    gain: float = number(low=0, open_low=True, unit="N m s/rad", help="$k_v$")
    limit: float = number(low=0, open_low=True, unit="N m", help=r"$\tau_{max}$")


@dataclasses.dataclass(frozen=True)
class Motor(Settings):
    r"""A motor that turns a joint with a torque that its control alone decides: $\tau = u\, \tau_{max}$."""

    name: str = static(help="unique within the body")
    group: str = static(help="motors of one group share one component of the action, the control $u$ from 0 to 1")
    joint: str = static(help="the name of the hinge")
    torque: float = number(unit="N m", help=r"$\tau_{max}$, negative for a motor that turns the joint backwards")


def groups_of(muscles: Iterable[Any]) -> tuple[str, ...]:
    """The groups of `muscles`, without repeats, in the order of first appearance: the components of an action."""
    return tuple(dict.fromkeys(muscle.group for muscle in muscles))


def add_servos(spec: mujoco.MjSpec, servos: Iterable[Servo]) -> None:
    """Add servos to a skeleton that has their joints. Their actuators follow those of the muscles."""
    for servo in servos:
        actuator = spec.add_actuator(name=servo.name, target=servo.joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        actuator.set_to_velocity(kv=servo.gain)
        actuator.forcelimited = True
        actuator.forcerange = (-servo.limit, servo.limit)


def add_motors(spec: mujoco.MjSpec, motors: Iterable[Motor]) -> None:
    """Add motors to a skeleton that has their joints."""
    for motor in motors:
        actuator = spec.add_actuator(name=motor.name, target=motor.joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        actuator.gainprm[0] = motor.torque
        actuator.ctrllimited = True
        actuator.ctrlrange = (0.0, 1.0)


# Half-width of the native bump in units of √(2 k_CE). Matching the curvature would give 1; this value minimises the
# greatest deviation from the Gaussian over |L/r − 1| ≤ 0.8 (for k_CE = 0.5), the range of the hopper's muscles.
_WIDTH = 1.2
# Flattens the built-in force–velocity curve: full force at any speed that occurs.
_MAX_VELOCITY = 1e9


def set_native_gain(actuator: mujoco.MjsActuator, muscle: Muscle) -> None:
    """Give an `MjsActuator` MuJoCo's `muscle` gain for `muscle`, without activation dynamics or passive force.

    The built-in force–length curve is a bump of four parabolas between `lmin` and `lmax`, 1 at the rest length and ½
    half way to either end. Its half-width is the only free number; everything else of the built-in muscle is switched
    off.
    """
    width = _half_width(muscle.shape)
    actuator.gaintype = mujoco.mjtGain.mjGAIN_MUSCLE
    # with this length range the normalised length is L / r
    actuator.lengthrange = (0.0, muscle.rest_length)
    # range (2), force, scale, lmin, lmax, vmax, fpmax (a matter of the passive bias, which stays off), fvmax
    actuator.gainprm[:9] = (0.0, 1.0, muscle.strength, 1.0, 1.0 - width, 1.0 + width, _MAX_VELOCITY, 1.0, 1.0)


def check_thesis(model: mujoco.MjModel) -> None:
    """Refuse actuators whose gain is the user's, and that are no muscles of this library: its callback would take them
    for such.

    **Raises:** `ValueError` naming the actuator.
    """
    for i in np.flatnonzero(model.actuator_gaintype == mujoco.mjtGain.mjGAIN_USER):
        numbers = model.actuator_gainprm[i, :3]
        others = model.actuator_gainprm[i, 3:]
        right = np.isfinite(numbers).all() and numbers[0] < 0 and numbers[1] > 0 and numbers[2] > 0 and not others.any()
        right = right and model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_TENDON and model.actuator_gear[i, 0] == 1
        right = right and model.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_NONE
        wanted = "a muscle, as `add_muscles` makes it: other gains of type 'user' are not known here"
        check(right, "actuator", model.actuator(i).name, wanted)


def native_force_length(length: npt.ArrayLike, rest_length: Real, shape: Real = 0.5) -> np.ndarray:
    """The force–length factor that `muscle_model="native"` uses in place of the Gaussian of `tension`.

    **Arguments:** path length and rest length in m, and the Gaussian's $k_{CE}$; arrays broadcast.

    **Returns:** the factor, from 0 to 1.

    Source: MuJoCo's `mju_muscleGainLength`.
    """
    strain = np.abs(np.asarray(length) / rest_length - 1.0) / (_half_width(shape) / 2.0)
    return np.where(strain <= 1.0, 1.0 - 0.5 * strain**2, np.where(strain < 2.0, 0.5 * (2.0 - strain) ** 2, 0.0))


def _half_width(shape: Real) -> Any:
    return _WIDTH * math.sqrt(2.0) * np.sqrt(shape)
