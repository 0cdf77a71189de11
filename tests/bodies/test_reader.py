"""What is read of a body is what MuJoCo itself computes for that moment, and reading changes nothing."""

import mujoco
import numpy as np
import pytest

import motorgrad as mg
from motorgrad.bodies import BodyBatch, BodyReader, SlopeBatch, compile_model

MIXED = """<mujoco><option timestep="0.002"/><worldbody>
  <geom name="floor" type="plane" size="2 2 .1"/>
  <body name="cart" pos="0 0 .3"><joint name="slide" type="slide" axis="1 0 0" damping="1"/>
    <geom type="box" size=".1 .1 .05" mass="1" contype="0" conaffinity="0"/>
    <body name="pole"><joint name="hinge" axis="0 1 0" stiffness="2"/>
      <geom type="capsule" size=".02" fromto="0 0 0 0 0 .5"/><site name="tip" pos="0 0 .5"/></body></body>
  <body name="ball" pos="1 0 .11"><freejoint name="free"/><geom type="sphere" size=".1" mass=".5"/></body>
</worldbody><actuator>
  <motor name="push" joint="slide" gear="3" ctrllimited="true" ctrlrange="-.5 .5"/>
  <general name="lag" joint="hinge" dyntype="filter" dynprm=".1" gainprm="2"/>
</actuator><sensor><accelerometer name="felt" site="tip"/></sensor></mujoco>"""
BODIES = {
    "hopper": mg.bodies.Hopper(),
    "arm6": mg.bodies.Mjcf("arm6"),
    "hill": mg.bodies.Mjcf("arm6", muscle_model="hill"),
    "mixed": mg.bodies.Mjcf(MIXED),
}


def watched(batch, every=1):
    batch.watcher = BodyReader(batch, 1, every)
    return batch.watcher


@pytest.mark.parametrize("every", [None, 1, 3])
def test_reading_changes_nothing(every):
    alone, seen = BodyBatch(BODIES["hopper"], 3), BodyBatch(BODIES["hopper"], 3)
    watched(seen, every)
    rng = np.random.default_rng(0)
    for _ in range(40):
        control = rng.random((3, 2))
        alone.step(control)
        seen.step(control)
    np.testing.assert_array_equal(alone.physics, seen.physics)
    np.testing.assert_array_equal(alone.packed, seen.packed)


def of_mujoco(model, data, muscles):
    """MuJoCo's own quantities of a moment, and the force of all contacts on each part."""
    copied = mujoco.MjData(model)
    mujoco.mj_copyData(copied, model, data)
    mujoco.mj_forward(model, copied)
    found = {}
    for i in range(model.nu):
        name, kind, sign = model.actuator(i).name, *(("muscle", -1) if muscles else ("actuator", 1))
        found[f"{kind} length: {name}"] = copied.actuator_length[i]
        found[f"{kind} velocity: {name}"] = copied.actuator_velocity[i]
        found[f"{kind} force: {name}"] = sign * copied.actuator_force[i]
        if model.actuator_actadr[i] >= 0:
            found[f"{kind} activation: {name}"] = copied.act[model.actuator_actadr[i] + model.actuator_actnum[i] - 1]
    for i in np.flatnonzero(model.jnt_type >= int(mujoco.mjtJoint.mjJNT_SLIDE)):
        name, place, dof = model.joint(i).name, model.jnt_qposadr[i], model.jnt_dofadr[i]
        position, force = (
            ("angle", "torque") if model.jnt_type[i] == int(mujoco.mjtJoint.mjJNT_HINGE) else ("position", "force")
        )
        found[f"joint {position}: {name}"] = copied.qpos[place]
        found[f"joint velocity: {name}"] = copied.qvel[dof]
        found[f"joint {force}: {name}"] = copied.qfrc_actuator[dof]
        found[f"passive {force}: {name}"] = copied.qfrc_passive[dof]
    on, wrench = np.zeros((model.nbody, 3)), np.zeros(6)
    for i in range(copied.ncon):
        mujoco.mj_contactForce(model, copied, i, wrench)
        pressed = copied.contact[i].frame.reshape(3, 3).T @ wrench[:3]
        first, second = (model.geom_bodyid[geom] for geom in copied.contact[i].geom)
        on[second] += pressed
        on[first] -= pressed
    return found, {model.body(i).name: on[i] for i in range(1, model.nbody)}


@pytest.mark.parametrize("name", [*BODIES, pytest.param("myosuite", marks=pytest.mark.needs("motorgrad[myosuite]"))])
def test_every_quantity_is_that_of_its_moment(name):
    body = BODIES[name] if name in BODIES else mg.bodies.Mjcf("myosuite:myoElbowPose1D6MRandom-v0")
    batch = BodyBatch(body, 2, substeps=4)
    reader, model = watched(batch), compile_model(body)
    data = mujoco.MjData(model)
    mujoco.mj_setState(model, data, batch.physics[0], mujoco.mjtState.mjSTATE_INTEGRATION)
    rng, touched = np.random.default_rng(1), False

    def compare(reading):
        found = dict(zip((column.name for column in reader.columns), reading[0], strict=True))
        wanted, forces = of_mujoco(model, data, name != "mixed")
        assert found == pytest.approx(found | wanted, rel=1e-9, abs=1e-9)
        for part, force in forces.items():
            got = [found.get(f"contact force: {part} {axis}", 0.0) for axis in "xyz"]
            np.testing.assert_allclose(got, force, atol=1e-9 + 1e-9 * np.abs(force).max())
        return any(force.any() for force in forces.values())

    for _ in range(40):
        control = np.tile(rng.random(len(batch.groups)), (2, 1))
        batch.step(control)
        actuators = [model.actuator(each.name).id for each in mg.bodies.actuators_of(body)]
        data.ctrl[actuators] = control[0, mg.bodies.group_places(body)]
        for reading in reader.readings:
            touched |= compare(reading)
            mujoco.mj_step(model, data)
        touched |= compare(reader.end())
    assert touched == (name in ("hopper", "mixed"))


def test_columns_have_names_and_units():
    units = dict(BodyReader(BodyBatch(BODIES["mixed"], 1)).columns)
    assert {
        "joint position: slide": "m",
        "joint angle: hinge": "rad",
        "joint position: free 3": "m",
        "joint position: free 7": "1",
        "joint velocity: free 4": "rad/s",
        "joint force: slide": "N",
        "joint torque: hinge": "N m",
        "actuator length: push": "m",
        "actuator velocity: lag": "rad/s",
        "actuator force: lag": "N m",
        "contact force: ball z": "N",
        "sensor: felt x": "m/s²",
    }.items() <= units.items()
    assert not any(name.startswith(("muscle", "contact force: cart")) for name in units)


def test_the_length_of_a_fiber_is_that_of_its_state():
    batch = BodyBatch(BODIES["hill"], 1)
    reader = watched(batch, None)
    batch.step(np.full((1, 6), 0.7))
    names, model = [column.name for column in reader.columns], batch.model
    data = mujoco.MjData(model)
    mujoco.mj_setState(model, data, batch.physics[0], mujoco.mjtState.mjSTATE_INTEGRATION)
    mujoco.mj_forward(model, data)
    for i in range(model.nu):
        place = names.index(f"fiber length: {model.actuator(i).name}")
        assert reader.end()[0, place] == pytest.approx(mg.bodies.read_hill(model, data, i).fiber_length)


def test_controls_are_read_as_they_act():
    batch = BodyBatch(BODIES["mixed"], 1, substeps=2)
    reader = watched(batch)
    batch.step([[3.0, 3.0]])
    names = [column.name for column in reader.columns]
    read = reader.readings[0][0]
    assert read[names.index("actuator control: push")] == 0.5  # its range ends there
    assert read[names.index("actuator force: push")] == pytest.approx(0.5)
    assert read[names.index("actuator control: lag")] == 3.0


def test_a_slope_is_read_with_its_gravity():
    body = mg.bodies.Hexapod()
    batch = SlopeBatch(body, 2, substeps=2)
    reader = watched(batch)
    control = np.zeros((2, len(batch.groups) + 2))
    control[1, -2] = 0.3  # rad, of the second alone
    for _ in range(3):
        batch.step(control)
    level = BodyBatch(body, 2, substeps=2)
    flat = watched(level)
    for _ in range(3):
        level.step(control[:, :-2])
    np.testing.assert_array_equal(reader.end()[0], flat.end()[0])
    assert np.abs(reader.end()[1] - flat.end()[1]).max() > 1e-3


def test_bodies_that_differ_by_seed_are_refused():
    batch = BodyBatch([mg.bodies.Hopper(), mg.bodies.Hopper(load_mass=3.0)], 2)
    with pytest.raises(ValueError, match=r"2 models.*of one body"):
        BodyReader(batch)
