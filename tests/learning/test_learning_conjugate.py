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
from motorgrad.policies import (
    Hyperplanes,
    MultilayerPerceptron,
    Policy,
    abilities,
    hyperplanes,
    softmax,
    split,
    trainable,
)

UNITS = Hyperplanes([[1.0, -0.5], [0.2, 0.3], [-0.4, 0.1]], [0.1, -0.4, 0.0])


@pytest.fixture(scope="module")
def network():
    return softmax(2, 3, network=MultilayerPerceptron(hidden=(5, 4), sparsity=0.0))(jax.random.key(1))


@eqx.filter_jit
def observed(metric, policy, seen, actions, diverged):
    """The states of a metric after each of some decisions."""

    def add(state, decision):
        y, a, dropped = decision
        state = metric.observe(state, policy, Transition(y, a, jnp.zeros(()), y, diverged=dropped))
        return state, state

    return jax.lax.scan(add, metric.init(policy), (seen, actions, diverged))[1]


def after(states, count):
    """The state after so many decisions."""
    return jax.tree.map(lambda leaf: np.asarray(leaf)[count - 1], states)


@eqx.filter_jit
def preconditioned(metric, state, policy, gradient):
    return metric.precondition(state, policy, gradient)


def decisions(policy: Policy, count: int, seed: int = 0):
    rng = np.random.default_rng(seed)
    seen = rng.normal(size=(count, policy.inputs)).astype(np.float32)
    uniforms = rng.random((count, policy.uniforms)).astype(np.float32)
    return seen, np.asarray(_sampled(policy, seen, uniforms))


@eqx.filter_jit
def _sampled(policy, seen, uniforms):
    return jax.vmap(policy.sample)(seen, uniforms)


def gradient_of(policy: Policy, seed: int = 2):
    leaves, structure = jax.tree.flatten(trainable(policy))
    numbers = np.random.default_rng(seed).normal(size=sum(leaf.size for leaf in leaves)).astype(np.float32)
    parts = np.split(numbers, np.cumsum([leaf.size for leaf in leaves])[:-1])
    return structure.unflatten(part.reshape(leaf.shape) for part, leaf in zip(parts, leaves, strict=True))


def flat(tree):
    return np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(tree)])


@eqx.filter_jit
def matrices(policy, seen, actions):
    """The Fisher matrix of each decision, whole."""
    learned, settings = split(policy)
    vector, shaped = ravel_pytree(learned)

    def coordinates(vector, y, a):
        return abilities.fisher_coordinates(eqx.combine(shaped(vector), settings), y, a).ravel()

    roots = jax.vmap(lambda y, a: jax.jacrev(coordinates)(vector, y, a))(seen, actions)
    return jnp.einsum("nki,nkj->nij", roots, roots)


def matrix(policy, seen, actions):
    """Their mean."""
    return np.asarray(matrices(policy, seen, actions), float).mean(axis=0)


def test_independent_units_have_the_direction_of_their_own_matrices():
    seen, actions = decisions(UNITS, 40)
    never = np.zeros(40, bool)
    gradient = gradient_of(UNITS)
    blocks = eqx.filter_jit(UNITS.fisher_sum)(seen, actions, np.ones(40, np.float32))
    blocks = tuple(np.asarray(m) / np.float32(40) for m in blocks)
    wanted = preconditioned(FisherMetric(damping=0.02), blocks, UNITS, gradient)
    metric = ConjugateGradient(memory=40, iterations=50, damping=0.02)
    state = after(observed(metric, UNITS, seen, actions, never), 40)
    found = preconditioned(metric, state, UNITS, gradient)
    for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True):
        np.testing.assert_allclose(one, other, rtol=2e-3, atol=1e-4)


@pytest.mark.ci
def test_a_network_has_the_direction_of_its_whole_matrix(network):
    seen, actions = decisions(network, 30)
    metric = ConjugateGradient(memory=30, iterations=200, damping=0.05)
    state = after(observed(metric, network, seen, actions, np.zeros(30, bool)), 30)
    gradient = gradient_of(network)
    vector = flat(gradient).astype(float)
    whole = matrix(network, seen, actions)
    wanted = np.linalg.solve(whole + 0.05 * np.eye(len(whole)), vector)
    found = flat(preconditioned(metric, state, network, gradient))
    np.testing.assert_allclose(found, wanted, rtol=5e-3, atol=5e-3 * np.abs(wanted).max())
    divergence = metric.divergence(state, network, gradient)
    np.testing.assert_allclose(divergence, 0.5 * vector @ whole @ vector, rtol=1e-4)


@pytest.mark.ci
def test_the_last_decisions_count_and_those_that_diverged_do_not():
    seen, actions = decisions(UNITS, 45)
    diverged = np.arange(45) % 5 == 1
    metric = ConjugateGradient(memory=8, damping=0.1, iterations=50)
    states = observed(metric, UNITS, seen, actions, diverged)
    each = np.asarray(matrices(UNITS, seen, actions), float)
    gradient = gradient_of(UNITS)
    for count in (3, 8, 19, 45):
        whole = each[np.flatnonzero(~diverged[:count])[-8:]].mean(axis=0)
        found = flat(preconditioned(metric, after(states, count), UNITS, gradient))
        wanted = np.linalg.solve(whole + 0.1 * np.eye(len(whole)), flat(gradient).astype(float))
        np.testing.assert_allclose(found, wanted, rtol=2e-3, atol=1e-4)


def test_before_any_decision_only_damping_counts():
    metric = ConjugateGradient(memory=8, damping=0.5)
    gradient = gradient_of(UNITS)
    found = preconditioned(metric, metric.init(UNITS), UNITS, gradient)
    np.testing.assert_allclose(flat(found), 2 * flat(gradient), rtol=1e-5)


@pytest.mark.ci
def test_a_step_has_the_divergence_of_the_limit_at_most(network):
    seen, actions = decisions(network, 30)
    metric = ConjugateGradient(memory=30)
    state = after(observed(metric, network, seen, actions, np.zeros(30, bool)), 30)
    for size in (1e-6, 1.0, 1e20):
        step = jax.tree.map(lambda x, size=size: size * x, gradient_of(network))
        short = metric.bounded(state, network, step, jnp.asarray(0.01))
        assert metric.divergence(state, network, short) <= 0.01 * (1 + 1e-5)
        assert size > 1e-6 or all(map(np.array_equal, jax.tree.leaves(short), jax.tree.leaves(step)))


@pytest.mark.ci
def test_a_network_learns_by_it_and_resumes_bit_for_bit(tmp_path):
    agent = {
        "policy": {"kind": "hyperplanes", "network": {"hidden": [8]}},
        "estimator": {"update_every": 50, "trace": {"decay": 0.9}},
        "metric": {"kind": "conjugate-gradient", "memory": 50, "kl": 0.02},
        "learning_rate": 1.0,
    }
    whole = mg.train("call-admission", agent, 600, 3, progress=False)
    mg.train("call-admission", agent, 300, 3, tmp_path / "run", window=3, progress=False)
    again = mg.train("call-admission", agent, 600, 3, tmp_path / "run", progress=False)
    for one, other in zip(jax.tree.leaves(whole.policies), jax.tree.leaves(again.policies), strict=True):
        np.testing.assert_array_equal(one, other)


def test_blocks_that_would_fill_the_memory_are_refused():
    large = hyperplanes(10, 2, network=MultilayerPerceptron(hidden=(64, 64)))
    with pytest.raises(ValueError, match="at most 4,096 parameters"):
        eqx.filter_eval_shape(lambda key: FisherMetric().init(large(key)), jax.random.key(0))
    assert jax.jit(lambda key: ConjugateGradient().init(large(key)).seen)(jax.random.key(0)) == 0


@pytest.mark.parametrize(("name", "value"), [("memory", 0), ("iterations", 0), ("damping", -1.0), ("kl", -0.1)])
def test_bad_numbers_are_refused(name, value):
    with pytest.raises(ValueError, match=name):
        dataclasses.replace(ConjugateGradient(), **{name: value})
