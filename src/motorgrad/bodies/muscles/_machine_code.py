"""The laws of muscles in machine code, as the C functions that MuJoCo calls.

A function in machine code (compiled by numba) runs without the interpreter, as a thread pool requires. It receives
pointers to mjModel and mjData, and reads these structs as tables of pointers: `_layout` takes the place of each pointer
from MuJoCo's own description of the structs.
"""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import ctypes
import functools
import types
import warnings
from collections.abc import Sequence
from typing import Any

import mujoco

from motorgrad.bodies.muscles._curve_sets import CURVES, hill_curves, with_curves
from motorgrad.bodies.muscles._layout import place_of_array, place_of_timestep
from motorgrad.bodies.muscles._muscle import tension
from motorgrad.bodies.muscles._stored_code import compiled

# Slides whose position is the length, each with a fixed tendon.
_PROBE = '<mujoco><option timestep="{}"/><worldbody>{}</worldbody><tendon>{}</tendon><actuator>{}</actuator></mujoco>'
_PROBE_BODY = '<body><joint name="j{i}" type="slide" ref="{length}"/><geom size=".1" contype="0"/></body>'
_PROBE_TENDON = '<fixed name="t{i}"><joint joint="j{i}" coef="1"/></fixed>'
_PROBE_ACTUATOR = {
    "mjcb_act_gain": '<general {of}="{of[0]}{i}" gaintype="user" gainprm="{force} {rest} {shape}"/>',
    "mjcb_act_bias": '<general {of}="{of[0]}{i}" dyntype="user" actdim="{states}" biastype="user" gainprm="0" '
    'dynprm="{rise} .06" biasprm="{force} {rest} .1 .3 10 .1 36 {curves}"/>',
}


@functools.cache
def compiled_hill(curves: str) -> types.SimpleNamespace:
    """The functions of Hill-type muscles that have some curves, compiled, by name."""
    numba = _numba()
    helpers = {each.__name__ for each in hill_curves(curves).helpers}

    def inlined(function: types.FunctionType) -> Any:
        name = function.__name__
        # without a way in from Python, which only one of them needs, they compile faster
        inner = {"no_cpython_wrapper": name != "steady_fiber", "no_cfunc_wrapper": True}
        # a helper is called at many places, and faster if it is not written out at each
        return numba.njit(function, error_model="numpy", forceinline=name not in helpers, **inner)

    return with_curves(curves, inlined)


def _with_any_curves(name: str) -> Any:
    """A compiled function of Hill-type muscles; the number of the curves comes before its other arguments."""
    first, second = (getattr(compiled_hill(curves), name) for curves in CURVES)

    def law(curves, *arguments):  # pragma: no cover - runs as machine code
        return first(*arguments) if curves == 0.0 else second(*arguments)

    return _numba().njit(law, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)


@functools.cache  # also keeps the compiled functions alive as long as the process
def machine_code(name: str) -> Any:
    """The C function for a callback of MuJoCo, such as `mjcb_act_gain`."""
    numba = _numba()
    word = numba.types.CPointer(numba.types.CPointer(numba.types.float64))
    body = {"mjcb_act_gain": _gain, "mjcb_act_dyn": _dynamics, "mjcb_act_bias": _bias}[name]()
    made = compiled(body, numba.types.float64(word, word, numba.types.int32))
    pointer: Any = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int)(made.address)
    pointer.owner = made  # keeps the machine code alive as long as the pointer
    return pointer


def _numba() -> Any:
    with warnings.catch_warnings():
        # numba probes optional packages on import, which may raise deprecation warnings of their own
        warnings.simplefilter("ignore")
        import numba  # imported late, as it takes longer than the rest of this package
    return numba


def _gain() -> Any:
    """The thesis's law: the gain, by which MuJoCo multiplies the activation."""
    law = _numba().njit(tension, error_model="numpy")
    parameters, lengths = _places("mjcb_act_gain", ("actuator_gainprm",), ("actuator_length",))
    size = int(mujoco.mjNGAIN)

    def gain(model, data, actuator):  # pragma: no cover - runs as machine code
        prm = model[parameters]
        first = actuator * size
        # strength is stored negative, because MuJoCo's force is positive when it lengthens a tendon
        return law(1.0, data[lengths][actuator], 0.0, prm[first], prm[first + 1], prm[first + 2], 0.0)

    return gain


def _bias() -> Any:
    """The force of a Hill-type muscle, which is negative where it pulls."""
    whole = _cast("int32")
    steady, rigid, compliant = map(_with_any_curves, ("steady_fiber", "rigid_tension", "compliant_tension"))
    parameters, address, count, lengths, velocities, states = _places(
        "mjcb_act_bias",
        ("actuator_biasprm", "actuator_actadr", "actuator_actnum"),
        ("actuator_length", "actuator_velocity", "act"),
    )
    size = int(mujoco.mjNBIAS)

    def bias(model, data, actuator):  # pragma: no cover - runs as machine code
        prm = model[parameters]
        at = actuator * size
        first = whole(model[address])[actuator]
        length = data[lengths][actuator]
        force = prm[at]
        optimal = prm[at + 1]
        slack = prm[at + 2]
        pennation = prm[at + 3]
        fastest = prm[at + 4]
        damping = prm[at + 5]
        stiffness = prm[at + 6]
        curves = prm[at + 7]
        if whole(model[count])[actuator] == 1:
            velocity = data[velocities][actuator]
            active = data[states][first]
            return -rigid(curves, active, length, velocity, force, optimal, slack, pennation, fastest, damping)
        fiber = data[states][first]
        active = data[states][first + 1]
        if fiber <= 0.0:
            fiber = steady(curves, active, length, 0.0, optimal, slack, pennation, fastest, damping, stiffness)
        return -compliant(curves, fiber, length, force, optimal, slack, pennation, stiffness)

    return bias


def _dynamics() -> Any:
    """The rates of a Hill-type muscle's states.

    MuJoCo adds each, times its time step, to the state. A rate here is the difference to the state after the step,
    divided by the step: so a state after MuJoCo's step is what `next_activation` and `next_fiber` compute.
    """
    whole = _cast("int32")
    real = _cast("float64")
    step = place_of_timestep(probe("mjcb_act_bias", 1, "joint")[0])
    shift, steady = map(_with_any_curves, ("next_fiber", "steady_fiber"))
    advance = compiled_hill("de-groote").next_activation  # the same with all curves
    dynamics, parameters, address, count, controls, lengths, velocities, states, rates, control = _places(
        "mjcb_act_bias",
        ("actuator_dynprm", "actuator_biasprm", "actuator_actadr", "actuator_actnum", "actuator_ctrladr"),
        ("actuator_length", "actuator_velocity", "act", "act_dot", "ctrl"),
    )
    many = int(mujoco.mjNDYN)
    size = int(mujoco.mjNBIAS)

    def rate(model, data, actuator):  # pragma: no cover - runs as machine code
        seconds = real(model)[step]
        first = whole(model[address])[actuator]
        own = model[dynamics]
        excitation = data[control][whole(model[controls])[actuator]]
        rise = own[actuator * many]
        fall = own[actuator * many + 1]
        last = first + whole(model[count])[actuator] - 1
        active = data[states][last]
        prm = model[parameters]
        at = actuator * size
        length = data[lengths][actuator]
        curves = prm[at + 7]
        later = advance(active, excitation, seconds, rise, fall)
        if last == first:
            return (later - active) / seconds
        optimal = prm[at + 1]
        slack = prm[at + 2]
        pennation = prm[at + 3]
        fastest = prm[at + 4]
        damping = prm[at + 5]
        stiffness = prm[at + 6]
        velocity = data[velocities][actuator]
        now = fiber = data[states][first]
        if fiber <= 0.0:
            fiber = steady(curves, active, length, 0.0, optimal, slack, pennation, fastest, damping, stiffness)
        held = (optimal, slack, pennation, fastest, damping, stiffness)
        new = shift(curves, fiber, active, later, length, velocity, seconds, *held)
        # with several states MuJoCo expects their rates here, and ignores what is returned
        data[rates][first] = (new - now) / seconds
        data[rates][last] = (later - active) / seconds
        return 0.0

    return rate


def _cast(kind: str) -> Any:
    """A function in machine code that reads a pointer as one to numbers of a kind, such as `"int32"`."""
    numba = _numba()
    wanted = numba.types.CPointer(getattr(numba.types, kind))

    @numba.extending.intrinsic
    def cast(context, pointer):
        def generate(context, builder, signature, arguments):
            return builder.bitcast(arguments[0], context.get_value_type(wanted))

        return wanted(pointer), generate

    return cast


def _places(callback: str, model: Sequence[str], data: Sequence[str]) -> list[int]:
    """Where mjModel and mjData keep arrays, counted in pointers from the struct's start."""
    probes = probe(callback, 2, "tendon")
    return [place_of_array(each, name) for each, names in zip(probes, (model, data), strict=True) for name in names]


def probe(callback: str, actuators: int, of: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A model with muscles that a callback serves, of various lengths and numbers, each on its own joint or tendon.

    Of Hill-type muscles, every second has a rigid tendon, and every second pair other curves.
    """
    numbers = range(actuators)
    model = mujoco.MjModel.from_xml_string(
        _PROBE.format(
            0.001 + 0.00012345 * actuators,
            "".join(_PROBE_BODY.format(i=i, length=0.2 + 0.1 * i) for i in numbers),
            "".join(_PROBE_TENDON.format(i=i) for i in numbers) if of == "tendon" else "",
            "".join(
                _PROBE_ACTUATOR[callback].format(
                    of=of,
                    i=i,
                    force=(100 + i) * (-1 if callback == "mjcb_act_gain" else 1),
                    rest=0.25 + 0.03 * i if callback == "mjcb_act_gain" else 0.1 + 0.08 * i,
                    shape=0.5 + 0.1 * i,
                    states=2 - i % 2,
                    rise=0.02 + 0.003 * i,
                    curves=i // 2 % 2,
                )
                for i in numbers
            ),
        )
    )
    return model, mujoco.MjData(model)
