"""The arm's mechanics against closed forms, and the table of its lifts against simulation."""

import dataclasses
import json
import math

import jax
import mujoco
import numpy as np
import pytest

from motorgrad.bodies import Arm, BodyBatch, compile_model, greatest_flexion, lift, lift_table, tabulate_lift, to_mjcf
from motorgrad.bodies.arm._lift import STORED, LiftTable

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
    found = greatest_flexion(dataclasses.replace(arm, strength=arm.ballistic_force(flexion)), [1.0])
    np.testing.assert_allclose(found, flexion, atol=3e-3)


def test_friction_costs_height():
    arm = Arm(load=3.0)
    strength = arm.ballistic_force(1.0)
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


@pytest.mark.ci
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
    ("timestep", 0.011),
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


def test_the_first_divergence_ends_it(monkeypatch):
    calls, step = [], BodyBatch.step
    monkeypatch.setattr(BodyBatch, "step", lambda self, action: calls.append(1) or step(self, action))
    with pytest.raises(RuntimeError, match=r"diverged at activation 0.5: Arm\(.*strength=10000000000000.0"):
        greatest_flexion(Arm(strength=1e13), [0.0, 0.5])
    assert len(calls) < 5


@pytest.mark.parametrize(
    ("load", "force", "words"),
    [(5, -5, "force = -5.0: must be from 0"), (5, [1.0, math.nan], "force = nan: must be"),
     (5, 1e12, r"force = 1000000000000.0: must be from 0 to 1e\+07 N"), (-1, 5, "load = -1.0: must be"),
     ([1.0, math.inf], 5, "load = inf: must be"), (math.nan, 5, "load = nan: must be")],
)  # fmt: skip
def test_a_lift_of_impossible_numbers_is_refused_by_name(load, force, words):
    with pytest.raises(ValueError, match=words):
        lift(Arm(), load, force)


@pytest.mark.parametrize("load", [-0.1, 20.1, 30.0, math.nan])
def test_there_is_no_top_force_beyond_the_table(load):
    with pytest.raises(ValueError, match=r"load = .*: must be from 0 to 20 kg"):
        lift_table(Arm()).top_force(load)
    assert lift_table(Arm()).top_force(20.0) > lift_table(Arm()).top_force(14.0)


ERRORS = [
    (0.0, 0.05, 1.5e-3),
    (0.05, 0.5, 5e-4),
    (0.5, 20.0, 2e-4),
]  # kg, of the full lift; what the documentation says


@pytest.mark.representatives("0.0-0.05-0.0015")
@pytest.mark.parametrize(("low", "high", "error"), ERRORS)
def test_the_stored_table_is_as_high_as_a_simulation_at_random_points(low, high, error):
    generator, table = np.random.default_rng(3), lift_table(Arm())
    load = generator.uniform(math.sqrt(low), math.sqrt(high), 4)[:, None] ** 2
    share = np.hstack([generator.uniform(0.0, 0.97, (4, 4)), generator.uniform(0.97, 1.02, (4, 4))])
    force = share * np.vectorize(table.top_force)(load)
    found, wanted = np.asarray(jax.jit(table.lift)(load, force)), lift(Arm(), load, force)
    np.testing.assert_allclose(found, wanted, atol=error)
    assert 0.3 < wanted.mean() < 0.9
    # the bounds that are stated are not those of a better table
    assert np.abs(found - wanted).max() > error / 4


@pytest.mark.ci
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
    assert again.mujoco_version == mujoco.__version__
    np.testing.assert_array_equal(again.effort, table.effort)
    np.testing.assert_array_equal(again.height, table.height)
    table.save(tmp_path / "second.npz")
    assert (tmp_path / "table.npz").read_bytes() == (tmp_path / "second.npz").read_bytes()


def test_the_version_that_simulated_a_table_stays_with_it(tmp_path):
    table = LiftTable(Arm(), np.array([1.1, 1.0]), np.array([[0.0, 1.0], [0.0, 1.0]]), "1.2.3")
    table.save(tmp_path / "table.npz")
    LiftTable.load(tmp_path / "table.npz").save(tmp_path / "again.npz")
    assert LiftTable.load(tmp_path / "again.npz").mujoco_version == "1.2.3"
    assert LiftTable.load(STORED).mujoco_version[0].isdigit()


@pytest.mark.parametrize(("name", "value"), [("seconds", 1.0), ("heaviest", 10.0)])
def test_a_table_of_other_lifts_is_refused(name, value, tmp_path):
    with np.load(STORED) as file:
        stored = dict(file)
    made = json.loads(str(stored["made"]))
    assert name in made
    np.savez(tmp_path / "other.npz", **stored | {"made": json.dumps(made | {name: value})})
    with pytest.raises(ValueError, match=rf"other.npz: {name} = {value}: must be"):
        LiftTable.load(tmp_path / "other.npz")


def test_arms_that_lift_alike_share_a_table():
    assert lift_table(Arm()) is lift_table(Arm(load=3.0, strength=99.0, elbow_height=2.0))


@pytest.mark.ci
def test_an_arm_without_a_stored_table_gets_one_of_its_own_and_says_so(monkeypatch, capfd):
    asked = []

    def few(arm):
        asked.append(arm)
        return tabulate_lift(arm, loads=2, shares=3)

    monkeypatch.setattr("motorgrad.bodies.arm._lift.tabulate_lift", few)
    other = Arm(joint_damping=0.05)
    assert lift_table(other).arm == other
    assert lift_table(other) is lift_table(other)
    assert asked == [other]
    assert capfd.readouterr().err.splitlines() == [
        "motorgrad: simulating how high this arm lifts loads, for a minute or two"
    ]
    lift_table(Arm())
    assert capfd.readouterr().err == ""


def test_a_table_is_flat_beyond_the_top_and_its_loads():
    ends = np.array([(5.0, 1e4), (5.0, 0.0), (-3.0, 3.0), (0.0, 3.0)])
    more = np.stack([np.full(300, 8.0), np.linspace(0, 120, 300)], 1)
    heights = np.asarray(jax.jit(lift_table(Arm()).lift)(*np.concatenate([ends, more]).T))
    (top, bottom, below, lightest), heights = heights[:4], heights[4:]
    assert top == 1.0
    assert bottom == 0.0
    assert below == lightest
    assert (np.diff(heights) >= 0).all()
