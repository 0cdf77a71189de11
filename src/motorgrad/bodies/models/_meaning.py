"""What the numbers of a compiled model mean: whatever MuJoCo takes in and then computes nonsense from is refused."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import warnings
from collections.abc import Iterator

import mujoco
import numpy as np

from motorgrad._errors import check, check_not_negative, check_positive
from motorgrad.bodies.muscles._hill import check_hill
from motorgrad.bodies.muscles._muscle import check_thesis

_OBJECT_TYPES = {
    **{kind: kind for kind in ("body", "geom", "site", "pair", "tendon", "actuator", "sensor")},
    **{"dof": "joint", "jnt": "joint", "qpos0": "joint", "qpos": "joint"},
    **{"cam": "camera", "eq": "equality", "key": "keyframe"},
}
"""What a field of MuJoCo's model describes, by the beginning of its name."""
_SHORT = {"camera": "cam", "equality": "eq", "keyframe": "key"}
_LIMITS = ("tendon_range", "jnt_actfrcrange", "tendon_actfrcrange", "actuator_forcerange", "actuator_actrange")
"""Ranges with which MuJoCo only compares: one without an end has a meaning."""
_NOT_NEGATIVE = (
    *("dof_armature", "dof_damping", "dof_frictionloss", "tendon_damping", "tendon_frictionloss"),
    *("geom_friction", "pair_friction", "actuator_delay", "sensor_delay"),
)
_FLUID = ("density", "viscosity")
_MAX_VALUE = float(mujoco.mjMAXVAL)
_ROUNDED = 1 + 1e-9  # for a delay of a whole number of steps
_DYNAMICS = mujoco.mjtDyn


def check_meaning(model: mujoco.MjModel) -> None:
    """Refuse numbers of a model that mean nothing, and warn of those that will not do what they say.

    **Raises:** `ValueError` that names the part, the number given and what is allowed.
    """
    check_positive("option: timestep", float(model.opt.timestep))
    for name in dir(model.opt):
        if not name.startswith("_"):
            value = np.asarray(getattr(model.opt, name))
            check(np.isfinite(value).all(), f"option: {name}", value.tolist(), "finite")
    for name in _FLUID:
        check(getattr(model.opt, name) >= 0, f"option: {name}", getattr(model.opt, name), "at least 0")
    for name, values in _numbers(model):
        if name in _LIMITS:
            _check_each(model, name, np.isnan(values), "numbers")
        else:
            _check_each(model, name, ~np.isfinite(values), "finite")
    for name in _NOT_NEGATIVE:
        _check_each(model, name, getattr(model, name) < 0, "at least 0")
    for name in ("key_qpos", "key_qvel"):
        # beyond this MuJoCo resets the simulation, and a batch that has just begun cannot tell
        _check_each(model, name, np.abs(getattr(model, name)) > _MAX_VALUE, f"at most {_MAX_VALUE:g} in size")
    for i in range(model.nu):
        _check_actuator(model, i, _named(model, "actuator", i))
    for i in range(model.nsensor):
        _check_sensor(model, i, _named(model, "sensor", i))
    if noisy := [_named(model, "sensor", int(i)) for i in np.flatnonzero(model.sensor_noise)]:
        more = f" and {len(noisy) - 1} more" * (len(noisy) > 1)
        warnings.warn(f"noise of {noisy[0]}{more}: it has no effect, as MuJoCo adds none to readings", stacklevel=2)
    if mujoco.__version__ == "4.0.0" and _meets_fault(model):
        warnings.warn(
            "MuJoCo 4.0.0: its sparse Cholesky factors, and so accelerations, may be wrong where bodies that branch "
            "touch others; use <option jacobian='dense'/>, or MuJoCo 4.0.1 or later",
            stacklevel=2,
        )


def check_user_types(model: mujoco.MjModel) -> None:
    """Refuse actuators and sensors that MuJoCo leaves to the user, unless they are muscles of this library.

    **Raises:** `ValueError` that names the actuator or the sensor.
    """
    check_thesis(model)
    check_hill(model)
    for i in np.flatnonzero(model.sensor_type == mujoco.mjtSensor.mjSENS_USER):
        wanted = "of another type: what a sensor of type 'user' reads is known only to the program it was made for"
        check(False, "sensor", model.sensor(i).name, wanted)


def _meets_fault(model: mujoco.MjModel) -> bool:
    """Whether a model may meet the fault of MuJoCo 4.0.0 in the sparse Cholesky factorisation of Newton's solver.

    It merges rows with different descendants: where one of several bodies branches and touches another, accelerations
    are wrong by as much as themselves. In one body alone the error was 4 · 10⁻⁵ of the greatest at most.
    """
    if not mujoco.mj_isSparse(model) or model.opt.solver != mujoco.mjtSolver.mjSOL_NEWTON or model.ntree < 2:
        return False
    parents = model.dof_parentid[model.dof_parentid >= 0]
    return bool((np.bincount(parents) > 1).any())


def _numbers(model: mujoco.MjModel) -> Iterator[tuple[str, np.ndarray]]:
    """The fields with which physics computes, those that follow from others last. Users' own data may be anything."""
    names = [name for name in dir(model) if name.split("_")[0] in _OBJECT_TYPES and not name.endswith("_user")]
    for name in sorted(names, key=lambda name: name.endswith("0") and name != "qpos0"):
        values = getattr(model, name)
        if isinstance(values, np.ndarray) and values.dtype.kind == "f":
            yield name, values


def _check_each(model: mujoco.MjModel, field: str, wrong: np.ndarray, wanted: str) -> None:
    """Refuse the first part of a model for which a field is wrong, a mask of the field's shape."""
    if not wrong.any():
        return
    row = int(np.argwhere(wrong)[0, 0])
    start, _, what = field.partition("_")
    value = getattr(model, field)[row].tolist()
    if start == "dof":
        row = int(model.dof_jntid[row])
    elif start.startswith("qpos"):
        row = int(np.flatnonzero(model.jnt_qposadr <= row)[-1])
    check(False, f"{what or 'ref'} of {_named(model, _OBJECT_TYPES[start], row)}", value, wanted)


def _named(model: mujoco.MjModel, kind: str, i: int) -> str:
    """A part with its name, or its number where it has none."""
    name = getattr(model, _SHORT.get(kind, kind))(i).name
    return f"{kind} {name!r}" if name else f"{kind} {i + 1}"


def _check_actuator(model: mujoco.MjModel, i: int, which: str) -> None:
    constants = model.actuator_dynprm[i]
    dynamics = model.actuator_dyntype[i]
    _check_muscle(model, i, which)
    if dynamics == _DYNAMICS.mjDYN_MUSCLE:
        for name, value in zip(("activation", "deactivation"), constants[:2], strict=True):
            check_positive(f"time constant of {name} of {which}", float(value))
        # at an activation of 0, and at one of 1, MuJoCo takes half of them
        _warn_of_overshoot(model, which, min(constants[:2]) / 2)
    elif dynamics == _DYNAMICS.mjDYN_FILTER:
        check_positive(f"time constant of {which}", float(constants[0]))
        _warn_of_overshoot(model, which, constants[0])
    elif dynamics == _DYNAMICS.mjDYN_FILTEREXACT:
        check_not_negative(f"time constant of {which}", float(constants[0]))
    _check_delay(which, model.actuator_delay[i], model.actuator_history[i, 0], model.opt.timestep)
    limited = model.actuator_actlimited[i]
    low, high = model.actuator_actrange[i] if limited else (0.0, 1.0)
    first = model.actuator_actadr[i]
    count = model.actuator_actnum[i]
    for key in range(model.nkey if limited or dynamics == _DYNAMICS.mjDYN_MUSCLE else 0):
        active = model.key_act[key, first : first + count]
        right = (active >= low).all() and (active <= high).all()
        where = f"activation of {which} in {_named(model, 'keyframe', key)}"
        check(right, where, active.tolist(), f"from {low:g} to {high:g}")


def _check_muscle(model: mujoco.MjModel, i: int, which: str) -> None:
    """Refuse negative lengths of a muscle of MuJoCo's."""
    gain = model.actuator_gaintype[i]
    bias = model.actuator_biastype[i]
    for own, prm in (
        (gain == mujoco.mjtGain.mjGAIN_MUSCLE, model.actuator_gainprm[i]),
        (bias == mujoco.mjtBias.mjBIAS_MUSCLE, model.actuator_biasprm[i]),
    ):
        if own:
            wanted = "lengths of the fiber from 0 on, in optimal ones"
            check(prm[0] >= 0, f"range of {which}", prm[:2].tolist(), wanted)
            span = model.actuator_lengthrange[i]
            wanted = "lengths of the path from 0 on, in m"
            check(span[0] >= 0 or not _on_path(model, i), f"lengthrange of {which}", span.tolist(), wanted)


def _on_path(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether an actuator is on a tendon that is a path in space."""
    if model.actuator_trntype[actuator] != mujoco.mjtTrn.mjTRN_TENDON:
        return False
    first = model.tendon_adr[model.actuator_trnid[actuator, 0]]
    return model.wrap_type[first] != mujoco.mjtWrap.mjWRAP_JOINT


def _warn_of_overshoot(model: mujoco.MjModel, which: str, shortest: float) -> None:
    step = model.opt.timestep
    if step > shortest:
        message = (
            f"goes beyond what it approaches in a time step of {step:g} s; use a timestep of at most {shortest:g} s"
        )
        warnings.warn(f"{which}: its activation, with time constants from {shortest:g} s on, {message}", stacklevel=2)


def _check_sensor(model: mujoco.MjModel, i: int, which: str) -> None:
    samples = model.sensor_history[i, 0]
    every = model.sensor_interval[i, 0]
    _check_delay(which, model.sensor_delay[i], samples, every or model.opt.timestep)
    wanted = "left out, or nsample given: alone, it does nothing"
    check(every == 0 or samples, f"interval of {which}", float(every), wanted)


def _check_delay(which: str, delay: float, samples: int, every: float) -> None:
    if delay > 0:
        wanted = f"at most {samples * every:g} s, as nsample is {samples}"
        check(delay <= samples * every * _ROUNDED, f"delay of {which}", float(delay), wanted)
