"""Optimizers: the direction, one learning rate a group, and life among optax's own."""

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest
from compiled_learner import decision, updates_of

from motorgrad.learning import SGD, Adam, Agent, olpomdp
from motorgrad.policies import Factored, Hyperplanes, LocalGaussians, trainable

# Our own, and any optax transformation; each must climb.
OPTIMIZERS = {
    "sgd": SGD(0.05),
    "sgd, by group": SGD({"weights": 0.05, "bias": 0.1}),
    "adam": Adam(0.05),
    "adam, by group": Adam({"weights": 0.05, "bias": 0.01}),
    "optax.sgd": optax.sgd(0.05),
    "optax.sgd with momentum": optax.sgd(0.01, momentum=0.9),
    "optax.adam": optax.adam(0.05),
    "optax.rmsprop": optax.rmsprop(0.05),
    "optax.adagrad": optax.adagrad(0.5),
    "optax.inject_hyperparams": optax.inject_hyperparams(optax.sgd)(learning_rate=0.05),
}
CLIPPED = {"optimizer": optax.clip_by_global_norm(1.0), "transformations": (SGD(0.05),)}
PLANES = Hyperplanes(jnp.zeros((2, 3)), jnp.zeros(2))


def learner(optimizer, policy=None, **more):
    return Agent(policy or Hyperplanes([[0.2, -0.3]], [0.1]), olpomdp(0.0), optimizer, **more)


@pytest.mark.ci
@pytest.mark.representatives("sgd", "adam", "adam, by group", "optax.adam", "sgd after optax")
@pytest.mark.parametrize("name", [*OPTIMIZERS, "sgd after optax"])
def test_every_optimizer_ascends(name):
    # The unit is paid 1 for firing and −1 for silence: the probability of firing has to rise towards 1.
    agent = learner(**CLIPPED) if name == "sgd after optax" else learner(OPTIMIZERS[name])
    state, observation = agent.init(jax.random.key(0)), jnp.asarray([1.0, 0.5])

    def decide(state, uniforms):
        return decision(agent, state, observation, uniforms, lambda action: 2 * action[0] - 1).state, None

    uniforms = jax.random.uniform(jax.random.key(1), (300, 1))
    after, _ = jax.jit(lambda s: jax.lax.scan(decide, s, uniforms))(state)
    assert state.policy.prob(observation)[0] < 0.55
    assert after.policy.prob(observation)[0] > 0.9


def one_step(optimizer, policy):
    """What a gradient of ones makes of the parameters."""
    chain = learner(optimizer, policy).chain
    return updates_of(chain, jax.tree.map(jnp.ones_like, trainable(policy)), chain.init(policy), policy)[0]


def test_sgd_is_the_rate_times_the_gradient():
    step = one_step(SGD(0.25), PLANES)
    np.testing.assert_array_equal(step.weights, 0.25)
    np.testing.assert_array_equal(step.bias, 0.25)


def test_each_group_moves_at_its_own_rate():
    step = one_step(SGD({"weights": 0.25, "bias": 0.5}), PLANES)
    np.testing.assert_array_equal(step.weights, 0.25)
    np.testing.assert_array_equal(step.bias, 0.5)


def test_groups_are_found_by_their_field_in_nested_policies():
    policy = Factored(
        [Hyperplanes([[0.0]], [0.0]), Factored([LocalGaussians([[0.0]], [[0.0]]), Hyperplanes([[0.0]], [0.0])])]
    )
    step = one_step(SGD({"weights": 1.0, "bias": 2.0, "centre": 3.0, "log_width": 4.0}), policy)
    first, inner = step.pools
    assert (first.weights, first.bias) == (1.0, 2.0)
    assert (inner.pools[0].centre, inner.pools[0].log_width) == (3.0, 4.0)
    assert (inner.pools[1].weights, inner.pools[1].bias) == (1.0, 2.0)


def test_a_longer_name_is_that_of_a_field_in_one_pool():
    pools = [Hyperplanes([[0.0]], [0.0]) for _ in range(4)]
    policy = Factored([pools[0], Factored(pools[1:])])
    given = {"weights": 1.0, "pools.0.weights": 2.0, "pools": {1: {"pools.1.weights": 3.0}}, "bias": 4.0}
    kept = {"weights": 1.0, "pools.0.weights": 2.0, "pools.1.pools.1.weights": 3.0, "bias": 4.0}
    assert SGD(given).learning_rate == kept
    step = one_step(SGD(given), policy)
    first, inner = step.pools
    assert [float(pool.weights[0, 0]) for pool in (first, *inner.pools)] == [2.0, 2.0, 3.0, 1.0]
    assert [float(pool.bias[0]) for pool in (first, *inner.pools)] == [4.0] * 4
    with pytest.raises(ValueError, match=r"learning rates: 'pools\.3\.weights': did you mean 'pools\.0\.w"):
        SGD({"weights": 1.0, "bias": 1.0, "pools.3.weights": 1.0}).init(policy)
    with pytest.raises(ValueError, match=r"weights = 1\.0: must be left out: .* in pools\.0\.weights, pools\.1"):
        SGD({"weights": 1.0, "bias": 1.0, "pools.0.weights": 1.0, "pools.1.weights": 1.0}).init(Factored(pools[:2]))


def test_a_rate_may_be_an_array_over_units():
    step = one_step(SGD({"weights": np.array([[0.5], [0.25]]), "bias": [0.0, 1.0]}), PLANES)
    np.testing.assert_array_equal(step.weights, [[0.5] * 3, [0.25] * 3])
    np.testing.assert_array_equal(step.bias, [0.0, 1.0])


@pytest.mark.parametrize("rates", [0.25, {"weights": 0.25, "bias": 0.25}])
def test_the_rates_are_leaves(rates):
    step = one_step(jax.tree.map(lambda rate: 2 * rate, SGD(rates)), PLANES)
    np.testing.assert_array_equal(step.weights, 0.5)


def test_adam_is_optaxs_own():
    ours, theirs = one_step(Adam(0.01, b1=0.8, b2=0.99), PLANES), one_step(optax.adam(0.01, 0.8, 0.99), PLANES)
    np.testing.assert_allclose(ours.weights, theirs.weights, rtol=1e-6)  # float32


@pytest.mark.parametrize("make", [SGD, Adam])
def test_adam_and_sgd_move_at_the_rate_of_each_group(make):
    step = one_step(make({"weights": 0.25, "bias": 0.5}), PLANES)
    # Adam's first step is the rate times the gradient's sign, but for its ε of 1e-8
    np.testing.assert_allclose(step.weights, 0.25, rtol=1e-5)
    np.testing.assert_allclose(step.bias, 0.5, rtol=1e-5)


@pytest.mark.parametrize(
    ("rates", "names"),
    [
        ({"weights": 0.1}, "parameters without a learning rate: 'bias'"),
        ({"weight": 0.1, "bias": 0.1}, "in the learning rates: 'weight': did you mean 'weights'"),
        ({"weights": 0.1, "bias": 0.1, "weigths": 0.1}, "in the learning rates: 'weigths': did you mean 'weights'"),
        ({"weights": [0.1, 0.2], "bias": 0.1}, r"learning rate weights = \(2,\)"),
        ({"weights": 0.1, "bias": np.ones((2, 2))}, r"learning rate bias = \(2, 2\)"),
    ],
)
def test_rates_that_do_not_fit_the_parameters_are_refused(rates, names):
    with pytest.raises(ValueError, match=names):
        learner(SGD(rates), PLANES).init(jax.random.key(0))


@pytest.mark.parametrize("rate", [-1.0, float("nan"), float("inf"), {"weights": -1.0}, {"weights": [0.1, -0.1]}])
def test_impossible_rates_are_refused(rate):
    with pytest.raises(ValueError, match=r"learning_rate.* = .*: must be"):
        SGD(rate)
