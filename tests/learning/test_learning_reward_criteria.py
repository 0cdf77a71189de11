"""Reward criteria: values of episodes, increments that add up to them, and gradients against exact ones."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.learning import (
    Agent,
    Average,
    Discounted,
    Episodic,
    Estimator,
    Last,
    Maximum,
    MeanReward,
    ProximalPolicyOptimization,
    RewardCriterion,
    Transition,
)
from motorgrad.policies import Softmax
from motorgrad.tasks import ThreeState
from motorgrad.training import agent_for, stepper_for
from motorgrad.worlds import FiniteMDP, episode_gradient, episode_value, oracle, three_state


class Product(RewardCriterion):
    """A function of one's own: the product of 1 + r, minus 1."""

    def accumulated(self, value, reward, count):
        return (1 + value) * (1 + reward) - 1


REWARDS = np.array([-2.0, -0.5, 3.0, 1.0])
VALUES = {
    "maximum": (Maximum(), lambda r: np.max(r)),
    "last": (Last(), lambda r: r[-1]),
    "average": (Average(), np.mean),
    "discounted": (Discounted(0.8), lambda r: sum(0.8**t * each for t, each in enumerate(r))),
    "own": (Product(), lambda r: np.prod(1 + np.asarray(r)) - 1),
}
every = pytest.mark.parametrize("name", VALUES)
LENGTH = 4
POINT = Softmax(np.array([[1.0, -0.5], [-0.3, 0.8]]))


def world():
    """The three states, with rewards of both signs, so that no two criteria agree."""
    mdp = three_state()
    return FiniteMDP(mdp.transitions, [-1.0, 0.5, 2.0], mdp.observations)


class Task(ThreeState):
    """The three states with other rewards."""

    dynamics = property(lambda self: world())


@every
def test_the_value_of_an_episode_is_the_closed_form_and_increments_add_up_to_it(name):
    criterion, value = VALUES[name]
    for rewards in (REWARDS, -np.abs(REWARDS), REWARDS[:1]):
        assert float(criterion.value_of(rewards)) == pytest.approx(value(rewards), rel=1e-5, abs=1e-5)
        state = criterion.init(jnp.float32)
        paid = 0.0
        for reward in rewards:
            increment, state = criterion.update(state, jnp.float32(reward))
            paid += float(increment)
        assert paid == pytest.approx(value(rewards), rel=1e-5, abs=1e-5)
    assert float(criterion.value_of(np.zeros(0))) == 0


def by_enumeration(mdp, weights, value):
    """The expected value of an episode over all paths, in JAX."""
    chosen = jax.nn.softmax(jnp.asarray(mdp.observations) @ weights.T, axis=1)
    matrix = jnp.einsum("sa,ast->st", chosen, jnp.asarray(mdp.transitions))
    paths = np.array(list(itertools.product(range(mdp.states), repeat=LENGTH)))
    before = np.insert(paths[:, :-1], 0, mdp.start, axis=1)
    chances = jnp.prod(matrix[before, paths], axis=1)
    return chances @ jnp.asarray([value(mdp.rewards[path]) for path in paths])


@every
def test_the_oracle_of_episodes_is_the_enumeration_of_all_paths_and_its_derivative(name):
    criterion, value = VALUES[name]
    mdp = world()
    with jax.enable_x64(True):
        weights = jnp.asarray(np.asarray(POINT.weights, float))
        found, slope = jax.value_and_grad(lambda w: by_enumeration(mdp, w, value))(weights)
    assert episode_value(mdp, POINT, criterion.accumulated, LENGTH) == pytest.approx(float(found), rel=1e-9)
    exact = oracle.flat(episode_gradient(mdp, POINT, criterion.accumulated, LENGTH))
    np.testing.assert_allclose(exact, np.ravel(slope), rtol=1e-8, atol=1e-12)


def check_estimate(name, decisions, precision):
    criterion, _ = VALUES[name]
    exact = oracle.flat(episode_gradient(world(), POINT, criterion.accumulated, LENGTH))
    estimator = Estimator(Episodic(), MeanReward(), update_every="never", criterion=criterion)
    stepper = stepper_for(Task(time_limit=LENGTH), Agent(POINT, estimator), range(400))
    stepper.advance(decisions)
    mean = stepper.state["cycle"].agent.gradient.mean
    per_seed = LENGTH * np.asarray(mean.weights, float).reshape(400, -1)
    error = per_seed.std(0) / np.sqrt(len(per_seed))
    assert np.linalg.norm(error) < precision * np.linalg.norm(exact)
    # four standard errors, and what a running mean that holds rewards of the trace takes away, of the order of 1/n
    np.testing.assert_array_less(np.abs(per_seed.mean(0) - exact), 4 * error + 5e-3 * np.linalg.norm(exact))


@pytest.mark.representatives("maximum")
@every
def test_the_mean_estimate_over_seeds_is_the_exact_gradient(name):
    check_estimate(name, 4_000, 0.06)


def test_what_ends_diverges_or_begins_leaves_no_value_behind():
    criterion = Maximum()
    agent = Agent(POINT, Estimator(Episodic(), None, update_every="never", criterion=criterion))
    state = agent.init(jax.random.key(0))
    look = jnp.zeros(2)
    paid = []
    for reward, ended, diverged in ((1.0, False, False), (3.0, False, True), (2.0, True, False), (-1.0, False, False)):
        state, action = agent.act(state, look, jnp.array([0.5]))
        transition = Transition(look, action, jnp.float32(reward), look, jnp.array(ended), False, jnp.array(diverged))
        paid.append(float(agent.estimator.paid(state.estimator, transition)[0].reward))
        state = agent.observe(state, transition)
    # what diverged also ended its episode
    assert paid == [1.0, 2.0, 2.0, -1.0]
    assert float(state.estimator.criterion.value) == -1.0


def test_parts_that_read_rewards_read_increments():
    settings = {"metric": "episodic-nac", "update_every": 8, "trace": "episodic"}
    look = jnp.array([0.5, 0.2])
    found = []
    for criterion, rewards in (("last", (1.0, 1.0, 3.0)), ("none", (1.0, 0.0, 2.0))):
        agent = agent_for(ThreeState(time_limit=4), {**settings, "criterion": criterion})
        state = agent.init(jax.random.key(0))
        for reward in rewards:
            state, action = agent.act(state, look, jnp.array([0.5]))
            state = agent.observe(state, Transition(look, action, jnp.float32(reward), look))
        found.append(state.chain[0])
    jax.tree.map(np.testing.assert_array_equal, *found)


def test_a_criterion_is_refused_without_episodes_and_with_another_discount():
    with pytest.raises(ValueError, match=r"^discount = 0\.9: must be None with the criterion Maximum"):
        Estimator(discount=0.9, criterion=Maximum())
    for agent in (
        Agent(POINT, Estimator(criterion=Last())),
        ProximalPolicyOptimization(POINT, criterion=Last()),
    ):
        with pytest.raises(ValueError, match="criterion: needs episodes"):
            stepper_for(ThreeState(), agent, [0])


def test_an_episode_of_too_many_different_values_is_refused():
    mdp = FiniteMDP(np.full((2, 9, 9), 1 / 9), np.sqrt(np.arange(9.0)), np.eye(9))
    with pytest.raises(ValueError, match="pairs of state and value"):
        episode_value(mdp, Softmax(np.zeros((2, 9))), Discounted(0.7).accumulated, 6)
