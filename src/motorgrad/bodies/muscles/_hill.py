"""Hill-type muscles as a user describes them, and as they appear in a MuJoCo model."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt

from motorgrad._errors import check
from motorgrad.bodies.muscles._curve_sets import CURVES, with_curves
from motorgrad.bodies.muscles._hill_curves import STRAIN
from motorgrad.bodies.muscles._hill_dynamics import tendon_length
from motorgrad.bodies.muscles._machine_code import compiled_hill
from motorgrad.bodies.muscles._muscle import OnPath, Wrap
from motorgrad.schema import Settings, inner, number, static

Tendon = Literal["compliant", "rigid"]
Curves = Literal["de-groote", "millard"]
SPAN = (0.4, 1.5)
"""The least and the greatest length of a fiber, as multiples of the optimal one, where nothing else tells them."""
MIN_TENDON_SLACK = 1e-3
"""The least slack length of a tendon that stretches, as a multiple of the fiber's optimal length."""


@dataclasses.dataclass(frozen=True)
class Hill(Settings):
    r"""The numbers of a Hill-type muscle: a fiber, and in series with it a tendon.

    $$\left(a f_L(\tilde l) f_V(\tilde v) + f_P(\tilde l) + \beta \tilde v\right) \cos\alpha = f_T(\tilde l_T)$$

    The page on muscles explains it, and `hill_curves` has the curves.

    Source: De Groote et al. (2016); Millard et al. (2013).
    """

    max_isometric_force: float = number(
        low=0, open_low=True, unit="N", help="greatest isometric force of the fiber, at its optimal length"
    )
    optimal_fiber_length: float = number(low=0, open_low=True, unit="m", help="length at which a fiber is strongest")
    tendon_slack_length: float = number(low=0, unit="m", help="length beyond which the tendon pulls")
    pennation_angle: float = number(
        0.0,
        0,
        math.pi / 2,
        open_high=True,
        unit="rad",
        help="between fiber and tendon at the optimal length; the fiber keeps its height as it changes its length",
    )
    max_contraction_velocity: float = number(
        10.0, 0, open_low=True, unit="1/s", help="greatest velocity of shortening, in optimal fiber lengths per second"
    )
    activation_time_constant: float = number(
        0.015, 0, open_low=True, unit="s", help="time constant with which the activation rises"
    )
    deactivation_time_constant: float = number(
        0.06, 0, open_low=True, unit="s", help="time constant with which the activation falls"
    )
    fiber_damping: float = number(0.1, 0, help="β, which acts on the velocity as a multiple of the greatest")
    tendon: Tendon = static(
        "compliant",
        help='`"compliant"` for one that stretches, and a fiber whose length is a state; `"rigid"` for one '
        "that always has its slack length, or pulls on nothing",
    )
    tendon_strain: float = number(
        STRAIN, 0, open_low=True, help="strain of a compliant tendon at the greatest isometric force"
    )
    curves: Curves = static(
        "de-groote",
        help='`"de-groote"` for those of De Groote et al. (2016), `"millard"` for those of Millard et al. (2013)',
    )

    def validate(self) -> None:
        least = MIN_TENDON_SLACK * self.optimal_fiber_length if self.tendon == "compliant" else 0.0
        wanted = f"at least {least:g} m, or the tendon 'rigid'"
        check(self.tendon_slack_length >= least, "tendon_slack_length", self.tendon_slack_length, wanted)

    @classmethod
    def spanning(
        cls, path: Sequence[float], max_isometric_force: float, span: Sequence[float] = SPAN, **others: Any
    ) -> "Hill":
        """A muscle for a path: fiber and tendon so long that the fiber uses a span of its force–length curve.

        **Arguments:**

        - `path` (m): the least and the greatest length of the path.
        - `max_isometric_force` (N): greatest isometric force of the fiber.
        - `span`: the fiber's lengths at these ends, on a tendon of its slack length, as multiples of the optimal
          length. By default 0.4 and 1.5.
        - `others`: further numbers of a `Hill`.

        ```python
        flexor = mg.bodies.Hill.spanning((0.20, 0.31), 400.0, tendon="rigid")
        print(round(flexor.optimal_fiber_length, 3), round(flexor.tendon_slack_length, 3))  # → 0.1 0.16
        ```
        """
        low, high = path
        optimal = (high - low) / (span[1] - span[0])
        return cls(max_isometric_force, optimal, low - span[0] * optimal, **others)


@dataclasses.dataclass(frozen=True)
class HillMuscle(OnPath):
    """A Hill-type muscle and its path, for a body of your own; otherwise as `Muscle`.

    ```python
    soleus = mg.bodies.HillMuscle(
        "soleus",
        group="extensors",
        origin=mg.bodies.Attachment("shank", (0.0, 0.0, -0.05)),
        insertion=mg.bodies.Attachment("foot", (-0.05, 0.0, 0.0)),
        hill=mg.bodies.Hill(3500.0, optimal_fiber_length=0.05, tendon_slack_length=0.25, pennation_angle=0.44),
    )
    ```
    """

    hill: Hill = inner(help="the numbers of fiber and tendon")
    wrap: Wrap | None = inner(None, help="what the path wraps around, or None for a straight muscle")

    @property
    def damping(self) -> float:
        """The damping of the path, which has none: the fiber has its own."""
        return 0.0


def set_hill(actuator: mujoco.MjsActuator, hill: Hill) -> None:
    """Make a `MjsActuator` on a tendon a Hill-type muscle.

    MuJoCo stores it as an actuator with user dynamics and a user bias: `biasprm` holds the greatest isometric force,
    optimal fiber length, tendon slack length, pennation angle, greatest velocity, fiber damping, the stiffness of the
    tendon's curve (De Groote's exponent, or the inverse of Millard's strain) and the number of the curves, 0 for De
    Groote's and 1 for Millard's; `dynprm` the two time constants. Its states are the fiber's length as a multiple of
    the optimal length, if the tendon is compliant, and then the activation. A fiber of length 0, as MuJoCo sets all
    states at the start, is one in balance with its tendon at rest.
    """
    check(actuator.gear[0] == 1.0, f"gear of the muscle {actuator.name!r}", float(actuator.gear[0]), "1")
    actuator.dyntype, actuator.biastype = mujoco.mjtDyn.mjDYN_USER, mujoco.mjtBias.mjBIAS_USER
    actuator.gaintype = mujoco.mjtGain.mjGAIN_FIXED
    actuator.actdim = 2 if hill.tendon == "compliant" else 1
    actuator.ctrllimited = True
    actuator.ctrlrange = (0.0, 1.0)
    # limits of what was an activation would hold the fiber's length
    actuator.actlimited = False
    actuator.actearly = False
    actuator.gainprm[:] = 0.0
    actuator.dynprm[:] = _filled(hill.activation_time_constant, hill.deactivation_time_constant, size=mujoco.mjNDYN)
    actuator.biasprm[:] = _filled(
        hill.max_isometric_force,
        hill.optimal_fiber_length,
        hill.tendon_slack_length,
        hill.pennation_angle,
        hill.max_contraction_velocity,
        hill.fiber_damping,
        CURVES[hill.curves].tendon_stiffness(hill.tendon_strain),
        [*CURVES].index(hill.curves),
        size=mujoco.mjNBIAS,
    )


def _filled(*numbers: float, size: int) -> np.ndarray:
    return np.array([*numbers, *[0.0] * (size - len(numbers))])


def hill_actuators(model: mujoco.MjModel) -> np.ndarray:
    """Which actuators of a model are Hill-type muscles, a mask `(nu,)`."""
    return np.array(model.actuator_biastype == mujoco.mjtBias.mjBIAS_USER.value)


def check_hill(model: mujoco.MjModel) -> None:
    """Refuse actuators whose dynamics or bias is the user's, and that are no Hill-type muscles of this library: its
    callbacks would take them for such.

    **Raises:** `ValueError` naming the actuator.
    """
    user = (model.actuator_dyntype == mujoco.mjtDyn.mjDYN_USER) | hill_actuators(model)
    for i in np.flatnonzero(user):
        wanted = "a Hill-type muscle, as `set_hill` makes it: no other dynamics or biases of type 'user' are known here"
        check(_is_hill(model, int(i)), "actuator", model.actuator(i).name, wanted)


def _is_hill(model: mujoco.MjModel, i: int) -> bool:
    """Whether the callbacks can serve an actuator: it has all that `set_hill` sets, within the ranges of `Hill`."""
    numbers = model.actuator_biasprm[i]
    constants = model.actuator_dynprm[i]
    states = int(model.actuator_actnum[i])
    curves = numbers[7]
    stiffness = numbers[6]
    right = hill_actuators(model)[i] and model.actuator_dyntype[i] == mujoco.mjtDyn.mjDYN_USER
    right = right and model.actuator_gaintype[i] == mujoco.mjtGain.mjGAIN_FIXED and not model.actuator_gainprm[i].any()
    right = right and model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_TENDON and model.actuator_gear[i, 0] == 1
    right = right and states in (1, 2) and curves in range(len(CURVES)) and 0 < stiffness < math.inf
    right = right and not model.actuator_actlimited[i] and not numbers[8:].any()
    if not right:
        return False
    force, optimal, slack, pennation, fastest, damping = map(float, numbers[:6])
    rise, fall = map(float, constants[:2])
    try:
        tendon = "compliant" if states == 2 else "rigid"
        Hill(force, optimal, slack, pennation, fastest, rise, fall, damping, tendon)
    except ValueError:
        return False
    return True


def _curves_of(model: mujoco.MjModel, actuator: int) -> str:
    """The name of a muscle's curves."""
    return [*CURVES][int(model.actuator_biasprm[actuator, 7])]


def fibers(model: mujoco.MjModel) -> np.ndarray:
    """The actuators of a model that have a fiber whose length is a state."""
    return np.flatnonzero(hill_actuators(model) & (model.actuator_actnum == 2))


class HillState(NamedTuple):
    """Fiber and tendon of a muscle at a moment.

    - `fiber_length`, `tendon_length`: in m.
    - `pennation_angle`: in rad.
    - `tendon_strain`: negative while the tendon is slack.
    """

    fiber_length: float
    tendon_length: float
    pennation_angle: float
    tendon_strain: float


def read_hill(model: mujoco.MjModel, data: mujoco.MjData, actuator: int) -> HillState:
    """Fiber and tendon of a Hill-type muscle.

    **Arguments:** a model; MuJoCo's data of it, after `mj_forward`; the number of the actuator.

    **Raises:** `ValueError` for an actuator of another kind.
    """
    check(hill_actuators(model)[actuator], "actuator", model.actuator(actuator).name, "a Hill-type muscle")
    optimal, slack, pennation = (float(x) for x in model.actuator_biasprm[actuator, 1:4])
    length = float(data.actuator_length[actuator])
    height = math.sin(pennation)
    if model.actuator_actnum[actuator] == 2:
        first = model.actuator_actadr[actuator]
        states = np.array(data.act)[None]
        settle(model, states, np.array(data.actuator_length)[None])
        fiber = float(states[0, first])
        tendon = float(tendon_length(fiber, length, optimal, pennation))
    else:
        fiber = math.hypot(max(length - slack, 0.0) / optimal, height)
        tendon = slack
    angle = math.asin(min(height / fiber, 1.0)) if fiber else 0.0
    return HillState(fiber * optimal, tendon, angle, tendon / slack - 1.0 if slack else 0.0)


def hill_force(
    model: mujoco.MjModel, actuator: int, activation: float, length: npt.ArrayLike, velocity: npt.ArrayLike
) -> np.ndarray:
    """The force in N of a Hill-type muscle whose tendon is at rest, at lengths of the path in m and rates in m/s."""
    force, optimal, slack, pennation, fastest, damping, stiffness = model.actuator_biasprm[actuator, :7]
    numbers = (force, optimal, slack, pennation, fastest, damping)
    curves = _curves_of(model, actuator)
    law = with_curves(curves)
    if model.actuator_actnum[actuator] == 1:
        return law.rigid_tension(activation, length, velocity, *numbers)
    steady = np.vectorize(compiled_hill(curves).steady_fiber, [float])
    fiber = steady(activation, length, velocity, *numbers[1:], stiffness)
    return law.compliant_tension(fiber, length, force, optimal, slack, pennation, stiffness)


def settle(model: mujoco.MjModel, activation: np.ndarray, length: np.ndarray) -> None:
    """Put the fibers of length 0 in balance with their tendons, at rest.

    **Arguments:** a model; states `(rows, na)`, changed in place; lengths of the paths `(rows, nu)`, in m.
    """
    for actuator in fibers(model):
        steady = compiled_hill(_curves_of(model, actuator)).steady_fiber
        numbers = model.actuator_biasprm[actuator, 1:7]
        first = model.actuator_actadr[actuator]
        for row in np.flatnonzero(activation[:, first] <= 0.0):
            activation[row, first] = steady(activation[row, first + 1], length[row, actuator], 0.0, *numbers)
