"""The natural gradient by conjugate gradients, against the matrices of `FisherMetric` and explicit ones."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree

import motorgrad as mg
from motorgrad.learning import ConjugateGradient, FisherMetric, Transition
from motorgrad.policies import Hyperplanes, MultilayerPerceptron, Policy, hyperplanes, softmax, split, trainable

UNITS = Hyperplanes([[1.0, -0.5], [0.2, 0.3], [-0.4, 0.1]], [0.1, -0.4, 0.0])
NETWORK = softmax(2, 3, network=MultilayerPerceptron(hidden=(5, 4), sparsity=0.0))(jax.random.key(1))


@eqx.filter_jit
def observed(metric, policy, seen, actions, diverged):
    """The state of a metric after some decisions."""

    def add(state, decision):
        y, a, dropped = decision
        return metric.observe(state, policy, Transition(y, a, jnp.zeros(()), y, False, dropped)), None

    return jax.lax.scan(add, metric.init(policy), (seen, actions, diverged))[0]


@eqx.filter_jit
def preconditioned(metric, state, policy, gradient):
    return metric.precondition(state, policy, gradient)


def decisions(policy: Policy, count: int, seed: int = 0):
    rng = np.random.default_rng(seed)
    seen = jnp.asarray(rng.normal(size=(count, policy.inputs)), jnp.float32)
    uniforms = jnp.asarray(rng.random((count, policy.uniforms)), jnp.float32)
    return seen, jax.vmap(policy.sample)(seen, uniforms)


def gradient_of(policy: Policy, seed: int = 2):
    flat, shaped = ravel_pytree(trainable(policy))
    return shaped(jnp.asarray(np.random.default_rng(seed).normal(size=flat.size), jnp.float32))


@eqx.filter_jit
def matrix(policy, seen, actions):
    """The mean Fisher matrix, whole."""
    learned, settings = split(policy)
    flat, shaped = ravel_pytree(learned)

    def coordinates(vector):
        present = eqx.combine(shaped(vector), settings)
        return jax.vmap(present.fisher_coordinates)(seen, actions).ravel()

    root = jax.jacrev(coordinates)(flat)
    return root.T @ root / len(seen)


def test_independent_units_have_the_direction_of_their_own_matrices():
    seen, actions = decisions(UNITS, 40)
    never = jnp.zeros(40, bool)
    gradient = gradient_of(UNITS)
    blocks = tuple(m / 40 for m in UNITS.fisher_sum(seen, actions, jnp.ones(40)))
    wanted = FisherMetric(damping=0.02).precondition(blocks, UNITS, gradient)
    metric = ConjugateGradient(memory=40, iterations=50, damping=0.02)
    found = preconditioned(metric, observed(metric, UNITS, seen, actions, never), UNITS, gradient)
    for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True):
        np.testing.assert_allclose(one, other, rtol=2e-3, atol=1e-4)


@pytest.mark.ci
def test_a_network_has_the_direction_of_its_whole_matrix():
    seen, actions = decisions(NETWORK, 30)
    metric = ConjugateGradient(memory=30, iterations=200, damping=0.05)
    state = observed(metric, NETWORK, seen, actions, jnp.zeros(30, bool))
    gradient = gradient_of(NETWORK)
    flat = np.asarray(ravel_pytree(gradient)[0], float)
    whole = np.asarray(matrix(NETWORK, seen, actions), float)
    wanted = np.linalg.solve(whole + 0.05 * np.eye(len(whole)), flat)
    found = ravel_pytree(preconditioned(metric, state, NETWORK, gradient))[0]
    np.testing.assert_allclose(found, wanted, rtol=5e-3, atol=5e-3 * np.abs(wanted).max())
    divergence = metric.divergence(state, NETWORK, gradient)
    np.testing.assert_allclose(divergence, 0.5 * flat @ whole @ flat, rtol=1e-4)


@pytest.mark.parametrize("count", [3, 8, 19, 45])
def test_the_last_decisions_count_and_those_that_diverged_do_not(count):
    seen, actions = decisions(UNITS, count)
    diverged = jnp.arange(count) % 5 == 1
    metric = ConjugateGradient(memory=8, damping=0.1, iterations=50)
    state = observed(metric, UNITS, seen, actions, diverged)
    kept = np.flatnonzero(~np.asarray(diverged))[-8:]
    whole = np.asarray(matrix(UNITS, seen[kept], actions[kept]), float)
    gradient = gradient_of(UNITS)
    flat = np.asarray(ravel_pytree(gradient)[0], float)
    found = ravel_pytree(preconditioned(metric, state, UNITS, gradient))[0]
    np.testing.assert_allclose(found, np.linalg.solve(whole + 0.1 * np.eye(len(whole)), flat), rtol=2e-3, atol=1e-4)


def test_before_any_decision_only_damping_counts():
    metric = ConjugateGradient(memory=8, damping=0.5)
    gradient = gradient_of(UNITS)
    found = preconditioned(metric, metric.init(UNITS), UNITS, gradient)
    np.testing.assert_allclose(ravel_pytree(found)[0], 2 * ravel_pytree(gradient)[0], rtol=1e-5)


@pytest.mark.ci
def test_a_step_has_the_divergence_of_the_limit_at_most():
    seen, actions = decisions(NETWORK, 30)
    metric = ConjugateGradient(memory=30)
    state = observed(metric, NETWORK, seen, actions, jnp.zeros(30, bool))
    for size in (1e-6, 1.0, 1e20):
        step = jax.tree.map(lambda x, size=size: size * x, gradient_of(NETWORK))
        short = metric.bounded(state, NETWORK, step, jnp.asarray(0.01))
        assert metric.divergence(state, NETWORK, short) <= 0.01 * (1 + 1e-5)
        assert size > 1e-6 or all(map(np.array_equal, jax.tree.leaves(short), jax.tree.leaves(step)))


@pytest.mark.ci
def test_a_network_learns_by_it_and_resumes_bit_for_bit(tmp_path):
    agent = {
        "policy": {"kind": "hyperplanes", "network": {"hidden": [8]}},
        "estimator": {"improve": 50, "trace": {"decay": 0.9}},
        "metric": {"kind": "conjugate-gradient", "memory": 50, "kl": 0.02},
        "learning_rate": 1.0,
    }
    whole = mg.train("call-admission", agent, 600, 3, progress=False)
    mg.train("call-admission", agent, 300, 3, tmp_path / "run", window=3, progress=False)
    again = mg.train("call-admission", agent, 600, 3, tmp_path / "run", progress=False)
    for one, other in zip(jax.tree.leaves(whole.policies), jax.tree.leaves(again.policies), strict=True):
        np.testing.assert_array_equal(one, other)


def test_blocks_that_would_fill_the_memory_are_refused():
    large = hyperplanes(10, 2, network=MultilayerPerceptron(hidden=(64, 64)))(jax.random.key(0))
    with pytest.raises(ValueError, match="at most 4,096 parameters"):
        FisherMetric().init(large)
    assert ConjugateGradient().init(large).seen == 0


@pytest.mark.parametrize(("name", "value"), [("memory", 0), ("iterations", 0), ("damping", -1.0), ("kl", -0.1)])
def test_bad_numbers_are_refused(name, value):
    with pytest.raises(ValueError, match=name):
        dataclasses.replace(ConjugateGradient(), **{name: value})
