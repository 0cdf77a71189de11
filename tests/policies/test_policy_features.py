"""Features: what linear units and critics see beside their inputs."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import policy_examples
import pytest
from policy_examples import compiled, drawn_scores

import motorgrad as mg
from motorgrad.learning import Features
from motorgrad.policies import (
    Featured,
    FeatureMap,
    Hyperplanes,
    abilities,
    bounded_hyperplanes,
    describe,
    graded_hyperplanes,
    hyperplanes,
    initial,
    mixed,
    rebuild,
    softmax,
    trainable,
)
from motorgrad.schema import table

SEEN = np.array([0.5, -1.0, 2.0], np.float32)
RICH = FeatureMap(squares=True, products=True, nonlinear=7, shape="fourier", scale=0.7, seed=3)


@compiled
def expanded(features, observation):
    return features.expanded(observation)


def test_squares_and_products_of_all_pairs_stand_beside_the_inputs():
    found = expanded(FeatureMap(squares=True, products=True), SEEN)
    np.testing.assert_allclose(found, [0.5, -1, 2, 0.25, 1, 4, -0.5, 1, -2])
    assert RICH.size(3) == len(expanded(RICH, SEEN)) == 16
    np.testing.assert_array_equal(expanded(FeatureMap(), SEEN), SEEN)


@pytest.mark.parametrize("shape", ["tanh", "fourier", "radial", "grid"])
def test_nonlinear_features_are_those_of_their_formula_and_seed(shape):
    count, scale = 9, 0.7
    drawn = np.random.RandomState(5)
    w = drawn.standard_normal((count, 3)) if shape != "grid" else None
    offsets = 2 * np.pi * drawn.random_sample(count) if shape == "fourier" else None
    y, root = np.asarray(SEEN, float), np.sqrt(3)
    features = FeatureMap(nonlinear=count, shape=shape, scale=scale, seed=5)
    found = np.asarray(expanded(features, SEEN))[3:]
    if shape == "tanh":
        wanted = np.tanh(scale * (w @ y / root + drawn.standard_normal(count)))
    elif shape == "fourier":
        wanted = np.sqrt(2) * np.cos(scale * w @ y / root + offsets)
    else:
        centres = w if shape == "radial" else 2 * mg.policies._features.lattice(count, 3) - 1
        assert np.abs(centres).max() < (1 if shape == "grid" else 4)
        wanted = np.exp(-(scale**2) * ((y - centres) ** 2).sum(1) / 6)
    np.testing.assert_allclose(found, wanted, rtol=2e-5, atol=1e-6)
    other = expanded(FeatureMap(nonlinear=count, shape=shape, scale=scale, seed=6), SEEN)[3:]
    assert np.array_equal(found, other) == (shape == "grid")


def test_the_random_numbers_of_a_seed_never_change():
    """A stored policy of random features is worth nothing under others."""
    np.testing.assert_allclose(expanded(FeatureMap(nonlinear=2, seed=1), SEEN)[3:], FROZEN, rtol=1e-5)


FROZEN = [0.96086312, -0.999575]


def test_the_kernel_of_fourier_features_is_that_of_radial_ones():
    features, rng = FeatureMap(nonlinear=40_000, shape="fourier"), np.random.default_rng(0)
    one, other = rng.normal(size=(2, 3))
    found = np.mean(expanded(features, one)[3:] * expanded(features, other)[3:])
    assert found == pytest.approx(np.exp(-np.sum((one - other) ** 2) / 6), abs=0.02)


MAKE = {
    "hyperplanes": lambda **f: hyperplanes(3, 2, **f),
    "graded": lambda **f: graded_hyperplanes(3, 2, **f),
    "bounded": lambda **f: bounded_hyperplanes(3, 2, **f),
    "mixed": lambda **f: mixed(3, 3, **f),
    "softmax": lambda **f: softmax(3, 4, **f),
}


def moved(policy, seed=0):
    """A policy with small random numbers added to its parameters."""
    return policy_examples.moved(policy, np.random.default_rng(seed), 0.3)


@compiled
def told(policy, observation, uniforms):
    actions = jax.vmap(policy.sample, (None, 0))(observation, uniforms)
    return {
        "actions": actions,
        "prob": policy.prob(observation),
        "mode": policy.mode(observation),
        "entropy": policy.entropy(observation),
        "fisher": abilities.fisher(policy, observation, actions[0]),
    }


@pytest.mark.representatives("hyperplanes")
@pytest.mark.parametrize("name", MAKE)
def test_a_policy_of_features_is_the_pool_at_the_features(name):
    assert not isinstance(MAKE[name](), Featured)
    with jax.enable_x64(True):
        policy = moved(MAKE[name](features=RICH))
        assert isinstance(policy, Featured)
        assert (policy.inputs, policy.pool.inputs) == (3, 16)
        seen = np.asarray(SEEN, float)
        inner = expanded(RICH, seen)
        uniforms = np.random.default_rng(1).random((5, policy.uniforms))
        actions, scores, derivatives = map(np.asarray, drawn_scores(policy, seen, uniforms))
        np.testing.assert_allclose(scores, derivatives, rtol=1e-7, atol=1e-9)
        own, pools = told(policy, seen, uniforms), told(policy.pool, inner, uniforms)
        np.testing.assert_array_equal(own["actions"], actions)
        np.testing.assert_array_equal(own.pop("actions"), pools.pop("actions"))
        for one, other in zip(*map(jax.tree.leaves, (own, pools)), strict=True):
            np.testing.assert_allclose(one, other)
        assert policy.actions == policy.pool.actions
        assert abilities.has_temperature(policy) == abilities.has_temperature(policy.pool)


def test_the_features_are_no_parameters_and_survive_storing():
    policy = hyperplanes(3, 2, RICH)
    assert [leaf.shape for leaf in jax.tree.leaves(trainable(policy))] == [(2, 16), (2,)]
    shapes = rebuild(json.loads(json.dumps(describe(policy))))
    assert shapes.features == RICH
    assert jax.tree.structure(shapes) == jax.tree.structure(policy)


def test_settings_name_the_features_of_policies_and_critics(tmp_path):
    task = mg.make("hopper")
    agent = mg.agent_for(task, {"policy.features.nonlinear": 16, "policy.features.seed": 3})
    assert agent.policy.features == FeatureMap(nonlinear=16, seed=3)
    scaled = {"policy.features.nonlinear": 16, "policy.features.seed": 3, "policy.features.scale": 2.0}
    changed = mg.agent_for(task, scaled).policy
    assert changed.features == FeatureMap(nonlinear=16, scale=2.0, seed=3)
    again = mg.agent_for(task, policy=table(changed))
    assert again.policy == changed
    assert initial("hyperplanes", task, features=FeatureMap(nonlinear=16)).inputs == 3
    for bad, told in {
        "nonlineer": "did you mean 'nonlinear'",
        "nonlinear": "an integer from 0",
        "scale": "above 0",
    }.items():
        with pytest.raises(ValueError, match=told):
            mg.agent_for(task, policy={"kind": "hyperplanes", "features": {bad: -1}})


def test_critics_see_the_same_features():
    features = Features(squares=True, products=True, nonlinear=4, actions=True)
    found = features(SEEN, jnp.array([1.0, 0.0]))
    same = FeatureMap(squares=True, products=True, nonlinear=4).expanded(SEEN)
    np.testing.assert_array_equal(found, jnp.concatenate([same, jnp.array([1.0, 0.0, 1.0])]))


@pytest.mark.slow
@pytest.mark.ci
def test_a_run_with_features_is_stored_and_continues(tmp_path):
    from motorgrad.cli import main

    options = ["--agent.policy.features.nonlinear", "8", "--agent.policy.features.shape", "radial"]
    assert main(["train", "hopper", *options, "--steps", "64", "--out", str(tmp_path / "run"), "--seeds", "2"]) == 0
    run = mg.load(tmp_path / "run")
    assert run.policies.features == FeatureMap(nonlinear=8, shape="radial")
    assert mg.resume(tmp_path / "run", 128, progress=False).decision == 128


@pytest.mark.parametrize(
    ("build", "names"),
    [
        (lambda: FeatureMap(shape="tan"), "unknown shape 'tan': did you mean 'tanh'"),
        (lambda: FeatureMap(scale=0.0), "scale = 0.0: must be a finite number above 0"),
        (lambda: FeatureMap(nonlinear=-1), "nonlinear = -1: must be"),
        (lambda: hyperplanes(3, 2, 64), "features = 64: must be a FeatureMap"),
        (lambda: Featured(Hyperplanes([[1.0]], [0.0]), RICH, 3), "pool.inputs = 1: must be 16, the number of features"),
    ],
)
def test_what_is_impossible_is_refused_by_name(build, names):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        build()
    assert names in str(error.value)
