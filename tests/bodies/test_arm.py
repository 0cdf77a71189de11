"""The arm's mechanics against closed forms, and the table of its lifts against simulation."""

import dataclasses
import math

import mujoco
import numpy as np
import pytest

from motorgrad.bodies import Arm, BodyBatch, compile_model, greatest_flexion, lift, lift_table, tabulate_lift, to_mjcf
from motorgrad.bodies._lift import STORED, LiftTable

FLEXIONS = np.linspace(0.0, Arm().most_flexion, 7)
FREE = dataclasses.replace(Arm(), joint_damping=0.0)


def forward(arm, flexion, activation=0.0):
    model = compile_model(arm)
    data = mujoco.MjData(model)
    data.qpos[0], data.ctrl[0] = flexion, activation
    mujoco.mj_forward(model, data)
    return data


@pytest.mark.parametrize("arm", [Arm(), Arm(load=0.0), Arm(load=9.0, bone_length=0.4, offset=0.03, lower_mass=2.0)])
@pytest.mark.parametrize("flexion", FLEXIONS)
def test_the_closed_forms_are_mujocos(arm, flexion):
    data = forward(arm, flexion)
    assert data.ten_length[0] == pytest.approx(arm.muscle_length(flexion), abs=1e-12)
    assert -data.ten_J[0] == pytest.approx(arm.moment_arm(flexion), abs=1e-7)
    assert data.qfrc_bias[0] == pytest.approx(arm.weight_moment * math.sin(flexion), abs=1e-9)
    rise = data.site("hand").xpos[2] - forward(arm, 0.0).site("hand").xpos[2]
    assert rise == pytest.approx(arm.rise(flexion), abs=1e-12)


def test_the_elbow_is_at_a_right_angle_and_the_load_in_the_hand():
    data = forward(Arm(load=14.0), 0.0)
    np.testing.assert_allclose(data.site("hand").xpos, (0.0, 0.0, 0.3), atol=1e-12)
    np.testing.assert_allclose(data.body("upper_arm").xpos, (0.0, 0.0, 0.6))
    assert compile_model(Arm(load=14.0)).body_mass.sum() == pytest.approx(15.0)
    assert compile_model(Arm(load=0.0)).body_mass.sum() == pytest.approx(1.0)


@pytest.mark.parametrize("flexion", FLEXIONS[1:-1])
def test_the_balance_holds_it_still(flexion):
    arm = Arm(load=6.0)
    force = arm.balance(flexion)
    data = forward(dataclasses.replace(arm, strength=force), flexion, activation=1.0)
    assert data.qacc[0] == pytest.approx(0.0, abs=1e-9)
    half = forward(dataclasses.replace(arm, strength=force), flexion, activation=0.5)
    assert half.actuator_force[0] == pytest.approx(-force / 2)  # graded, and it pulls
    assert half.qacc[0] < -1.0


def test_the_force_does_not_depend_on_the_length():
    forces = [forward(Arm(), flexion, activation=0.7).actuator_force[0] for flexion in FLEXIONS]
    np.testing.assert_allclose(forces, -0.7 * Arm().strength, rtol=1e-12)


@pytest.mark.parametrize("load", [0.5, 14.0])
@pytest.mark.parametrize("flexion", FLEXIONS[2:-1])
def test_without_friction_the_work_of_the_muscle_is_the_lift(load, flexion):
    arm = dataclasses.replace(FREE, load=load)
    found = greatest_flexion(dataclasses.replace(arm, strength=arm.throw(flexion)), [1.0])
    np.testing.assert_allclose(found, flexion, atol=3e-3)


def test_friction_costs_height():
    arm = Arm(load=3.0)
    strength = arm.throw(1.0)
    found = [
        greatest_flexion(dataclasses.replace(arm, strength=strength, joint_damping=friction), [1.0])[0]
        for friction in (0.0, 0.02, 0.2)
    ]
    assert found[0] > found[1] > found[2]


def test_full_activation_just_takes_14_kg_to_the_top():
    most = Arm().most_flexion
    assert greatest_flexion(Arm(load=14.0), [1.0])[0] == most
    assert greatest_flexion(Arm(load=14.0), [0.99])[0] < most
    assert greatest_flexion(Arm(load=14.2), [1.0])[0] < most


def test_half_the_time_step_lifts_as_high():
    activation = np.linspace(0.1, 0.9, 5)
    coarse, fine = (greatest_flexion(Arm(load=14.0, timestep=step), activation) for step in (0.001, 0.0005))
    np.testing.assert_allclose(coarse, fine, atol=2e-4)


def test_a_stop_holds_it():
    batch = BodyBatch(Arm(load=1.0), 1, substeps=1)
    flexions = [batch.step([[1.0]]) or float(batch.packed[0, 0]) for _ in range(1000)]
    assert max(flexions) > Arm().most_flexion
    assert math.degrees(max(flexions) - Arm().most_flexion) < 4.5  # short of where the muscle's ends would meet


def test_nothing_touches():
    model = compile_model(Arm())
    assert not (model.geom_contype.any() and (model.geom_contype & model.geom_conaffinity).any())
    assert forward(Arm(elbow_height=0.1), 0.0).ncon == 0


def test_export_moves_identically_and_needs_no_callback():
    arm = Arm(load=2.0)
    mujoco.set_mjcb_act_gain(None)
    models = compile_model(arm), mujoco.MjModel.from_xml_string(to_mjcf(arm))
    paths = []
    for model in models:
        data = mujoco.MjData(model)
        data.ctrl[0] = 0.2
        paths.append([mujoco.mj_step(model, data) or float(data.qpos[0]) for _ in range(500)])
    assert paths[0] == paths[1]
    assert max(paths[0]) > 0.5
    assert mujoco.get_mjcb_act_gain() is None


BAD = [
    *((name, -1.0) for name in ("load", "offset", "joint_damping", "strength", "bone_length", "lower_mass")),
    *((name, 0.0) for name in ("strength", "bone_length", "lower_mass", "elbow_height", "timestep")),
    *(("least_angle", value) for value in (15.0, 90.0, 120.0, -5.0, math.nan)),
    ("load", math.inf),
]


@pytest.mark.parametrize(("name", "value"), BAD)
def test_impossible_numbers_are_refused_by_name(name, value):
    with pytest.raises(ValueError, match=rf"{name} = {value!r}: must be"):
        Arm(**{name: value})


@pytest.mark.parametrize(
    ("activation", "seconds", "words"),
    [([], 2.0, "activation.shape"), ([1.5], 2.0, "activation ="), ([[0.1]], 2.0, "activation.shape"),
     ([0.5], 0.0, "seconds ="), ([0.5], math.inf, "seconds =")],
)  # fmt: skip
def test_what_is_no_lift_is_refused(activation, seconds, words):
    with pytest.raises(ValueError, match=words):
        greatest_flexion(Arm(), activation, seconds)


ERROR = 2e-4  # of the full lift; what the documentation says


@pytest.fixture(scope="module")
def points():
    generator = np.random.default_rng(3)
    load = 14.0 * generator.random(40)
    tops = np.array([lift_table(Arm()).top_force(each) for each in load])
    return load, tops * generator.uniform(0.0, 1.1, 40)


def test_the_stored_table_is_as_high_as_a_simulation_at_random_points(points):
    load, force = points
    found, wanted = np.asarray(lift_table(Arm()).lift(load, force)), lift(Arm(), load, force)
    np.testing.assert_allclose(found, wanted, atol=ERROR)
    assert 0.1 < wanted.mean() < 0.9


def test_the_stored_table_is_what_is_simulated_now():
    stored = LiftTable.load(STORED)
    assert stored.arm == Arm()
    fresh = tabulate_lift(Arm(), loads=3, shares=5)
    rows, columns = np.linspace(0, len(stored.effort) - 1, 3).astype(int), slice(None, None, 20)
    np.testing.assert_allclose(fresh.effort, stored.effort[rows], atol=1e-4)
    np.testing.assert_allclose(fresh.height, stored.height[rows, columns], atol=1e-4)


def test_a_table_is_stored_whole(tmp_path):
    table = LiftTable(Arm(offset=0.01), np.array([1.1, 1.0]), np.array([[0.0, 1.0], [0.0, 1.0]]))
    table.save(tmp_path / "table.npz")
    again = LiftTable.load(tmp_path / "table.npz")
    assert again.arm == table.arm
    np.testing.assert_array_equal(again.effort, table.effort)
    np.testing.assert_array_equal(again.height, table.height)
    table.save(tmp_path / "second.npz")
    assert (tmp_path / "table.npz").read_bytes() == (tmp_path / "second.npz").read_bytes()


def test_arms_that_lift_alike_share_a_table():
    assert lift_table(Arm()) is lift_table(Arm(load=3.0, strength=99.0, elbow_height=2.0))


def test_an_arm_without_a_stored_table_gets_one_of_its_own(monkeypatch):
    asked = []

    def few(arm):
        asked.append(arm)
        return tabulate_lift(arm, loads=2, shares=3)

    monkeypatch.setattr("motorgrad.bodies._lift.tabulate_lift", few)
    other = Arm(joint_damping=0.05)
    assert lift_table(other).arm == other
    assert lift_table(other) is lift_table(other)
    assert asked == [other]


def test_a_table_is_flat_beyond_the_top_and_its_loads():
    table = lift_table(Arm())
    assert float(table.lift(5.0, 1e4)) == 1.0
    assert float(table.lift(5.0, 0.0)) == 0.0
    assert float(table.lift(-3.0, 3.0)) == float(table.lift(0.0, 3.0))
    heights = np.asarray(table.lift(8.0, np.linspace(0, 120, 300)))
    assert (np.diff(heights) >= 0).all()
