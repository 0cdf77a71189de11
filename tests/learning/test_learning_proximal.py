"""Proximal policy optimisation: the clipped surrogate, its advantages and its steps."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled_learner import decided, started

from motorgrad.learning import (
    SGD,
    Agent,
    Batch,
    CompatibleWeights,
    ConjugateAscent,
    Episodic,
    EpisodicNatural,
    Estimator,
    Exponential,
    LeastSquaresNatural,
    LinearBaseline,
    MeanReward,
    OptimalBaseline,
    ProximalPolicyOptimization,
)
from motorgrad.policies import GradedHyperplanes, Softmax, recurrent, trainable
from motorgrad.training import agent_for

WEIGHTS = np.array([[0.3, -0.2], [0.1, 0.4], [0.0, 0.2]])
LOOKS = np.random.default_rng(0).normal(size=(9, 2)).astype(np.float32)
REWARDS = np.random.default_rng(1).normal(size=8).astype(np.float32)


def stepped(agent, ends=(2,), diverged=()):
    """The policy after eight decisions."""
    state = started(agent)
    for t in range(8):
        flags = {"truncated": t in ends, "diverged": t in diverged}
        state = decided(agent, state, LOOKS[t], [0.1 * t], REWARDS[t], LOOKS[t + 1], **flags).state
    return state


def once(decisions, **settings):
    """A learner that uses each batch once, and its advantages as they are."""
    fixed = {"update_every": decisions, "epochs": 1, "standardise": False, "optimizer": SGD(0.5)}
    return ProximalPolicyOptimization(Softmax(WEIGHTS), **fixed, **settings)


@pytest.mark.ci
@pytest.mark.representatives("baseline1-trace1")
@pytest.mark.parametrize("trace", [Exponential(0.8), Episodic()])
@pytest.mark.parametrize("baseline", [MeanReward(), LinearBaseline(0.1)])
def test_one_pass_over_a_batch_is_the_step_of_its_samples(trace, baseline):
    """Advantages summed backwards, times scores, are errors times the trace, ends of episodes included."""
    policy = Softmax(WEIGHTS)
    plain = Agent(policy, Estimator(trace, baseline, update_every=8, entropy=0.1), SGD(0.5))
    decay = trace.decay if isinstance(trace, Exponential) else 1.0
    found, wanted = stepped(once(8, baseline=baseline, decay=decay, entropy=0.1)), stepped(plain)
    assert not np.allclose(wanted.policy.weights, WEIGHTS)
    np.testing.assert_allclose(found.policy.weights, wanted.policy.weights, rtol=1e-4, atol=1e-6)
    assert int(found.batch.waiting) == int(wanted.gradient.count) == 0


@pytest.mark.parametrize(("worth", "wanted"), [([0.1] * 7, [0.0] * 7), ([0.0, 1.0, 1.0, 0.0], [-1.0, 1.0, 1.0, -1.0])])
def test_equal_advantages_are_standardised_to_0(worth, wanted):
    batch = Batch.empty(Softmax(WEIGHTS), len(worth), jax.random.key(0))
    batch = batch._replace(error=jnp.asarray(worth, jnp.float32), end=jnp.ones(len(worth), bool))
    np.testing.assert_allclose(batch.advantages(0.0, standardise=True), wanted, rtol=1e-6)


@pytest.mark.ci
def test_what_diverged_is_no_part_of_a_batch():
    plain = Agent(Softmax(WEIGHTS), Estimator(Exponential(0.8), MeanReward(), update_every=7), SGD(0.5))
    found, wanted = (stepped(each, (), (3,)) for each in (once(7, decay=0.8), plain))
    np.testing.assert_allclose(found.policy.weights, wanted.policy.weights, rtol=1e-4, atol=1e-6)


@pytest.mark.ci
@pytest.mark.representatives("policy0")
@pytest.mark.parametrize("policy", [Softmax(WEIGHTS), GradedHyperplanes([[0.5, -1.0]], [0.2], [-0.5])])
def test_the_gradient_is_that_of_what_is_not_clipped(policy):
    """It is the mean of ratio × advantage × score over the decisions that may still gain."""
    agent, rng = ProximalPolicyOptimization(policy, clip=0.2), np.random.default_rng(2)
    seen = rng.normal(size=(40, 2)).astype(np.float32)
    uniforms = rng.uniform(size=(40, policy.uniforms)).astype(np.float32)
    difference = rng.normal(0, 0.3, 40).astype(np.float32)
    advantages = rng.normal(size=40).astype(np.float32)

    @eqx.filter_jit
    def everything(policy):
        actions = jax.vmap(policy.sample)(seen, uniforms)
        now = jax.vmap(policy.log_prob)(seen, actions)
        batch = (seen, actions, now + difference, advantages)
        slope = jax.grad(lambda p: 0.5 * jnp.mean(jax.vmap(p.entropy)(seen)))(policy)
        gradients = [agent.gradient(policy, batch, *bonus) for bonus in ((), (0.5,))]
        return now, batch[2], jax.vmap(policy.score)(seen, actions), gradients, slope

    now, old, scores, (found, bonus), slope = jax.tree.map(np.asarray, everything(policy))
    ratio = np.exp(now - old)
    gone = ((advantages > 0) & (ratio > 1.2)) | ((advantages < 0) & (ratio < 0.8))
    assert 5 < gone.sum() < 35
    weight = np.where(gone, 0, ratio * advantages) / 40
    wanted = jax.tree.map(lambda s: np.tensordot(weight, s, 1), scores)
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-3, atol=1e-5), found, wanted)
    wanted = jax.tree.map(lambda a, b: a + b, found, trainable(slope))
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-3, atol=1e-5), bonus, wanted)


def test_every_decision_is_used_once_an_epoch_in_an_order_of_its_own():
    batch = Batch.empty(Softmax(WEIGHTS), 8, jax.random.key(1))
    order = np.asarray(batch.order(epochs=3, minibatches=4))
    assert order.shape == (12, 2)
    epochs = order.reshape(3, 8)
    np.testing.assert_array_equal(np.sort(epochs), [np.arange(8)] * 3)
    assert not np.array_equal(epochs[0], epochs[1])
    assert not np.array_equal(order, batch.emptied().order(3, 4))
    other = Batch.empty(Softmax(WEIGHTS), 8, jax.random.key(2))
    assert not np.array_equal(order, other.order(3, 4))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"update_every": 1}, r"update_every = 1: must be an integer of at least 2"),
        ({"update_every": "episode"}, r"update_every = 'episode': must be an integer of at least 2"),
        ({"update_every": 9}, r"minibatches = 2: must be a divisor of update_every = 9"),
        ({"baseline": OptimalBaseline()}, r"baseline = 'OptimalBaseline': must be a critic, or one that does not see"),
        ({"metric": EpisodicNatural()}, r"metric = 'EpisodicNatural': must be one that reads a gradient"),
        ({"metric": LeastSquaresNatural()}, r"metric = 'LeastSquaresNatural': must be one that reads a gradient"),
        ({"metric": CompatibleWeights()}, r"metric = 'CompatibleWeights': must be one that reads a gradient"),
        ({"optimizer": ConjugateAscent()}, r"optimizer = 'ConjugateAscent': must be one that makes a step of every"),
    ],
)
def test_parts_that_do_not_fit_are_refused_by_name(settings, message):
    with pytest.raises(ValueError, match=message):
        ProximalPolicyOptimization(Softmax(WEIGHTS), **{"update_every": 8, "minibatches": 2, **settings})


@pytest.mark.parametrize("name", ["trace", "bound", "entropy_in", "estimator", "discount", "growth"])
def test_settings_of_the_policy_gradient_alone_are_unknown(name):
    with pytest.raises(ValueError, match=f"unknown setting of agent '{name}'"):
        agent_for("three-state", {"kind": "proximal", name: "none"})


def test_a_policy_whose_memory_depends_on_its_parameters_is_refused():
    agent = ProximalPolicyOptimization(recurrent(2, 1), update_every=8)
    with pytest.raises(ValueError, match=r"policy = .*: must be one whose memory does not depend on its parameters"):
        eqx.filter_eval_shape(agent.init, jax.random.key(0))
