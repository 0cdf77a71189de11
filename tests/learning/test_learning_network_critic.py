"""Critics with hidden layers, and steps that are bounded: against exact values, exact gradients, and steps by hand."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled_learner import started
from test_learning_critics import CHAIN_POINT, POINT, Which

from motorgrad.learning import (
    Agent,
    BoundedTemporalDifference,
    Estimator,
    Exponential,
    FittedReturns,
    LeastSquares,
    NetworkCritic,
    OvershootingBound,
    RootMeanSquare,
    TemporalDifference,
    Transition,
    TrueOnlineTemporalDifference,
)
from motorgrad.policies import MultilayerPerceptron, softmax, split
from motorgrad.tasks import Chain, ThreeState
from motorgrad.training import stepper_for
from motorgrad.worlds import oracle

SMALL = MultilayerPerceptron(hidden=(8,), activation="tanh", layer_norm=False, sparsity=0.0)
WORLDS = {  # (task, policy, learning rate, decisions); noise biases a nonlinear critic, more so at a greater rate
    "three states": (ThreeState(), POINT, 0.005, 80_000),
    "chain": (Chain(length=4), CHAIN_POINT, 0.02, 20_000),
}
KEY = jax.random.key(0)


def values_of(critic, states, seen):
    """The values of observations by the critics of many seeds, (seeds, observations)."""
    previous = jnp.zeros(2)
    return np.asarray(jax.vmap(lambda s: jax.vmap(lambda y: critic.value_at(s, y, previous))(seen))(states))


@pytest.mark.ci
@pytest.mark.parametrize(("name", "discount"), [("three states", 0.8), ("chain", 0.8), ("chain", None)])
def test_a_network_critic_learns_the_exact_values(name, discount):
    task, policy, rate, decisions = WORLDS[name]
    critic = NetworkCritic(Which(task.dynamics), discount, 0.7, TemporalDifference(rate, level_rate=0.0), SMALL)
    stepper = stepper_for(task, Agent(policy, Estimator(Exponential(0.5), critic, update_every="never")), range(50))
    stepper.advance(decisions)
    seen = jnp.asarray(task.dynamics.observations, jnp.float32)
    found = values_of(critic, stepper.state["cycle"].agent.estimator.baseline, seen)
    exact = oracle.values(task.dynamics, policy, discount)
    if discount is None:  # known but for a constant
        found, exact = found - found.mean(1, keepdims=True), exact - exact.mean()
    scale = np.abs(exact).max()
    np.testing.assert_allclose(found.mean(0), exact, atol=0.03 * scale)


@pytest.mark.ci
def test_values_fitted_to_the_returns_of_batches_are_the_exact_ones():
    task, policy, *_ = WORLDS["chain"]
    fit = FittedReturns(0.01, interval=400, passes=20)
    critic = NetworkCritic(Which(task.dynamics), 0.8, 0.7, fit, SMALL)
    stepper = stepper_for(task, Agent(policy, Estimator(Exponential(0.5), critic, update_every="never")), range(50))
    seen = jnp.asarray(task.dynamics.observations, jnp.float32)
    found = {}
    for decisions in (399, 1, 11_600):
        stepper.advance(decisions)
        found[stepper.decision] = values_of(critic, stepper.state["cycle"].agent.estimator.baseline, seen)
    assert not found[399].any()
    assert found[400].any()
    exact = oracle.values(task.dynamics, policy, 0.8)
    np.testing.assert_allclose(found[12_000].mean(0), exact, atol=0.03 * np.abs(exact).max())


def by_hand(rewards, later, ends, discount, decay):
    returns, following = np.zeros(len(rewards)), later[-1]
    for t in reversed(range(len(rewards))):
        following = later[t] if ends[t] or t == len(rewards) - 1 else following
        expected = (1 - decay) * later[t] + decay * following
        returns[t] = following = rewards[t] + discount * expected
    return returns


@pytest.mark.ci
def test_the_returns_of_a_batch_end_with_its_episodes():
    """One step of plain size down the squared error, from the returns by hand."""
    fit = FittedReturns(0.01, interval=5, passes=1)
    critic = NetworkCritic(network=SMALL, discount=0.9, decay=0.6, fit=fit)
    state = begun(critic)
    rng = np.random.default_rng(0)
    looks, rewards = jnp.asarray(rng.normal(size=(6, 2)), jnp.float32), rng.normal(size=5)
    terminated, cut = [False, True, False, False, False], [False, False, False, True, False]
    weights = state.weights
    for t in range(5):
        state = critic.observe(state, looks[t])
        told = Transition(looks[t], jnp.int32(0), jnp.float32(rewards[t]), looks[t + 1], jnp.asarray(terminated[t]))
        if t == 3:  # a decision that diverged leaves nothing behind
            broken = told._replace(reward=jnp.float32(jnp.nan), diverged=jnp.asarray(True))
            state = critic.solve(critic.update(state, POINT, broken)[1])
        state = critic.solve(critic.update(state, POINT, told)[1])
        state = critic.restart(state) if terminated[t] or cut[t] else state
    values = np.array([float(weights(look)) for look in looks])
    later = values[1:] * ~np.array(terminated)
    returns = by_hand(rewards, later, np.array(terminated) | np.array(cut), 0.9, 0.6)
    learned, rest = split(weights)

    def loss(w):
        return 0.5 * jnp.mean((jax.vmap(eqx.combine(w, rest))(looks[:5]) - returns) ** 2)

    slope = flat(jax.grad(loss)(learned))
    step = flat(split(state.weights)[0]) - flat(learned)
    np.testing.assert_allclose(step, -0.01 * slope / (np.abs(slope) + 1e-8), rtol=1e-3, atol=1e-6)
    assert int(state.fit.waiting) == 0


@pytest.mark.ci
def test_network_policy_and_network_critic_estimate_the_exact_gradient():
    """With the trace of the discount, the errors of a critic that has settled do not matter (Schulman et al., 2016)."""
    task, discount, seeds = ThreeState(), 0.8, 200
    policy = eqx.filter_jit(softmax(2, 2, network=MultilayerPerceptron(hidden=(4,), sparsity=0.0)))(KEY)
    policy = moved(policy, 0.3)
    critic = NetworkCritic(network=SMALL, discount=discount, decay=0.7, fit=TemporalDifference(0.005))
    stepper = stepper_for(
        task, Agent(policy, Estimator(Exponential(discount), critic, update_every="never")), range(seeds)
    )
    stepper.advance(4_800)
    leaves = jax.tree.leaves(stepper.state["cycle"].agent.gradient.mean)
    found = np.concatenate([np.asarray(leaf, float).reshape(seeds, -1) for leaf in leaves], axis=1)
    exact = oracle.flat(oracle.biased_gradient(task.dynamics, policy, discount))
    error = found.std(0) / np.sqrt(seeds)
    assert np.linalg.norm(error) < 0.1 * np.linalg.norm(exact)
    np.testing.assert_array_less(np.abs(found.mean(0) - exact), 4.5 * error + 0.02 * np.linalg.norm(exact))


def flat(tree):
    return np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(tree)])


def moved(tree, size):
    """The tree with every number of it elsewhere, by normal noise."""
    return jax.tree.map(lambda w: w + np.float32(size * np.random.default_rng(w.size).normal(size=w.shape)), tree)


@eqx.filter_jit
def _begun(critic):
    state = critic.start(POINT, jnp.float32, KEY)
    learned, rest = split(state.weights)
    return critic.observe(state._replace(weights=eqx.combine(moved(learned, 0.5), rest)), jnp.array([0.3, -1.2]))


def begun(critic):
    """A critic's state with every parameter away from 0, at an observation."""
    return _begun(critic)


@eqx.filter_jit
def decided(critic, state, transition):
    """The advantage of a decision, the state after it, the same at the next observation and after an episode's end;
    the value before, its slope and the next value, by automatic differentiation."""
    advantage, after = critic.update(state, POINT, transition)
    following = critic.observe(after, transition.next_observation)
    learned, rest = split(state.weights)
    value, slope = jax.value_and_grad(lambda w: eqx.combine(w, rest)(transition.observation))(learned)
    by_hand = value, slope, state.weights(transition.next_observation)
    return advantage.value, after, following, critic.restart(following), by_hand


def critic_with(fit):
    network = MultilayerPerceptron((5, 4), sparsity=0.0)
    return NetworkCritic(network=network, discount=0.9, decay=0.6, fit=FITS[fit])


FITS = {"td": TemporalDifference(0.1), "bounded": BoundedTemporalDifference(1.0, scaling=2.0)}


@pytest.mark.ci
@pytest.mark.representatives("bounded-False", "bounded-True")
@pytest.mark.parametrize("terminated", [False, True])
@pytest.mark.parametrize("fit", FITS)
def test_two_decisions_are_those_of_the_formulas(fit, terminated):
    critic = critic_with(fit)
    state = begun(critic)
    looks = np.array([[0.3, -1.2], [1.0, 0.4], [-0.5, 0.1]], np.float32)
    trace = np.zeros(flat(split(state.weights)[0]).shape)
    for t, reward in enumerate([0.7, -2.0]):
        ends, weights = np.bool_(terminated and t == 1), state.weights
        transition = Transition(looks[t], np.int32(1), np.float32(reward), looks[t + 1], ends, diverged=np.bool_(False))
        advantage, after, state, fresh, (value, slope, later) = decided(critic, state, transition)
        error = reward + 0.9 * float(later) * (not ends) - float(value)
        trace = 0.9 * 0.6 * trace + flat(slope)
        rate = 0.1 if fit == "td" else 1 / max(1, 2 * max(abs(error), 1) * np.abs(trace).sum())
        assert float(advantage) == pytest.approx(error, rel=1e-5)
        step = flat(split(after.weights)[0]) - flat(split(weights)[0])
        np.testing.assert_allclose(step, rate * error * trace, rtol=2e-3, atol=1e-6)
        if fit == "bounded":
            assert np.abs(step).sum() < 0.5 + 1e-4  # 1/κ
    assert not flat(fresh.fit).any()


def test_a_diverged_decision_teaches_nothing():
    critic = critic_with("bounded")
    state = begun(critic)
    lost = np.full(2, np.nan, np.float32)
    given = np.zeros(2, np.float32), np.int32(0), np.float32(np.nan), lost
    transition = Transition(*given, terminated=np.bool_(False), diverged=np.bool_(True))
    after = decided(critic, state, transition)[1]
    np.testing.assert_array_equal(flat(after.weights), flat(state.weights))


def test_every_seed_has_a_critic_of_its_own_that_starts_at_0():
    agent = Agent(POINT, Estimator(Exponential(0.5), NetworkCritic(network=SMALL)))
    one, same, other = (started(agent, seed).estimator.baseline for seed in (0, 0, 1))
    jax.tree.map(np.testing.assert_array_equal, *(eqx.filter(each, eqx.is_array) for each in (one, same)))
    assert not np.array_equal(*(each.weights.layers.layers[0].weight for each in (one, other)))
    assert float(eqx.filter_jit(agent.estimator.baseline.value_at)(one, np.array([0.3, -1.0]), np.zeros(2))) == 0


def test_a_fit_for_linear_critics_is_refused():
    for fit in (LeastSquares(), TrueOnlineTemporalDifference()):
        with pytest.raises(ValueError, match=rf"fit = '{type(fit).__name__}': must be one for any function"):
            NetworkCritic(network=SMALL, fit=fit)


@pytest.mark.ci
@pytest.mark.representatives("None-None")
@pytest.mark.parametrize("normalization", [None, RootMeanSquare(0.5)])
@pytest.mark.parametrize("entropy", [None, 0.5])
def test_a_bounded_sample_is_the_sample_over_the_bound(normalization, entropy):
    policy = eqx.filter_jit(softmax(2, 3, network=MultilayerPerceptron((6,))))(KEY)
    plain = Estimator(Exponential(0.9), None, normalization=normalization, entropy=entropy)
    bounded = dataclasses.replace(plain, bound=OvershootingBound(3.0))
    look, action, reward = np.array([0.2, -0.4], np.float32), np.int32(2), np.float32(-1.7)
    transition = Transition(look, action, reward, look)

    @eqx.filter_jit
    def sampled(policy):
        state = plain.act(plain.init(policy), look, policy.score(look, action))
        both = [each.sample(each.act(each.init(policy), look, policy.score(look, action)), policy, transition)[0]
                for each in (plain, bounded)]  # fmt: skip
        return both, state.trace

    both, trace = sampled(policy)
    found, trace = [flat(each) for each in both], flat(trace)
    worth = 1.0 if normalization else 1.7
    wanted = max(1, 3 * worth * np.abs(trace).sum())
    assert wanted > 1
    np.testing.assert_allclose(found[1], found[0] / wanted, rtol=1e-5, atol=1e-7)
