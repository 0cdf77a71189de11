"""The hexapod's mechanics against what can be said of them without simulating."""

import dataclasses

import jax
import mujoco
import numpy as np
import pytest

from motorgrad import bodies
from motorgrad.bodies import LEGS, BodyBatch, Hexapod, Leg, OnTerrain, Terrain, biomimetic_hexapod, walk

GRAVITY = 9.81
BODIES = {"plain": Hexapod(), "biomimetic": biomimetic_hexapod()}
HALF = len(LEGS) // 2  # left legs come first, right ones in the same order


@pytest.fixture(params=BODIES)
def body(request):
    return BODIES[request.param]


def posed(model, **angles):
    """Data in the start pose but for the joints of some freedoms, in rad, the same on all legs."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for freedom, angle in angles.items():
        for leg in LEGS:
            data.joint(f"{freedom}_{leg}").qpos[0] = angle
    mujoco.mj_forward(model, data)
    return data


def moment_arms(model, freedom, **angles):
    """By muscle: how its length changes when the joints of a freedom turn, in m."""
    h = 1e-5
    at = angles.pop(freedom)
    after, before = (posed(model, **angles, **{freedom: at + d}).ten_length.copy() for d in (h, -h))
    change = (after - before) / (2 * h)
    return {model.tendon(i).name: change[i] for i in range(model.ntendon)}


def settle(body, activation, decisions=250):
    batch = BodyBatch(body, 1, substeps=8)
    for _ in range(decisions):
        batch.step(activation[None])
    return batch, bodies.read_hexapod(batch.unpack(batch.packed))


def firing(body, *kinds):
    return np.array([float(name.split("_")[0] in kinds) for name in body.groups])


def test_masses_and_lengths_add_up(body):
    model = bodies.compile_model(body)
    assert model.body_mass.sum() == pytest.approx(body.mass, abs=1e-12)
    assert Hexapod().mass == pytest.approx(3 * 1.5 + 6 * (0.06 + 0.10 + 0.06))
    assert Hexapod().length == pytest.approx(0.74)
    for name, section in body.sections.items():
        leg = section.leg
        for side in ("left", "right"):
            for part in ("coxa", "femur", "foot"):
                segment = getattr(leg, part)
                geom = model.geom(f"{part}_{side}_{name}")
                assert 2 * geom.size[1] == pytest.approx(segment.length)
                assert model.body(f"{part}_{side}_{name}").mass[0] == pytest.approx(segment.mass)
            assert model.body(f"femur_{side}_{name}").pos[0] == pytest.approx(leg.coxa.length)
            assert model.body(f"foot_{side}_{name}").pos[0] == pytest.approx(leg.femur.length)
            assert np.degrees(model.joint(f"lateral_{side}_{name}").range) == pytest.approx(leg.lateral.range)
            assert np.degrees(model.joint(f"vertical_{side}_{name}").range) == pytest.approx(leg.vertical.range)
    assert np.ptp(np.degrees(model.joint("spine_front").range)) == pytest.approx(15.0)


def test_ranges_are_those_of_the_source():
    leg = Leg()
    assert [np.ptp(hinge.range) for hinge in (leg.lateral, leg.vertical, leg.ankle)] == [60, 70, 7]
    assert len(Hexapod().muscles) == len(Hexapod().groups) == 24


def test_starts_on_the_floor_and_is_its_own_mirror_image(body):
    model = bodies.compile_model(body)
    data = posed(model, lateral=0.0)
    for leg in LEGS:
        geom, size = data.geom(f"foot_{leg}"), model.geom(f"foot_{leg}").size
        tip = geom.xpos + size[1] * geom.xmat.reshape(3, 3)[:, 2]
        assert tip[2] - size[0] == pytest.approx(0.0, abs=1e-12)
    for kind in ("coxa", "femur", "foot"):
        for left, right in zip(LEGS[:HALF], LEGS[HALF:], strict=True):
            np.testing.assert_allclose(
                data.body(f"{kind}_{left}").xpos, data.body(f"{kind}_{right}").xpos * (1, -1, 1), atol=1e-12
            )
    np.testing.assert_allclose(data.subtree_com[1][1], 0.0, atol=1e-12)


@pytest.mark.parametrize(("freedom", "axis"), [("lateral", 0), ("vertical", 2)])
def test_positive_is_forward_and_up(body, freedom, axis):
    model = bodies.compile_model(body)
    before, after = (posed(model, **{freedom: angle}) for angle in (0.0, 0.1))
    for leg in LEGS:
        move = after.body(f"foot_{leg}").xpos - before.body(f"foot_{leg}").xpos
        assert move[axis] > 0.005


@pytest.mark.parametrize(("end", "sign"), [("front", 1), ("rear", -1)])
def test_spine_bends_about_the_middle_of_the_gap(end, sign):
    for axis, component in (("pitch", 2), ("yaw", 1)):
        model = bodies.compile_model(Hexapod(spine_axis=axis))
        data = posed(model)
        here = data.body(end).xpos.copy()
        data.joint(f"spine_{end}").qpos[0] = 0.1
        mujoco.mj_forward(model, data)
        arm = 0.11 + 0.02  # half a section and half of the gap
        moved = data.body(end).xpos - here
        assert moved[component] == pytest.approx(arm * np.sin(0.1))
        assert moved[0] == pytest.approx(-sign * arm * (1 - np.cos(0.1)))


def test_rest_lengths_are_those_in_the_middle_of_the_range(body):
    model = bodies.compile_model(body)
    for muscle in body.muscles:
        kind, _, leg = muscle.name.partition("_")
        freedom = "lateral" if kind in ("protractor", "retractor") else "vertical"
        hinge = getattr(body.sections[leg.split("_")[1]].leg, freedom)
        data = posed(model, **{freedom: hinge.middle})
        assert data.tendon(muscle.name).length[0] == pytest.approx(muscle.rest_length, abs=1e-12)


def test_every_muscle_pulls_with_its_strength_at_its_rest_length(body):
    model = bodies.compile_model(body)
    data = mujoco.MjData(model)
    for index, muscle in enumerate(body.muscles):
        kind, _, leg = muscle.name.partition("_")
        freedom = "lateral" if kind in ("protractor", "retractor") else "vertical"
        mujoco.mj_resetDataKeyframe(model, data, 0)
        data.joint(f"{freedom}_{leg}").qpos[0] = getattr(body.sections[leg.split("_")[1]].leg, freedom).middle
        data.ctrl[index] = 1.0
        mujoco.mj_forward(model, data)
        assert data.actuator_force[index] == pytest.approx(-muscle.strength)


def test_each_muscle_moves_its_own_freedom_in_its_own_direction(body):
    """Shorter is further on: protractors forward, levators up; the arms are those of the geometry."""
    model = bodies.compile_model(body)
    for share in (0.02, 0.5, 0.98):
        hinge = {f: np.radians(np.interp(share, (0, 1), getattr(Leg(), f).range)) for f in ("lateral", "vertical")}
        lateral = moment_arms(model, "lateral", lateral=hinge["lateral"], vertical=0.2)
        vertical = moment_arms(model, "vertical", lateral=0.0, vertical=hinge["vertical"])
        for leg in LEGS:
            pair = body.sections[leg.split("_")[1]].leg.vertical_muscles
            assert lateral[f"protractor_{leg}"] < -0.02
            assert lateral[f"retractor_{leg}"] > 0.02
            assert vertical[f"levator_{leg}"] < -0.015
            assert vertical[f"depressor_{leg}"] == pytest.approx(pair.radius, abs=1e-8)  # wrapped at every angle
            for own, other in ((lateral, ("levator", "depressor")), (vertical, ("protractor", "retractor"))):
                assert all(abs(own[f"{kind}_{leg}"]) < 1e-9 for kind in other)


def test_muscles_of_a_level_leg_stay_in_its_plane(body):
    """Also where the femur is in line with the coxa, as it is in the start pose."""
    model = bodies.compile_model(body)
    data = posed(model, vertical=0.0)
    for leg in LEGS:
        coxa = data.body(f"coxa_{leg}")
        for kind in ("levator", "depressor"):
            tendon = model.tendon(f"{kind}_{leg}").id
            first, count = data.ten_wrapadr[tendon], data.ten_wrapnum[tendon]
            path = data.wrap_xpos.reshape(-1, 3)[first : first + count]
            np.testing.assert_allclose((path - coxa.xpos) @ coxa.xmat.reshape(3, 3)[:, 1], 0.0, atol=1e-12)
            assert count == (2 if kind == "levator" else 4)
    lateral = moment_arms(model, "lateral", lateral=0.0, vertical=0.0)
    assert all(abs(arm) < 1e-9 for name, arm in lateral.items() if name.startswith(("levator", "depressor")))


def test_depressors_run_as_the_closed_formula_says(body):
    model = bodies.compile_model(body)
    for degrees in np.arange(-30.0, 66.0, 3.7):
        data = posed(model, vertical=np.radians(degrees))
        for leg in LEGS:
            numbers = body.sections[leg.split("_")[1]].leg
            pair = numbers.vertical_muscles
            interior = np.pi - np.radians(degrees)
            length = bodies.wrapped_length(interior, numbers.coxa.length, pair.distance, pair.radius)
            assert data.tendon(f"depressor_{leg}").length[0] == pytest.approx(length, abs=1e-12)


@pytest.mark.ci
@pytest.mark.representatives("plain-thesis", "biomimetic-native")
@pytest.mark.parametrize("muscle_model", ["thesis", "native"])
def test_lies_still_without_muscles_and_stands_with_them(body, muscle_model):
    body = dataclasses.replace(body, muscle_model=muscle_model)
    weight = body.mass * GRAVITY
    batch, lying = settle(body, np.zeros(24))
    assert lying.belly[0] + lying.contact[0].sum() == pytest.approx(weight, rel=2e-3)
    assert lying.belly[0] > 0.5 * weight
    assert abs(batch.unpack(batch.packed).velocity).max() < 2e-3
    assert lying.position[0, 2] > 0.03
    # both lateral muscles hold a leg against creeping forward or back
    batch, standing = settle(body, firing(body, "depressor", "protractor", "retractor"))
    assert standing.belly[0] == 0.0
    assert standing.contact[0].sum() == pytest.approx(weight, rel=2e-3)
    assert abs(batch.unpack(batch.packed).velocity).max() < 2e-2  # its feet still creep
    assert standing.position[0, 2] > 0.18
    assert np.degrees(standing.vertical).min() > -36.0


def test_momentum_is_kept_in_free_fall():
    """Muscles are inner forces: in the air they change neither the fall nor the way sideways, nor the spin."""
    body = Hexapod()
    model = bodies.compile_model(body)
    model.opt.timestep = 2.5e-4
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qpos[2] += 5.0
    rng = np.random.default_rng(3)
    for _ in range(10):
        data.ctrl[:] = rng.random(24).round()
        for _ in range(100):
            mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    assert data.subtree_linvel[1] == pytest.approx([0.0, 0.0, -GRAVITY * 0.25], abs=2e-3)
    assert abs(data.qvel[6:]).max() > 0.5
    spin = abs(data.subtree_angmom[1]).max()
    assert spin < 2e-3


def test_mirrored_actions_give_mirrored_motion(body):
    batch = BodyBatch(body, 2, substeps=8)
    swap = [body.groups.index(name.replace("left", "R").replace("right", "left").replace("R", "right"))
            for name in body.groups]  # fmt: skip
    rng = np.random.default_rng(0)
    for _ in range(15):
        action = rng.random(24).round()
        batch.step(np.stack([action, action[swap]]))
        reading = bodies.read_hexapod(batch.unpack(batch.packed))
        mirrored = np.roll(np.arange(6), HALF)
        for part in (reading.lateral, reading.vertical):
            np.testing.assert_allclose(part[0], part[1][mirrored], atol=1e-4)
        np.testing.assert_allclose(reading.position[0] * (1, -1, 1), reading.position[1], atol=1e-4)
        np.testing.assert_allclose(reading.heading[0], -reading.heading[1], atol=1e-4)
        np.testing.assert_allclose(reading.yaw_rate[0], -reading.yaw_rate[1], atol=5e-3)
    assert abs(reading.lateral[0] - reading.lateral[0][mirrored]).max() > 0.1


@pytest.mark.ci
@pytest.mark.representatives("biomimetic")
def test_stiff_stops_hold_under_random_muscles(body):
    batch, rng = BodyBatch(body, 4, substeps=8), np.random.default_rng(1)
    for _ in range(150):
        batch.step(rng.random((4, 24)).round())
        reading = bodies.read_hexapod(batch.unpack(batch.packed))
        for freedom in ("lateral", "vertical"):
            angles = np.degrees(getattr(reading, freedom))
            for i, leg in enumerate(LEGS):
                least, greatest = getattr(body.sections[leg.split("_")[1]].leg, freedom).range
                assert least - 6 < angles[:, i].min()
                assert angles[:, i].max() < greatest + 6
    assert not batch.diverged.any()


@pytest.mark.ci
def test_threads_and_the_number_of_seeds_change_nothing():
    sequence = np.random.default_rng(1).random((40, 5, 24)).round()
    runs = []
    for seeds, threads in ((5, 1), (5, 3), (2, 2)):
        batch = BodyBatch(Hexapod(), seeds, substeps=8, threads=threads)
        for action in sequence[:, :seeds]:
            batch.step(action)
        runs.append(batch.packed.copy())
    np.testing.assert_array_equal(runs[0], runs[1])
    np.testing.assert_array_equal(runs[0][:2], runs[2])


def test_reading_has_the_meaning_that_it_says():
    batch = BodyBatch(Hexapod(drive="servos"), 2, substeps=8)
    model, data = batch.model, mujoco.MjData(batch.model)
    for _ in range(30):
        batch.step(np.tile(np.repeat([2.0, -2.0], 6), (2, 1)))
    state = batch.unpack(batch.packed)
    reading = bodies.read_hexapod(state)
    data.qpos[:], data.qvel[:] = state.position[0], state.velocity[0]
    mujoco.mj_forward(model, data)
    for i, leg in enumerate(LEGS):
        for freedom in ("lateral", "vertical"):
            assert getattr(reading, freedom)[0, i] == pytest.approx(data.joint(f"{freedom}_{leg}").qpos[0], abs=1e-6)
            velocity = getattr(reading, f"{freedom}_velocity")[0, i]
            assert velocity == pytest.approx(data.joint(f"{freedom}_{leg}").qvel[0], abs=1e-5)
    np.testing.assert_allclose(reading.position[0], data.body("middle").xpos, atol=1e-6)
    ahead = data.body("middle").xmat.reshape(3, 3)[:2, 0]
    assert reading.heading[0] == pytest.approx(np.arctan2(ahead[1], ahead[0]), abs=1e-6)
    assert reading.speed[0] == pytest.approx(data.qvel[:2] @ ahead / np.linalg.norm(ahead), abs=1e-5)
    again = jax.jit(lambda packed: bodies.read_hexapod(batch.unpack(packed)))(batch.packed.copy())
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, atol=1e-6), tuple(again), tuple(reading))


def test_heading_and_speed_of_a_turned_body():
    batch = BodyBatch(Hexapod(), 1)
    turn, velocity = 2.0, np.array([0.3, -0.7])
    batch._batch.bind("qpos")[0, 3:7] = np.cos(turn / 2), 0.0, 0.0, np.sin(turn / 2)
    batch._batch.bind("qvel")[0, :2] = velocity
    batch._batch.forward()
    packed = np.concatenate([batch._batch.bind(name) for name in ("qpos", "qvel", "sensordata")] + [[[0.0]]], axis=1)
    reading = bodies.read_hexapod(batch.unpack(packed))
    assert reading.heading[0] == pytest.approx(turn)
    assert reading.speed[0] == pytest.approx(velocity @ (np.cos(turn), np.sin(turn)))


@pytest.mark.parametrize(("roll", "upright"), [(0.0, 1.0), (60.0, 0.5), (90.0, 0.0), (180.0, -1.0)])
def test_upright_is_how_far_the_trunks_own_up_points_up(roll, upright):
    batch, half = BodyBatch(Hexapod(), 1), np.radians(roll) / 2
    batch._batch.bind("qpos")[0, 3:7] = np.cos(half), np.sin(half), 0.0, 0.0
    batch._batch.forward()
    packed = np.concatenate([batch._batch.bind(name) for name in ("qpos", "qvel", "sensordata")] + [[[0.0]]], axis=1)
    assert bodies.read_hexapod(batch.unpack(packed)).upright[0] == pytest.approx(upright, abs=1e-6)


def test_servos_push_to_their_velocity_and_no_harder_than_their_limit():
    body = Hexapod(drive="servos")
    assert body.muscles == ()
    assert len(body.groups) == 12
    model = bodies.compile_model(body)
    data = posed(model)
    for wanted, torque in ((0.1, 2.0), (5.0, 6.0), (-5.0, -6.0)):
        data.ctrl[:6] = wanted
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(data.actuator_force[:6], torque, atol=1e-9)
    data.ctrl[6:] = 5.0
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.actuator_force[6:], 12.0)


@pytest.mark.parametrize("terrain", [False, True])
def test_the_foot_s_friction_counts_and_not_the_ground_s(terrain):
    """Of two frictions MuJoCo takes the greater, and low ones would not count at all, unless the feet come first."""
    body = biomimetic_hexapod()
    model = bodies.compile_model(OnTerrain(body, Terrain(difficulty=0.0)) if terrain else body)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qpos[2] -= 1e-3
    mujoco.mj_forward(model, data)
    found = {model.geom(contact.geom2).name: contact.friction[0] for contact in data.contact}
    assert found == {f"foot_{leg}": body.sections[leg.split("_")[1]].leg.friction for leg in LEGS}


def test_a_foot_without_friction_gets_nowhere():
    def far(friction):
        body = Hexapod(drive="servos")
        body = body.map_sections(lambda s: dataclasses.replace(s, leg=dataclasses.replace(s.leg, friction=friction)))
        return walk(body, seconds=5.0).gait().net[0]

    assert far(0.01) < 0.25 < 0.45 < far(1.0)


@pytest.mark.parametrize("muscle_model", ["thesis", "native"])
def test_export_simulates_identically(muscle_model):
    body = Hexapod(muscle_model=muscle_model)
    again = mujoco.MjModel.from_xml_string(bodies.to_mjcf(body))
    ends = []
    for model in (bodies.compile_model(body), again):
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        data.ctrl[:] = firing(body, "depressor", "retractor")
        for _ in range(200):
            mujoco.mj_step(model, data)
        ends.append(data.qpos.copy())
    np.testing.assert_array_equal(ends[0], ends[1])
