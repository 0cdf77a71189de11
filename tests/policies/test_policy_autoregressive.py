"""Units whose noise lasts: the process that they follow, their score, and what they remember."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats
from policy_examples import Compiled, compiled

import motorgrad as mg
from motorgrad.policies import (
    Autoregressive,
    BoundedHyperplanes,
    GradedHyperplanes,
    GradedMotoneurons,
    MultilayerPerceptron,
    Network,
    abilities,
    bounded_hyperplanes,
    graded_hyperplanes,
    initial,
    split,
    trainable,
)

RHO = 0.8


def _units(kind: type = GradedHyperplanes, **more: object) -> GradedHyperplanes:
    return kind(weights=[[0.5, -1.0], [0.3, 0.2]], bias=[0.2, -0.4], log_deviation=[-1.0, -0.5], floor=0.02, **more)


def _behind_layers() -> Network:
    layers = compiled(MultilayerPerceptron(hidden=(4, 2)).build)(3, jax.random.key(0))
    return Network(_units(BoundedHyperplanes), layers, 3)


MAKE = {
    "graded": _units,
    "squashed": lambda: _units(BoundedHyperplanes, low=0.0, high=2.0),
    "clipped": lambda: _units(BoundedHyperplanes, density="clipped"),
    "network": _behind_layers,
}


def test_while_the_location_stays_the_process_has_its_mean_deviation_and_correlation():
    policy, shown = Autoregressive(_units(), RHO), jnp.array([0.3, 0.1])

    def step(memory: jax.Array, uniforms: jax.Array) -> tuple[jax.Array, jax.Array]:
        seen = abilities.observation_with_memory(policy, memory, shown)
        action = policy.sample(seen, uniforms)
        return abilities.remember(policy, seen, action), action

    uniforms = np.random.default_rng(1).random((40_000, 2), np.float32)
    x = np.asarray(jax.lax.scan(step, abilities.initial_memory(policy), uniforms)[1])[100:]
    np.testing.assert_allclose(x.mean(axis=0), policy.policy.mean(shown), atol=0.03)
    np.testing.assert_allclose(x.std(axis=0), policy.policy.deviation, rtol=0.05)
    for lag in (1, 2, 5):
        found = [np.corrcoef(unit[:-lag], unit[lag:])[0, 1] for unit in x.T]
        np.testing.assert_allclose(found, RHO**lag, atol=0.04)


def test_the_density_is_the_normal_one_around_the_mix_of_location_and_last_action():
    units, last, shown = _units(), np.array([0.7, -0.2]), np.array([0.3, 0.1])
    policy = Autoregressive(units, RHO)
    seen, ask = np.concatenate([shown, last]).astype(np.float32), Compiled(policy)
    action = ask.sample(seen, np.array([0.2, 0.9], np.float32))
    mean = (1 - RHO) * Compiled(units).mean(shown) + RHO * last
    normal = scipy.stats.norm(mean, np.sqrt(1 - RHO**2) * np.asarray(units.deviation))
    np.testing.assert_allclose(action, normal.ppf([0.2, 0.9]), rtol=1e-5)
    np.testing.assert_allclose(ask.log_prob(seen, action), normal.logpdf(action).sum(), rtol=1e-5)
    np.testing.assert_allclose(ask.mode(seen), mean, rtol=1e-5)


@pytest.mark.ci
@pytest.mark.parametrize("name", MAKE)
def test_score_and_fisher_matrix_are_the_derivatives(name):
    with jax.enable_x64(True):
        policy = Autoregressive(MAKE[name](), RHO)
        rng = np.random.default_rng(3)
        seen = jnp.asarray(rng.normal(size=policy.inputs))
        action = policy.sample(seen, jnp.asarray(rng.uniform(size=2)))
        score, slope = policy.score(seen, action), jax.grad(lambda own: own.log_prob(seen, action))(policy)
        jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-9), score, trainable(slope))
        if name != "network":  # whose layers' matrix is a sample
            learned, settings = split(policy)
            J = jax.jacobian(lambda own: abilities.fisher_coordinates(eqx.combine(own, settings), seen, action))(
                learned
            )
            rows = [abilities.blocks(policy, jax.tree.map(lambda leaf, i=i: leaf[i], J))[0] for i in range(4)]
            expected = sum(row[:, :, None] * row[:, None, :] for row in rows)
            np.testing.assert_allclose(abilities.fisher(policy, seen, action)[0], expected, rtol=1e-9, atol=1e-12)
        blocks = abilities.blocks(policy, score)
        jax.tree.map(np.testing.assert_array_equal, abilities.from_blocks(policy, blocks), score)


@compiled
def in_the_end(policy, shown):
    """The most probable action after many, and that of the units alone, which a low-pass filter reaches in the end."""

    def step(memory, _):
        seen = abilities.observation_with_memory(policy, memory, shown)
        action = policy.mode(seen)
        return abilities.remember(policy, seen, action), action

    return jax.lax.scan(step, abilities.initial_memory(policy), length=61)[1][-1], policy.policy.mode(shown)


@pytest.mark.representatives("graded", "squashed", "clipped")
@pytest.mark.parametrize("name", MAKE)
def test_the_memory_is_the_last_action_before_its_bounds(name):
    policy = Autoregressive(MAKE[name](), RHO)
    size = policy.observation_size
    seen = abilities.observation_with_memory(policy, abilities.initial_memory(policy), np.full(size, 0.1, np.float32))
    assert seen.shape == (policy.inputs,) == (size + 2,)
    reached, still = in_the_end(policy, np.full(size, 0.1, np.float32))
    np.testing.assert_allclose(reached, still, atol=1e-4)


def test_without_a_filter_the_mean_is_that_of_the_units_and_the_noise_lasts():
    policy = Autoregressive(_units(), RHO, filtered=False)

    def step(memory: jax.Array, given: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
        shown, uniforms = given
        seen = abilities.observation_with_memory(policy, memory, shown)
        action = policy.sample(seen, uniforms)
        return abilities.remember(policy, seen, action), action - policy.policy.mean(shown)

    shown, uniforms = np.random.default_rng(1).random((2, 40_000, 2), np.float32)
    noise = np.asarray(jax.lax.scan(step, abilities.initial_memory(policy), (shown, uniforms))[1])[100:]
    np.testing.assert_allclose(noise.mean(axis=0), 0, atol=0.03)
    np.testing.assert_allclose(noise.std(axis=0), policy.policy.deviation, rtol=0.05)
    for lag in (1, 5):
        found = [np.corrcoef(unit[:-lag], unit[lag:])[0, 1] for unit in noise.T]
        np.testing.assert_allclose(found, RHO**lag, atol=0.04)


@pytest.mark.representatives("graded", "squashed")
@pytest.mark.parametrize("name", MAKE)
def test_without_a_filter_the_most_probable_action_is_that_of_the_units(name):
    policy = Autoregressive(MAKE[name](), RHO, filtered=False)
    memory, look = abilities.initial_memory(policy), 0.1 * jnp.ones(policy.observation_size)
    for place in (look, -2 * look, 3 * look):
        seen = abilities.observation_with_memory(policy, memory, place)
        np.testing.assert_allclose(policy.mode(seen), policy.policy.mode(place), rtol=1e-6)
        memory = abilities.remember(policy, seen, policy.mode(seen))
        np.testing.assert_array_equal(memory, 0)


def test_learners_by_scores_refuse_noise_beside_a_mean_that_is_not_filtered():
    task = mg.make("linear-recruitment", units=2)
    policy = {"kind": "bounded-hyperplanes", "autocorrelation": RHO, "filtered": False}
    with pytest.raises(ValueError, match=r"policy = 'Autoregressive': must be one with an exact score"):
        mg.train(task, mg.agent_for(task, policy=policy, learning_rate=1e-3), steps=10, progress=False)


def test_an_autocorrelation_of_zero_is_the_policy_alone():
    assert type(graded_hyperplanes(2, 2)) is GradedHyperplanes
    assert type(bounded_hyperplanes(2, 2, autocorrelation=0.5)) is Autoregressive
    layers = initial("bounded-hyperplanes", 3, units=2, network=MultilayerPerceptron(hidden=(4,)), autocorrelation=0.5)
    assert type(layers(jax.random.key(0)).policy) is Network


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: bounded_hyperplanes(2, 1, autocorrelation=1.0), r"autocorrelation = 1.0: must be in \[0, 1\)"),
        (lambda: graded_hyperplanes(2, 1, autocorrelation=-0.1), r"autocorrelation = -0.1: must be in \[0, 1\)"),
        (
            lambda: bounded_hyperplanes(2, 1, density="beta", autocorrelation=0.5),
            "density = 'beta': must be 'squashed' or 'clipped' with an autocorrelation",
        ),
        (lambda: Autoregressive(_units(BoundedHyperplanes, density="truncated"), 0.5), "policy = 'BoundedHyperplanes'"),
        (lambda: Autoregressive(GradedMotoneurons([0.0], [1.0], [0.0]), 0.5), "policy = 'GradedMotoneurons'"),
    ],
)
def test_what_cannot_be_is_refused_by_name(make, message):
    with pytest.raises(ValueError, match=message):
        make()
