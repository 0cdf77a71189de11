"""Gymnasium environments as tasks: how they are made, errors by name, what a batch does, copies."""

import itertools
import pickle
import re
import sys
import textwrap

import gymnasium
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium_examples import NONE, Told

import motorgrad as mg
from motorgrad.schema import table
from motorgrad.tasks import EnvironmentState, Gymnasium, from_gymnasium


def test_cart_pole_is_what_it_is():
    task = from_gymnasium("CartPole-v1")
    assert task == mg.make("gymnasium", env_id="CartPole-v1") == Gymnasium()
    assert (task.observation_size, task.action_size, task.actions, task.period) == (5, 2, "discrete", 1.0)
    assert task.has_episodes
    assert task.episode_limit is None  # its time limit is the environment's own
    assert task.no_resume is None


def test_the_settings_describe_a_task_and_make_it_again():
    task = from_gymnasium("Acrobot-v1", repeat=2, scaling="running", code="count", end_reward=3.0, max_episode_steps=90)
    plain = table(task)
    assert plain["kwargs"] == {"max_episode_steps": 90}
    assert mg.make("gymnasium", **plain) == task
    assert task.period == pytest.approx(0.4)  # Acrobot's own step is 0.2 s


# making


@pytest.mark.parametrize(
    ("env_id", "kwargs", "message"),
    [
        ("CartPol-v1", {}, "env_id = 'CartPol-v1': .* Did you mean: `CartPole`"),
        ("CartPole-v9", {}, "version `v9` for environment `CartPole` doesn't exist"),
        ("", {}, "env_id = '': "),
        ("nowhere/Nothing-v0", {}, "Namespace nowhere not found"),
        ("no_such_module:Nothing-v0", {}, "a dependency is not installed: No module named 'no_such_module'"),
        ("CartPole-v1", {"speed": 3}, "cannot be made with {'speed': 3}: TypeError: .*unexpected keyword argument"),
        ("CartPole-v1", {"max_episode_steps": 0}, "cannot be made with"),
    ],
)
def test_an_environment_that_cannot_be_made_is_said_in_one_line(env_id, kwargs, message):
    with pytest.raises(ValueError, match=message) as error:
        from_gymnasium(env_id, **kwargs)
    assert "\n" not in str(error.value)


def test_a_missing_dependency_is_said(register):
    def needy():
        raise gymnasium.error.DependencyNotInstalled("Box2D is not installed,\nyou can install it")

    with pytest.raises(ValueError, match=r"not installed: Box2D is not installed, you can install it$"):
        from_gymnasium(register(needy))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"repeat": 0}, "repeat = 0: must be an integer of at least 1"),
        ({"scaling": "bound"}, "unknown scaling 'bound': did you mean 'bounds'"),
        ({"end_reward": np.inf}, "end_reward = inf: must be a finite number"),
        ({"env_id": 3}, "env_id = 3: must be a string"),
        ({"kwargs": {"render": None}}, "kwargs.render = None: must be a number, a string"),
    ],
)
def test_an_impossible_setting_is_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        Gymnasium(**settings)


def test_an_environment_that_a_module_registers(tmp_path, monkeypatch, register):
    (tmp_path / "my_environments.py").write_text(
        textwrap.dedent("""
            import gymnasium
            from gymnasium.envs.classic_control import CartPoleEnv
            gymnasium.register("MyPole-v0", CartPoleEnv, max_episode_steps=7)
        """)
    )
    monkeypatch.syspath_prepend(tmp_path)
    task = from_gymnasium("my_environments:MyPole-v0")
    assert task.observation_size == 5
    sys.modules.pop("my_environments")


# batches


def test_a_step_shows_what_the_environment_said(told):
    task = from_gymnasium(told(end=3, cut=5))
    batch = task.batch([0, 1])
    for time in (1, 2, 3):
        batch.step(np.zeros((2, 1), np.float32))
        state = batch.unpack(batch.packed)
        np.testing.assert_array_equal(state.observation, np.full((2, 2), np.float32(time / 10)))
        np.testing.assert_array_equal(state.reward, time)
        np.testing.assert_array_equal(state.terminated, time == 3)
        np.testing.assert_array_equal(state.truncated, False)
    batch.reset([1])
    np.testing.assert_array_equal(batch.packed[1], 0)
    assert batch.packed[0, 2] == 3


@pytest.mark.parametrize(("ends", "flags"), [({"end": 5}, [True, False]), ({"cut": 5}, [False, True])])
def test_a_held_action_adds_rewards_up_and_stops_at_an_end(told, ends, flags):
    task = from_gymnasium(told(**ends), repeat=3)
    batch = task.batch([0])
    for rewards, steps, over in (([1, 2, 3], 3, [False, False]), ([4, 5], 2, flags)):
        batch.step(np.ones((1, 1), np.float32))
        state = batch.unpack(batch.packed[0])
        assert state.reward == sum(rewards)
        assert state.steps == steps
        assert [state.terminated, state.truncated] == over
    assert [int(a) for a in batch._environments[0].unwrapped.told] == [1] * 5


def test_a_decision_may_end_and_be_cut_at_once(told):
    task = from_gymnasium(told(end=1, cut=1))
    memory, reward, terminated = task.reward(
        task.init(NONE), EnvironmentState(jnp.zeros(2), 2.0, True, True, 1.0), None
    )
    assert terminated
    assert task.truncated(memory, EnvironmentState(jnp.zeros(2), 2.0, True, True, 1.0))
    assert reward == 2.0


def test_the_end_reward_is_the_learners_alone(told):
    task = from_gymnasium(told(), end_reward=-7.0)
    for terminated, truncated, wanted in ((True, False, -5.0), (False, True, 2.0), (False, False, 2.0)):
        state = EnvironmentState(jnp.zeros(2), jnp.float32(2.0), jnp.array(terminated), jnp.array(truncated), 1.0)
        memory, reward, _ = task.reward(task.init(NONE), state, None)
        assert float(reward) == wanted
        value, occurred = task.metrics(memory, state)["return"]
        assert float(value) == 2.0
        assert bool(occurred) is (terminated or truncated)


def test_numbers_that_are_not_finite_are_flagged_and_not_shown(told):
    task = from_gymnasium(told(bad=2))
    batch = task.batch([0, 1])
    batch.step(np.zeros((2, 1), np.float32))
    batch.reset([1])
    batch.step(np.zeros((2, 1), np.float32))
    assert batch.lost
    np.testing.assert_array_equal(batch.packed[:, -1], [1, 0])
    np.testing.assert_array_equal(batch.packed[:, :2], np.float32([[0.1, 0.1], [0.1, 0.1]]))
    np.testing.assert_array_equal(batch.unpack(batch.packed).reward, [0, 1])
    batch.reset([0])
    batch.step(np.zeros((2, 1), np.float32))
    assert batch.packed[0, -1] == 0


def test_an_error_in_a_step_says_where(register):
    class Broken(Told):
        def step(self, action):
            raise IndexError("out of road")

    name = register(Broken)
    batch = from_gymnasium(name).batch([5])
    with pytest.raises(IndexError, match="out of road") as error:
        batch.step(np.zeros((1, 1), np.float32))
    assert any(f"in step 1 of {name} of seed 5" in note for note in error.value.__notes__)


def test_an_environment_is_seeded_exactly():
    task = from_gymnasium("CartPole-v1")
    batch, alone = task.batch([3, 8]), gymnasium.make("CartPole-v1")
    wanted = [alone.reset(seed=8)[0], *(alone.reset()[0] for _ in range(2))]
    for first in wanted:
        np.testing.assert_array_equal(batch.packed[1, :4], first)
        batch.reset([1])


def test_a_snapshot_brings_environments_back():
    task = from_gymnasium("CartPole-v1")
    batch, other = task.batch([3, 8]), task.batch([0, 1])
    batch.step(np.ones((2, 1), np.float32))
    kept = batch.snapshot()
    assert all(leaf.shape[0] == 2 for leaf in kept.values())
    other.restore(kept)
    for now in (batch, other):
        now.step(np.ones((2, 1), np.float32))
        now.reset([0])
    np.testing.assert_array_equal(batch.packed, other.packed)
    assert (batch.packed[:, :4] != kept["packed"][:, :4]).any()


# copies


class Opaque(Told):
    def __init__(self):
        super().__init__()
        self.held = (i for i in range(3))  # the state of a generator cannot be read


class Forgetful(Told):
    """What it shows depends on what no object holds that a copy could have."""

    steps = itertools.count()

    def step(self, action):
        seen, _, *rest = super().step(action)
        return seen, float(next(Forgetful.steps)), *rest


class Fragile(Told):
    """It works only as what it was made as."""

    def __init__(self):
        super().__init__()
        self.me = id(self)

    def step(self, action):
        if self.me != id(self):
            raise AttributeError("another one")
        return super().step(action)


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        (
            Opaque,
            r"it cannot be written as data: NoState: env\.held is a builtins\.generator, whose state cannot be read",
        ),
        (Forgetful, "a restored copy of it continues differently from the original"),
        (Fragile, "a restored copy of it fails: AttributeError"),
    ],
)
def test_an_environment_that_cannot_be_restored_is_found_out(register, kind, message):
    name = register(kind)
    task = from_gymnasium(name)
    assert re.match(f"{name}: {message}", task.no_resume)
    kept = task.batch([0]).snapshot()
    assert kept["environments"].tolist() == [b""]


def test_a_task_can_be_pickled():
    task = from_gymnasium("CartPole-v1", repeat=2)
    assert pickle.loads(pickle.dumps(task)) == task
