"""The stride's task: the clock, the ground that rises and sinks, what is felt and paid; learning it."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.bodies import read_hexapod
from motorgrad.environments import TaskEnv
from motorgrad.policies import graded_hyperplanes, hyperplanes
from motorgrad.tasks import HexapodStride, make
from motorgrad.training import agent_for, stepper_for, train


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def walked(task, action, decisions, phase=0.0, slope_number=0.5):
    """The memories and the states of one body under one action, and what it observes, is paid and reports."""
    batch = task.batch([0], 1)
    state = jax.tree.map(lambda part: part[0], batch.unpack(batch.packed.copy()))
    memory, seen = task.observe(task.init(jnp.array([phase])), state, jnp.array([slope_number]))
    told = []
    for _ in range(decisions):
        batch.step(np.asarray(task.control(jnp.asarray(action), memory))[None])
        state = jax.tree.map(lambda part: jnp.asarray(part[0]), batch.unpack(batch.packed.copy()))
        memory, reward, fallen = task.reward(memory, state, jnp.asarray(action))
        metrics = task.metrics(memory, state)
        memory, seen = task.observe(memory, state, jnp.array([slope_number]))
        told.append((memory, state, float(reward), bool(fallen), metrics, float(seen[0])))
    return told


def test_an_action_is_a_frequency_within_the_limits():
    task = HexapodStride(start=0.3, shortest=0.1, longest=0.6)
    actions = np.array([[0.0], [1.0], [-0.25], [-5.0], [9.0]])
    np.testing.assert_allclose(task.period_of(actions), [0.3, 0.15, 0.4, 0.6, 0.1], rtol=1e-6)


def test_the_clock_goes_on_at_the_rate_that_was_chosen_whatever_was_before():
    task = HexapodStride(slopes=(0.0,))
    told = walked(task, [0.5], 20, phase=0.11)
    phases = np.array([float(memory.phase) for memory, *_ in told])
    np.testing.assert_allclose(phases, (0.11 + 0.01 * np.arange(1, 21) / 0.2) % 1.0, atol=1e-5)
    assert {round(float(metrics["period"][0]), 6) for *_, metrics, _ in told} == {0.2}
    # choices are averaged as frequencies: two ways to the same phase
    ends = []
    for pair in ((0.0, 1.0), (0.5, 0.5)):
        memory = task.init(jnp.array([0.3]))
        for action in pair:
            memory, *_ = task.reward(memory, told[0][1], jnp.array([action]))
        ends.append(float(memory.phase))
    assert ends[0] == pytest.approx(ends[1], abs=1e-6)


def test_swing_and_stance_follow_the_phase():
    task = HexapodStride()
    fires = dict(
        zip(task.body.groups, np.asarray(task.control(np.zeros(1), task.init(jnp.array([0.2]))))[:24], strict=True)
    )
    assert fires["depressor_left_front"] == fires["levator_right_front"] == 1
    assert fires["levator_left_front"] == fires["depressor_right_front"] == 0


def test_the_slope_is_drawn_for_each_stretch_and_felt_as_pitch():
    task = HexapodStride(slopes=(-10.0, 10.0), stretch=0.05, smoothing=1.0)
    memory, slopes = task.init(jnp.array([0.0])), []
    batch = task.batch([0], 1)
    state = jax.tree.map(lambda part: part[0], batch.unpack(batch.packed.copy()))
    numbers = np.random.default_rng(0).random(60)
    for number in numbers:
        memory, seen = task.observe(memory, state, jnp.array([number]))
        slopes.append(math.degrees(float(memory.slope)))
        # the body stands level on the plane
        assert float(seen[0]) == pytest.approx(slopes[-1] / task.pitch_scale, abs=1e-4)
    drawn = np.where(numbers[::5] < 0.5, -10.0, 10.0)
    np.testing.assert_allclose(slopes, drawn.repeat(5), rtol=1e-5)
    assert len(set(drawn)) == 2


def test_the_pitch_is_smoothed():
    task = HexapodStride(slopes=(8.0,), smoothing=0.25)
    memory = task.init(jnp.array([0.0]))
    state = jax.tree.map(lambda part: part[0], task.batch([0], 1).unpack(task.batch([0], 1).packed.copy()))
    seen = []
    for _ in range(3):
        memory, observed = task.observe(memory, state, jnp.array([0.0]))
        seen.append(float(observed[0]))
    np.testing.assert_allclose(seen, 0.8 * (1 - 0.75 ** np.arange(1, 4)), atol=1e-4)


@pytest.mark.ci
def test_it_is_paid_for_its_speed_and_falls_where_it_overturns():
    task = HexapodStride(slopes=(0.0,), reward_scale=3.0)
    for _memory, state, reward, fallen, metrics, _ in walked(task, [0.9], 30):
        assert reward == pytest.approx(3.0 * float(read_hexapod(state).speed), abs=1e-5)
        assert (fallen, float(metrics["falls"][0])) == (False, 0.0)
    over = state._replace(sensors={**state.sensors, "upward": jnp.array([0.0, 0.6, -0.8])})
    assert bool(task.reward(task.init(jnp.zeros(1)), over, jnp.zeros(1))[2])


@pytest.mark.ci
def test_uphill_is_slower_than_downhill():
    task = HexapodStride()
    speed = {}
    for slope in (-10.0, 10.0):
        told = walked(dataclasses.replace(task, slopes=(slope,)), [0.9], 200)
        speed[slope] = np.mean([reward for _, _, reward, *_ in told[100:]])
    assert speed[-10.0] > speed[10.0] + 1.0


@pytest.mark.ci
def test_it_learns_on_real_numbers_and_refuses_other_policies():
    task = make("hexapod-stride", stretch=0.1)
    run = train(task, steps=60, seeds=2, progress=False)
    assert not np.array_equal(run.policies.bias, run.initial.bias)
    with pytest.raises(ValueError, match="binary actions, but the task 'hexapod-stride' takes continuous"):
        train(task, agent_for(task, policy="hyperplanes", learning_rate=1e-3), steps=10, progress=False)
    assert (graded_hyperplanes(task).inputs, hyperplanes(task).outputs) == (1, 1)


@pytest.mark.slow
def test_a_saved_learner_goes_on_to_the_last_bit():
    task = HexapodStride(stretch=0.1)
    agent = agent_for(task)
    whole, parts = stepper_for(task, agent, [0, 1], threads=1), stepper_for(task, agent, [0, 1], threads=1)
    whole.advance(40)
    parts.advance(17)
    again = stepper_for(task, agent, [0, 1], threads=1)
    again.restore(parts.state)
    again.advance(23)
    jax.tree.map(np.testing.assert_array_equal, again.state, whole.state)


@pytest.mark.ci
def test_as_an_environment_it_takes_real_numbers():
    environment = TaskEnv("hexapod-stride")
    assert environment.action_space.shape == (1,)
    environment.reset(seed=0)
    for action in (np.array([0.5]), np.array([-0.5], np.float32)):
        observation, reward, *_ = environment.step(action)
        assert np.isfinite([*observation, reward]).all()
    with pytest.raises(ValueError, match=r"action = .*numbers from -0.625 to 2.75"):
        environment.step(np.array([np.nan]))


@pytest.mark.parametrize(
    ("setting", "named"),
    [
        ({"slopes": ()}, "slopes = (): must be at least one"),
        ({"slopes": (50.0,)}, "slopes[0] = 50.0: must be in [-45, 45], in degrees"),
        ({"stretch": 0.0}, "stretch = 0.0"),
        ({"shortest": 0.01}, "shortest = 0.01: must be at least two decisions"),
        ({"longest": 0.05}, "longest = 0.05"),
        ({"start": 2.0}, "start = 2.0"),
        ({"pitch_scale": 0.0}, "pitch_scale = 0.0"),
        ({"smoothing": 0.0}, "smoothing = 0.0"),
        ({"reward_scale": math.inf}, "reward_scale = inf"),
        ({"action_period": 0.003}, "action_period = 0.003"),
        ({"body": {"drive": "servos"}}, "body.drive = 'servos'"),
    ],
)
def test_impossible_settings_are_refused_by_name(setting, named):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        make("hexapod-stride", **setting)
    assert named in str(error.value)


def test_as_an_environment_it_takes_actions_from_the_greatest_period_to_the_least():
    environment = TaskEnv("hexapod-stride")
    (low,), (high,) = environment.action_space.low, environment.action_space.high
    for action, period in ((low, 0.8), (high, 0.08)):
        environment.reset(seed=0)
        *_, info = environment.step(np.array([action], np.float32))
        assert info["period"] == pytest.approx(period, rel=1e-5)
    with pytest.raises(ValueError, match=r"numbers from -0.625 to 2.75"):
        environment.step(np.array([-1.0], np.float32))
