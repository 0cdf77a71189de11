"""Intentional updates: outputs move by what was intended, for critics and policies, linear and with hidden layers."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import motorgrad as mg
from motorgrad.learning import (
    SGD,
    Agent,
    Estimator,
    Exponential,
    Features,
    IntentionalStep,
    IntentionalTemporalDifference,
    LinearCritic,
    MeanReward,
    NetworkCritic,
    RootMeanSquare,
    Transition,
)
from motorgrad.policies import MultilayerPerceptron, Softmax, hyperplanes, softmax, split
from motorgrad.tasks import ThreeState
from motorgrad.training import stepper_for
from motorgrad.worlds import oracle

POLICY = Softmax(np.array([[0.3, -0.2], [0.1, 0.4]]))
SMALL = MultilayerPerceptron((6, 4), sparsity=0.0)


def flat(tree):
    return np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(tree)])


def critic_of(kind, fit, decay=0.0) -> Any:
    if kind == "linear":
        return LinearCritic(Features(squares=True), 0.9, decay, fit)
    return NetworkCritic(Features(), 0.9, decay, fit, network=SMALL)


def live(critic, looks, rewards):
    """The values of each observation before and after its reward, and the errors."""

    def decide(state, now):
        look, after, reward = now
        state = critic.observe(state, look)
        before = critic.value(state.weights, state.features)
        advantage, state = critic.update(state, POLICY, Transition(look, jnp.int32(0), reward, after))
        return state, jnp.stack([before, critic.value(state.weights, state.features), advantage.value])

    @jax.jit
    def whole(told):
        numbers, rest = eqx.partition(critic.start(POLICY, jnp.float32, jax.random.key(0)), eqx.is_array)

        def step(numbers, now):
            state, found = decide(eqx.combine(numbers, rest), now)
            return eqx.filter(state, eqx.is_array), found

        return jax.lax.scan(step, numbers, told)[1]

    told = (looks[:-1], looks[1:], rewards[: len(looks) - 1].astype(np.float32))
    return np.asarray(whole(told), float).T


def decisions(count, scale=1.0):
    rng = np.random.default_rng(0)
    return (scale * rng.normal(size=(count + 1, 2))).astype(np.float32), rng.normal(size=count)


@pytest.mark.ci
@pytest.mark.representatives("linear-1.0", "linear-100.0")
@pytest.mark.parametrize("scale", [1.0, 100.0])
@pytest.mark.parametrize("kind", ["linear", "network"])
def test_a_critic_takes_back_the_intended_fraction_of_each_error(kind, scale):
    fraction = 0.5 if kind == "linear" else 1e-3  # of a network, to first order
    looks, rewards = decisions(12, scale)
    before, after, errors = live(critic_of(kind, IntentionalTemporalDifference(fraction, clip=1e6)), looks, rewards)
    np.testing.assert_allclose((after - before) / errors, fraction, rtol=1e-4 if kind == "linear" else 0.05)


def test_with_a_trace_no_value_moves_by_more_than_intended():
    looks, rewards = decisions(200)
    before, after, errors = live(critic_of("linear", IntentionalTemporalDifference(0.5), 0.9), looks, rewards)
    shares = (after - before) / errors
    assert shares.max() <= 0.5 + 1e-4
    assert np.median(shares) > 0.02


def test_the_scale_of_rewards_does_not_matter():
    looks, rewards = decisions(20)
    critic = critic_of("linear", IntentionalTemporalDifference(0.5), 0.9)
    np.testing.assert_allclose(live(critic, looks, 1e3 * rewards)[1], 1e3 * live(critic, looks, rewards)[1], rtol=1e-3)


def test_an_outlier_counts_as_so_many_usual_errors():
    looks = np.ones((4, 2), np.float32)
    critic = LinearCritic(Features(), 0.0, 0.0, IntentionalTemporalDifference(0.5, rate=0.5, clip=3.0))
    before, after, errors = live(critic, looks, np.array([1.0, 1.0, 100.0]))
    usual = (0.25 * 1.0 + 0.5 * 0.5) / 0.75  # of the errors 1 and ½
    np.testing.assert_allclose((after - before)[:2], 0.5 * errors[:2], rtol=1e-5)
    np.testing.assert_allclose((after - before)[2], 0.5 * 3.0 * usual, rtol=1e-5)


@pytest.mark.parametrize("kind", ["linear", pytest.param("network", marks=pytest.mark.ci)])
def test_a_decision_that_diverged_teaches_nothing(kind):
    critic = critic_of(kind, IntentionalTemporalDifference())
    broken = Transition(np.ones(2), np.int32(0), np.float32(np.nan), np.full(2, np.nan), diverged=np.bool_(True))

    @eqx.filter_jit
    def taught(broken):
        state = critic.observe(critic.start(POLICY, jnp.float32, jax.random.key(0)), jnp.ones(2))
        return state, critic.update(state, POLICY, broken)[1]

    state, after = taught(broken)
    weights = (eqx.filter(each.weights, eqx.is_array) for each in (after, state))
    jax.tree.map(np.testing.assert_array_equal, *weights)
    jax.tree.map(np.testing.assert_array_equal, after.fit, state.fit)


@pytest.mark.parametrize("decay", [0.0, 0.8])
def test_a_step_of_the_policy_is_that_of_the_formula(decay):
    step, rate = 0.1, 0.2
    estimator = Estimator(Exponential(decay), None, bound=IntentionalStep(step, rate))
    state, z, squares, weight, sensitivity = estimator.init(POLICY), 0.0, 0.0, 0.0, 0.0
    for action, reward in ((0, 1.0), (1, -2.0), (1, 0.5)):
        look = jnp.array([0.5, -1.0 + action])
        score = POLICY.score(look, jnp.int32(action))
        state = estimator.act(state, look, score)
        sample, state = estimator.sample(state, POLICY, Transition(look, jnp.int32(action), jnp.float32(reward), look))
        s = flat(score)
        z, squares, weight = decay * z + s, squares + rate * (s * s - squares), weight + rate * (1 - weight)
        scale = np.zeros_like(s)
        np.divide(1, np.sqrt(squares / weight), out=scale, where=squares > 0)
        sensitivity += rate * (np.sum(s * s * scale) - sensitivity)
        wanted = step * reward * scale * z / np.sqrt(sensitivity / weight * np.sum(z * z * scale))
        np.testing.assert_allclose(flat(sample), wanted, rtol=1e-5)


@pytest.mark.ci
@pytest.mark.representatives("softmax")
@pytest.mark.parametrize("kind", ["softmax", "hyperplanes", "network"])
def test_the_policy_changes_by_what_is_intended_on_average(kind):
    """The mean squared change of log π, over what the policy does, is near its bound: the trace is one score."""
    make = {
        "softmax": lambda: POLICY,
        "hyperplanes": lambda: hyperplanes(2, 2),
        "network": lambda: eqx.filter_jit(softmax(2, 2, network=SMALL))(jax.random.key(1)),
    }
    policy, change, rng = make[kind](), 0.01, np.random.default_rng(0)
    policy = jax.tree.map(lambda x: np.asarray(x) + np.float32(0.3) if eqx.is_inexact_array(x) else x, policy)
    estimator = Estimator(Exponential(0.0), None, bound=IntentionalStep(change, 0.01))
    learned, settings = split(policy)

    @jax.jit
    def decide(state, look, uniforms, other, others):
        action = policy.sample(look, uniforms)
        state = estimator.act(state, look, policy.score(look, action))
        sample, state = estimator.sample(state, policy, Transition(look, action, jnp.float32(1.0), look))
        after = eqx.combine(eqx.apply_updates(learned, sample), settings)
        seen = policy.sample(other, others)
        return state, after.log_prob(other, seen) - policy.log_prob(other, seen)

    state, changes = estimator.init(policy), []
    for _ in range(300):
        numbers = rng.random((2, policy.uniforms))
        looks = rng.normal(size=(2, 2))
        state, found = decide(state, looks[0], numbers[0], looks[1], numbers[1])
        changes.append(float(found))
    root = np.sqrt(np.mean(np.square(changes[50:])))
    assert 0.1 * change < root < 1.1 * change


@pytest.mark.ci
def test_a_linear_learner_finds_the_best_policy():
    task = ThreeState()
    estimator = Estimator(
        Exponential(0.8), MeanReward(), normalization=RootMeanSquare(1 / 400), bound=IntentionalStep(0.01)
    )
    stepper: Any = stepper_for(task, Agent(Softmax(jnp.zeros((2, 2))), estimator, SGD(1.0)), range(10))
    stepper.advance(30_000)
    earned = [oracle.average_reward(task.dynamics, Softmax(w)) for w in stepper.policies().weights]
    assert min(earned) > 0.78


def test_the_preset_has_the_networks_of_stream_ac():
    stream: Any
    intentional: Any
    stream, intentional = mg.presets.stream_ac("hopper"), mg.presets.intentional_ac("hopper")
    assert intentional.policy == stream.policy
    critic = intentional.estimator.baseline
    assert (critic.network, critic.discount, critic.decay) == (
        stream.estimator.baseline.network,
        stream.estimator.baseline.discount,
        stream.estimator.baseline.decay,
    )
    assert (critic.fit.fraction, intentional.estimator.bound.change) == (0.5, 0.05)
    assert intentional.estimator.reward_scaling is None
    assert intentional.estimator.normalization.rate**-0.5 == pytest.approx(20)
