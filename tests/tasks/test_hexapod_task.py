"""The hexapod's task: what is observed, paid and reported, along real walks and by hand; its settings; learning it."""

import dataclasses
import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import motorgrad as mg
from motorgrad.bodies import LEGS, TRIPODS, BodyBatch, OnTerrain, Terrain, biomimetic_hexapod, read_hexapod
from motorgrad.bodies import Hexapod as HexapodBody
from motorgrad.tasks import TRIPOD_SYNERGIES, Hexapod, HexapodSynergy, make
from motorgrad.training import agent_for, evaluate, stepper_for, train

NONE = jnp.zeros(0)
ALL = ("lateral", "current", "contact", "yaw", "course")


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo notes divergences in the working directory


def wander(decisions, seeds=2, seed=0):
    """States (decisions + 1) of real bodies under random muscles, from the start pose on."""
    batch = BodyBatch(HexapodBody(), seeds, substeps=8, threads=1)
    random, packed = np.random.default_rng(seed), [batch.packed.copy()]
    for _ in range(decisions):
        batch.step(random.random((seeds, 24)).round())
        packed.append(batch.packed.copy())
    return batch.unpack(np.stack(packed))


@functools.cache
def the_walk():
    """The states of one walk, made once, when a test needs them."""
    return wander(130)


def at(decision, row=0, **sensors):
    """The state of one body at one decision of a walk, some of its sensors replaced."""
    walk = the_walk()
    seen = {name: jnp.asarray(values[decision, row]) for name, values in walk.sensors.items()}
    changed = {name: jnp.asarray(value, jnp.float32) for name, value in sensors.items()}
    return walk._replace(
        position=jnp.asarray(walk.position[decision, row]),
        velocity=jnp.asarray(walk.velocity[decision, row]),
        sensors=seen | changed,
    )


def followed(task, decisions=130):
    """What is observed at the start and after every decision, what each pays, whether it fell, and its metrics."""

    @jax.jit
    def decide(memory, state):
        memory, reward, fallen = task.reward(memory, state, jnp.zeros(task.action_size))
        memory, seen = task.observe(memory, state, NONE)
        return memory, seen, reward, fallen, task.metrics(memory, state)

    memory, first = task.observe(task.init(NONE), at(0), NONE)
    observed, rewards, falls, metrics = [first], [], [], []
    for decision in range(1, decisions + 1):
        memory, seen, reward, fallen, told = decide(memory, at(decision))
        observed.append(seen)
        rewards.append(float(reward))
        falls.append(bool(fallen))
        metrics.append({k: float(v) if o else None for k, (v, o) in told.items()})
    return np.stack(observed), np.array(rewards), falls, metrics


@pytest.mark.ci
def test_the_six_lateral_angles_are_observed_in_parts_of_thirty_degrees():
    observed, *_ = followed(Hexapod(observes=("lateral",), lag=0))
    np.testing.assert_allclose(observed, np.degrees(read_hexapod(the_walk()).lateral[:, 0]) / 30.0, atol=1e-6)
    assert np.abs(observed).max() > 0.5
    half, *_ = followed(Hexapod(observes=("lateral",), lag=0, angle_scale=60.0))
    np.testing.assert_allclose(half, observed / 2, atol=1e-6)


@pytest.mark.representatives("2")
@pytest.mark.parametrize("lag", [0, 1, 2, 5])
def test_lag_shows_the_angles_of_so_many_decisions_ago_and_stood_still_before(lag):
    fresh, *_ = followed(Hexapod(observes=("lateral",), lag=0), decisions=20)
    late, *_ = followed(Hexapod(observes=("lateral",), lag=lag), decisions=20)
    np.testing.assert_array_equal(late[lag:], fresh[: len(fresh) - lag])
    np.testing.assert_array_equal(late[:lag], np.tile(fresh[0], (lag, 1)))


@pytest.mark.ci
def test_all_senses_in_their_order_whatever_the_order_asked_for():
    task = Hexapod(observes=("course", "contact", "current", "yaw", "lateral"), lag=1, course=40, yaw_smoothing=0.25)
    observed, *_ = followed(task)
    assert observed.shape == (131, 20)
    assert len(task.observation_range) == task.observation_size == 20
    reading = read_hexapod(the_walk())
    now = np.degrees(reading.lateral[:, 0]) / 30.0
    np.testing.assert_allclose(observed[1:, :6], now[:-1], atol=1e-6)
    np.testing.assert_allclose(observed[:, 6:12], now, atol=1e-6)
    contact = np.where(reading.contact[:, 0] > 0.5, 1.0, -1.0)
    np.testing.assert_array_equal(observed[:, 12:18], contact)
    assert 0.1 < (contact > 0).mean() < 0.9
    smoothed, yaw = [], 0.0
    for rate in reading.yaw_rate[:, 0]:
        yaw += 0.25 * (rate - yaw)
        smoothed.append(yaw)
    np.testing.assert_allclose(observed[:, 18], smoothed, atol=1e-5)
    starts = reading.heading[np.arange(131) // 40 * 40, 0]
    away = np.angle(np.exp(1j * (reading.heading[:, 0] - starts)))
    np.testing.assert_allclose(observed[:, 19], away, atol=1e-5)
    assert np.abs(away).max() > 0.05


def test_joints_and_trunk_are_sensed_as_the_body_moves():
    """The trunk against the coordinates of its free joint, whose rotation is in its own axes."""
    task = Hexapod(observes=("trunk", "velocity", "vertical"))
    observed, *_ = followed(task)
    assert observed.shape == (131, 26)
    assert len(task.observation_range) == len(task.observation_names) == task.observation_size == 26
    reading, walk = read_hexapod(the_walk()), the_walk().velocity[:, 0]
    np.testing.assert_allclose(observed[:, :6], np.degrees(reading.vertical[:, 0]) / 30.0, atol=1e-6)
    joints = np.concatenate([reading.lateral_velocity[:, 0], reading.vertical_velocity[:, 0]], axis=1)
    np.testing.assert_allclose(observed[:, 6:18], joints / 10, atol=1e-5)
    turned = Rotation.from_quat(the_walk().position[:, 0, 3:7], scalar_first=True)
    tilt = turned.as_matrix()[:, 2, :2]
    np.testing.assert_allclose(observed[:, 18:20], 5 * tilt, atol=1e-5)
    own = turned.inv().apply(the_walk().sensors["velocity"][:, 0])
    np.testing.assert_allclose(observed[:, 20:23], own / [2, 1, 0.5], atol=1e-5)
    np.testing.assert_allclose(observed[:, 23:], walk[:, 3:6] / 3, atol=1e-5)
    assert np.abs(observed).max(0).min() > 0.1
    with pytest.raises(ValueError, match="smell"):
        Hexapod(observes=("smell",))


def test_with_all_senses_left_and_right_share_their_units():
    task = make("hexapod-proprioception")
    policy = agent_for(task).policy(jax.random.key(0))
    assert (task.observation_size, policy.outputs, policy.pool.outputs) == (40, 24, 12)
    assert "lateral" not in task.observes
    assert not np.any(policy.pool.pool.weights)


def test_a_course_goes_on_where_headings_jump_by_a_turn():
    task = Hexapod(observes=("course",), course=1000)
    memory, _ = task.observe(task.init(NONE), at(0, forward=(math.cos(3.1), math.sin(3.1), 0.0)), NONE)
    _, seen = task.observe(memory, at(1, forward=(math.cos(-3.1), math.sin(-3.1), 0.0)), NONE)
    assert float(seen[0]) == pytest.approx(2 * math.pi - 6.2, abs=1e-5)


@pytest.mark.ci
def test_velocity_is_paid_along_the_heading_the_course_or_x():
    reading, velocity = read_hexapod(the_walk()), the_walk().sensors["velocity"][:, 0]
    heading = reading.heading[:, 0]
    kept = heading[(np.arange(1, 131) - 1) // 40 * 40]
    along = {
        "heading": velocity[1:, 0] * np.cos(heading[1:]) + velocity[1:, 1] * np.sin(heading[1:]),
        "course": velocity[1:, 0] * np.cos(kept) + velocity[1:, 1] * np.sin(kept),
        "x": velocity[1:, 0],
    }
    for reward_type, wanted in along.items():
        _, rewards, *_ = followed(Hexapod(reward_type=reward_type, course=40))
        np.testing.assert_allclose(rewards, 4.0 * wanted, atol=1e-5)
        _, doubled, *_ = followed(Hexapod(reward_type=reward_type, course=40, reward_scale=8.0))
        np.testing.assert_allclose(doubled, 2.0 * rewards, atol=1e-5)
    assert np.abs(along["heading"] - along["course"]).max() > 0.01
    assert np.abs(along["heading"] - along["x"]).max() > 0.01


@pytest.mark.ci
def test_speed_is_reported_at_every_decision_and_stalls_once_a_second():
    *_, falls, metrics = followed(Hexapod())
    speed = read_hexapod(the_walk()).speed[1:, 0]
    np.testing.assert_allclose([r["speed"] for r in metrics], speed, atol=1e-6)
    stalls = {n + 1: r["stalls"] for n, r in enumerate(metrics) if r["stalls"] is not None}
    assert stalls == {50: float(speed[:50].mean() < 0.3), 100: float(speed[50:100].mean() < 0.3)}
    assert not any(falls)
    assert {r["falls"] for r in metrics} == {0.0}
    assert {r["net"] for r in metrics} == {None}  # twenty seconds are not over


def test_net_displacement_is_that_of_twenty_seconds_each():
    """Along a straight line at 0.5 m/s and then back at 1 m/s, in decisions of a second."""
    task = Hexapod(action_period=1.0)
    places = [0.5 * n for n in range(21)] + [10.0 - n for n in range(1, 21)]
    memory, found = task.init(NONE), []
    for n, place in enumerate(places):
        speed = -1.0 if n > 20 else 0.5
        state = at(0, position=(1.0, 2.0 + place, 0.2), velocity=(speed, 0.0, 0.0), forward=(1.0, 0.0, 0.0))
        if n:
            memory, _, _ = task.reward(memory, state, jnp.zeros(24))
        memory, _ = task.observe(memory, state, NONE)
        values = task.metrics(memory, state)
        if n and values["net"][1]:
            found.append((n, float(values["net"][0])))
        if n:
            assert bool(values["stalls"][1])
            assert float(values["stalls"][0]) == (n > 20)
    assert found == [(20, pytest.approx(0.5)), (40, pytest.approx(1.0))]


def walked(task, speeds, upward=1.0):
    """The metrics of `net` along x at these speeds in m/s, one a decision; at the last the trunk's up points so."""
    memory, _ = task.observe(task.init(NONE), at(0, position=(0.0, 0.0, 0.2)), NONE)
    found, place = [], 0.0
    for n, speed in enumerate(speeds, 1):
        place += speed * task.period
        up = (0.0, 0.0, upward if n == len(speeds) else 1.0)
        state = at(0, position=(place, 0.0, 0.2), velocity=(speed, 0.0, 0.0), forward=(1.0, 0.0, 0.0), upward=up)
        memory, _, _ = task.reward(memory, state, jnp.zeros(24))
        memory, _ = task.observe(memory, state, NONE)
        value, occurred = task.metrics(memory, state)["net"]
        found += [(n, float(value))] if bool(occurred) else []
    return found


def test_a_fall_ends_the_twenty_seconds_and_wins_nothing():
    task = Hexapod(action_period=1.0)
    assert walked(task, [1.0] * 5) == []
    assert walked(task, [1.0] * 5, upward=-1.0) == [(5, pytest.approx(5 / 20))]
    assert walked(task, [1.0] * 22, upward=-1.0) == [(20, pytest.approx(1.0)), (22, pytest.approx(2 / 20))]
    assert walked(task, [1.0] * 20, upward=-1.0) == [(20, pytest.approx(1.0))]  # once, not twice


@pytest.mark.ci
def test_a_shorter_episode_has_a_net_displacement_of_its_own_length():
    assert walked(Hexapod(action_period=1.0, time_limit=4.0), [1.0, 1.0, 1.0, -1.0]) == [(4, pytest.approx(0.5))]
    assert walked(Hexapod(action_period=1.0, time_limit=40.0), [1.0] * 21) == [(20, pytest.approx(1.0))]


def test_an_overturned_trunk_ends_the_episode_and_counts_as_a_fall():
    task = Hexapod()
    memory, _ = task.observe(task.init(NONE), at(0), NONE)
    for tilt, fallen in ((0.0, False), (89.0, False), (91.0, True), (180.0, True)):
        up = (0.0, math.sin(math.radians(tilt)), math.cos(math.radians(tilt)))
        state = at(1, upward=up)
        after, _, ended = task.reward(memory, state, jnp.zeros(24))
        assert bool(ended) == fallen
        rate, occurred = task.metrics(after, state)["falls"]
        assert occurred
        assert float(rate) == pytest.approx(50.0 * fallen)


@pytest.mark.ci
def test_the_engine_puts_a_body_on_its_back_on_its_feet():
    task = HexapodSynergy()
    stepper = stepper_for(task, agent_for(task), range(2), threads=1)
    stepper.advance(3)
    stepper.harvest()
    snapshot = stepper.batch.snapshot()
    snapshot["state"][1, 1 + 2] = 0.3  # after the clock, the root's position and its quaternion
    snapshot["state"][1, 1 + 3 : 1 + 7] = (0.0, 1.0, 0.0, 0.0)
    stepper.batch.restore(snapshot)
    stepper.advance(1)
    record = stepper.harvest()
    np.testing.assert_array_equal(record["episodes"], [0, 1])
    np.testing.assert_allclose(record["falls"], [0.0, 50.0])
    assert not record["diverged"].any()
    upright = read_hexapod(stepper.batch.unpack(stepper.batch.packed)).upright
    np.testing.assert_array_less(0.9, upright)
    memory = stepper.state["cycle"].memory
    np.testing.assert_array_equal(memory.decisions, [4, 0])


def test_synergies_drive_the_muscles_of_their_phase_and_tripod():
    task = HexapodSynergy()
    assert (task.action_size, len(task.body.groups)) == (4, 24)
    for unit, (tripod, muscles) in enumerate(
        (tripod, muscles) for tripod in TRIPODS for muscles in ({"protractor", "levator"}, {"retractor", "depressor"})
    ):
        driven = np.asarray(task.control(np.eye(4)[unit]))
        wanted = [name.partition("_")[0] in muscles and name.partition("_")[2] in tripod for name in task.body.groups]
        np.testing.assert_array_equal(driven, wanted)
    np.testing.assert_array_equal(task.control(np.ones((3, 4))), np.ones((3, 24)))
    plain = Hexapod()
    action = np.arange(24) % 2
    assert plain.control(action) is action
    np.testing.assert_array_equal(Hexapod(synergies=TRIPOD_SYNERGIES).control(np.ones(4)), np.ones(24))


def test_muscles_that_two_units_drive_fire_once():
    task = Hexapod(synergies=("levator_*", "levator_left_* depressor_*"))
    driven = np.asarray(task.control(np.array([1.0, 1.0])))
    np.testing.assert_array_equal(driven, [name.startswith(("levator", "depressor")) for name in task.body.groups])


@pytest.mark.ci
def test_terrain_is_under_the_body_and_difficulty_0_is_a_plane():
    assert Hexapod().dynamics == HexapodBody()
    task = make("hexapod", terrain={"kind": "waves", "difficulty": 0.5, "seed": 3})
    assert task.dynamics == OnTerrain(HexapodBody(), Terrain("waves", difficulty=0.5, seed=3))
    run = train(task, steps=20, seeds=1, window=10, progress=False)
    assert np.isfinite(run.curve("speed")[1]).all()
    assert not run.curve("diverged")[1].any()


@pytest.mark.ci
def test_the_biomimetic_body_walks_too():
    task = HexapodSynergy(body=biomimetic_hexapod())
    run = train(task, steps=30, seeds=1, window=10, progress=False)
    assert np.isfinite(run.curve("speed")[1]).all()
    assert not run.curve("diverged")[1].any()


BAD = [
    ({"lag": -1}, "lag = -1: must be an integer from 0 to 1,000, in decisions"),
    ({"lag": 0.5}, "lag = 0.5: must be an integer"),
    ({"course": 0}, "course = 0: must be an integer of at least 1, in decisions"),
    ({"observes": ()}, r"observes = \(\): must be at least one of lateral, current"),
    ({"observes": ("lateral", "lateral")}, "observes = .*must be different senses"),
    ({"observes": ("latral",)}, r"observes\[0\] 'latral': did you mean 'lateral'"),
    ({"reward_type": "y"}, "reward_type 'y'"),
    ({"angle_scale": 0.0}, r"angle_scale = 0.0: must be in \[0.01, 90\], in degrees"),
    ({"yaw_smoothing": 0.0}, r"yaw_smoothing = 0.0: must be in \(0, 1\]"),
    ({"reward_scale": math.nan}, "reward_scale = nan"),
    ({"action_period": 0.021}, "action_period = 0.021: must be a positive multiple of the time step, 0.0025 s"),
    ({"time_limit": 0.01}, "time_limit = 0.01: must be None or at least one action period"),
    ({"synergies": ()}, r"synergies = \(\): must be at least one unit"),
    ({"synergies": ("levator_*", " ")}, r"synergies\[1\] = ' ': must be names"),
    ({"synergies": ("levater_left_rear",)}, r"synergies\[0\]: 'levater_left_rear': did you mean 'levator_left_rear'"),
    ({"body": HexapodBody(drive="servos")}, "body.drive = 'servos': must be 'muscles'"),
]


@pytest.mark.parametrize(("settings", "message"), BAD, ids=[str(settings)[:40] for settings, _ in BAD])
def test_impossible_settings_are_refused_by_name(settings, message):
    with pytest.raises(ValueError, match=message):
        Hexapod(**settings)


@pytest.mark.ci
def test_an_evaluation_measures_the_gait():
    task = HexapodSynergy(time_limit=2.0)
    run = train(task, steps=100, seeds=[4, 9], window=50, progress=False)
    found = evaluate(run, 200)
    assert set(found.motion_metrics) == {"gait", "frequency", "phase", "contact_correlation", "correlation", "duty"}
    assert set(found.motion_metrics["gait"]) <= {"tripod", "pronk", "intermediate", "stalled"}
    assert all(len(values) == 2 for values in found.motion_metrics.values())
    assert found.sensors is not None
    # the mean speed that the classes are made from is the metric's, but for the start
    speed = read_hexapod_of(found)[:, 100:].mean(1)
    assert all((kind == "stalled") == (v < 0.03) for kind, v in zip(found.motion_metrics["gait"], speed, strict=True))
    assert evaluate(run, 149).measures == {}  # after the first two seconds there must be one to measure


def read_hexapod_of(found):
    ahead, velocity = found.sensors["forward"], found.sensors["velocity"]
    return (ahead[..., :2] * velocity[..., :2]).sum(-1) / np.linalg.norm(ahead[..., :2], axis=-1)


@pytest.mark.ci
def test_a_run_of_either_is_loaded_with_its_settings(tmp_path):
    for task in (Hexapod(lag=1, observes=ALL, reward_type="course"), HexapodSynergy(lag=2)):
        run = train(task, steps=10, seeds=1, out=tmp_path / task.name, window=5, progress=False)
        assert run.policies.weights.shape == (1, task.action_size, task.observation_size)
        assert mg.load(tmp_path / task.name).task == task


@pytest.mark.slow
@pytest.mark.parametrize("lag", [0, 1])
def test_synergies_learn_to_walk(lag):
    # 150 s of practice; the fixed controller walks at 0.52 m/s
    run = train(HexapodSynergy(lag=lag), steps=7_500, seeds=4, window=500, progress=False)
    speed = run.curve("speed")[1]
    assert np.median(speed[:, 0]) < 0.5
    assert np.median(speed[:, -1]) > 0.6
    assert dataclasses.asdict(run.task)["lag"] == lag
    assert len(LEGS) == run.task.observation_size


@pytest.mark.parametrize("course", [1, 7, 160, 2**31 - 1])
def test_an_episode_without_end_keeps_its_seconds_spans_and_courses(course):
    task = Hexapod(course=course, time_limit=None)
    often = math.lcm(task._span, task._decisions(1.0))
    assert task._round % often == 0
    assert course == 2**31 - 1 or task._round % course == 0
    assert 2**29 < task._round < 2**30
    memory = task.init(jnp.zeros(0))._replace(decisions=jnp.int32(2 * task._round - 2))
    observe = jax.jit(task.observe)
    for made in (-1, 0, 1):
        memory, _ = observe(memory, at(0), jnp.zeros(0))
        assert memory.decisions == task._round + made + (made < 0) * task._round
        assert (memory.decisions % often == 0) == (made == 0)
