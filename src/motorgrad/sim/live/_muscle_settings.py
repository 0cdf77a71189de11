"""The numbers of a model's muscles that can be changed while it runs."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)

from collections.abc import Callable
from typing import Any, NamedTuple

import mujoco
import numpy as np

from motorgrad._errors import check

FIELDS = ("actuator_gainprm", "actuator_biasprm", "actuator_lengthrange", "tendon_damping")
"""The arrays of a model in which these numbers are."""


class Number(NamedTuple):
    """Where a number is: how to read it from a model, how to put it there, and the least it can be."""

    get: Callable[[Any], float]
    put: Callable[[Any, float], None]
    positive: bool = False


def muscle_numbers(model: Any) -> dict[str, Number]:
    """By name, such as `body.flexor.strength` (N), `.rest_length` (m) and `.damping` (N s/m), of every muscle.

    A muscle is an actuator on a tendon whose gain is this library's, MuJoCo's `muscle`, or one constant pull.
    """
    kinds, found = mujoco.mjtGain, {}
    for i in range(model.nu):
        if model.actuator_trntype[i] != mujoco.mjtTrn.mjTRN_TENDON:
            continue
        name, gain = f"body.{model.actuator(i).name or i}", model.actuator_gaintype[i]
        tendon = int(model.actuator_trnid[i, 0])
        if gain == kinds.mjGAIN_USER:
            found[f"{name}.strength"] = _at("actuator_gainprm", (i, 0), -1.0)
            found[f"{name}.rest_length"] = _at("actuator_gainprm", (i, 1), positive=True)
        elif gain == kinds.mjGAIN_FIXED and model.actuator_gainprm[i, 0] < 0:
            found[f"{name}.strength"] = _at("actuator_gainprm", (i, 0), -1.0)
        elif gain == kinds.mjGAIN_MUSCLE:
            found[f"{name}.strength"] = _strength(i)
            if model.actuator_lengthrange[i, 0] == 0:  # whose range is the rest length, as this library makes them
                found[f"{name}.rest_length"] = _at("actuator_lengthrange", (i, 1), positive=True)
        else:
            continue
        first = (tendon, 0) if model.tendon_damping.ndim == 2 else (tendon,)
        found[f"{name}.damping"] = _at("tendon_damping", first)
    return found


def check_number(name: str, number: Number, value: float) -> None:
    """Refuse what no muscle can have."""
    check(value > 0 if number.positive else value >= 0, name, value, "above 0" if number.positive else "at least 0")


def fields_of(model: Any) -> dict[str, np.ndarray]:
    """Copies of the arrays in which the numbers are."""
    return {name: np.array(getattr(model, name)) for name in FIELDS}


def _at(field: str, place: tuple[int, ...], sign: float = 1.0, positive: bool = False) -> Number:
    def put(model: Any, value: float) -> None:
        getattr(model, field)[place] = sign * value

    return Number(lambda model: sign * float(getattr(model, field)[place]), put, positive)


def _strength(actuator: int) -> Number:
    """The peak force of MuJoCo's muscle, which may be given by its `scale` instead; the passive force has its own."""

    def get(model: Any) -> float:
        given, scale = model.actuator_gainprm[actuator, 2:4]
        return float(given if given >= 0 else scale / max(model.actuator_acc0[actuator], mujoco.mjMINVAL))

    def put(model: Any, value: float) -> None:
        model.actuator_gainprm[actuator, 2] = value
        if model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_MUSCLE:
            model.actuator_biasprm[actuator, 2] = value

    return Number(get, put)
