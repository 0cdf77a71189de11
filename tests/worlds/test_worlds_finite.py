"""Finite MDPs: what is refused, and whether sampling follows the matrices."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.worlds import FiniteMDP, action_index, call_admission, chain, load_unload, parity, t_maze, three_state

WORLDS = {
    "three-state": three_state,
    "chain, walk": lambda: chain(6, "walk"),
    "chain, reset": lambda: chain(4, "reset"),
    "call admission": lambda: call_admission(2),
    "parity": parity,
    "load-unload": lambda: load_unload(3),
    "t-maze": lambda: t_maze(2),
    "four actions": lambda: FiniteMDP(np.random.default_rng(0).dirichlet(np.ones(5), (4, 5)), np.arange(5), np.eye(5)),
}


POINTS = 4096
ENDS = (0.0, np.nextafter(np.float32(1), np.float32(0)))


@functools.cache
def led_to(name):
    """A world, each of its actions in each of its states, and where an even grid of numbers and both ends lead then."""
    world = WORLDS[name]()
    uniforms = np.append((np.arange(POINTS) + 0.5) / POINTS, ENDS).astype(np.float32)[:, None]
    actions, states = np.indices((world.actions, world.states), np.int32).reshape(2, -1)
    step = jax.jit(jax.vmap(jax.vmap(world.step, (None, None, 0)), (0, 0, None)))
    return world, actions, states, np.asarray(step(states, actions, uniforms))


@pytest.mark.parametrize("name", WORLDS)
def test_the_share_of_uniforms_that_lead_to_a_state_is_its_probability(name):
    world, _, _, after = led_to(name)
    share = np.stack([np.bincount(row, minlength=world.states) for row in after[:, :POINTS]]) / POINTS
    # An interval holds its length's share of an even grid to within one point.
    np.testing.assert_allclose(share, world.transitions.reshape(share.shape), atol=1.01 / POINTS)


@pytest.mark.parametrize("end", range(2))
@pytest.mark.parametrize("name", WORLDS)
def test_the_ends_of_the_unit_interval_lead_to_possible_states(name, end):
    world, actions, states, after = led_to(name)
    assert (world.transitions[actions, states, after[:, POINTS + end]] > 0).all()


@pytest.mark.parametrize("name", WORLDS)
def test_an_episode_begins_in_the_start_state(name):
    world = WORLDS[name]()
    assert int(world.reset(jnp.zeros(0))) == world.start


def test_bits_spell_an_action_most_significant_first():
    bits = jnp.asarray([[0.0, 0, 0], [0, 0, 1], [1, 0, 0], [1, 1, 0]])
    np.testing.assert_array_equal(jax.vmap(action_index)(bits), [0, 1, 4, 6])
    assert int(action_index(jnp.asarray(5))) == 5


def test_rewards_are_paid_for_the_state_entered_or_for_the_action_taken():
    move = np.array([[[0.0, 1], [1, 0]]] * 2)
    entered = FiniteMDP(move, [3, 5], np.eye(2))
    taken = FiniteMDP(move, [[1, 2], [3, 4]], np.eye(2))
    before, action, after = map(jnp.asarray, (0, 1, 1))
    assert float(entered.reward(before, action, after)) == 5
    assert float(taken.reward(before, action, after)) == 3
    np.testing.assert_array_equal(entered.expected_rewards, [[5, 3], [5, 3]])
    np.testing.assert_array_equal(taken.expected_rewards, [[1, 2], [3, 4]])


half = np.full((2, 2, 2), 0.5)


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        ((half[0], [0, 1], np.eye(2)), r"transitions = \(2, 2\): must be of shape \(actions, states, states\)"),
        ((half[:, :1], [0, 1], np.eye(2)), r"transitions = \(2, 1, 2\)"),
        ((half * 1.1, [0, 1], np.eye(2)), "transitions = .*must be probabilities"),
        (([[[1.5, -0.5], [0, 1]]], [0, 1], np.eye(2)), "transitions = .*least -0.5"),
        ((half * np.nan, [0, 1], np.eye(2)), "transitions = .*must be probabilities"),
        ((half, [0, 1, 2], np.eye(2)), r"rewards = \(3,\): must be of shape \(2,\) or \(2, 2\)"),
        ((half, [0, 1], np.eye(3)), r"observations = \(3, 3\): must be of shape \(2, inputs\)"),
        ((half, [0, 1], [0, 1]), r"observations = \(2,\)"),
        ((half, [0, 1], np.eye(2), 2), "start = 2"),
        ((half, [0, 1], np.eye(2), -1), "start = -1"),
    ],
)
def test_impossible_mdps_are_refused_by_name(arguments, names):
    with pytest.raises(ValueError, match=names):
        FiniteMDP(*arguments)


@pytest.mark.parametrize(
    ("make", "names"),
    [
        (lambda: chain(1), "length = 1"),
        (lambda: chain(6, "rest"), "variant 'rest': did you mean 'reset'"),
        (lambda: call_admission(0), "capacity = 0"),
        (lambda: call_admission(5, rewards=(1, 2)), "departures and rewards"),
    ],
)
def test_impossible_worlds_are_refused_by_name(make, names):
    with pytest.raises(ValueError, match=names):
        make()
