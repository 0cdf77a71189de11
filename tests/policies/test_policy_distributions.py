"""Probabilities, samples, modes and entropies of every policy, against sums over all its actions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from policy_examples import (
    EXAMPLES,
    EXTREME_REPRESENTATIVES,
    EXTREMES,
    REPRESENTATIVES,
    Compiled,
    call,
    hides,
    observation_of,
    over_actions,
    policy_of,
    samples,
)
from scipy import stats

from motorgrad.policies import Masked

seeds = st.integers(0, 2**31)
few = settings(max_examples=25, deadline=None, derandomize=True)


INDEPENDENT = [name for name in EXAMPLES if getattr(policy_of(name), "independent", True) and not hides(name)]


def surprise(log_p):
    """The mean of −log p; what is impossible has no part in it."""
    log_p = np.asarray(log_p)
    possible = np.isfinite(log_p)
    return -np.sum(np.exp(log_p[possible]) * log_p[possible])


def drawn(name, seed, look):
    policy = policy_of(name, seed)
    observation = observation_of(policy, look)
    return policy, observation, np.asarray(over_actions(policy, "log_prob", observation))


@pytest.mark.representatives(*REPRESENTATIVES)
@pytest.mark.parametrize("name", EXAMPLES)
@few
@given(seed=seeds, look=seeds)
def test_probabilities_of_all_actions_sum_to_one(name, seed, look):
    with jax.enable_x64(True):
        _, _, log_p = drawn(name, seed, look)
    assert np.exp(log_p).sum() == pytest.approx(1, abs=1e-13)  # at most 32 terms of rounding 1e-16


@pytest.mark.representatives(*EXTREME_REPRESENTATIVES)
@pytest.mark.parametrize("place", EXTREMES)
def test_probabilities_of_all_actions_sum_to_one_at_extremes(place):
    with jax.enable_x64(True):
        policy, observation = EXTREMES[place]()
        total = np.exp(np.asarray(over_actions(policy, "log_prob", jnp.asarray(observation)))).sum()
    assert total == pytest.approx(1, abs=1e-13)


@pytest.mark.representatives(*REPRESENTATIVES)
@pytest.mark.parametrize("name", EXAMPLES)
@few
@given(seed=seeds, look=seeds)
def test_prob_is_the_marginal_of_the_log_probability(name, seed, look):
    with jax.enable_x64(True):
        policy, observation, log_p = drawn(name, seed, look)
        actions, prob = np.asarray(jax.vmap(policy.emit)(policy.enumerate())), Compiled(policy).prob(observation)
    chance = np.exp(log_p)
    marginal = np.bincount(actions, chance) if actions.ndim == 1 else chance @ actions
    np.testing.assert_allclose(prob, marginal, atol=1e-13)


@pytest.mark.representatives(*REPRESENTATIVES)
@pytest.mark.parametrize("name", EXAMPLES)
@few
@given(seed=seeds, look=seeds)
def test_entropy_is_the_expected_surprise(name, seed, look):
    with jax.enable_x64(True):
        policy, observation, log_p = drawn(name, seed, look)
        entropy = call(policy, "entropy", observation)
    assert entropy == pytest.approx(surprise(log_p), abs=1e-12)


@pytest.mark.representatives(*EXTREME_REPRESENTATIVES)
@pytest.mark.parametrize("place", EXTREMES)
def test_entropy_at_extremes_is_finite_and_that_of_the_sum_in_either_precision(place):
    policy, observation = EXTREMES[place]()
    single = call(policy, "entropy", jnp.asarray(observation))
    with jax.enable_x64(True):
        policy, observation = EXTREMES[place]()
        log_p = np.asarray(over_actions(policy, "log_prob", jnp.asarray(observation)))
        double = call(policy, "entropy", jnp.asarray(observation))
    exact = surprise(log_p)
    assert double == pytest.approx(exact, abs=1e-11)
    # φ − φ σ(φ) at φ = 700 in single precision cancels to an ulp of 700, 6e-5
    assert single == pytest.approx(exact, abs=2e-4)


@pytest.mark.representatives(*[name for name in REPRESENTATIVES if not hides(name)])
@pytest.mark.parametrize("name", [name for name in EXAMPLES if not hides(name)])
@few
@given(seed=seeds, look=seeds)
def test_mode_is_the_most_probable_action(name, seed, look):
    with jax.enable_x64(True):
        policy, observation, log_p = drawn(name, seed, look)
        at_mode = call(policy, "log_prob", observation, call(policy, "mode", observation))
    assert at_mode == pytest.approx(log_p.max(), abs=1e-12)


@pytest.mark.representatives(*REPRESENTATIVES)
@pytest.mark.parametrize("name", EXAMPLES)
def test_enumerate_lists_every_action_once_in_the_type_of_samples(name):
    policy = policy_of(name)
    ask = Compiled(policy)
    actions = ask.enumerate()
    sample = ask.sample(np.zeros(policy.inputs), np.full(policy.uniforms, 0.5))
    assert len(np.unique(actions, axis=0)) == len(actions)
    special = {"gated": 15, "gated-nested": 7, "factored-gated": 10}  # the possible ones
    special |= {"layered": 4 * 3 * 2 * 4, "layered-skip": 4 * 3, "controller": 3 * 4, "controller-softmax": 2 * 3}
    binary = special.get(name, 2**policy.outputs)
    assert len(actions) == (policy.outputs if actions.ndim == 1 else binary)
    assert (actions[0].shape, actions.dtype) == (sample.shape, sample.dtype)


@pytest.mark.representatives(*REPRESENTATIVES)
@pytest.mark.parametrize("name", EXAMPLES)
def test_as_many_uniforms_as_declared_decide_the_action_alone(name):
    policy = policy_of(name)
    observation = observation_of(policy)
    uniforms = np.random.default_rng(0).random((64, policy.uniforms))
    first, second = (samples(policy, observation, uniforms) for _ in range(2))
    np.testing.assert_array_equal(first, second)
    there = np.asarray(policy.active) if isinstance(policy, Masked) else np.ones(policy.uniforms, bool)
    for number in np.flatnonzero(there):  # and each of the numbers matters
        column = np.arange(policy.uniforms) == number
        low, high = (samples(policy, observation, np.where(column, u, uniforms)) for u in (0.0, 1.0))
        assert not np.array_equal(low, high)


@pytest.mark.representatives("local-gaussians-p-max", "factored-nested", "mirrored-local", "softmax-5")
@pytest.mark.parametrize("name", INDEPENDENT)
def test_the_share_of_uniforms_that_choose_an_action_is_its_probability(name):
    policy, points = policy_of(name), 4096
    observation = observation_of(policy)
    grid = (np.arange(points) + 0.5) / points
    actions = np.asarray(samples(policy, observation, np.repeat(grid[:, None], policy.uniforms, axis=1)))
    share = np.bincount(actions, minlength=policy.outputs) / points if actions.ndim == 1 else actions.mean(0)
    # An interval holds its length's share of an even grid to within one point.
    np.testing.assert_allclose(share, call(policy, "prob", observation), atol=1.01 / points)


def check_frequencies(name, draws):
    policy = policy_of(name)
    observation = observation_of(policy)
    actions = Compiled(policy).enumerate()
    actions = actions.reshape(len(actions), -1)
    uniforms = np.random.default_rng(7).random((draws, policy.uniforms), np.float32)
    # In parts: jaxlib 0.10.2 compiles a softmax over three numbers wrongly for 20,000 of them at once on a CPU.
    taken = [samples(policy, observation, some) for some in np.split(uniforms, range(4_000, draws, 4_000))]
    taken = np.concatenate(taken).reshape(draws, -1)
    base = max(2, int(actions.max()) + 1)
    weights = base ** np.arange(actions.shape[1])[::-1]
    count = np.bincount((taken @ weights).astype(int), minlength=base ** actions.shape[1])
    with jax.enable_x64(True):
        expected = draws * np.exp(np.asarray(over_actions(policy_of(name), "log_prob", np.asarray(observation, float))))
    codes, cells = (actions @ weights).astype(int), np.zeros(len(count))
    cells[codes] = expected
    expected = cells
    assert count[np.delete(np.arange(len(count)), codes)].sum() == 0  # what is not listed is impossible
    common = expected >= 5  # the chi-square approximation wants five in a cell: the others share one
    count, expected = (np.append(x[common], x[~common].sum()) for x in (count, expected))
    kept = expected > 0
    statistic = np.sum((count[kept] - expected[kept]) ** 2 / np.maximum(expected[kept], 1))
    assert count[~kept].sum() == 0
    # The keys are fixed; were they not, a right sampler would fail here once in a hundred thousand.
    assert stats.chi2.sf(statistic, max(kept.sum() - 1, 1)) > 1e-5


@pytest.mark.representatives(*REPRESENTATIVES)
@pytest.mark.parametrize("name", EXAMPLES)
def test_actions_are_as_frequent_as_their_joint_probability(name):
    check_frequencies(name, 20_000)


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_actions_are_as_frequent_as_their_joint_probability_over_many_draws(name):
    check_frequencies(name, 2_000_000)


def everything(policy, observation, action, uniforms):
    """All that a policy can be asked on one observation."""
    return {
        "prob": policy.prob(observation),
        "sample": policy.sample(observation, uniforms),
        "mode": policy.mode(observation),
        "log_prob": policy.log_prob(observation, action),
        "score": policy.score(observation, action),
        "entropy": policy.entropy(observation),
    }


@pytest.mark.representatives(*REPRESENTATIVES)
@pytest.mark.parametrize("name", EXAMPLES)
def test_mapping_over_seeds_gives_the_same_as_one_at_a_time(name):
    policies = [policy_of(name, seed) for seed in range(3)]
    looks = [observation_of(policy, seed) for seed, policy in enumerate(policies)]
    actions = Compiled(policies[0]).enumerate()[[0, 1, -1]]
    uniforms = np.random.default_rng(3).random((3, policies[0].uniforms), np.float32)
    stacked = jax.tree.map(lambda *leaves: np.stack(leaves), *policies)
    together = jax.jit(jax.vmap(everything))(stacked, np.stack(looks), actions, uniforms)
    together = jax.tree.map(np.asarray, together)
    single = jax.jit(everything)
    for seed in range(3):
        alone = single(policies[seed], looks[seed], actions[seed], uniforms[seed])
        for a, b in zip(jax.tree.leaves(alone), jax.tree.leaves(together), strict=True):
            # a compiled loop may round differently by a few ulp of single precision
            np.testing.assert_allclose(b[seed], a, rtol=1e-5, atol=1e-6)
