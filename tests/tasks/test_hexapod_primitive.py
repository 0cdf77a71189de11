"""The primitive's task: when steps can begin, what their parts drive and how long, what is paid; learning it."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.bodies import LEGS, TRIPODS, read_hexapod
from motorgrad.environments import TaskEnv
from motorgrad.tasks import HexapodPrimitive, make
from motorgrad.training import agent_for, stepper_for, train

NONE = jnp.zeros(0)


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def walked(task, actions):
    """What one body observes and does under these actions: observations, activations by name, rewards, metrics."""
    batch = task.batch([0], 1)
    state = jax.tree.map(lambda part: jnp.asarray(part[0]), batch.unpack(batch.packed.copy()))
    memory, seen = task.observe(task.init(NONE), state, NONE)
    told = []
    for action in np.asarray(actions, float):
        control = np.asarray(task.control(jnp.asarray(action), memory))
        batch.step(control[None])
        state = jax.tree.map(lambda part: jnp.asarray(part[0]), batch.unpack(batch.packed.copy()))
        memory, reward, fallen = task.reward(memory, state, jnp.asarray(action))
        metrics = task.metrics(memory, state)
        told.append((np.asarray(seen), dict(zip(batch.groups, control, strict=True)), float(reward), fallen, metrics))
        memory, seen = task.observe(memory, state, NONE)
    return told, state


def part_of(fires, tripod):
    """What a tripod does, by the muscles that fire in all of its legs."""
    kinds = ("protractor", "retractor", "levator", "depressor")
    on = tuple(kind for kind in kinds if all(fires[f"{kind}_{leg}"] == 1 for leg in TRIPODS[tripod]))
    off = [kind for kind in kinds if all(fires[f"{kind}_{leg}"] == 0 for leg in TRIPODS[tripod])]
    assert len(on) + len(off) == 4
    return {("protractor", "levator"): "swing", ("retractor", "depressor"): "stance", ("depressor",): "stand"}[on]


@pytest.mark.ci
def test_a_step_is_a_swing_and_a_stance_of_the_lengths_that_were_chosen():
    task = HexapodPrimitive(swing=0.1, stance=0.1)
    begin = np.array([1, 0, math.log(0.6), math.log(2.0), 9.0, 9.0])  # 0.06 s and 0.2 s, the first tripod
    told, _ = walked(task, [begin] + [np.zeros(6)] * 19)
    first = [part_of(fires, 0) for _, fires, *_ in told]
    assert first == ["swing"] * 3 + ["stance"] * 10 + ["stand"] * 7
    assert {part_of(fires, 1) for _, fires, *_ in told} == {"stand"}
    np.testing.assert_array_equal([seen[0] for seen, *_ in told], [1.0] + [0.0] * 12 + [1.0] * 7)
    np.testing.assert_array_equal([seen[1] for seen, *_ in told], 1.0)
    # a twenty-fifth of a second is two decisions of half a tripod's step each
    assert [float(metrics["begins"][0]) for *_, metrics in told] == [25.0] + [0.0] * 19


def test_a_choice_counts_only_where_a_step_can_begin():
    task = HexapodPrimitive(swing=0.04, stance=0.06)
    short, long = np.array([1, 1, 0, 0, 0, 0]), np.array([1, 1, 2, 2, 2, 2])
    told, _ = walked(task, [short] + [long] * 4 + [short] * 5 + [np.zeros(6)])
    once = ["swing"] * 2 + ["stance"] * 3
    for tripod in range(2):
        assert [part_of(fires, tripod) for _, fires, *_ in told] == once * 2 + ["stand"]


def test_lengths_have_limits():
    task = HexapodPrimitive(swing=0.1, stance=0.2, shortest=0.05, longest=0.5)
    lasting = np.asarray(task.lasting(np.array([1.0, 1.0, 0.0, 0.0, -9.0, 9.0])))
    np.testing.assert_allclose(lasting, [[0.1, 0.2], [0.05, 0.5]], rtol=1e-6)


@pytest.mark.ci
def test_the_lateral_angles_are_observed_and_speed_is_paid():
    task = HexapodPrimitive(angle_scale=15.0, reward_scale=2.0)
    told, state = walked(task, np.random.default_rng(0).integers(0, 2, (30, 6)))
    assert float(told[-1][2]) == pytest.approx(2.0 * float(read_hexapod(state).speed), abs=1e-5)
    assert not any(bool(fallen) for *_, fallen, _ in told)
    assert told[0][0].shape == (task.observation_size,) == (2 + len(LEGS),)
    assert len(task.observation_range) == task.observation_size
    _, seen = task.observe(task.init(NONE), state, NONE)
    np.testing.assert_allclose(seen[2:], np.degrees(read_hexapod(state).lateral) / 15.0, atol=1e-5)
    over = state._replace(sensors={**state.sensors, "upward": jnp.array([0.0, 0.6, -0.8])})
    assert bool(task.reward(task.init(NONE), over, jnp.zeros(6))[2])


@pytest.mark.ci
def test_it_learns_both_and_either_alone():
    task = HexapodPrimitive()
    rates = dict(task.learner["learning_rate"])
    for off, still, moved in (
        ((), (), ("weights", "bias")),
        (("movement.bias",), ("bias",), ("weights",)),
        (("precondition.weights", "precondition.bias"), ("weights",), ("bias",)),
    ):
        agent = agent_for(task, learning_rate=rates | dict.fromkeys(off, 0.0))
        run = train(task, agent, steps=150, seeds=1, progress=False)
        learned = {"weights": run.policies.precondition.weights, "bias": run.policies.movement.bias}
        assert all(not np.any(learned[name]) for name in still)
        assert all(np.any(learned[name]) for name in moved)


@pytest.mark.slow
def test_a_saved_learner_goes_on_to_the_last_bit():
    task = HexapodPrimitive()
    agent = agent_for(task)
    whole, parts = stepper_for(task, agent, [0, 1], threads=1), stepper_for(task, agent, [0, 1], threads=1)
    whole.advance(40)
    parts.advance(17)
    again = stepper_for(task, agent, [0, 1], threads=1)
    again.restore(parts.state)
    again.advance(23)
    jax.tree.map(np.testing.assert_array_equal, again.state, whole.state)


@pytest.mark.slow
def test_other_policies_of_real_numbers_will_do_too():
    task = make("hexapod-primitive")
    rates = {"weights": 1e-4, "bias": 1e-4, "log_deviation": 0}
    agent = agent_for(task, policy="graded-hyperplanes", learning_rate=rates)
    run = train(task, agent, steps=30, seeds=1, progress=False)
    assert run.policies.bias.shape == (1, 6)
    environment = TaskEnv(task)
    environment.reset(seed=0)
    assert np.isfinite(environment.step(environment.action_space.sample())[0]).all()


@pytest.mark.parametrize(
    ("setting", "named"),
    [
        ({"swing": 5.0}, "swing = 5.0: must be from 0.02 to 1.0 s"),
        ({"stance": 0.001}, "stance = 0.001"),
        ({"shortest": 0.0}, "shortest = 0.0"),
        ({"longest": 0.01}, "longest = 0.01"),
        ({"angle_scale": 0.0}, "angle_scale = 0.0"),
        ({"reward_scale": math.nan}, "reward_scale = nan"),
        ({"action_period": 0.003}, "action_period = 0.003"),
        ({"body": {"drive": "servos"}}, "body.drive = 'servos'"),
    ],
)
def test_impossible_settings_are_refused_by_name(setting, named):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        make("hexapod-primitive", **setting)
    assert named in str(error.value)


def test_as_an_environment_its_actions_reach_the_limits_of_what_steps_last():
    task = HexapodPrimitive()
    low, high = np.array(task.action_range).T
    np.testing.assert_allclose(task.lasting(low.astype(np.float32)), task.shortest, rtol=1e-5)
    np.testing.assert_allclose(task.lasting(high.astype(np.float32)), task.longest, rtol=1e-5)
    assert (low[:2].tolist(), high[:2].tolist()) == ([0, 0], [1, 1])
