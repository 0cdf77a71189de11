"""The law that the muscles' panel draws is the one that MuJoCo runs."""

import dataclasses
from pathlib import Path

import mujoco
import numpy as np
import pytest

from motorgrad.bodies import CURVES, Hexapod, Hopper, Mjcf, compile_model
from timsim.panels._muscle_law import Law
from timsim.panels._muscles import MIN_VELOCITY_RANGE, Range, draw_operating

MOTORS = """<mujoco><worldbody><body><joint name="hinge" damping="0.1"/><geom size=".1"/>
<body pos=".3 0 0"><joint name="slide" type="slide"/><geom size=".1"/></body></body></worldbody>
<actuator><motor joint="hinge" gear="3"/><position joint="slide" kp="20" kv="2"/></actuator></mujoco>"""
STRONG = """<mujoco><worldbody><site name="a" pos="0 0 .5"/><body><joint name="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 .4 0 0" size=".02"/><site name="b" pos=".2 0 .05"/></body></worldbody>
<tendon><spatial name="t" damping="3"><site site="a"/><site site="b"/></spatial></tendon>
<actuator><muscle name="m" tendon="t" force="200" range="0.7 1.2"/></actuator></mujoco>"""

MODELS = {
    "thesis": lambda: compile_model(Hopper()),
    "native": lambda: compile_model(dataclasses.replace(Hopper(), muscle_model="native")),
    "hexapod": lambda: compile_model(Hexapod()),
    "leg": lambda: mujoco.MjModel.from_xml_path(str(Path(__file__).parents[1] / "leg.xml")),
    "hill, rigid": lambda: compile_model(Mjcf("arm6", muscle_model="hill", tendon="rigid")),
    "hill, rigid, Millard": lambda: compile_model(Mjcf("arm6", muscle_model="hill", tendon="rigid", curves="millard")),
    "motors": lambda: mujoco.MjModel.from_xml_string(MOTORS),
    "muscle": lambda: mujoco.MjModel.from_xml_string(STRONG),
}


# the laws of Hill-type muscles are compiled to machine code; those of stretching tendons are below
@pytest.fixture(params=[pytest.param(name, marks=pytest.mark.ci if "hill" in name else ()) for name in MODELS])
def model(request):
    return MODELS[request.param]()


def states(model, count=6):
    """Random postures, velocities and activations, each after `mj_forward`."""
    numbers, data = np.random.default_rng(0), mujoco.MjData(model)
    start = model.key_qpos[0] if model.nkey else model.qpos0
    for _ in range(count):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = start
        mujoco.mj_integratePos(model, data.qpos, numbers.normal(size=model.nv), 0.2)
        data.qvel[:] = numbers.normal(size=model.nv)
        data.ctrl[:] = numbers.uniform(size=model.nu)
        data.act[:] = numbers.uniform(size=model.na)
        mujoco.mj_forward(model, data)
        yield data


def level(model, data, row):
    """What drives an actuator: its activation, or its control."""
    last = model.actuator_actadr[row] + model.actuator_actnum[row] - 1
    return data.act[last] if model.actuator_actnum[row] else data.ctrl[row]


def test_forces_are_the_engines(model):
    for data in states(model):
        for row in range(model.nu):
            law = Law(model, row)
            length, velocity = data.actuator_length[row], data.actuator_velocity[row]
            found = law.force(level(model, data, row), length, velocity)
            assert float(found) == pytest.approx(law.force_now(data), rel=1e-6, abs=1e-6)


def test_dampers_count():
    model = MODELS["thesis"]()
    data = next(states(model))
    law = Law(model, 0)
    passive = law.force(0.0, data.actuator_length[0], data.actuator_velocity[0])
    assert float(passive) == pytest.approx(8.0 * data.actuator_velocity[0])


def test_moment_arms_are_how_lengths_change(model):
    for data in states(model, 3):
        for row in range(model.nu):
            law, (names, values) = Law(model, row), ([], [])
            for arm in law.moment_arms(data):
                names.append(arm.joint)
                values.append(arm.metres)
            assert list(np.abs(values)) == sorted(np.abs(values), reverse=True)
            probe, step = mujoco.MjData(model), 1e-6
            for name, value in zip(names, values, strict=True):
                if names.count(name) > 1:  # a free joint has six
                    continue
                place = model.joint(name).qposadr[0]
                probe.qpos[:] = data.qpos
                lengths = []
                for sign in (-1, 1):
                    probe.qpos[place] = data.qpos[place] + sign * step
                    mujoco.mj_forward(model, probe)
                    lengths.append(probe.actuator_length[row])
                slope = (lengths[1] - lengths[0]) / (2 * step)
                assert value == pytest.approx(-slope if law.pulls else slope, abs=1e-4)


def test_a_muscle_is_strongest_at_its_rest_length():
    for kind in ("thesis", "native"):
        model = MODELS[kind]()
        law = Law(model, 0)
        lengths = np.linspace(0.5, 1.5, 201) * law.rest_length
        force = law.force(1.0, lengths, np.zeros(201))
        assert lengths[np.argmax(force)] == pytest.approx(law.rest_length)
        assert force.max() == pytest.approx(100.0)


def test_the_point_is_on_the_curve_and_the_range_holds_it(model):
    for data in states(model, 2):
        law, activation = Law(model, 0), float(level(model, data, 0))
        length, velocity = float(data.actuator_length[0]), float(data.actuator_velocity[0])
        where = Range((np.inf, -np.inf), MIN_VELOCITY_RANGE).holding(length, velocity, law.rest_length)
        assert where.length[0] < length < where.length[1]
        assert where.speed >= abs(velocity)
        made = draw_operating(law, activation, length, velocity, where, law.force_now(data))
        assert made.count("<circle") == 2
        assert "nan" not in made


@pytest.mark.ci
@pytest.mark.parametrize("curves", CURVES)
def test_a_stretched_tendon_has_the_force_of_its_steady_length(curves):
    model = compile_model(Mjcf("arm6", muscle_model="hill", curves=curves))
    data = mujoco.MjData(model)
    for state in np.random.default_rng(1).uniform(size=(5, 6)):
        mujoco.mj_resetDataKeyframe(model, data, 0)
        data.act[1::2] = state  # fibers of length 0 are in balance
        mujoco.mj_forward(model, data)
        for row in range(6):
            law = Law(model, row)
            assert float(law.force(state[row], data.actuator_length[row], 0.0)) == pytest.approx(law.force_now(data))
            hill = law.hill_now(data)
            assert hill is not None
            assert hill.fiber_length + hill.tendon_length == pytest.approx(data.actuator_length[row])
            assert law.force(1.0, law.rest_length, -0.1) < law.force(1.0, law.rest_length, 0.0)
    assert Law(MODELS["thesis"](), 0).hill_now(data) is None
