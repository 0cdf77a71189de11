"""Environments of one's own, by their class or by a function that makes them."""

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers import TimeLimit

import motorgrad as mg
from motorgrad.schema import table
from motorgrad.tasks import from_gymnasium


class Walk(gymnasium.Env):
    """A walk to the right, which is rewarded."""

    observation_space = gymnasium.spaces.Box(-1, 1, (1,))
    action_space = gymnasium.spaces.Discrete(2)

    def __init__(self, length=5):
        self.length, self.place = length, 0

    def _seen(self):
        return np.array([self.place / self.length], np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place = 0
        return self._seen(), {}

    def step(self, action):
        self.place = max(0, self.place + (1 if action else -1))
        done = self.place == self.length
        return self._seen(), float(done), done, False, {}


def short_walk():
    return TimeLimit(Walk(3), 20)


MAKERS = pytest.mark.parametrize(("maker", "name"), [(Walk, "Walk"), (short_walk, "short_walk")])


@MAKERS
def test_a_class_or_a_function_is_an_environment(maker, name):
    task = from_gymnasium(maker)
    assert task.env_id == f"{__name__}:{name}"
    assert mg.make("gymnasium", **table(task)) == task


@pytest.mark.ci
@MAKERS
def test_a_run_with_a_class_or_a_function_is_stored_and_continues(maker, name, tmp_path):
    task = from_gymnasium(maker)
    run = mg.train(task, steps=200, seeds=2, out=tmp_path / "run", progress=False)
    assert mg.load(tmp_path / "run").task == task
    assert mg.resume(tmp_path / "run", 400, progress=False).decision == 400 > run.decision


def test_arguments_reach_the_class_and_time_limits_its_wrapper():
    task = from_gymnasium(Walk, length=3, max_episode_steps=50)
    assert task.longest_episode == 50
    assert task.batch([0])._environments[0].unwrapped.length == 3


def test_an_id_may_name_a_class_of_a_module():
    by_name = from_gymnasium("gymnasium.envs.classic_control.cartpole:CartPoleEnv", max_episode_steps=10)
    assert by_name.observation_size == from_gymnasium("CartPole-v1").observation_size
    assert by_name.imports({"env_id": by_name.env_id}) == []  # it was named here, by its user
    other = "gymnasium.envs.classic_control.pendulum:PendulumEnv"
    assert by_name.imports({"env_id": other}) == [other]


@pytest.mark.parametrize(
    ("maker", "message"),
    [
        (lambda: Walk(), "env_id = '<lambda>': must be an id, or a class or a function that is defined at the top"),
        (Walk(), "env_id = .*must be an id, or a class"),
        ("gymnasium.envs:Nothing", "env_id = 'gymnasium.envs:Nothing': "),
    ],
    ids=["lambda", "environment", "unknown"],
)
def test_what_a_run_could_not_name_is_refused(maker, message):
    with pytest.raises(ValueError, match=message):
        from_gymnasium(maker)


def make_nothing():
    return 3


def test_a_function_that_returns_something_else_is_named():
    with pytest.raises(ValueError, match="make_nothing"):
        from_gymnasium(make_nothing)
