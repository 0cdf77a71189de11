"""Baselines weighted by eligibility: against the exact constants, and the noise that they leave."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled_learner import decision, started, told

from motorgrad.learning import (
    Agent,
    Estimator,
    Exponential,
    MeanReward,
    OptimalBaseline,
    SparseLearner,
    UnitMean,
)
from motorgrad.policies import Hyperplanes, LocalGaussians, Softmax, abilities
from motorgrad.tasks import CallAdmission, ThreeState
from motorgrad.training import stepper_for
from motorgrad.worlds import oracle

POINT = Softmax([[1.0, 1.0], [-1.0, -1.0]])  # Baxter & Bartlett's test point
CALLS = CallAdmission(capacity=3)
ADMITS = Hyperplanes(np.full((1, CALLS.observation_size), 0.5), np.zeros(1))
PLACES = {"three states": (ThreeState(), POINT), "calls": (CALLS, ADMITS)}


def run(task, policy, baseline, decay, decisions, seeds):
    """The baselines' states and the estimates of many seeds at fixed parameters."""
    stepper = stepper_for(
        task, Agent(policy, Estimator(Exponential(decay), baseline, update_every="never")), range(seeds)
    )
    stepper.advance(decisions)
    state = stepper.state["cycle"].agent
    estimate = np.concatenate([leaf.reshape(seeds, -1) for leaf in jax.tree.leaves(state.gradient.mean)], axis=1)
    return state.estimator.baseline, np.asarray(estimate, float)


def in_order(policy, found, each):
    """The values of many seeds in the order of the oracle."""
    if each != "parameter":
        return np.concatenate([np.asarray(block).reshape(len(block), -1) for block in found], axis=1)
    build = jax.jit(jax.vmap(lambda blocks: abilities.from_blocks(policy, blocks)))(tuple(map(np.asarray, found)))
    return np.concatenate([np.asarray(leaf).reshape(len(leaf), -1) for leaf in jax.tree.leaves(build)], axis=1)


@pytest.mark.representatives("0.8-parameter-three states")
@pytest.mark.parametrize("name", PLACES)
@pytest.mark.parametrize("each", ["policy", pytest.param("unit", marks=pytest.mark.ci), "parameter"])
@pytest.mark.parametrize("decay", [0.0, 0.8])
def test_it_finds_the_exact_constants(decay, each, name):
    (task, policy), baseline = PLACES[name], OptimalBaseline(each=each)
    exact = oracle.optimal_baseline(task.dynamics, policy, decay, each)
    states, _ = run(task, policy, baseline, decay, 10_000, 100)
    found = in_order(policy, jax.jit(jax.vmap(baseline.values))(states), each)
    error = found.std(0) / 10
    assert error.max() < 0.02 * np.abs(exact).max()
    np.testing.assert_array_less(np.abs(found.mean(0) - exact), 4 * error + 0.01 * np.abs(exact).max())


def test_the_exact_constant_leaves_the_least_noise():
    """Without a memory of the trace, by a sum over all that may happen."""
    mdp, chance = ThreeState().dynamics, oracle.action_probabilities(ThreeState().dynamics, POINT)
    pi, (best,) = oracle.stationary_distribution(mdp, POINT), oracle.optimal_baseline(mdp, POINT, 0.0)
    scores = jax.jit(jax.vmap(lambda y: jax.vmap(lambda a: POINT.score(y, a).weights)(jnp.arange(2))))
    lengths = np.square(np.asarray(scores(mdp.observations))).sum((2, 3))

    def noise(b):
        squares = np.einsum("sa,s,ast,t->sa", chance, pi, mdp.transitions, (mdp.rewards - b) ** 2)
        return np.sum(squares * lengths)

    assert abs(best - oracle.average_reward(mdp, POINT)) > 0.02  # it is not the average reward
    assert noise(best) < min(noise(best - 0.01), noise(best + 0.01))
    assert noise(best) < noise(oracle.average_reward(mdp, POINT))


@pytest.mark.ci
@pytest.mark.parametrize("baseline", [OptimalBaseline(), OptimalBaseline(each="parameter"), UnitMean()], ids=repr)
def test_it_does_not_bias_the_estimate(baseline):
    exact = oracle.flat(oracle.biased_gradient(ThreeState().dynamics, POINT, 0.8))
    _, found = run(ThreeState(), POINT, baseline, 0.8, 4_800, 300)
    error = found.std(0) / np.sqrt(len(found))
    assert np.linalg.norm(error) < 0.06 * np.linalg.norm(exact)
    np.testing.assert_array_less(np.abs(found.mean(0) - exact), 4 * error + 1e-2 * np.linalg.norm(exact))


def test_units_have_constants_of_their_own():
    """Written out: each row of weights is a unit, with the running means of its own trace."""
    policy = Hyperplanes(jnp.array([[0.5, -0.2], [0.1, 0.3]]), jnp.zeros(2))
    for baseline, power in ((OptimalBaseline(each="unit"), 1.0), (UnitMean(), 0.5)):
        agent = Agent(policy, Estimator(Exponential(0.7), baseline, update_every="never"))
        state, rng = started(agent), np.random.default_rng(1)
        products, weights, total = np.zeros(2), np.zeros(2), np.zeros((2, 2))
        for n in range(1, 7):
            look, uniforms, reward = rng.normal(size=2), rng.random(2), np.float32(rng.normal())
            acted, _, state = told(agent, state, look, uniforms, reward, np.zeros(2))
            trace = acted.estimator.trace
            own = np.where(weights > 0, products / np.where(weights > 0, weights, 1), 0)
            total += (reward - own)[:, None] * np.asarray(trace.weights)
            squares = np.square(trace.weights).sum(1) + np.square(trace.bias)
            products, weights = products + squares**power * reward, weights + squares**power
            np.testing.assert_allclose(state.gradient.mean.weights, total / n, rtol=1e-4, atol=1e-6)


def test_a_diverged_reward_teaches_it_nothing():
    agent = Agent(POINT, Estimator(Exponential(0.8), OptimalBaseline(each="unit")))
    state, _, lost = told(agent, started(agent), [0.5, 0.25], [0.3], np.nan, np.zeros(2), diverged=True)
    jax.tree.map(np.testing.assert_array_equal, lost.estimator.baseline, state.estimator.baseline)
    assert not np.isnan(lost.gradient.weights).any()


@pytest.mark.ci
def test_without_one_the_trace_is_not_told():
    seen = []

    class Looks(MeanReward):
        def update(self, state, policy, transition):
            seen.append(transition.eligibility)
            return super().update(state, policy, transition)

    agent = Agent(POINT, Estimator(Exponential(0.8), Looks()))
    decision(agent, agent.init(jax.random.key(0)), jnp.array([0.5, 0.25]), jnp.array([0.3]), jnp.float32(1.0))
    assert seen == [None]


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: OptimalBaseline(each="units"), "did you mean 'unit'"),
        (lambda: OptimalBaseline(rate=2.0), "rate = 2.0"),
        (
            lambda: SparseLearner(LocalGaussians([[0.5]], [[0.0]]), baseline=OptimalBaseline()),
            "baseline = .*: must be None or a ScalarBaseline",
        ),
    ],
)
def test_impossible_settings_are_refused_by_name(make, said):
    with pytest.raises(ValueError, match=said):
        make()
