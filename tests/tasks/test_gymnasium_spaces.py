"""Gymnasium environments as tasks: spaces of actions and their codes, what is observed and how it is scaled."""

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium_examples import NONE

import motorgrad as mg
from motorgrad.schema import kind_of
from motorgrad.tasks import EnvironmentState, from_gymnasium
from motorgrad.tasks.gymnasium._spaces import CODES


def decoded(task, *numbers):
    """The actions that these numbers of a policy stand for."""
    return [np.asarray(a).tolist() for a in native(task, np.asarray(numbers, np.float32))]


def native(task, numbers):
    """The environment's actions for rows of a policy's numbers."""
    code = task._facts.code
    return code.native(numbers[:, 0] if code.kind == "discrete" else numbers)


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
        (
            spaces.Box(np.float32([0, -1]), np.float32([1, 3])),
            "auto",
            "continuous",
            [[0.5, 1], [2, -9]],
            [[0.5, 1], [1, -1]],
        ),
        (spaces.Box(-2, 2, (1, 2)), "auto", "continuous", [[0.25, -2]], [[[0.25, -2]]]),
        (spaces.Box(-4, 255, (2,), np.int16), "auto", "continuous", [[0.7, -8.0]], [[1, -4]]),
        (spaces.Box(np.float32([0, -1]), np.float32([1, 3])), "each", "binary", [[0, 1], [1, 0]], [[0, 3], [1, -1]]),
        (spaces.Box(-2, 2, (1, 2)), "each", "binary", [[0, 1]], [[[-2, 2]]]),
        (spaces.Box(-2, 2, (1,)), "antagonists", "binary", [[0, 0], [1, 0], [0, 1], [1, 1]], [[0], [2], [-2], [0]]),
        (spaces.Box(0, 1, (2,)), "antagonists", "binary", [[0, 1]], [[0, 1]]),
        (spaces.Box(0, 255, (2,), np.uint8), "each", "binary", [[0, 1]], [[0, 255]]),
    ],
)
def test_units_and_choices_become_actions(told, action, code, kind, numbers, wanted):
    task = from_gymnasium(told(action=action), code=code)
    assert task.actions == kind
    alternatives = action.n if isinstance(action, spaces.Discrete) else np.prod(getattr(action, "nvec", 0))
    assert task.action_size == (alternatives if kind == "discrete" else len(numbers[0]))
    assert decoded(task, *numbers) == wanted
    batch = task.batch([0])
    for row in numbers:
        batch.step(np.array([row], np.float32))  # where the environment insists that the space contains it
    assert [np.asarray(a).tolist() for a in batch._environments[0].unwrapped.told] == wanted


def test_the_ends_of_a_box_are_reached_exactly(told):
    low, high = np.float32([-0.1, 1e-3]), np.float32([0.7, 0.3])
    for code, rows in (("each", (np.zeros(2), np.ones(2))), ("continuous", (np.full(2, -9.0), np.full(2, 9.0)))):
        task = from_gymnasium(told(action=spaces.Box(low, high)), code=code)
        for row, wanted in zip(rows, (low, high), strict=True):
            found = native(task, row[None])[0]
            assert found.dtype == np.float32
            np.testing.assert_array_equal(found, wanted)


@pytest.mark.ci
@pytest.mark.representatives("squashed", "clipped")
@pytest.mark.parametrize("density", ["squashed", "clipped", "truncated", "beta"])
def test_graded_units_act_within_the_bounds_of_the_space(told, density):
    low, high = np.float32([-0.4, 0.0]), np.float32([0.4, 3.0])
    task = from_gymnasium(told(action=spaces.Box(low, high)))
    assert task.action_range == tuple(zip(low.tolist(), high.tolist(), strict=True))
    assert kind_of(mg.agent_for(task).policy) == "bounded-hyperplanes"
    policy = mg.policies.bounded_hyperplanes(task, density=density, deviation=3.0)
    seen, uniforms = jnp.ones(policy.inputs), np.float32([[0.0, 1 - 2**-24], [0.5, 0.5]])
    drawn, mode = jax.jit(lambda u: (jax.vmap(lambda u: policy.sample(seen, u))(u), policy.mode(seen)))(uniforms)
    assert (np.asarray(drawn) >= low).all()
    assert (np.asarray(drawn) <= high).all()
    np.testing.assert_array_equal(native(task, np.asarray(drawn)), drawn)  # nothing is left to clip
    np.testing.assert_allclose(mode, (low + high) / 2, atol=1e-6)  # a signed one rests


def test_a_signed_box_can_rest_unless_it_is_told_not_to():
    task = from_gymnasium("Reacher-v5")
    assert (task.actions, task.action_size, task.action_range) == ("continuous", 2, ((-1.0, 1.0),) * 2)
    batch = task.batch([0])
    batch.step(np.zeros((1, 2), np.float32))
    assert batch._environments[0].unwrapped.data.ctrl.tolist() == [0, 0]
    assert from_gymnasium("Reacher-v5", code="each").actions == "binary"


@pytest.mark.parametrize("code", CODES["MultiDiscrete"])
def test_every_action_can_be_said_and_nothing_else(told, code):
    space = spaces.MultiDiscrete([2, 4], start=[3, -2])
    task = from_gymnasium(told(action=space), code=code)
    said = np.arange(task.action_size)[:, None]
    if task.actions == "binary":
        said = (np.arange(2**task.action_size)[:, None] >> np.arange(task.action_size)) & 1
    actions = native(task, said.astype(np.float32))
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
        (spaces.Box(0, 1, (2,)), "count", "known are antagonists, auto, continuous, each"),
        (spaces.MultiDiscrete([100, 100]), "choice", "has 10000 combined actions, at most 4096; use 'count'"),
        (spaces.Discrete(1), "count", "single action, which no unit can choose; use 'choice'"),
    ],
)
def test_a_code_that_does_not_go_with_the_actions_is_refused(told, action, code, message):
    with pytest.raises(ValueError, match=message):
        from_gymnasium(told(action=action), code=code)


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
    running = from_gymnasium("CartPole-v1")._facts.seen.running
    np.testing.assert_array_equal(running, [False, True, False, True])
    found = mg.tasks.gymnasium._spaces.observation_code(spaces.Box(-huge, huge), "auto", "X").running
    np.testing.assert_array_equal(found, [False, True, False, True])


def test_no_scaling_changes_nothing(told):
    task = from_gymnasium(told(action=spaces.MultiBinary(1)), scaling="none")
    _, seen = observed(task, task.init(NONE), [0.3, -7.0])
    np.testing.assert_array_equal(seen, np.float32([[0.3, -7.0]]))


def test_running_statistics_are_the_mean_and_the_variance_of_all_that_was_observed(told):
    task = from_gymnasium(told(action=spaces.MultiBinary(1)), scaling="running")
    drawn = np.random.default_rng(0).normal([3.0, -500.0], [0.1, 20.0], (150, 2)).astype(np.float32)
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


# bounds in the space's own type


@pytest.mark.parametrize("code", CODES["Box"])
@pytest.mark.parametrize("low", [-np.inf, 0])
def test_infinite_bounds_of_whole_numbers_are_refused(told, code, low):
    """A space of whole numbers has the ends of its type in place of infinite bounds."""
    space = spaces.Box(low, np.inf, (2,), np.int32)
    with pytest.raises(ValueError, match=r"actions in a Box\(2,\) space: must be a Box with finite bounds"):
        from_gymnasium(told(action=space), code=code)


@pytest.mark.parametrize(
    "space",
    [
        spaces.Box(-(2**62), 2**62, (1,), np.int64),
        spaces.Box(0, 2**64 - 1, (1,), np.uint64),
        spaces.Box(-(2**31), 2**31 - 1, (1,), np.int32),
        spaces.Box(-3e38, 3e38, (1,), np.float32),
        spaces.Box(-1e300, 1e300, (1,), np.float64),
        spaces.Box(1, 1 + 1e-12, (1,), np.float64),
        spaces.Box(3, 3, (1,), np.int8),
    ],
    ids=str,
)
def test_bounds_between_which_single_precision_has_not_every_number_are_reached_only(told, space):
    name = told(action=space)
    with pytest.raises(
        ValueError, match=rf"code = 'continuous': .* for number 0 of the actions of {name}: must be a low"
    ):
        from_gymnasium(name)
    for code, units, wanted in (("each", [0.0], space.low), ("each", [1.0], space.high)):
        found = native(from_gymnasium(name, code=code), np.array([units], np.float32))[0]
        assert found.dtype == space.dtype
        np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize("number", [3e38, -3e38, np.inf, -np.inf, np.nan, 0.4])
def test_whatever_a_policy_draws_becomes_a_whole_number_of_the_space(told, number):
    space = spaces.Box(-5, 2**24, (2,), np.int32)
    with np.errstate(all="raise"):
        action = native(from_gymnasium(told(action=space)), np.full((1, 2), number, np.float32))[0]
    assert space.contains(action)


@pytest.mark.parametrize(
    ("space", "code", "units", "wanted"),
    [
        (spaces.Discrete(2**60, start=2**60), "bits", 60, 2**61 - 1),
        (spaces.Discrete(3, start=2**60), "count", 2, 2**60 + 2),
        (spaces.Discrete(3, start=2**60 + 1), "choice", 1, 2**60 + 1),
        (spaces.MultiDiscrete(np.array([64], np.int8), np.int8), "bits", 6, [63]),
    ],
)
def test_sums_of_units_are_exact(told, space, code, units, wanted):
    on = np.zeros((1, units)) if code == "choice" else np.ones((1, units))
    assert decoded(from_gymnasium(told(action=space), code=code), *on) == [wanted]


def test_too_many_units_are_refused_before_they_are_made(told):
    for space, code in ((spaces.Discrete(2**40), "count"), (spaces.MultiBinary(70_000), "auto")):
        with pytest.raises(ValueError, match=r"needs .* units, at most 65,536; use "):
            from_gymnasium(told(action=space), code=code)


def test_bounds_that_single_precision_cannot_tell_apart_scale_nothing():
    space = spaces.Box(np.array([0.0, 1e5, -1.0]), np.array([1e-320, 1e5 + 1e-9, 1.0]), dtype=np.float64)
    found = mg.tasks.gymnasium._spaces.observation_code(space, "auto", "X")
    np.testing.assert_array_equal(found.running, [True, True, False])
    assert (found.divisor > 0).all()


@pytest.mark.parametrize("goal", [spaces.Dict({"a": spaces.Text(3)}), spaces.Tuple([spaces.Discrete(2, start=3)])])
def test_an_environment_with_goals_is_told_how_to_become_numbers(told, goal):
    box = spaces.Box(-1, 1, (2,))
    space = spaces.Dict({"observation": box, "achieved_goal": box, "desired_goal": goal})
    with pytest.raises(ValueError, match=r"observations in a Dict.*: must be Box; gymnasium\.wrappers\.FlattenObserva"):
        from_gymnasium(told(observation=space))
