"""Gymnasium environments as tasks: spaces, codes of actions, scaling, errors by name, what a batch does."""

import pickle
import re
import sys
import textwrap

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium import spaces

import motorgrad as mg
from motorgrad._settings import table
from motorgrad.tasks import EnvironmentState, Gymnasium, from_gymnasium
from motorgrad.tasks._gymnasium_spaces import CODES

NONE = jnp.zeros(0)


class Told(gymnasium.Env):
    """An environment of given spaces that shows what it is told and how often; it ends and cuts when asked to."""

    def __init__(self, observation=None, action=None, end=None, cut=None, bad=None, shown=None):
        self.observation_space = spaces.Box(-1, 1, (2,)) if observation is None else observation
        self.action_space = spaces.Discrete(2) if action is None else action
        self.end, self.cut, self.bad, self.shown = end, cut, bad, shown
        self.told, self.time = [], 0

    def look(self):
        if self.shown is not None:
            return np.asarray(self.shown, self.observation_space.dtype)
        value = np.full(self.observation_space.shape, self.time / 10, self.observation_space.dtype)
        return value

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.time = 0
        return self.look(), {}

    def step(self, action):
        assert self.action_space.contains(action), action
        self.told.append(action)
        self.time += 1
        seen = self.look()
        if self.time == self.bad:
            seen = np.full_like(seen, np.nan)
        return seen, float(self.time), self.time == self.end, self.time == self.cut, {}


@pytest.fixture
def register():
    """Register environments for the time of a test."""
    before = set(gymnasium.registry)

    def one(make, **keywords):
        name = f"Mine{len(gymnasium.registry)}-v0"
        gymnasium.register(id=name, entry_point=make, disable_env_checker=True, **keywords)
        return name

    yield one
    for name in set(gymnasium.registry) - before:
        del gymnasium.registry[name]


@pytest.fixture
def told(register):
    """The id of an environment as `Told` is told to be."""
    return lambda **settings: register(lambda **more: Told(**settings, **more))


def decoded(task, *numbers):
    """The actions that these numbers of a policy stand for."""
    return [np.asarray(a).tolist() for a in task._facts.code.decode(np.asarray(numbers, np.float32))]


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


# spaces of actions


@pytest.mark.parametrize(
    ("action", "code", "kind", "numbers", "wanted"),
    [
        (spaces.Discrete(3), "auto", "discrete", [[0], [2]], [0, 2]),
        (spaces.Discrete(3, start=-1), "auto", "discrete", [[0], [2]], [-1, 1]),
        (spaces.Discrete(4, start=5), "bits", "binary", [[0, 0], [0, 1], [1, 0], [1, 1]], [5, 6, 7, 8]),
        (spaces.Discrete(3, start=5), "count", "binary", [[0, 0], [0, 1], [1, 0], [1, 1]], [5, 6, 6, 7]),
        (spaces.MultiBinary(2), "auto", "binary", [[0, 1]], [[0, 1]]),
        (spaces.MultiBinary((2, 2)), "auto", "binary", [[0, 1, 1, 0]], [[[0, 1], [1, 0]]]),
        (spaces.MultiDiscrete([3, 2]), "auto", "binary", [[1, 0, 1], [1, 1, 0]], [[1, 1], [2, 0]]),
        (spaces.MultiDiscrete([3, 2]), "choice", "discrete", [[0], [3], [5]], [[0, 0], [1, 1], [2, 1]]),
        (spaces.MultiDiscrete([2, 4], start=[1, -1]), "bits", "binary", [[1, 1, 0]], [[2, 1]]),
        (spaces.MultiDiscrete([[2, 2], [1, 3]]), "count", "binary", [[1, 0, 1, 1]], [[[1, 0], [0, 2]]]),
        (spaces.Box(np.float32([0, -1]), np.float32([1, 3])), "auto", "binary", [[0, 1], [1, 0]], [[0, 3], [1, -1]]),
        (spaces.Box(-2, 2, (1, 2)), "each", "binary", [[0, 1]], [[[-2, 2]]]),
        (spaces.Box(-2, 2, (1,)), "antagonists", "binary", [[0, 0], [1, 0], [0, 1], [1, 1]], [[0], [2], [-2], [0]]),
        (spaces.Box(0, 1, (2,)), "antagonists", "binary", [[0, 1]], [[0, 1]]),
        (spaces.Box(0, 255, (2,), np.uint8), "auto", "binary", [[0, 1]], [[0, 255]]),
    ],
)
def test_units_and_choices_become_actions(told, action, code, kind, numbers, wanted):
    task = from_gymnasium(told(action=action), code=code)
    assert task.actions == kind
    alternatives = action.n if isinstance(action, spaces.Discrete) else np.prod(getattr(action, "nvec", 0))
    assert task.action_size == (len(numbers[0]) if kind == "binary" else alternatives)
    assert decoded(task, *numbers) == wanted
    batch = task.batch([0])
    for row in numbers:
        batch.step(np.array([row], np.float32))  # where the environment insists that the space contains it
    assert [np.asarray(a).tolist() for a in batch._environments[0].unwrapped.told] == wanted


def test_the_ends_of_a_box_are_reached_exactly(told):
    low, high = np.float32([-0.1, 1e-3]), np.float32([0.7, 0.3])
    task = from_gymnasium(told(action=spaces.Box(low, high)))
    for row, wanted in ((np.zeros(2), low), (np.ones(2), high)):
        found = task._facts.code.decode(row[None])[0]
        assert found.dtype == np.float32
        np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize("code", CODES["MultiDiscrete"])
def test_every_action_can_be_said_and_nothing_else(told, code):
    space = spaces.MultiDiscrete([2, 4], start=[3, -2])
    task = from_gymnasium(told(action=space), code=code)
    said = np.arange(task.action_size)[:, None]
    if task.actions == "binary":
        said = (np.arange(2**task.action_size)[:, None] >> np.arange(task.action_size)) & 1
    actions = task._facts.code.decode(said.astype(np.float32))
    assert all(space.contains(action) for action in actions)
    assert len({tuple(action) for action in actions}) == 8


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"action": spaces.Dict({"a": spaces.Discrete(2)})}, r"has actions in a Dict.* space: must be Discrete, Multi"),
        ({"action": spaces.Tuple([spaces.Discrete(2)])}, "has actions in a Tuple"),
        ({"action": spaces.Text(3)}, "has actions in a Text"),
        ({"action": spaces.Box(-np.inf, np.inf, (2,))}, r"actions in a Box\(2,\) space: must be a Box with finite"),
        (
            {"observation": spaces.Dict({"a": spaces.Box(0, 1)})},
            r"observations in a Dict.*wrappers\.FlattenObservation",
        ),
        ({"observation": spaces.Tuple([spaces.Box(0, 1)])}, r"observations in a Tuple.*wrappers\.FlattenObservation"),
        ({"observation": spaces.Discrete(3)}, r"observations in a Discrete.*wrappers\.FlattenObservation"),
        ({"observation": spaces.Text(3)}, r"observations in a Text.*wrappers\.TransformObservation"),
        ({"observation": spaces.Box(0, 1, (0,))}, "at least one number"),
    ],
)
def test_a_space_that_is_not_supported_is_refused_by_name(told, settings, message):
    with pytest.raises(ValueError, match=message) as error:
        from_gymnasium(told(**settings))
    assert "\n" not in str(error.value)


def test_the_wrapper_that_is_named_helps(register):
    def lake():
        return gymnasium.wrappers.FlattenObservation(gymnasium.make("FrozenLake-v1"))

    task = from_gymnasium(register(lake))
    assert task.observation_size == 16 + 1
    packed = task.batch([0]).packed
    np.testing.assert_array_equal(packed[0, :16], np.eye(16)[0])


@pytest.mark.parametrize(
    ("action", "code", "message"),
    [
        (spaces.Discrete(3), "each", "did you mean|known are auto, bits, choice, count"),
        (spaces.Discrete(3), "bits", "has \\[3\\] actions: must be powers of two; use 'count'"),
        (spaces.Box(0, 1, (2,)), "count", "known are antagonists, auto, each"),
        (spaces.MultiDiscrete([100, 100]), "choice", "has 10000 combined actions, at most 4096; use 'count'"),
        (spaces.Discrete(1), "count", "single action, which no unit can choose; use 'choice'"),
    ],
)
def test_a_code_that_does_not_go_with_the_actions_is_refused(told, action, code, message):
    with pytest.raises(ValueError, match=message):
        from_gymnasium(told(action=action), code=code)


# making


@pytest.mark.parametrize(
    ("env_id", "kwargs", "message"),
    [
        ("CartPol-v1", {}, "env_id = 'CartPol-v1': .* Did you mean: `CartPole`"),
        ("CartPole-v9", {}, "version `v9` for environment `CartPole` doesn't exist"),
        ("", {}, "env_id = '': "),
        ("nowhere/Nothing-v0", {}, "Namespace nowhere not found"),
        ("no_such_module:Nothing-v0", {}, "something that it needs is not installed: No module named 'no_such_module'"),
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
        ({"repeat": 0}, "repeat = 0: must be a whole number of at least 1 step"),
        ({"scaling": "bound"}, "unknown scaling 'bound': did you mean 'bounds'"),
        ({"end_reward": np.inf}, "end_reward = inf: must be a finite number"),
        ({"env_id": 3}, "env_id = 3: must be the id"),
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


# observations


def observed(task, memory, *observations):
    """What a policy sees of these observations in turn, and the memory afterwards."""
    seen = []
    for y in observations:
        state = EnvironmentState(jnp.asarray(y, jnp.float32), 0.0, False, False, 1.0)
        memory, now = task.observe(memory, state, NONE)
        seen.append(np.asarray(now))
    return memory, np.array(seen)


def test_bounds_bring_observations_to_one(told):
    space = spaces.Box(np.float32([-2, 0]), np.float32([2, 10]))
    task = from_gymnasium(told(observation=space), scaling="bounds")
    _, seen = observed(task, task.init(NONE), [-2, 0], [2, 10], [0, 5])
    np.testing.assert_allclose(seen, [[-1, -1, 1], [1, 1, 1], [0, 0, 1]])


def test_without_bounds_scaling_by_them_is_refused_by_name():
    with pytest.raises(ValueError, match=r"scaling = 'bounds': numbers \[1, 3\] of the observation of CartPole-v1"):
        from_gymnasium("CartPole-v1", scaling="bounds")


def test_auto_takes_bounds_where_there_are_usable_ones():
    huge = np.float32([4, 3.4e38, 2, np.inf])
    running = from_gymnasium("CartPole-v1")._facts.scaling.running
    np.testing.assert_array_equal(running, [False, True, False, True])
    found = mg.tasks._gymnasium_spaces.observation_scaling(spaces.Box(-huge, huge), "auto", "X").running
    np.testing.assert_array_equal(found, [False, True, False, True])


def test_no_scaling_changes_nothing(told):
    task = from_gymnasium(told(action=spaces.MultiBinary(1)), scaling="none")
    _, seen = observed(task, task.init(NONE), [0.3, -7.0])
    np.testing.assert_array_equal(seen, np.float32([[0.3, -7.0]]))


def test_running_statistics_are_the_mean_and_the_variance_of_all_that_was_observed(told):
    task = from_gymnasium(told(action=spaces.MultiBinary(1)), scaling="running")
    drawn = np.random.default_rng(0).normal([3.0, -500.0], [0.1, 20.0], (400, 2)).astype(np.float32)
    memory, seen = observed(task, task.init(NONE), *drawn)
    np.testing.assert_allclose(memory.mean.mean, drawn.astype(float).mean(axis=0), rtol=1e-6)
    np.testing.assert_allclose(memory.variance.mean, drawn.astype(float).var(axis=0), rtol=1e-4)
    np.testing.assert_array_equal(seen[0], 0)
    wanted = (drawn[-1] - drawn.mean(axis=0)) / drawn.std(axis=0)
    np.testing.assert_allclose(seen[-1], wanted, rtol=1e-3)
    _, seen = observed(task, memory, [1e9, -1e9])
    np.testing.assert_array_equal(seen, [[5, -5]])


def test_running_statistics_stay_exact_over_long_runs(told):
    task = from_gymnasium(told(action=spaces.MultiBinary(1)), scaling="running")
    memory = task.init(NONE)
    count = jnp.uint32(1_000_000_000)  # as after so many zeros
    memory = memory._replace(mean=memory.mean._replace(count=count), variance=memory.variance._replace(count=count))
    one = jnp.ones(2)
    state = EnvironmentState(one, 0.0, False, False, 1.0)
    ended = jax.jit(lambda m: jax.lax.fori_loop(0, 1000, lambda _, m: task.observe(m, state, NONE)[0], m))(memory)
    share = 1000 / (1e9 + 1000)
    np.testing.assert_allclose(ended.mean.mean + ended.mean.carry, share, rtol=1e-5)
    np.testing.assert_allclose(ended.variance.mean + ended.variance.carry, share, rtol=1e-4)


def test_statistics_outlive_an_episode_and_can_be_frozen(told):
    task = from_gymnasium(told(action=spaces.MultiBinary(1)), scaling="running")
    memory, _ = observed(task, task.init(NONE), [1.0, 2.0], [3.0, 5.0])
    memory, _, _ = task.reward(memory, EnvironmentState(jnp.zeros(2), 4.0, False, True, 2.0), None)
    assert (float(memory.returned), float(memory.length)) == (4.0, 2.0)
    renewed = task.renew(memory, NONE)
    assert (float(renewed.returned), float(renewed.length)) == (0.0, 0.0)
    np.testing.assert_array_equal(renewed.mean.mean, [2.0, 3.5])
    frozen, _ = observed(task, task.freeze(renewed), [100.0, 100.0])
    np.testing.assert_array_equal(frozen.mean.mean, [2.0, 3.5])
    assert int(frozen.mean.count) == 2


def test_an_observation_of_any_shape_is_flattened(told):
    space = spaces.Box(0, 255, (2, 3, 1), np.uint8)
    task = from_gymnasium(told(observation=space, shown=np.arange(6).reshape(2, 3, 1)))
    assert task.observation_size == 6 + 1
    batch = task.batch([0])
    np.testing.assert_array_equal(batch.packed[0, :6], np.arange(6))
    batch.step(np.zeros((1, 1), np.float32))
    np.testing.assert_array_equal(batch.packed[0, :6], np.arange(6))


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
        value, occurred = task.readings(memory, state)["return"]
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
    assert any(f"in a step of {name} of seed 5" in note for note in error.value.__notes__)


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


class Unpicklable(Told):
    def __init__(self):
        super().__init__()
        self.held = (i for i in range(3))  # a generator cannot be pickled


class Forgetful(Told, gymnasium.utils.EzPickle):
    """Pickled as what it was made from, as many environments are: a copy is at the beginning."""

    def __init__(self):
        gymnasium.utils.EzPickle.__init__(self)
        super().__init__()


class Fragile(Told):
    def __setstate__(self, state):
        pass


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        (Unpicklable, "it cannot be serialised: TypeError: .*generator"),
        (Forgetful, "a restored copy of it goes on otherwise than the original"),
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
