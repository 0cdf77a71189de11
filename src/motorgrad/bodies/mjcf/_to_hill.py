"""Hill-type muscles in place of MuJoCo's own, in any model."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import fnmatch
import warnings
from collections.abc import Sequence

import mujoco
import numpy as np

from motorgrad._errors import check, unknown
from motorgrad.bodies.muscles._hill import SPAN, Curves, Hill, Tendon, set_hill

_MUSCLE = (mujoco.mjtGain.mjGAIN_MUSCLE, mujoco.mjtBias.mjBIAS_MUSCLE, mujoco.mjtDyn.mjDYN_MUSCLE)
_MIN_SLACK = 0.1  # of the optimal length: below it, a model leaves no room for a tendon


def hill_of(model: mujoco.MjModel, actuator: int, tendon: Tendon = "compliant", curves: Curves = "de-groote") -> Hill:
    """The Hill-type muscle that resembles a `muscle` of MuJoCo.

    MuJoCo's muscle has a fiber on a rigid tendon, whose lengths follow from the range of the path: where that is
    shortest, the fiber has `range[0]` times its optimal length, and where it is longest, `range[1]` times. If the
    tendon would be shorter than a tenth of the optimal length, 0.4 and 1.5 are taken in place of both. Greatest force,
    greatest velocity in m/s and time constants are MuJoCo's.

    **Arguments:** a compiled model; the number of the actuator; `tendon` and `curves` of the Hill-type muscle.

    **Raises:** `ValueError` for an actuator that is no `muscle`, for one whose path changes its length too much, and
    for one with numbers that no `Hill` has.
    """
    name = model.actuator(actuator).name
    kinds = (model.actuator_gaintype, model.actuator_biastype, model.actuator_dyntype)
    is_muscle = all(kind[actuator] == muscle for kind, muscle in zip(kinds, _MUSCLE, strict=True))
    check(is_muscle, "actuator", name, "a muscle of MuJoCo, with dynamics, gain and bias of that type")
    if smooth := float(model.actuator_dynprm[actuator, 2]):
        warnings.warn(f"tausmooth of the muscle {name!r} = {smooth:g}: a Hill-type muscle has none", stacklevel=2)
    try:
        return _resembling(model, actuator, tendon, curves)
    except ValueError as error:
        raise ValueError(f"muscle {name!r}: {error}; give its numbers by `hill`") from None


def _resembling(model: mujoco.MjModel, actuator: int, tendon: Tendon, curves: Curves) -> Hill:
    numbers = model.actuator_gainprm[actuator]
    (low, high) = model.actuator_lengthrange[actuator]
    check(0 <= numbers[0] < numbers[1], "range", numbers[:2].tolist(), "rising, from 0 on")
    check(0 <= low < high, "lengthrange", [float(low), float(high)], "rising, from 0 on (m)")
    given, scale, fastest = (float(numbers[place]) for place in (2, 3, 6))
    force = given if given >= 0 else scale / float(model.actuator_acc0[actuator])
    rise, fall = (float(x) for x in model.actuator_dynprm[actuator, :2])
    for span in (numbers[:2], SPAN):
        optimal = (high - low) / (span[1] - span[0])
        if low - span[0] * optimal >= _MIN_SLACK * optimal:
            return Hill.spanning(
                (float(low), float(high)),
                force,
                tuple(map(float, span)),
                # the same velocity in m/s
                max_contraction_velocity=fastest * float((span[1] - span[0]) / (numbers[1] - numbers[0])),
                activation_time_constant=rise,
                deactivation_time_constant=fall,
                tendon=tendon,
                curves=curves,
            )
    raise ValueError(f"path = {low:.4g} to {high:.4g} m: must be less variable, so that there is room for a tendon")


def to_hill(
    spec: mujoco.MjSpec, model: mujoco.MjModel, numbers: Sequence[tuple[str, Hill]], tendon: Tendon, curves: Curves
) -> None:
    """Replace muscles of a description by Hill-type ones, in place.

    **Arguments:** the description, and the model compiled from it; `hill`, `tendon` and `curves` of `Mjcf`.
    """
    names = [each.name for each in spec.actuators]
    chosen: dict[str, Hill] = {}
    for pattern, hill in numbers:
        chosen |= dict.fromkeys(matching("actuator in hill", pattern, names), hill)
    for i, name in enumerate(names):
        on_path = model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_TENDON
        if name in chosen:
            check(on_path, f"actuator {name!r} in hill", model.actuator(i).name, "a muscle on a tendon")
        elif on_path and model.actuator_gaintype[i] == mujoco.mjtGain.mjGAIN_MUSCLE:
            chosen[name] = hill_of(model, i, tendon, curves)
    check(chosen, "muscle_model", "hill", "'native' for a model without muscles on tendons, or see `hill`")
    keys = np.array(model.key_act)
    for each in spec.actuators:
        if each.name in chosen:
            set_hill(each, chosen[each.name])
    for key, states in zip(spec.keys, keys, strict=True):
        key.act = [state for i in range(model.nu) for state in _states(spec.actuators[i], model, i, states)]


def matching(kind: str, pattern: str, known: Sequence[str]) -> list[str]:
    """The names that a name, or a pattern such as `flexor*`, means. **Raises** `ValueError` where it means none."""
    found = [name for name in known if name == pattern] or fnmatch.filter(known, pattern)
    if not found:
        raise unknown(kind, pattern, known)
    return found


def _states(actuator: mujoco.MjsActuator, model: mujoco.MjModel, i: int, before: np.ndarray) -> list[float]:
    """The states of an actuator in a keyframe: as before, and 0 for what is new."""
    first = int(model.actuator_actadr[i])
    count = int(model.actuator_actnum[i])
    old = before[first : first + count].tolist() if first >= 0 else []
    wanted = max(int(actuator.actdim), 1 if actuator.dyntype != mujoco.mjtDyn.mjDYN_NONE else 0)
    return [0.0] * (wanted - len(old)) + old
