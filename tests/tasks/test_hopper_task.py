"""The hopper's task: what is observed and paid, by hand and along recorded hops; its settings; learning it."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.bodies import Attachment, BodyState, Muscle
from motorgrad.bodies import Hopper as HopperBody
from motorgrad.learning import Agent, gpomdp
from motorgrad.policies import hyperplanes
from motorgrad.tasks import Hopper, make
from motorgrad.training import agent_for, stepper_for, train

AIR, GROUND = 0.0, 5.0  # newtons of contact
IDLE = jnp.zeros(2)


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo notes divergences in the working directory


def body_state(height=0.0, contact=AIR, angle=0.0, velocity=0.0):
    sensors = {"foot_height": height, "foot_contact": contact, "knee_angle": angle, "knee_velocity": velocity}
    return BodyState(jnp.zeros(6), jnp.zeros(6), {name: jnp.asarray(value) for name, value in sensors.items()})


def paid(task, flight, action=IDLE):
    """What each decision along a flight pays, given as (height, contact) pairs, and the apex reported at each."""
    memory, rewards, apexes = task.init(jnp.zeros(0)), [], []
    for height, contact in flight:
        memory, reward, terminated = task.reward(memory, body_state(height, contact), action)
        assert terminated is False
        value, occurred = task.metrics(memory, None)["apex"]
        rewards.append(float(reward))
        apexes.append(float(value) if occurred else None)
    return rewards, apexes


# two apexes, the second one higher: the legs are drawn in on the way down
TWO_PEAKS = [(0.02, GROUND), (0.1, AIR), (0.3, AIR), (0.2, AIR), (0.25, AIR), (0.5, AIR), (0.1, AIR), (0.0, GROUND)]
AGAIN = [(0.05, AIR), (0.04, AIR), (0.0, GROUND), (0.0, GROUND)]


def test_a_landing_pays_the_flights_greatest_height():
    rewards, apexes = paid(Hopper(), TWO_PEAKS + AGAIN)
    np.testing.assert_allclose(rewards, [0, 0, 0, 0, 0, 0, 0, 50, 0, 0, 5, 0], atol=1e-5)
    assert [round(a, 3) if a else a for a in apexes] == [*[None] * 7, 0.5, None, None, 0.05, None]


def test_the_apex_variant_pays_the_first_apex_once_when_it_is_passed():
    rewards, apexes = paid(Hopper(reward_type="apex"), TWO_PEAKS + AGAIN)
    np.testing.assert_allclose(rewards, [0, 0, 0, 30, 0, 0, 0, 0, 0, 5, 0, 0], atol=1e-5)
    assert apexes[7] == pytest.approx(0.5)  # what is reported is the whole flight's


@pytest.mark.parametrize("variant", ["landing", "apex"])
def test_a_flight_below_hop_height_is_no_hop(variant):
    low = [(0.02, AIR), (0.03, AIR), (0.01, AIR), (0.0, GROUND)]
    assert paid(Hopper(reward_type=variant), low) == ([0, 0, 0, 0], [None] * 4)
    assert max(paid(Hopper(reward_type=variant, hop_height=0.029), low)[0]) == pytest.approx(3)


def test_a_touch_of_the_ground_begins_a_new_flight():
    rewards, _ = paid(Hopper(), [(0.4, AIR), (0.0, GROUND), (0.1, AIR), (0.0, GROUND)])
    np.testing.assert_allclose(rewards, [0, 40, 0, 10], atol=1e-5)


def test_inputs_of_noise_follow_the_sensors():
    task, plain = Hopper(noise_inputs=3), Hopper()
    state = body_state(contact=GROUND, angle=0.3, velocity=2.0)
    _, seen = task.observe(task.init(jnp.zeros(0)), state, jnp.asarray([0.0, 0.5, 0.75]))
    _, sensed = plain.observe(plain.init(jnp.zeros(0)), state, jnp.zeros(0))
    np.testing.assert_allclose(seen, [*sensed, -1.0, 0.0, 0.5], atol=1e-6)
    assert (task.uniforms, plain.uniforms) == (3, 0)
    assert task.observation_size == len(task.observation_names) == len(task.observation_range) == 6
    assert task.observation_names == (*plain.observation_names, "noise 1", "noise 2", "noise 3")
    assert len(task.observation_units) == 6


WINDY = Hopper(body=HopperBody(lateral="spring"), gust=8.0)


def test_a_gust_lasts_for_a_flight_and_is_drawn_anew_for_the_next():
    memory = WINDY.init(jnp.zeros(0))
    forces = []
    for contact, number in zip((GROUND, AIR, AIR, GROUND, AIR), (0.9, 0.25, 0.9, 0.9, 1.0), strict=True):
        memory, seen = WINDY.observe(memory, body_state(contact=contact), jnp.asarray([number]))
        *muscles, force = WINDY.control(jnp.asarray([1.0, 0.0]), memory)
        assert muscles == [1.0, 0.0]
        assert len(seen) == WINDY.observation_size == 3  # it is not observed
        forces.append(float(force))
    np.testing.assert_allclose(forces, [0.0, -4.0, -4.0, 0.0, 8.0], atol=1e-5)


def test_gusts_change_neither_actions_nor_costs_and_go_with_inputs_of_noise():
    assert (WINDY.action_size, WINDY.action_names, WINDY.uniforms) == (2, ("flexor", "extensor"), 1)
    assert paid(WINDY, TWO_PEAKS, jnp.ones(2)) == paid(Hopper(), TWO_PEAKS, jnp.ones(2))
    noisy = dataclasses.replace(WINDY, noise_inputs=2)
    memory, seen = noisy.observe(noisy.init(jnp.zeros(0)), body_state(), jnp.asarray([0.5, 0.75, 0.25]))
    np.testing.assert_allclose(seen[3:], [0.0, 0.5], atol=1e-6)
    assert float(memory.gust) == pytest.approx(-4.0)


def test_a_body_that_cannot_lean_has_no_gusts():
    with pytest.raises(ValueError, match=r"gust = 8.0: must be 0 for a body that cannot lean"):
        Hopper(gust=8.0)


def test_a_motor_costs_what_a_muscle_does():
    motors = Hopper(body=HopperBody(drive="motors"))
    for action in ((1.0, 0.0), (1.0, 1.0)):
        assert paid(motors, [(0.0, GROUND)], jnp.asarray(action)) == paid(
            Hopper(), [(0.0, GROUND)], jnp.asarray(action)
        )


def test_reward_scale_is_the_pay_of_a_metre():
    assert paid(Hopper(reward_scale=30.0), [(0.5, AIR), (0.0, GROUND)])[0][1] == pytest.approx(15)


@pytest.mark.parametrize(("action", "muscles"), [((0, 0), 0), ((1, 0), 2), ((0, 1), 2), ((1, 1), 4)])
def test_the_penalty_is_for_each_active_muscle(action, muscles):
    for penalty in (0.1, 0.7):
        ((cost,), _) = paid(Hopper(penalty=penalty), [(0.0, GROUND)], jnp.asarray(action, float))
        assert cost == pytest.approx(-penalty * muscles)


def test_a_muscle_more_costs_more():
    origin, insertion = (Attachment(name, (0.0, 0.0, 0.0)) for name in ("load", "foot"))
    extra = Muscle("helper", "helper", origin, insertion, strength=50.0, rest_length=0.4)
    task = Hopper(body=HopperBody(extra_muscles=(extra,)))
    assert task.action_size == 3
    ((cost,), _) = paid(task, [(0.0, GROUND)], jnp.ones(3))
    assert cost == pytest.approx(-0.5)


@pytest.mark.parametrize("centre", [90.0, 0.0, 60.0])
@pytest.mark.parametrize("interior", [45.0, 90.0, 140.0])
def test_the_observation_is_contact_angle_about_the_centre_and_scaled_velocity(centre, interior):
    task = Hopper(centre=centre, velocity_scale=0.05)
    for contact, sign in ((AIR, -1), (GROUND, 1)):
        state = body_state(contact=contact, angle=math.radians(interior - 90), velocity=-8.0)
        memory = task.init(jnp.zeros(0))
        same, seen = task.observe(memory, state, jnp.zeros(0))
        np.testing.assert_allclose(seen, [sign, math.radians(interior - centre), -0.4], atol=1e-6)
        assert same == memory


def test_without_contact_the_knee_alone_is_observed():
    whole, knee = Hopper(), Hopper(observe_contact=False)
    state = body_state(contact=GROUND, angle=0.3, velocity=-8.0)
    seen = [task.observe(task.init(jnp.zeros(0)), state, jnp.zeros(0))[1] for task in (whole, knee)]
    np.testing.assert_array_equal(seen[1], seen[0][1:])
    for task, observed in zip((whole, knee), seen, strict=True):
        assert len(task.observation_range) == task.observation_size == len(observed)


def reference(task, heights, contacts, actions):
    """The rewards of one seed's life, once more, in plain Python."""
    flight, first, rewards = 0.0, False, []
    for height, contact, action in zip(heights, contacts, actions, strict=True):
        earned = 0.0
        if contact > 0:
            highest = max(flight, height)
            if task.reward_type == "landing" and highest > task.hop_height:
                earned = highest
            flight, first = 0.0, False
        else:
            if task.reward_type == "apex" and not first and height < flight and flight > task.hop_height:
                earned, first = flight, True
            flight = max(flight, height)
        rewards.append(task.reward_scale * earned - task.penalty * 2 * sum(action))
    return rewards


@pytest.mark.ci
@pytest.mark.parametrize("variant", ["landing", "apex"])
def test_the_engine_pays_along_recorded_hops_what_the_rule_says(variant):
    task = Hopper(reward_type=variant)
    stepper = stepper_for(task, agent_for(task), range(3), mode="sample")
    paid, seen, actions = [], [], []
    for _ in range(250):
        actions.append(np.array(stepper.control))
        stepper.advance(1)
        paid.append(stepper.harvest()["reward"])
        sensors = stepper.batch.unpack(stepper.batch.packed.copy()).sensors
        seen.append((sensors["foot_height"], sensors["foot_contact"]))
    actions, paid = np.stack(actions, 1), np.stack(paid, 1)
    for row in range(3):
        heights, contacts = ([float(pair[part][row]) for pair in seen] for part in (0, 1))
        np.testing.assert_allclose(paid[row], reference(task, heights, contacts, actions[row].tolist()), atol=1e-4)
    assert (paid > 1).sum() >= 3  # there were hops


@pytest.mark.parametrize(("period", "timestep", "substeps"), [(0.01, 0.001, 10), (0.01, 0.0005, 20), (0.003, 0.001, 3)])
def test_an_action_lasts_whole_physics_steps(period, timestep, substeps):
    task = Hopper(action_period=period, body=HopperBody(timestep=timestep))
    assert task.substeps == substeps
    assert task.period == period
    batch = task.batch([0], 1)
    for _ in range(3):
        batch.step(np.zeros((1, 2)))
    assert batch.snapshot()["state"][0, 0] == pytest.approx(3 * period)  # the physics' own clock


@pytest.mark.parametrize(("limit", "decisions"), [(None, None), (0.01, 1), (0.5, 50), (0.29, 29)])
def test_a_time_limit_is_in_seconds(limit, decisions):
    assert Hopper(time_limit=limit).episode_limit == decisions


BAD = [
    ("reward_type", "takeoff"),
    *(("reward_scale", value) for value in (math.nan, math.inf)),
    *(("penalty", value) for value in (-0.1, math.nan, math.inf)),
    *(("gust", value) for value in (-1.0, math.nan, math.inf)),
    *(("hop_height", value) for value in (0.0, -1.0, math.nan, math.inf)),
    *(("centre", value) for value in (-1.0, 181.0, math.nan)),
    *(("velocity_scale", value) for value in (math.nan, math.inf)),
    *(("action_period", value) for value in (0.0, -0.01, 0.0105, 0.0004, math.nan, math.inf)),
    *(("time_limit", value) for value in (0.0, 0.009, -1.0, math.nan, math.inf)),
]


@pytest.mark.parametrize(("name", "value"), BAD)
def test_impossible_settings_are_refused_by_name(name, value):
    with pytest.raises(ValueError, match=rf"{name} (= )?{value!r}: (must be|known are|did you mean)"):
        Hopper(**{name: value})


@pytest.mark.parametrize("value", ["1", None, [1.0], True, math.nan])
@pytest.mark.parametrize("name", [f.name for f in dataclasses.fields(Hopper) if f.type is float or f.type == "float"])
def test_what_is_no_number_is_refused_by_name(name, value):
    with pytest.raises(ValueError, match=f"{name} = .*must be a finite number"):
        make("hopper", **{name: value})


def test_the_bodys_settings_are_a_table_in_the_tasks():
    task = make("hopper", body={"load_mass": 3, "muscle_model": "native"}, penalty=0)
    assert task == Hopper(body=HopperBody(load_mass=3.0, muscle_model="native"), penalty=0.0)
    with pytest.raises(ValueError, match=r"unknown setting of hopper.body 'load_mas': did you mean 'load_mass'"):
        make("hopper", body={"load_mas": 3})
    with pytest.raises(ValueError, match=r"load_mass = -1.0: must be"):
        make("hopper", body={"load_mass": -1})


VARIANTS = {
    "native muscles": {"muscle_model": "native"},
    "a spring": {"lateral": "spring"},
    "a heavy load": {"load_mass": 4.0},
}


@pytest.mark.ci
@pytest.mark.parametrize("settings", VARIANTS.values(), ids=VARIANTS)
def test_every_variant_of_the_body_learns(settings):
    gust = 5.0 if "lateral" in settings else 0.0
    plain, run = (
        train(task, steps=150, seeds=2, window=50, progress=False)
        for task in (make("hopper"), make("hopper", body=settings, gust=gust))
    )
    assert np.isfinite(run.metrics["reward"].to_numpy()).all()
    assert not run.curve("diverged")[1].any()
    assert np.abs(run.policies.weights).max() > 0
    assert not np.array_equal(run.policies.weights, plain.policies.weights)


@pytest.mark.ci
def test_an_estimate_at_fixed_parameters_is_finite_and_not_nothing():
    task = Hopper()
    stepper = stepper_for(task, Agent(hyperplanes(task), gpomdp(0.98)), range(3))
    stepper.advance(400)
    agent = stepper.state["cycle"].agent
    np.testing.assert_array_equal(agent.policy.weights, 0)
    np.testing.assert_array_equal(agent.gradient.count, 400)
    for leaf in jax.tree.leaves(agent.gradient.mean):
        assert np.isfinite(leaf).all()
        assert (leaf != 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("variant", ["landing", "apex"])
def test_it_learns_to_hop(variant):
    # 400 s of practice; the untrained hopper's apex is about 0.09 m, most are past 0.3 m by then
    run = train(Hopper(reward_type=variant), steps=40_000, seeds=4, window=2_500, progress=False)
    apex = run.curve("apex")[1]
    untrained, learned = np.median(apex[:, 0]), np.median(apex[:, -2:])
    assert untrained < 0.15
    assert learned > 2 * untrained
    assert np.median(run.curve("reward")[1][:, -1]) > np.median(run.curve("reward")[1][:, 0])
