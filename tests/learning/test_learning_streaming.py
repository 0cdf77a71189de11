"""What streaming learners add: scaled rewards, entropy within the trace, and standardised inputs."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled_learner import decision, started, told

import motorgrad as mg
from motorgrad.learning import (
    SGD,
    Agent,
    Constant,
    Estimator,
    Exponential,
    NetworkCritic,
    RewardScaling,
    Transition,
    Window,
    entropy_gradient,
)
from motorgrad.policies import (
    Factored,
    Featured,
    FeatureMap,
    Mirrored,
    MultilayerPerceptron,
    Softmax,
    abilities,
    hyperplanes,
    trainable,
)
from motorgrad.schema import kind_of
from motorgrad.training import stepper_for
from motorgrad.training.engines._frozen import Frozen

LOOK = jnp.array([0.5, -1.0])
POLICY_OF_UNITS = hyperplanes(2, 1)
POLICY = Softmax(np.array([[0.3, -0.2], [0.1, 0.4]]))


def decided(agent, rewards, ends=(), looks=None):
    """A learner after so many rewards; without compiling."""
    state = agent.init(jax.random.key(0))
    for t, reward in enumerate(rewards):
        look = LOOK if looks is None else looks[t]
        following = LOOK if looks is None else looks[t + 1]
        uniforms, ended = jnp.array([0.2 + 0.1 * t]), jnp.array(t in ends)
        state = decision(agent, state, look, uniforms, jnp.float32(reward), following, truncated=ended).observed
    return state


def test_rewards_are_divided_by_the_deviation_of_their_discounted_sum():
    scaling, rewards, ends = RewardScaling(0.9), [1.0, -2.0, 0.5, 3.0, 3.0], [2]
    state, sums, u = scaling.init(jnp.float32), [], 0.0
    for t, reward in enumerate(rewards):
        state = scaling.update(state, jnp.float32(reward))
        u = 0.9 * u + reward
        sums.append(u)
        factor = 1 / np.std(sums) if t else 1
        np.testing.assert_allclose(scaling.factor(state), factor, rtol=1e-5)
        if t in ends:
            state, u = scaling.restart(state), 0.0


def test_a_learner_sees_scaled_rewards_alone():
    rewards = [1.0, -2.0, 4.0]
    agent = Agent(POLICY, Estimator(Exponential(0.5), Constant(0.0), reward_scaling=RewardScaling(0.9)))
    plain = Agent(POLICY, Estimator(Exponential(0.5), Constant(0.0)))
    sums = [1.0, -1.1, 3.01]
    scaled, unscaled = decided(agent, rewards), decided(plain, rewards)
    factor = 1 / np.std(sums)
    np.testing.assert_allclose(scaled.gradient.weights, factor * unscaled.gradient.weights, rtol=1e-5)


@pytest.mark.parametrize("trace", [Exponential(0.5), pytest.param(Window(2), marks=pytest.mark.ci)])
def test_entropy_enters_the_trace_by_the_sign_of_the_advantage(trace):
    """The sample is δ times a trace whose scores each have κ sign(δ) ∇H of their own decision added."""
    rewards, bonus = [1.0, -2.0, 0.5], 0.3
    estimator = Estimator(trace, Constant(0.0), entropy=bonus, entropy_in="trace")
    state = decided(Agent(POLICY, estimator), rewards)
    plain, scores = Agent(POLICY, Estimator(Window(1), Constant(0.0))), []
    for t in range(3):
        _, action = plain.act(plain.init(jax.random.key(0)), LOOK, jnp.array([0.2 + 0.1 * t]))
        scores.append(POLICY.score(LOOK, action).weights)
    slope = entropy_gradient(POLICY, LOOK).weights
    weights = [0.25, 0.5, 1.0] if isinstance(trace, Exponential) else [0, 1, 1]
    whole = sum(w * (s + bonus * np.sign(r) * slope) for w, s, r in zip(weights, scores, rewards, strict=True))
    np.testing.assert_allclose(state.gradient.weights, rewards[-1] * whole, rtol=1e-5)


@pytest.fixture(scope="module")
def standardised():
    network = MultilayerPerceptron((3,), sparsity=0.0, standardise=True)
    critic = NetworkCritic(discount=0.9, network=network)
    return Agent(hyperplanes(2, 1, network=network), Estimator(Exponential(0.5), critic), SGD(0.1))


@pytest.mark.ci
def test_inputs_are_standardised_by_what_actions_led_to(standardised):
    looks = np.random.default_rng(0).normal(3.0, 2.0, (5, 2)).astype(np.float32)
    state = decided(standardised, [1.0, 0.0, 1.0, 2.0], looks=looks)
    for layers in (state.policy.module.layers, state.estimator.baseline.weights.layers.layers):
        first = layers[0]
        np.testing.assert_allclose(first.mean, looks[1:].mean(axis=0), rtol=1e-5)
        np.testing.assert_allclose(first.variance, looks[1:].var(axis=0), rtol=1e-5)
        wanted = np.clip((looks[1] - first.mean) / np.sqrt(first.variance), -5, 5)
        np.testing.assert_allclose(first(jnp.asarray(looks[1])), wanted, rtol=1e-4)
    assert all(leaf.shape != (2,) for leaf in jax.tree.leaves(trainable(state.policy)))  # no gradient moves them


@pytest.mark.ci
def test_what_diverged_is_not_among_the_statistics(standardised):
    state = told(standardised, started(standardised), np.ones(2), [0.2], 1.0)[2]
    state, _, after = told(standardised, state, np.ones(2), [0.3], 1.0, np.full(2, np.nan), diverged=True)
    for one, other in zip(jax.tree.leaves(after.policy), jax.tree.leaves(state.policy), strict=True):
        np.testing.assert_array_equal(one, other)
    kept = [each.estimator.baseline.weights.layers.layers[0] for each in (after, state)]
    jax.tree.map(np.testing.assert_array_equal, *kept)


@pytest.mark.ci
def test_a_frozen_policy_and_one_of_another_kind_keep_what_they_are(standardised):
    frozen = Frozen(standardised, greedy=False)
    state = frozen.init(jax.random.key(0))
    after, action = frozen.act(state, LOOK, jnp.array([0.3]))
    after = frozen.observe(after, Transition(LOOK, action, jnp.zeros(()), LOOK))
    assert after.policy is state.policy
    assert abilities.adapted(POLICY, LOOK) is POLICY
    plain = hyperplanes(2, 1, network=MultilayerPerceptron((3,), sparsity=0.0))(jax.random.key(0))
    assert abilities.adapted(plain, LOOK) is plain


def test_policies_of_several_parts_adapt_those_that_see_the_same():
    network = MultilayerPerceptron((3,), sparsity=0.0, standardise=True)
    unit = hyperplanes(2, 1, network=network)(jax.random.key(0))
    seen = jnp.array([3.0, 1.0])
    squared = hyperplanes(4, 1, network=network)(jax.random.key(0))
    found = abilities.adapted(Featured(squared, FeatureMap(squares=True), observed=2), seen)
    np.testing.assert_array_equal(found.pool.module.layers[0].mean, [3.0, 1.0, 9.0, 1.0])
    image = abilities.adapted(Mirrored(unit, order=[1, 0], signs=[1, 1], left=[0], right=[1]), seen)
    np.testing.assert_allclose(image.pool.module.layers[0].mean, (seen + image.mirrored(seen)) / 2)
    plain = Factored((POLICY_OF_UNITS, POLICY_OF_UNITS))
    assert abilities.adapted(plain, seen) is plain


@pytest.mark.parametrize(("task", "policy"), [("three-state", "softmax"), ("hopper", "hyperplanes")])
def test_the_preset_is_that_of_the_paper(task, policy):
    agent = mg.presets.stream_ac(task)
    estimator, critic = agent.estimator, agent.estimator.baseline
    assert (kind_of(agent.policy), agent.policy.network.standardise) == (policy, True)
    assert (estimator.trace.decay, critic.discount, critic.decay) == (0.99 * 0.8, 0.99, 0.8)
    assert (estimator.bound.scaling, critic.fit.scaling, critic.fit.learning_rate) == (3.0, 2.0, 1.0)
    assert (agent.optimizer.learning_rate, estimator.entropy, estimator.entropy_in) == (1.0, 0.01, "trace")
    assert dataclasses.asdict(critic.network) == dataclasses.asdict(
        MultilayerPerceptron((128, 128), "leaky-relu", True, 0.9, True)
    )


@pytest.mark.ci
def test_the_preset_resumes_bit_for_bit_and_its_seeds_do_not_touch():
    task = mg.make("three-state", time_limit=5)
    small = {"network.hidden": [4]}
    changes = {f"{place}.{name}": value for place in ("policy", "baseline") for name, value in small.items()}
    agent = mg.presets.stream_ac(task, changes=changes)
    whole, parts, more = (stepper_for(task, agent, seeds) for seeds in ([0, 1], [0, 1], [0, 1, 2]))
    whole.advance(12)
    more.advance(12)
    parts.advance(5)
    again = stepper_for(task, agent, [0, 1])
    again.restore(parts.state)
    again.advance(7)
    jax.tree.map(np.testing.assert_array_equal, again.state, whole.state)
    first = jax.tree.map(lambda leaf: leaf[:2], more.policies())
    # on some processors the compiled program rounds networks differently beside another number of seeds
    close = functools.partial(np.testing.assert_allclose, rtol=1e-5, atol=1e-8)
    jax.tree.map(close, first, whole.policies())


@pytest.mark.slow
def test_a_stored_policy_has_its_statistics_and_is_evaluated_with_them(tmp_path):
    task = mg.make("three-state")
    agent = mg.presets.stream_ac(task, changes={"policy.network.hidden": [4], "baseline.network.hidden": [4]})
    run = mg.train(task, agent, steps=40, seeds=2, out=tmp_path / "run", progress=False)
    first = mg.load(tmp_path / "run").policies.module.layers[0]
    assert (np.asarray(first.count) == 40).all()
    np.testing.assert_array_equal(first.mean, run.policies.module.layers[0].mean)
    assert np.isfinite(mg.evaluate(run, 20).reward).all()
