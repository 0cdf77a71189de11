"""The portable muscle: MuJoCo's built-in `muscle` gain shaped like the Gaussian of `tension`.

The built-in force–length curve is a bump of four parabolas between `lmin` and `lmax`, 1 at the rest length and ½ half
way to either end. Its half-width is the one free number; everything else of the built-in muscle is switched off.
"""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import math
from typing import Any

import mujoco
import numpy as np

from motorgrad.bodies._muscle import Muscle

# Half-width of the bump in units of √(2 k_CE). A matched curvature would be 1; this value makes the greatest deviation
# from the Gaussian least over |L/r − 1| ≤ 0.8 (for k_CE = 0.5), the range that the hopper's muscles use.
_WIDTH = 1.2
# The built-in force–velocity curve, made flat: full force at any speed that occurs.
_MAX_VELOCITY = 1e9


def set_native_gain(actuator: Any, muscle: Muscle) -> None:
    """Give an `MjsActuator` MuJoCo's `muscle` gain for `muscle`, without activation dynamics or passive force."""
    width = _half_width(muscle.shape)
    actuator.gaintype = mujoco.mjtGain.mjGAIN_MUSCLE
    # with this length range the normalised length is L / r
    actuator.lengthrange = (0.0, muscle.rest_length)
    # range (2), force, scale, lmin, lmax, vmax, fpmax (a matter of the passive bias, which stays off), fvmax
    actuator.gainprm[:9] = (0.0, 1.0, muscle.strength, 1.0, 1.0 - width, 1.0 + width, _MAX_VELOCITY, 1.0, 1.0)


def native_force_length(length: Any, rest_length: Any, shape: Any = 0.5) -> np.ndarray:
    """The force–length factor that `muscle_model="native"` has in place of the Gaussian.

    **Arguments:** path length and rest length in m, the Gaussian's $k_{CE}$; arrays broadcast.

    **Returns:** the factor, from 0 to 1.

    Source: MuJoCo's `mju_muscleGainLength`.
    """
    strain = np.abs(np.asarray(length) / rest_length - 1.0) / (_half_width(shape) / 2.0)
    return np.where(strain <= 1.0, 1.0 - 0.5 * strain**2, np.where(strain < 2.0, 0.5 * (2.0 - strain) ** 2, 0.0))


def _half_width(shape: Any) -> Any:
    return _WIDTH * math.sqrt(2.0) * np.sqrt(shape)
