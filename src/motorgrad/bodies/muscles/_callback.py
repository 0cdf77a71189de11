"""The muscle law inside MuJoCo: a compiled `mjcb_act_gain`, and checks that it is installed.

MuJoCo asks one process-wide C function for the gain of every actuator whose gain type is "user". Without one it uses
the gain 1, so a muscle would silently *push* with 1 N. Therefore every path to a simulation calls
`check_muscle_callback`. A function in machine code (here compiled by numba) runs without the interpreter, as a thread
pool requires.
"""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import ctypes
import functools
import warnings
from typing import Any

import mujoco
import numpy as np

from motorgrad.bodies.muscles._muscle import tension

_POINTER = ctypes.sizeof(ctypes.c_void_p)
# mjData has large fixed tables (timers, solver statistics) before its array pointers; this many bytes cover them.
_SCAN_LIMIT = 1 << 20
# An empty array has the address of the next one, so the neighbours of a match are candidates too.
_NEIGHBOURS = 64

# Slides whose position is the length, each with a fixed tendon, so that no array near the two in question is empty.
_PROBE = "<mujoco><worldbody>{}</worldbody><tendon>{}</tendon><actuator>{}</actuator></mujoco>"
_PROBE_BODY = '<body><joint name="j{i}" type="slide" ref="{length}"/><geom size=".1" contype="0"/></body>'
_PROBE_TENDON = '<fixed name="t{i}"><joint joint="j{i}" coef="1"/></fixed>'


def install_muscle_callback() -> None:
    """Install the muscle law as MuJoCo's gain callback for this process. Further calls do nothing.

    `compile_model` and `BodyBatch` call this. Call it yourself before simulating an exported MJCF file that has muscles
    of the "thesis" model.

    **Raises:** `RuntimeError` if another library's callback is installed, or if the installed law does not return the
    forces of `tension`.
    """
    current = mujoco.get_mjcb_act_gain()
    ours = _compiled_gain()
    if current is None:
        mujoco.set_mjcb_act_gain(ours)
        _verify_forces()
    elif _address(current) != _address(ours):
        raise RuntimeError(_foreign(current))


def check_muscle_callback(model: mujoco.MjModel) -> None:
    """Check that a model's muscles pull.

    **Arguments:** `model`: any model; one without user gains passes.

    **Raises:** `RuntimeError` if the model has user gains, and MuJoCo's gain callback is missing or foreign.
    """
    if not uses_callback(model):
        return
    current = mujoco.get_mjcb_act_gain()
    if current is None:
        raise RuntimeError(
            "mjcb_act_gain = None: the model has muscles with gaintype 'user', which would push with gain 1; "
            "call motorgrad.bodies.install_muscle_callback() first"
        )
    if _address(current) != _address(_compiled_gain()):
        raise RuntimeError(_foreign(current))


def uses_callback(model: mujoco.MjModel) -> bool:
    """Whether the model has an actuator whose gain comes from the callback."""
    return bool(np.any(model.actuator_gaintype == mujoco.mjtGain.mjGAIN_USER))


def _foreign(callback: Any) -> str:
    return (
        f"mjcb_act_gain = {callback!r}: a callback that is not motorgrad's muscle law is installed, and MuJoCo "
        "has room for one; remove it with mujoco.set_mjcb_act_gain(None), or use muscle_model='native'"
    )


def _address(callback: Any) -> int | None:
    """The C address behind a ctypes function; None for a Python callable, which is never ours."""
    try:
        return ctypes.cast(callback, ctypes.c_void_p).value
    except ctypes.ArgumentError:
        return None


@functools.cache  # also keeps the compiled function alive as long as the process
def _compiled_gain() -> Any:
    with warnings.catch_warnings():
        # numba probes optional packages on import, which may raise deprecation warnings of their own
        warnings.simplefilter("ignore")
        import numba  # imported late, as it takes longer than the rest of this package

    word = numba.types.CPointer(numba.types.CPointer(numba.types.float64))
    law = numba.njit(tension, error_model="numpy")
    parameters, lengths = _offsets()
    per_actuator = int(mujoco.mjNGAIN)

    @numba.cfunc(numba.types.float64(word, word, numba.types.int32), error_model="numpy")
    def gain(model, data, actuator):  # pragma: no cover - runs as machine code
        # the struct is read as a table of pointers, at the two places found by `_offsets`
        prm = model[parameters]
        first = actuator * per_actuator
        # strength is stored negative, because MuJoCo's force is positive when it lengthens a tendon
        return law(1.0, data[lengths][actuator], 0.0, prm[first], prm[first + 1], prm[first + 2], 0.0)

    gain_type = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int)
    address: Any = gain.address
    pointer: Any = gain_type(address)
    pointer.owner = gain  # keeps the machine code alive as long as the pointer
    return pointer


def _offsets() -> tuple[int, int]:
    """Where mjModel keeps `actuator_gainprm` and mjData `actuator_length`, counted in pointers from the struct's start.

    The addresses of both arrays are known, so their place is found by searching the structs of several small models.
    Exactly one place must fit all of them.
    """
    probes = [_probe(1, "joint"), _probe(2, "joint"), _probe(3, "tendon")]
    places = []
    for which, attribute in enumerate(("actuator_gainprm", "actuator_length")):
        fitting = set.intersection(*(_places(probe[which], attribute) for probe in probes))
        if len(fitting) != 1:
            raise RuntimeError(
                f"MuJoCo {mujoco.__version__}: {attribute} is at {len(fitting)} places of its struct instead of 1, so "
                "the muscle law cannot be installed; use mujoco>=4.0,<4.1, or muscle_model='native'"
            )
        places.append(fitting.pop())
    return places[0], places[1]


def _places(struct: Any, attribute: str) -> set[int]:
    """The indices of the struct's words that hold the address of the array `attribute`."""
    address = getattr(struct, attribute).ctypes.data

    def holds(index: int) -> bool:
        return ctypes.c_void_p.from_address(struct._address + index * _POINTER).value == address

    first = next(filter(holds, range(_SCAN_LIMIT // _POINTER)), None)
    # both structs have hundreds of further pointers after these arrays
    return set() if first is None else set(filter(holds, range(first, first + _NEIGHBOURS)))


def _probe(actuators: int, of: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A model with user-gain actuators of various lengths and parameters, each on its own joint or tendon."""
    numbers = range(actuators)
    model = mujoco.MjModel.from_xml_string(
        _PROBE.format(
            "".join(_PROBE_BODY.format(i=i, length=0.2 + 0.1 * i) for i in numbers),
            "".join(_PROBE_TENDON.format(i=i) for i in numbers) if of == "tendon" else "",
            "".join(
                f'<general {of}="{of[0]}{i}" gaintype="user" gainprm="{-100 - i} {0.25 + 0.03 * i} {0.5 + 0.1 * i}"/>'
                for i in numbers
            ),
        )
    )
    return model, mujoco.MjData(model)


def _verify_forces() -> None:
    """Compare the forces MuJoCo computes through the callback with `tension`; remove the callback on a mismatch."""
    model, data = _probe(3, "tendon")
    data.ctrl[:] = (0.5, 1.0, 0.0)
    mujoco.mj_forward(model, data)
    prm = model.actuator_gainprm
    expected = -tension(data.ctrl, data.actuator_length, 0.0, -prm[:, 0], prm[:, 1], prm[:, 2])
    if not np.allclose(data.actuator_force, expected, rtol=1e-12, atol=1e-9):
        mujoco.set_mjcb_act_gain(None)
        raise RuntimeError(
            f"mjcb_act_gain: the compiled muscle law gives forces {data.actuator_force} N instead of {expected} N"
        )
