"""The arm's mechanics against closed forms, and the table of its lifts against simulation."""

import dataclasses
import json
import math

import jax
import mujoco
import numpy as np
import pytest

from motorgrad.bodies import (
    POSTURES,
    Arm,
    BodyBatch,
    compile_model,
    greatest_flexion,
    lift,
    lift_table,
    tabulate_lift,
    to_mjcf,
)
from motorgrad.bodies.arm._arm import STRENGTH
from motorgrad.bodies.arm._lift import STORED, LiftTable

FLEXIONS = np.linspace(0.0, Arm().most_flexion, 7)
LEVEL = Arm(posture="horizontal")
ODD = {"load": 9.0, "bone_length": 0.4, "offset": 0.03, "lower_mass": 2.0}


def forward(arm, flexion, activation=0.0):
    model = compile_model(arm)
    data = mujoco.MjData(model)
    data.qpos[0], data.ctrl[0] = flexion, activation
    mujoco.mj_forward(model, data)
    return data


@pytest.mark.parametrize("arm", [Arm(), LEVEL, Arm(load=0.0), Arm(**ODD), Arm(**ODD, posture="horizontal")])
@pytest.mark.parametrize("share", np.linspace(0.0, 1.0, 7))
def test_the_closed_forms_are_mujocos(arm, share):
    flexion = share * arm.most_flexion
    data = forward(arm, flexion)
    assert data.ten_length[0] == pytest.approx(arm.muscle_length(flexion), abs=1e-12)
    assert -data.ten_J[0] == pytest.approx(arm.moment_arm(flexion), abs=1e-7)
    assert data.qfrc_bias[0] == pytest.approx(arm.weight_moment * math.sin(flexion), abs=1e-9)
    rise = data.site("hand").xpos[2] - forward(arm, 0.0).site("hand").xpos[2]
    assert rise == pytest.approx(arm.rise(flexion), abs=1e-12)


@pytest.mark.parametrize(("posture", "shoulder"), [("vertical", (0.0, 0.0, 0.9)), ("horizontal", (-0.3, 0.0, 0.6))])
def test_the_upper_arm_is_held_so_and_the_load_hangs_from_the_elbow(posture, shoulder):
    data = forward(Arm(load=14.0, posture=posture), 0.0)
    np.testing.assert_allclose(data.site("hand").xpos, (0.0, 0.0, 0.3), atol=1e-12)
    np.testing.assert_allclose(data.body("upper_arm").xpos, (0.0, 0.0, 0.6))
    np.testing.assert_allclose(data.geom("harness").xpos, shoulder, atol=1e-12)
    along = data.geom("upper_arm").xmat.reshape(3, 3)[:, 2] * data.model.geom("upper_arm").size[1]
    ends = data.geom("upper_arm").xpos + np.array([[-1.0], [1.0]]) * along
    for end in ((0.0, 0.0, 0.6), shoulder):
        assert np.abs(ends - end).sum(1).min() < 1e-12
    bent = forward(Arm(posture=posture), 0.3)
    assert bent.site("hand").xpos[0] < 0.0  # towards the shoulder of a horizontal upper arm, as the muscle is there


@pytest.mark.parametrize("posture", POSTURES)
@pytest.mark.parametrize("offset", [0.0, 0.02, 0.025])
def test_the_moment_arm_is_the_distance_of_the_elbow_from_the_muscle(posture, offset):
    arm = Arm(posture=posture, offset=offset)
    (muscle,) = arm.muscles
    origin = np.array(muscle.origin.position)[[0, 2]]
    across, down = np.array(muscle.insertion.position)[[0, 2]]
    for flexion in np.linspace(0.0, arm.most_flexion, 9):
        turned = (
            across * math.cos(flexion) + down * math.sin(flexion),
            down * math.cos(flexion) - across * math.sin(flexion),
        )
        twice_the_area = origin[0] * turned[1] - origin[1] * turned[0]
        distance = twice_the_area / math.dist(origin, turned)
        assert arm.moment_arm(flexion) == pytest.approx(distance, abs=1e-12)


def test_of_a_straight_elbow_the_moment_arm_is_the_offset_and_of_a_bent_one_it_is_not():
    """Section 4.3.2: the torque is always greater than zero, since the attachments are offset."""
    assert Arm().moment_arm(0.0) == pytest.approx(0.02, abs=1e-12)
    assert Arm(offset=0.0).moment_arm(0.0) == pytest.approx(0.0, abs=1e-12)
    assert LEVEL.moment_arm(0.0) == pytest.approx((0.15 + 0.02) / math.sqrt(2), abs=1e-12)
    assert Arm(posture="horizontal", offset=0.0).moment_arm(0.0) == pytest.approx(0.15 / math.sqrt(2), abs=1e-12)
    for arm in (Arm(), LEVEL):
        assert (np.diff(arm.moment_arm(np.linspace(0.0, arm.most_flexion, 50))) > 0).all()


def test_an_arm_throws_its_load_to_the_top_by_the_greatest_force_on_the_way():
    way = np.linspace(0.0, Arm().most_flexion, 100_001)[1:]
    assert Arm().throwing_force == pytest.approx(Arm().ballistic_force(way).max(), rel=1e-6)
    assert math.degrees(way[Arm().ballistic_force(way).argmax()]) == pytest.approx(84, abs=0.5)  # then it snaps up
    assert LEVEL.throwing_force == pytest.approx(LEVEL.ballistic_force(LEVEL.most_flexion))


def test_the_force_at_full_activation_is_that_of_the_posture_unless_given():
    assert (Arm().full_force, LEVEL.full_force) == (STRENGTH["vertical"], STRENGTH["horizontal"])
    assert dataclasses.replace(LEVEL, posture="vertical").full_force == Arm().full_force
    assert Arm(strength=50.0).full_force == Arm(strength=50.0, posture="horizontal").full_force == 50.0
    with pytest.raises(ValueError, match=r"'horizontl'.*horizontal"):
        Arm(posture="horizontl")


def test_mass_is_that_of_the_load_and_the_lower_arm():
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
    np.testing.assert_allclose(forces, -0.7 * Arm().full_force, rtol=1e-12)


@pytest.mark.parametrize("load", [0.5, 14.0])
@pytest.mark.parametrize(
    ("posture", "flexion"), [("vertical", 0.5), ("vertical", 1.1), ("horizontal", 0.4), ("horizontal", 1.0)]
)
def test_without_friction_the_work_of_the_muscle_is_the_lift(load, posture, flexion):
    arm = Arm(load=load, joint_damping=0.0, posture=posture)
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


@pytest.mark.parametrize("arm", [Arm(load=14.0), Arm(load=14.0, posture="horizontal")])
def test_full_activation_just_takes_14_kg_to_the_top(arm):
    full, less = greatest_flexion(arm, [1.0, 0.99])
    assert full == arm.most_flexion
    assert less < arm.most_flexion
    assert greatest_flexion(dataclasses.replace(arm, load=14.2), [1.0])[0] < arm.most_flexion


def test_below_a_vertical_upper_arm_a_load_is_lifted_to_the_top_or_less_than_half_of_that():
    """Below a horizontal one, a little less force lifts a little less high."""
    for arm, low, high in ((Arm(), 0.2, 0.5), (LEVEL, 0.85, 0.99)):
        top = lift_table(arm).top_force(12.0)
        whole, nearly = lift(arm, 12.0, [top * 1.001, top * 0.985])
        assert whole == 1.0
        assert low < nearly < high


@pytest.mark.ci
def test_half_the_time_step_lifts_as_high():
    activation = np.linspace(0.1, 0.9, 5)
    coarse, fine = (greatest_flexion(Arm(load=14.0, timestep=step), activation) for step in (0.001, 0.0005))
    np.testing.assert_allclose(coarse, fine, atol=2e-4)


@pytest.mark.parametrize("posture", POSTURES)
def test_a_stop_holds_it(posture):
    arm = Arm(load=1.0, posture=posture)
    batch = BodyBatch(arm, 1, substeps=1)
    flexions = [batch.step([[1.0]]) or float(batch.packed[0, 0]) for _ in range(1000)]
    assert max(flexions) > arm.most_flexion
    assert math.degrees(max(flexions) - arm.most_flexion) < 4.5  # short of where the muscle's ends would meet


def test_a_straight_elbow_does_not_bend_the_other_way():
    model = compile_model(Arm())
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qvel[0] = -5.0
    least = min(mujoco.mj_step(model, data) or float(data.qpos[0]) for _ in range(300))
    assert math.degrees(least) > -3.0
    assert compile_model(LEVEL).jnt_range[0, 0] < -3.0


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
    *(("least_angle", value) for value in (15.0, 180.0, 200.0, -5.0, math.nan)),
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
]  # kg, of the full lift, for a horizontal upper arm; what the documentation says


@pytest.mark.representatives("0.0-0.05-0.0015")
@pytest.mark.parametrize(("low", "high", "error"), ERRORS)
def test_the_stored_table_is_as_high_as_a_simulation_at_random_points(low, high, error):
    generator, table = np.random.default_rng(3), lift_table(LEVEL)
    load = generator.uniform(math.sqrt(low), math.sqrt(high), 4)[:, None] ** 2
    share = np.hstack([generator.uniform(0.0, 0.97, (4, 4)), generator.uniform(0.97, 1.02, (4, 4))])
    force = share * np.vectorize(table.top_force)(load)
    found, wanted = np.asarray(jax.jit(table.lift)(load, force)), lift(LEVEL, load, force)
    np.testing.assert_allclose(found, wanted, atol=error)
    assert 0.3 < wanted.mean() < 0.9
    # the bounds that are stated are not those of a better table
    assert np.abs(found - wanted).max() > error / 4


@pytest.mark.ci
def test_the_table_of_a_snapping_arm_is_as_high_as_a_simulation_but_for_the_last_per_cents():
    generator, table = np.random.default_rng(3), lift_table(Arm())
    load = generator.uniform(0.3, math.sqrt(20.0), 6)[:, None] ** 2
    share = np.hstack([generator.uniform(0.0, 0.98, (6, 6)), generator.uniform(0.98, 1.02, (6, 6))])
    force = share * np.vectorize(table.top_force)(load)
    error = np.abs(np.asarray(jax.jit(table.lift)(load, force)) - lift(Arm(), load, force))
    assert error[:, :6].max() < 3e-4
    assert error[:, 6:].max() < 2e-2
    assert error[share > 1.0001].max() == 0.0


@pytest.mark.ci
@pytest.mark.parametrize("posture", POSTURES)
def test_the_stored_table_is_what_is_simulated_now(posture):
    stored, arm = LiftTable.load(STORED[posture]), Arm(posture=posture)
    assert stored.arm == arm
    fresh = tabulate_lift(arm, loads=3, shares=5)
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
    assert LiftTable.load(STORED["vertical"]).mujoco_version[0].isdigit()


@pytest.mark.parametrize(("name", "value"), [("seconds", 1.0), ("heaviest", 10.0)])
def test_a_table_of_other_lifts_is_refused(name, value, tmp_path):
    with np.load(STORED["vertical"]) as file:
        stored = dict(file)
    made = json.loads(str(stored["made"]))
    assert name in made
    np.savez(tmp_path / "other.npz", **stored | {"made": json.dumps(made | {name: value})})
    with pytest.raises(ValueError, match=rf"other.npz: {name} = {value}: must be"):
        LiftTable.load(tmp_path / "other.npz")


def test_arms_that_lift_alike_share_a_table():
    assert lift_table(Arm()) is lift_table(Arm(load=3.0, strength=99.0, elbow_height=2.0))
    assert lift_table(LEVEL) is lift_table(dataclasses.replace(LEVEL, load=3.0, strength=99.0))
    assert lift_table(LEVEL).arm != lift_table(Arm()).arm


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
    more = np.stack([np.full(300, 8.0), np.linspace(0, 240, 300)], 1)
    heights = np.asarray(jax.jit(lift_table(Arm()).lift)(*np.concatenate([ends, more]).T))
    (top, bottom, below, lightest), heights = heights[:4], heights[4:]
    assert top == 1.0
    assert bottom == 0.0
    assert below == lightest
    assert (np.diff(heights) >= 0).all()
