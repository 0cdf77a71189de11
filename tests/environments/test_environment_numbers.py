"""The numbers are the task's: those that motorgrad's own engines see and reward, for the same actions."""

import numpy as np
import pytest

from motorgrad.environments import TaskEnv
from motorgrad.tasks import CallAdmission, Chain, Hopper
from motorgrad.training import agent_for, stepper_for


@pytest.mark.ci
@pytest.mark.representatives("landing")
@pytest.mark.parametrize("reward_type", ["landing", "apex"])
def test_the_hopper_of_training_is_the_environments(reward_type):
    task = Hopper(reward_type=reward_type, time_limit=1.5)
    stepper = stepper_for(task, agent_for(task), [4])
    environment = TaskEnv(task)
    observation, _ = environment.reset()
    paid_sometimes = apexes = 0
    for decision in range(450):
        assert np.array_equal(stepper.state["cycle"].observation[0], observation)
        # the learner's own action, or a hop: what a learner has not learned yet pays nothing
        action = np.array(stepper.control[0])
        observation, reward, terminated, truncated, info = environment.step(action)
        stepper.advance(1)
        record = stepper.harvest()
        assert reward == pytest.approx(record["reward"][0], rel=1e-6)  # compiled apart, they may round apart
        assert (terminated or truncated) == bool(record["episodes"][0]) == (decision % 150 == 149)
        assert ("apex" in info) == bool(record["apex_count"][0])
        if "apex" in info:
            assert np.float32(info["apex"]) == record["apex"][0]
            apexes += 1
        paid_sometimes += reward > 0
        if truncated:
            observation, _ = environment.reset()
    assert apexes > 3
    assert paid_sometimes > 3


@pytest.mark.ci
def test_the_chain_of_training_is_the_environments():
    task = Chain(length=3)
    stepper = stepper_for(task, agent_for(task), [4])
    environment = TaskEnv(task)
    environment.reset()
    total = 0.0
    for _ in range(100):
        stepper.advance(1)
        action = int(stepper.state["cycle"].action[0])
        observation, reward, *_ = environment.step(action)
        assert np.array_equal(stepper.state["cycle"].observation[0], observation)
        assert np.float32(reward) == stepper.harvest()["reward"][0]
        total += reward
    assert total > 0


def test_a_random_world_is_moved_by_the_rows_own_numbers():
    """Beside the task's functions and the generator that Gymnasium makes of the seed."""
    import gymnasium

    task = CallAdmission()
    environment = TaskEnv(task)
    environment.reset(seed=11)
    generator = gymnasium.utils.seeding.np_random(11)[0]
    state = task.dynamics.reset(np.zeros(0, np.float32))
    memory, _ = task.observe(task.init(np.zeros(0)), state, np.zeros(0))
    for decision in range(30):
        action = np.array([decision % 3 > 0], np.float32)
        state = task.dynamics.step(state, action, generator.random(1, np.float32))
        memory, paid, _ = task.reward(memory, state, action)
        memory, seen = task.observe(memory, state, np.zeros(0))
        observation, reward, *_ = environment.step(action)
        np.testing.assert_array_equal(observation, seen)
        assert np.float32(reward) == paid
