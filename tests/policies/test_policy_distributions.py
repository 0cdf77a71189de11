"""Probabilities, samples, modes and entropies of every policy, against sums over all its actions."""

import jax
import numpy as np
import pytest
from policy_examples import (
    CASES,
    DEPENDENT,
    EXAMPLES,
    EXTREME_REPRESENTATIVES,
    EXTREMES,
    HIDING,
    REPRESENTATIVES,
    Compiled,
    answers,
    answers_at,
    observation_in,
    observation_of,
    policy_of,
    samples,
)
from scipy import stats

from motorgrad.policies import Masked, abilities

DRAWS = 4096  # at a time, so that all tests share a program
MIDDLE = CASES // 2


def surprise(log_p):
    """The mean of −log p; what is impossible has no part in it."""
    log_p = np.asarray(log_p)
    possible = np.isfinite(log_p)
    return -np.sum(np.exp(log_p[possible]) * log_p[possible])


def test_the_examples_that_hide_what_they_draw_or_depend_on_each_other_are_known():
    policies = {name: policy_of(name) for name in EXAMPLES}
    assert {name for name, policy in policies.items() if abilities.has_hidden_units(policy)} == HIDING
    assert {name for name, policy in policies.items() if not getattr(policy, "independent", True)} == DEPENDENT


@pytest.mark.representatives(*REPRESENTATIVES)
@pytest.mark.parametrize("name", EXAMPLES)
def test_probabilities_of_all_actions_sum_to_one(name):
    for answer in answers(name):
        # at most 32 terms of rounding 1e-16
        assert np.exp(answer["log_prob"]).sum() == pytest.approx(1, abs=1e-13)


@pytest.mark.representatives(*EXTREME_REPRESENTATIVES)
@pytest.mark.parametrize("place", EXTREMES)
def test_probabilities_of_all_actions_sum_to_one_at_extremes(place):
    assert np.exp(answers_at(place, True)["log_prob"]).sum() == pytest.approx(1, abs=1e-13)


@pytest.mark.representatives(*REPRESENTATIVES)
@pytest.mark.parametrize("name", EXAMPLES)
def test_prob_is_the_marginal_of_the_log_probability(name):
    for answer in answers(name):
        actions, chance = answer["emitted"], np.exp(answer["log_prob"])
        marginal = np.bincount(actions, chance) if actions.ndim == 1 else chance @ actions
        np.testing.assert_allclose(answer["prob"], marginal, atol=1e-13)


@pytest.mark.representatives(*REPRESENTATIVES)
@pytest.mark.parametrize("name", EXAMPLES)
def test_entropy_is_the_expected_surprise(name):
    for answer in answers(name):
        assert answer["entropy"] == pytest.approx(surprise(answer["log_prob"]), abs=1e-12)


@pytest.mark.representatives(*EXTREME_REPRESENTATIVES)
@pytest.mark.parametrize("place", EXTREMES)
def test_entropy_at_extremes_is_finite_and_that_of_the_sum_in_either_precision(place):
    single, double = (answers_at(place, precise) for precise in (False, True))
    exact = surprise(double["log_prob"])
    assert double["entropy"] == pytest.approx(exact, abs=1e-11)
    # φ − φ σ(φ) at φ = 700 in single precision cancels to an ulp of 700, 6e-5
    assert single["entropy"] == pytest.approx(exact, abs=2e-4)


@pytest.mark.representatives(*[name for name in REPRESENTATIVES if name not in HIDING])
@pytest.mark.parametrize("name", [name for name in EXAMPLES if name not in HIDING])
def test_mode_is_the_most_probable_action(name):
    for answer in answers(name):
        assert answer["log_prob at the mode"] == pytest.approx(answer["log_prob"].max(), abs=1e-12)


@pytest.mark.representatives(*REPRESENTATIVES)
@pytest.mark.parametrize("name", EXAMPLES)
def test_enumerate_lists_every_action_once_in_the_type_of_samples(name):
    policy = policy_of(name)
    actions = Compiled(policy).enumerate()
    sample = jax.eval_shape(policy.sample, np.zeros(policy.inputs), np.full(policy.uniforms, 0.5))
    assert len(np.unique(actions, axis=0)) == len(actions)
    special = {"gated": 15, "gated-nested": 7, "factored-gated": 10, "tied": 4}  # the possible ones
    special |= {"layered": 4 * 3 * 2 * 4, "layered-skip": 4 * 3, "controller": 3 * 4, "controller-softmax": 2 * 3}
    binary = special.get(name, 2**policy.outputs)
    assert len(actions) == (policy.outputs if actions.ndim == 1 else binary)
    assert (actions[0].shape, actions.dtype) == (sample.shape, sample.dtype)


@pytest.mark.representatives(*REPRESENTATIVES)
@pytest.mark.parametrize("name", EXAMPLES)
def test_as_many_uniforms_as_declared_decide_the_action_alone(name):
    policy = policy_of(name, MIDDLE)
    observation = observation_in(MIDDLE, policy)
    uniforms = np.random.default_rng(0).random((DRAWS, policy.uniforms))
    first, second = (samples(policy, observation, uniforms) for _ in range(2))
    np.testing.assert_array_equal(first, second)
    there = np.asarray(policy.active) if isinstance(policy, Masked) else np.ones(policy.uniforms, bool)
    for number in np.flatnonzero(there):  # and each of the numbers matters
        column = np.arange(policy.uniforms) == number
        low, high = (samples(policy, observation, np.where(column, u, uniforms)) for u in (0.0, 1.0))
        assert not np.array_equal(low, high)


@pytest.mark.representatives("local-gaussians-p-max", "softmax-5")
@pytest.mark.parametrize("name", [name for name in EXAMPLES if name not in HIDING | DEPENDENT])
def test_the_share_of_uniforms_that_choose_an_action_is_its_probability(name):
    policy = policy_of(name, MIDDLE)
    grid = (np.arange(DRAWS) + 0.5) / DRAWS
    uniforms = np.repeat(grid[:, None], policy.uniforms, axis=1)
    actions = np.asarray(samples(policy, observation_in(MIDDLE, policy), uniforms))
    share = np.bincount(actions, minlength=policy.outputs) / DRAWS if actions.ndim == 1 else actions.mean(0)
    # An interval holds its length's share of an even grid to within one point.
    np.testing.assert_allclose(share, answers(name)[MIDDLE]["prob"], atol=1.01 / DRAWS)


def check_frequencies(name, parts):
    policy, draws = policy_of(name, MIDDLE), parts * DRAWS
    observation, answer = observation_in(MIDDLE, policy), answers(name)[MIDDLE]
    actions = answer["action"].reshape(len(answer["action"]), -1)
    uniforms = np.random.default_rng(7).random((parts, DRAWS, policy.uniforms), np.float32)
    # In parts: jaxlib 0.10.2 compiles a softmax over three numbers wrongly for 20,000 of them at once on a CPU.
    taken = np.concatenate([samples(policy, observation, some) for some in uniforms]).reshape(draws, -1)
    base = max(2, int(actions.max()) + 1)
    weights = base ** np.arange(actions.shape[1])[::-1]
    count = np.bincount((taken @ weights).astype(int), minlength=base ** actions.shape[1])
    expected = draws * np.exp(answer["log_prob"])
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
    check_frequencies(name, 5)


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_actions_are_as_frequent_as_their_joint_probability_over_many_draws(name):
    check_frequencies(name, 489)  # two million


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


@pytest.mark.ci
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
