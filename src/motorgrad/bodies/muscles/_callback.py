"""The muscle laws inside MuJoCo: installing the compiled callbacks, and checks that they are installed.

MuJoCo asks one process-wide C function for the gain of every actuator whose gain type is "user", and others for the
bias and the rates of states. Without the first it uses the gain 1, so a muscle would silently *push* with 1 N; without
the others a Hill-type muscle has no force. Therefore every path to a simulation calls `check_muscle_callback`.
"""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import ctypes
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from motorgrad.bodies.muscles._curve_sets import CURVES, with_curves
from motorgrad.bodies.muscles._machine_code import machine_code, probe
from motorgrad.bodies.muscles._muscle import tension

_WITHOUT = {
    "mjcb_act_gain": "muscles with gaintype 'user', which would push with gain 1",
    "mjcb_act_dyn": "Hill-type muscles, whose states would not change",
    "mjcb_act_bias": "Hill-type muscles, which would not pull",
}


def install_muscle_callback(model: mujoco.MjModel | mujoco.MjSpec | None = None) -> None:
    """Install the muscle laws as MuJoCo's callbacks for this process. Further calls do nothing.

    `compile_model` and `BodyBatch` call this. Call it yourself before simulating an exported MJCF file that has muscles
    of the "thesis" or "hill" model.

    **Arguments:** `model`: a model or a `mujoco.MjSpec`, for the callbacks that it needs; by default all.

    **Raises:** `RuntimeError` if another library's callback is installed, or if an installed law does not return the
    forces of its formula.
    """
    wanted = _WITHOUT if model is None else callbacks_of(model)
    for name in wanted:
        current = callback_getter(name)()
        ours = machine_code(name)
        if current is not None and _address(current) != _address(ours):
            raise RuntimeError(_foreign(name, current))
    missing = [name for name in wanted if callback_getter(name)() is None]
    for name in missing:
        _set(name, machine_code(name))
    try:
        if "mjcb_act_gain" in missing:
            _verify_thesis()
        if {"mjcb_act_dyn", "mjcb_act_bias"} & {*missing}:
            _verify_hill()
    except RuntimeError:
        for name in missing:
            _set(name, None)
        raise


def check_muscle_callback(model: mujoco.MjModel) -> None:
    """Check that a model's muscles pull.

    **Arguments:** `model`: any model; one without muscles of this library passes.

    **Raises:** `RuntimeError` if one of MuJoCo's callbacks that the model needs is missing or foreign.
    """
    for name in callbacks_of(model):
        current = callback_getter(name)()
        if current is None:
            raise RuntimeError(
                f"{name} = None: the model has {_WITHOUT[name]}; call motorgrad.bodies.install_muscle_callback() first"
            )
        if _address(current) != _address(machine_code(name)):
            raise RuntimeError(_foreign(name, current))


def callbacks_of(model: mujoco.MjModel | mujoco.MjSpec) -> tuple[str, ...]:
    """The names of MuJoCo's callbacks that a model, or a `mujoco.MjSpec`, needs."""
    kinds = {"gaintype": mujoco.mjtGain.mjGAIN_USER, "dyntype": mujoco.mjtDyn.mjDYN_USER}
    kinds["biastype"] = mujoco.mjtBias.mjBIAS_USER
    if isinstance(model, mujoco.MjSpec):
        found = {kind: np.array([getattr(each, kind) for each in model.actuators]) for kind in kinds}
    else:
        found = {kind: getattr(model, f"actuator_{kind}") for kind in kinds}
    thesis, *hill = (bool(np.any(found[kind] == user)) for kind, user in kinds.items())
    # the two of Hill-type muscles belong together
    return ("mjcb_act_gain",) * thesis + ("mjcb_act_dyn", "mjcb_act_bias") * any(hill)


def callback_getter(name: str) -> Any:
    """MuJoCo's function that returns the installed callback of this name, or None."""
    return getattr(mujoco, f"get_{name}")


def _set(name: str, callback: Callable[..., float] | None) -> None:
    getattr(mujoco, f"set_{name}")(callback)


def _foreign(name: str, callback: object) -> str:
    return (
        f"{name} = {callback!r}: a callback that is not motorgrad's muscle law is installed, and MuJoCo "
        f"has room for one; remove it with mujoco.set_{name}(None), or use muscle_model='native'"
    )


def _address(callback: Any) -> int | None:
    """The C address behind a ctypes function; None for a Python callable, which is never ours."""
    try:
        return ctypes.cast(callback, ctypes.c_void_p).value
    except ctypes.ArgumentError:
        return None


def _verify_thesis() -> None:
    """Compare the forces that MuJoCo computes through the callback with `tension`."""
    model, data = probe("mjcb_act_gain", 3, "tendon")
    data.ctrl[:] = (0.5, 1.0, 0.0)
    mujoco.mj_forward(model, data)
    prm = model.actuator_gainprm
    expected = -tension(data.ctrl, data.actuator_length, 0.0, -prm[:, 0], prm[:, 1], prm[:, 2])
    _same("mjcb_act_gain", "forces", data.actuator_force, expected)


def _verify_hill() -> None:
    """Compare the forces and the states after a step with the formulas, for tendons and curves of all kinds."""
    model, data = probe("mjcb_act_bias", 4, "tendon")
    data.ctrl[:] = (0.5, 1.0, 0.0, 0.7)
    data.qvel[:] = (0.1, -0.2, 0.05, 0.1)
    data.act[:] = (0.9, 0.4, 0.3, 1.1, 0.8, 0.6)
    mujoco.mj_forward(model, data)
    lengths = np.array(data.actuator_length)
    speeds = np.array(data.actuator_velocity)
    forces = np.zeros(4)
    states = np.array(data.act)
    step = model.opt.timestep
    for i, first in enumerate(model.actuator_actadr):
        force, optimal, slack, pennation, fastest, damping, stiffness, curves = (
            float(x) for x in model.actuator_biasprm[i, :8]
        )
        law = with_curves([*CURVES][int(curves)])
        last = first + model.actuator_actnum[i] - 1
        active = float(data.act[last])
        whole = (optimal, slack, pennation, fastest, damping)
        states[last] = law.next_activation(active, data.ctrl[i], step, *model.actuator_dynprm[i, :2])
        if last == first:
            forces[i] = law.rigid_tension(active, lengths[i], speeds[i], force, *whole)
            continue
        fiber = float(data.act[first])
        forces[i] = law.compliant_tension(fiber, lengths[i], force, optimal, slack, pennation, stiffness)
        states[first] = law.next_fiber(fiber, active, states[last], lengths[i], speeds[i], step, *whole, stiffness)
    _same("mjcb_act_bias", "forces", data.actuator_force, -forces)
    _same("mjcb_act_dyn", "states", data.act + step * data.act_dot, states)


def _same(name: str, what: str, found: np.ndarray, expected: np.ndarray) -> None:
    if not np.allclose(found, expected, rtol=1e-9, atol=1e-9):
        raise RuntimeError(f"{name}: the compiled muscle law gives {what} {found} instead of {expected}")
