"""The hopper's mechanics against what can be said of them without simulating."""

import dataclasses

import mujoco
import numpy as np
import pytest

from motorgrad import bodies
from motorgrad.bodies import Attachment, BodyBatch, Hopper, Muscle

GRAVITY = 9.81


def simulate(body, control, steps=600, lift=0.0, model=None):
    """Positions (steps, nq), and the final data, from the start pose raised by `lift` m."""
    model = model or bodies.compile_model(body)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qpos[0] += lift
    data.ctrl[:] = control
    positions = np.empty((steps, model.nq))
    for i in range(steps):
        mujoco.mj_step(model, data)
        positions[i] = data.qpos
    mujoco.mj_forward(model, data)
    return positions, data


def test_masses_add_up():
    for body, mass in ((Hopper(), 2.0 + 4 * 0.15 + 0.2), (Hopper(load_mass=3.0, foot_mass=0.5), 3.0 + 0.6 + 0.5)):
        assert bodies.compile_model(body).body_mass.sum() == pytest.approx(mass, abs=1e-12)


def test_start_pose_stands_on_the_floor_at_right_angles():
    state = (batch := BodyBatch(Hopper(), 2)).unpack(batch.packed)
    assert state.sensors["foot_height"] == pytest.approx(0.0, abs=1e-9)
    assert state.sensors["knee_angle"] == pytest.approx(0.0)
    assert state.sensors["load_height"] == pytest.approx(2 * 0.25 * np.sin(np.pi / 4) + 0.03, abs=1e-6)


@pytest.mark.parametrize("lateral", ["symmetric", "spring"])
def test_comes_to_rest_on_the_floor(lateral):
    _, data = simulate(Hopper(lateral=lateral), 0.0, steps=2500)
    assert data.sensor("foot_contact").data[0] == pytest.approx(2.8 * GRAVITY, rel=1e-3)
    assert abs(data.qvel).max() < 1e-3
    assert data.sensor("foot_height").data[2] == pytest.approx(0.0, abs=2e-3)


@pytest.mark.parametrize("control", [(0, 1, 0, 1), (1, 0, 1, 0), (1, 1, 1, 1)])
def test_foot_stays_level_loop_closed_and_knees_equal(control):
    positions, data = simulate(Hopper(), control)
    assert data.body("foot").xmat.reshape(3, 3)[0, 2] == pytest.approx(0.0, abs=0.01)
    np.testing.assert_allclose(positions[:, 5], positions[:, 2], atol=0.01)
    np.testing.assert_allclose(positions[:, 3], -positions[:, 2] / 2, atol=0.01)
    foot, shank = data.body("foot"), data.body("shank_right")
    end = shank.xpos + shank.xmat.reshape(3, 3) @ (0, 0, -0.25)
    np.testing.assert_allclose(end, foot.xpos, atol=1e-3)


def test_knee_stops_hold_under_full_activation():
    for control in ((0, 1, 0, 1), (1, 0, 1, 0)):
        positions, _ = simulate(Hopper(), control, steps=1500)
        knees = 90.0 + np.degrees(positions[:, [2, 5]])
        assert knees.min() > 36.0
        assert knees.max() < 155.0


def test_falls_freely():
    steps, h = 300, 0.001
    positions, data = simulate(Hopper(), 0.0, steps=steps, lift=1.0)
    n = np.arange(1, steps + 1)
    # the closed form of free fall under MuJoCo's semi-implicit step
    np.testing.assert_allclose(positions[:, 0], 1.0 - GRAVITY * h * h * n * (n + 1) / 2, atol=1e-6)
    np.testing.assert_allclose(positions[:, 1:], 0.0, atol=1e-6)
    assert data.sensor("foot_contact").data[0] == 0.0


def test_extending_lifts_off():
    positions, _ = simulate(Hopper(), (0, 1, 0, 1))
    assert positions[:, 0].max() > 0.4


def test_only_the_foot_touches_the_floor():
    model = bodies.compile_model(Hopper())
    touching = [model.geom(i).name for i in range(model.ngeom) if model.geom_contype[i] or model.geom_conaffinity[i]]
    assert sorted(touching) == ["floor", "foot"]


def test_spring_lets_the_body_lean_and_brings_it_back():
    model = bodies.compile_model(Hopper(lateral="spring"))
    data = mujoco.MjData(model)
    data.qpos[:] = (1.0, 0.1, 0.0, 0.0, -0.1, 0.0)  # a lean of .1 rad, in the air
    leans = []
    for _ in range(400):
        mujoco.mj_step(model, data)
        leans.append(data.body("foot").xpos[0])
    assert abs(leans[0]) > 0.03
    assert abs(leans[-1]) < 0.005
    held, _ = simulate(Hopper(), 0.0, lift=1.0, steps=400)
    assert abs(held[:, 1] - held[:, 4]).max() < 1e-6


@pytest.mark.parametrize("muscle_model", ["thesis", "native"])
@pytest.mark.parametrize("lateral", ["symmetric", "spring"])
def test_export_simulates_identically(muscle_model, lateral):
    body = Hopper(muscle_model=muscle_model, lateral=lateral, load_mass=1.7)
    again = mujoco.MjModel.from_xml_string(bodies.to_mjcf(body))
    mine = bodies.compile_model(body)
    for name in ("body_mass", "body_inertia", "body_quat", "site_pos", "actuator_gainprm", "eq_data", "geom_rgba"):
        np.testing.assert_array_equal(getattr(again, name), getattr(mine, name), err_msg=name)
    one, _ = simulate(body, (0, 1, 0, 1))
    two, _ = simulate(body, (0, 1, 0, 1), model=again)
    np.testing.assert_array_equal(two, one)


def test_a_number_can_be_changed_and_a_muscle_added():
    hopper = Hopper()
    heavy = dataclasses.replace(hopper, load_mass=3.0)
    assert simulate(heavy, (0, 1, 0, 1))[0][:, 0].max() < simulate(hopper, (0, 1, 0, 1))[0][:, 0].max()
    assert hopper.groups == ("flexor", "extensor")
    strap = Muscle("strap", "strap", Attachment("load", (0, 0, 0)), Attachment("foot", (0, 0, 0)), 300.0, 0.3)
    strapped = dataclasses.replace(hopper, extra_muscles=(strap,))
    assert strapped.groups == ("flexor", "extensor", "strap")
    assert [m.name for m in strapped.muscles] == [
        *("flexor_left", "extensor_left", "flexor_right", "extensor_right"),
        "strap",
    ]
    batch = BodyBatch(strapped, 1)
    for _ in range(5):
        batch.step([[0.0, 0.0, 1.0]])
    # pulling the foot towards the load flexes the knees
    assert batch.unpack(batch.packed).sensors["knee_angle"][0] < -0.1
    pulled = batch.model.actuator("strap").id
    assert pulled == 4


def test_native_hopper_hops_nearly_as_high():
    exact, native = (simulate(Hopper(muscle_model=kind), (0, 1, 0, 1))[0][:, 0].max() for kind in ("thesis", "native"))
    assert native == pytest.approx(exact, rel=0.1)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"load_mass": 0.0}, "load_mass = 0.0: must be a finite number above 0, in kg"),
        ({"link_length": -1.0}, "link_length = -1.0"),
        ({"extensor_strength": float("inf")}, "extensor_strength = inf"),
        ({"joint_damping": -0.1}, "joint_damping = -0.1"),
        ({"knee_range": (100.0, 150.0)}, "knee_range"),
        ({"foot_size": (0.1, 0.1)}, "foot_size"),
        ({"capsule_radius": 0.2}, "attachment_distance = 0.12: must be between"),
        ({"lateral": "symetric"}, "unknown lateral 'symetric': did you mean 'symmetric'"),
        ({"muscle_model": "nativ"}, "unknown muscle_model 'nativ': did you mean 'native'"),
        ({"extra_muscles": ("strap",)}, r"extra_muscles\[0\] = 'strap'"),
    ],
)
def test_bad_numbers_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        Hopper(**changes)


@pytest.mark.parametrize("tendon", ["compliant", "rigid"])
def test_a_hopper_has_hill_muscles_that_suit_its_paths(tendon):
    body = Hopper(muscle_model="hill", tendon=tendon)
    model = bodies.compile_model(body)
    data = mujoco.MjData(model)
    spans = []
    for angle in body.knee_range:
        mujoco.mj_resetData(model, data)
        bend = np.radians(angle) - np.pi / 2
        for name, share in (("hip_left", -0.5), ("knee_left", 1.0), ("hip_right", -0.5), ("knee_right", 1.0)):
            data.joint(name).qpos[0] = share * bend
        mujoco.mj_forward(model, data)
        hills = [muscle.hill for muscle in body.muscles]
        slack, optimal = np.array([(each.tendon_slack_length, each.optimal_fiber_length) for each in hills]).T
        spans.append((data.actuator_length - slack) / optimal)
    # the flexors are longest where the extensors are shortest
    np.testing.assert_allclose(np.sort(spans, axis=0), [[0.4] * 4, [1.5] * 4], atol=1e-9)
    again = mujoco.MjModel.from_xml_string(bodies.to_mjcf(body))
    np.testing.assert_array_equal(again.actuator_biasprm, model.actuator_biasprm)


def test_a_tendon_that_stretches_throws_the_foot_higher():
    """Extensors for 0.2 s, then flexors: the same muscles on tendons of both kinds."""
    height = {}
    for tendon in ("compliant", "rigid"):
        batch = BodyBatch(Hopper(muscle_model="hill", tendon=tendon), 1)
        heights = []
        for decision in range(140):
            batch.step([[0, 0] if decision < 60 else [0, 1] if decision < 80 else [1, 0]])
            heights.append(batch.unpack(batch.packed).sensors["foot_height"][0])
        height[tendon] = max(heights)
    assert height["compliant"] > 1.5 * height["rigid"] > 0.03


def test_a_motor_does_the_work_of_its_muscle_between_the_stops():
    muscles, motors = (bodies.compile_model(Hopper(drive=drive)) for drive in ("muscles", "motors"))
    angles = np.radians(np.linspace(40.0, 150.0, 111)) - np.pi / 2
    assert [motor.name for motor in Hopper(drive="motors").motors] == [muscle.name for muscle in Hopper().muscles]
    for place, motor in enumerate(Hopper(drive="motors").motors):
        torques = [knee_torque(muscles, motor.joint, angle, place) for angle in angles]
        mean = np.trapezoid(torques, angles) / np.ptp(angles)
        assert motor.torque == pytest.approx(mean, rel=1e-3)
        assert np.ptp(torques) > 0.2 * abs(mean)
        for angle in (-0.8, 0.0, 1.0):
            assert knee_torque(motors, motor.joint, angle, place) == pytest.approx(motor.torque, rel=1e-12)


def knee_torque(model, joint, angle, actuator):
    """The torque (N m) of one active actuator about its knee, with both knees at `angle` (rad from 90°)."""
    data = mujoco.MjData(model)
    data.qpos[:] = (1.0, -angle / 2, angle, -angle / 2, -angle / 2, angle)
    data.ctrl[actuator] = 1.0
    mujoco.mj_forward(model, data)
    return data.qfrc_actuator[model.joint(joint).dofadr[0]]


def test_motors_keep_the_dampers_and_the_groups_of_the_muscles():
    body = Hopper(drive="motors")
    assert body.muscles == ()
    assert body.groups == Hopper().groups
    model = bodies.compile_model(body)
    assert model.tendon_damping.tolist() == bodies.compile_model(Hopper()).tendon_damping.tolist()
    held, _ = simulate(body, (0, 1, 0, 1), lift=1.0, steps=20)
    free, _ = simulate(Hopper(drive="motors", muscle_damping=0.0), (0, 1, 0, 1), lift=1.0, steps=20)
    assert held[-1, 2] < free[-1, 2]
    np.testing.assert_array_equal(simulate(body, 2.0)[0], simulate(body, 1.0)[0])


def test_motors_and_extra_muscles_act_together():
    strap = Muscle("strap", "strap", Attachment("load", (0, 0, 0)), Attachment("foot", (0, 0, 0)), 300.0, 0.3)
    body = Hopper(drive="motors", extra_muscles=(strap,))
    assert body.groups == ("flexor", "extensor", "strap")
    batch = BodyBatch(body, 2, substeps=200)
    batch.step([[0, 0, 1], [0, 1, 0]])
    knees = batch.unpack(batch.packed).sensors["knee_angle"]
    assert knees[0] < -0.2 < 0.2 < knees[1]


def test_motors_are_refused_with_a_law_that_gives_them_no_torque():
    with pytest.raises(ValueError, match="muscle_model = 'native': must be 'thesis' with motors"):
        Hopper(drive="motors", muscle_model="native")
