"""Worlds that ask for hidden units or a memory: what can be earned in them, and the oracle's view of both."""

import jax
import numpy as np
import pytest

from motorgrad.policies import FiniteStateController, Hyperplanes, Layered, Softmax, initial
from motorgrad.worlds import load_unload, oracle, parity, t_maze, three_state


@pytest.mark.representatives("5")
@pytest.mark.parametrize("length", [3, 5, 8])
def test_on_the_line_memory_earns_once_a_round_trip_and_without_it_a_random_walk_is_best(length):
    world = load_unload(length)
    assert oracle.optimal_policy(world)[1] == pytest.approx(1 / (2 * (length - 1)), rel=1e-12)
    table, earned = oracle.best_memoryless(world, 5)
    assert earned == pytest.approx(1 / (2 * (length - 1) ** 2), rel=1e-5)
    # the rows in the order of the observations: between, right end, left end
    np.testing.assert_allclose(table, [[0.5, 0.5], [1, 0], [0, 1]], atol=0.01)


@pytest.mark.representatives("1")
@pytest.mark.parametrize("length", [1, 5])
def test_in_the_maze_memory_earns_every_trial_and_without_it_half_of_them(length):
    world = t_maze(length)
    assert oracle.optimal_policy(world)[1] == pytest.approx(4 / (length + 2), rel=1e-12)
    assert oracle.best_memoryless(world, 5)[1] == pytest.approx((4 - 0.1) / 2 / (length + 2), rel=1e-4)


@pytest.mark.ci
def test_no_soft_plane_earns_more_than_three_quarters_of_parity():
    world, rng = parity(2), np.random.default_rng(1)
    planes = [Hyperplanes(rng.normal(size=(1, 2), scale=8), rng.normal(size=1, scale=8)) for _ in range(100)]
    earned = [oracle.average_reward(world, plane) for plane in planes]
    assert 0.7 < max(earned) <= 0.75 + 1e-12
    assert oracle.optimal_policy(world)[1] == 1


def hidden():
    rng = np.random.default_rng(2)
    return Layered([Hyperplanes(rng.normal(size=(2, 2)), rng.normal(size=2))], Softmax(rng.normal(size=(2, 3))))


@pytest.mark.ci
def test_marginal_and_joint_policies_have_the_same_reward_and_gradient():
    world, policy = three_state(), hidden()
    joint = oracle.joint(world, policy)
    assert joint.actions == 8
    assert oracle.average_reward(joint, policy) == pytest.approx(oracle.average_reward(world, policy), abs=1e-14)
    for exact in (oracle.gradient, lambda mdp, policy: oracle.biased_gradient(mdp, policy, 0.7)):
        one, other = oracle.flat(exact(joint, policy)), oracle.flat(exact(world, policy))
        np.testing.assert_allclose(one, other, atol=1e-14)


def test_a_controller_that_keeps_the_load_in_mind_earns_what_can_be_earned():
    """State 1 means a load: entered at the left end, left at the right end."""
    large = 50.0
    transition, act = np.zeros((2, 6)), np.zeros((2, 6))
    for state in (0, 1):
        transition[:, 3 * state : 3 * state + 3] = [[0, large, large * (1 - state)], [large, 0, large * state]]
        act[1, 3 * state : 3 * state + 3] = [large, -large, large if state else -large]
    controller = FiniteStateController(Softmax(transition), Softmax(act))
    joint = oracle.joint(load_unload(5), controller)
    assert joint.states == 20
    assert oracle.average_reward(joint, controller) == pytest.approx(0.125, abs=1e-12)


@pytest.mark.ci
def test_where_internal_states_are_alike_nothing_is_learned_about_them():
    """The vanishing gradient of Aberdeen and Baxter (2002), and their remedy."""
    world, rng = load_unload(4), np.random.default_rng(3)
    act = Softmax(np.tile(rng.normal(size=(2, 3)), (1, 2)))  # the same in both internal states
    even = FiniteStateController(Softmax(np.zeros((2, 6))), act)
    linked = FiniteStateController(Softmax(np.array([[2.0, 0, 2, 2, 0, 0], [0, 2, 0, 0, 2, 2]])), act)
    slopes = [oracle.gradient(oracle.joint(world, policy), policy) for policy in (even, linked)]
    for slope in slopes:
        np.testing.assert_allclose(slope.transition.weights, 0, atol=1e-15)
    first, second = np.split(slopes[0].act.weights, 2, axis=1)
    np.testing.assert_allclose(first, second, atol=1e-15)  # so the states stay alike
    first, second = np.split(slopes[1].act.weights, 2, axis=1)
    assert np.abs(first - second).max() > 0.001


def test_what_the_oracle_cannot_take_is_refused_by_name():
    recurrent = initial("recurrent", 2, units=2, output="softmax")(jax.random.key(0))
    controller = initial("finite-state-controller", 2, units=2, output="softmax")(jax.random.key(0))
    for call, words in (
        (lambda: oracle.joint(three_state(), Softmax(np.zeros((2, 2)))), "policy = 'Softmax'"),
        (lambda: oracle.joint(three_state(), recurrent), "policy = 'Recurrent'"),
        (lambda: oracle.joint(load_unload(), controller), "policy.observation_size = 2: must be 3"),
        (lambda: oracle.average_reward(three_state(), controller), "policy = 'FiniteStateController'"),
        (lambda: load_unload(2), "length = 2"),
        (lambda: t_maze(0), "length = 0"),
        (lambda: parity(11), "inputs = 11"),
    ):
        with pytest.raises(ValueError) as error:  # noqa: PT011
            call()
        assert words in str(error.value)
