"""The muscle law in MuJoCo against its formula, the guard around the callback, and the portable variant."""

import ctypes
import dataclasses

import mujoco
import numpy as np
import pytest

from motorgrad import bodies
from motorgrad.bodies import Attachment, Hopper, Muscle, Wrap
from motorgrad.bodies.muscles._layout import place_of_array
from motorgrad.bodies.muscles._machine_code import probe


def one_muscle(muscle_model: str = "thesis", **changes) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A muscle along x from the world to a ball on a slide: its length is the joint's position."""
    spec = mujoco.MjSpec()
    ball = spec.worldbody.add_body(name="ball")
    ball.add_joint(name="x", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(1, 0, 0))
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(0.02, 0, 0), mass=1.5)
    numbers = {"strength": 320.0, "rest_length": 0.21, "damping": 7.0, "shape": 0.4} | changes
    origin, insertion = Attachment("world", (0, 0, 0)), Attachment("ball", (0, 0, 0))
    bodies.add_muscles(spec, [Muscle("m", "g", origin, insertion, **numbers)], muscle_model)
    model = bodies.compile_model(spec)
    return model, mujoco.MjData(model)


@pytest.mark.parametrize("activation", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("length", [0.03, 0.15, 0.21, 0.3, 0.6])
def test_forces_are_those_of_the_law(activation, length):
    model, data = one_muscle()
    data.qpos[0], data.qvel[0], data.ctrl[0] = length, -0.7, activation
    mujoco.mj_forward(model, data)
    contractile = activation * 320.0 * np.exp(-((length / 0.21 - 1.0) ** 2) / 0.4)
    np.testing.assert_allclose(data.actuator_force[0], -contractile, rtol=1e-12)
    # the whole tension pulls the ball towards the origin; x is the length, so the force along x is minus the tension
    total = data.qfrc_actuator[0] + data.qfrc_passive[0]
    np.testing.assert_allclose(total, -(contractile + 7.0 * -0.7), rtol=1e-12)
    law = bodies.tension(activation, length, -0.7, 320.0, 0.21, 0.4, 7.0)
    np.testing.assert_allclose(-total, law, rtol=1e-12)


def test_law_broadcasts():
    lengths = np.linspace(0.1, 0.4, 7)
    out = bodies.tension(np.ones((3, 1)), lengths, 0.0, 100.0, 0.25)
    assert out.shape == (3, 7)
    assert np.argmax(out[0]) == 3  # at the rest length
    np.testing.assert_allclose(out[0, 3], 100.0)


def test_activation_is_clamped_by_the_model():
    model, data = one_muscle()
    data.qpos[0], data.ctrl[0] = 0.21, 3.0
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.actuator_force[0], -320.0, rtol=1e-12)


def test_missing_callback_is_an_error():
    model, _ = one_muscle()
    mujoco.set_mjcb_act_gain(None)
    with pytest.raises(RuntimeError, match=r"mjcb_act_gain = None.*push.*install_muscle_callback"):
        bodies.check_muscle_callback(model)
    bodies.install_muscle_callback()
    bodies.check_muscle_callback(model)


def test_foreign_callback_is_an_error():
    model, _ = one_muscle()
    kind = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int)
    foreign = kind(lambda model, data, i: 1.0)
    for callback in (foreign, lambda model, data, i: 1.0):
        mujoco.set_mjcb_act_gain(None)
        mujoco.set_mjcb_act_gain(callback)
        for attempt in (
            lambda: bodies.check_muscle_callback(model),
            bodies.install_muscle_callback,
            lambda: bodies.compile_model(Hopper()),
            lambda: bodies.BodyBatch(Hopper(), seeds=1),
        ):
            with pytest.raises(RuntimeError, match=r"mjcb_act_gain = .*not motorgrad's muscle law"):
                attempt()
        bodies.check_muscle_callback(bodies.compile_model(Hopper(muscle_model="native")))  # needs none


def test_arrays_are_where_mujoco_describes_them():
    """Their addresses are those that MuJoCo's Python module gives, by another way."""
    for callback in ("mjcb_act_gain", "mjcb_act_bias"):
        for struct in probe(callback, 3, "tendon"):
            for name in ("actuator_length", "actuator_gainprm", "actuator_biasprm", "ctrl", "qvel", "qpos0"):
                if hasattr(struct, name):
                    pointer = struct._address + place_of_array(struct, name) * ctypes.sizeof(ctypes.c_void_p)
                    found = ctypes.c_void_p.from_address(pointer).value
                    assert found == getattr(struct, name).ctypes.data


def test_a_place_that_does_not_hold_what_it_should_is_an_error():
    """These numbers are within the struct, which holds no pointer to them."""
    _, data = probe("mjcb_act_gain", 1, "joint")
    with pytest.raises(RuntimeError, match=r"MjData.solver_fwdinv is not where.*cannot be installed"):
        place_of_array(data, "solver_fwdinv")


def test_batch_notices_a_callback_that_vanishes():
    batch = bodies.BodyBatch(Hopper(), seeds=1, threads=1)
    mujoco.set_mjcb_act_gain(None)
    with pytest.raises(RuntimeError, match="mjcb_act_gain"):
        batch.step([[1.0, 1.0]])


def test_native_muscle_follows_its_curve_and_stays_near_the_gaussian():
    model, data = one_muscle("native", shape=0.5)
    strain = np.linspace(-0.95, 1.5, 99)
    data.qvel[0] = -0.7
    data.ctrl[0] = 0.5
    forces = []
    for length in 0.21 * (1.0 + strain):
        data.qpos[0] = length
        mujoco.mj_forward(model, data)
        forces.append(-data.actuator_force[0] / (0.5 * 320.0))
    np.testing.assert_allclose(forces, bodies.native_force_length(0.21 * (1 + strain), 0.21), atol=1e-7)
    deviation = np.abs(np.array(forces) - np.exp(-(strain**2) / 0.5))
    # the figures of docs/bodies.md
    assert deviation[np.abs(strain) <= 0.25].max() < 0.032
    assert deviation[np.abs(strain) <= 0.8].max() < 0.056
    assert 0.07 < deviation.max() < 0.09


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"strength": 0.0}, r"strength = 0.0: must be a finite number above 0, in N"),
        ({"strength": float("nan")}, "strength = nan"),
        ({"rest_length": -0.1}, "rest_length = -0.1"),
        ({"shape": 0}, "shape = 0"),
        ({"damping": -1.0}, "damping = -1.0: must be a finite number of at least 0, in N s/m"),
        ({"group": ""}, "group = ''"),
        ({"name": ""}, "name = ''"),
    ],
)
def test_bad_muscles_are_refused(changes, message):
    good = Muscle("m", "g", Attachment("a", (0, 0, 0)), Attachment("b", (0, 0, 0)), 100.0, 0.2)
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(good, **changes)


def test_a_point_may_be_an_array():
    assert Attachment("thigh_left", np.arange(3)) == Attachment("thigh_left", (0.0, 1.0, 2.0))  # type: ignore[arg-type]


def test_bad_attachments_and_paths_are_refused():
    with pytest.raises(ValueError, match="a list of 3 entries"):
        Attachment("thigh_left", (0.0, 1.0))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="geom = ''"):
        Wrap("", "side")
    good = Hopper().muscles[0]
    for change, message in (
        ({"origin": Attachment("thigh_lift", (0, 0, 0))}, "unknown body 'thigh_lift': did you mean 'thigh_left'"),
        ({"wrap": Wrap("capsule_lefft", "front_left")}, "unknown geom 'capsule_lefft': did you mean 'capsule_left'"),
        ({"wrap": Wrap("capsule_left", "front_leftt")}, "unknown site 'front_leftt': did you mean 'front_left'"),
        ({}, "Muscle.name = 'flexor_left': must be different"),
    ):
        extra = dataclasses.replace(good, **({"name": "more"} if change else {}), **change)
        with pytest.raises(ValueError, match=message):
            Hopper(extra_muscles=(extra,)).spec()
    with pytest.raises(ValueError, match="at least one muscle"):
        bodies.add_muscles(mujoco.MjSpec(), [])
