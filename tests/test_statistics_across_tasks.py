"""Statistics of methods across tasks: scipy's where it has them, and cases worked out by hand."""

import itertools

import numpy as np
import pytest
from scipy import stats

from motorgrad.statistics import (
    distribution_scores,
    effective_dimension,
    expected_best,
    improvement_of,
    interquartile_mean,
    interquartile_mean_of,
    mean_over_tasks,
    median_over_tasks,
    percentile_range,
    performance_profile,
    probability_of_improvement,
    sensitivity_of,
    stratified_bootstrap,
)


def test_the_interquartile_mean_by_hand():
    # of 1 … 8, the two lowest and the two highest are left out
    assert interquartile_mean(np.array([[1.0, 8.0, 3.0, 100.0], [5.0, 6.0, 4.0, -7.0]])) == np.mean([3, 4, 5, 6])


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (3, 7), (4, 16)])
def test_the_interquartile_mean_is_scipys(shape):
    scores = np.random.default_rng(0).standard_cauchy((6, *shape))
    wanted = [stats.trim_mean(each.ravel(), 0.25) for each in scores]
    np.testing.assert_allclose(interquartile_mean(scores), wanted, rtol=1e-12)


def test_means_and_medians_over_tasks_by_hand():
    scores = np.array([[0.0, 1.0], [2.0, 4.0], [10.0, 30.0]])
    assert mean_over_tasks(scores) == pytest.approx((0.5 + 3 + 20) / 3)
    assert median_over_tasks(scores) == 3


def test_the_probability_of_improvement_by_hand():
    # first task: 2 > 1, 2 = 2, 0 < 1, 0 < 2; second: always better
    one, other = np.array([[2.0, 0.0], [5.0, 6.0]]), np.array([[1.0, 2.0], [3.0, 4.0]])
    assert probability_of_improvement(one, other) == ((1 + 0.5) / 4 + 1) / 2
    assert probability_of_improvement(other, one) == 1 - ((1 + 0.5) / 4 + 1) / 2


def test_the_probability_of_improvement_is_mann_and_whitneys():
    rng = np.random.default_rng(1)
    one, other = rng.integers(0, 6, (5, 11)), rng.integers(1, 7, (5, 8))
    wanted = [stats.mannwhitneyu(a, b).statistic / (11 * 8) for a, b in zip(one, other, strict=True)]
    assert probability_of_improvement(one, other) == pytest.approx(np.mean(wanted))


def test_a_performance_profile_by_hand():
    scores = np.array([[0.0, 1.0], [0.5, 0.5]])
    np.testing.assert_allclose(performance_profile(scores, np.array([-1, 0, 0.5, 1])), [1, 0.75, 0.25, 0])
    survival = stats.ecdf(scores.ravel()).sf.evaluate([-1, 0, 0.5, 1])
    np.testing.assert_allclose(performance_profile(scores, np.array([-1, 0, 0.5, 1])), survival)


def test_the_bootstrap_of_one_task_is_scipys():
    sample = np.random.default_rng(2).exponential(size=40)
    value, low, high = stratified_bootstrap(mean_over_tasks, sample, resamples=20_000)
    wanted = stats.bootstrap((sample,), np.mean, n_resamples=20_000, method="percentile", rng=3).confidence_interval
    assert value == pytest.approx(sample.mean())
    np.testing.assert_allclose([low, high], wanted, atol=0.015)


def test_the_bootstrap_draws_every_task_from_itself():
    # without spread within the tasks nothing is random, however far they lie apart
    scores = np.repeat([[0.0], [100.0]], 8, axis=1)
    value, low, high = stratified_bootstrap(median_over_tasks, scores, resamples=50)
    assert value == low == high == 50


def test_pairs_are_drawn_together():
    one = np.random.default_rng(4).normal(size=(2, 12))
    value, low, high = stratified_bootstrap(
        lambda a, b: mean_over_tasks(a) - mean_over_tasks(b), one + 1, one, paired=True, resamples=100
    )
    np.testing.assert_allclose([value, low, high], 1)
    _, low, high = stratified_bootstrap(
        lambda a, b: mean_over_tasks(a) - mean_over_tasks(b), one + 1, one, resamples=100
    )
    assert high - low > 0.1


def test_the_bootstrap_is_the_same_however_much_is_drawn_at_a_time(monkeypatch):
    from motorgrad.statistics import _across_tasks

    scores = np.random.default_rng(5).normal(size=(3, 10))
    whole = stratified_bootstrap(interquartile_mean, scores, resamples=64)
    monkeypatch.setattr(_across_tasks, "AT_ONCE", 900)
    np.testing.assert_array_equal(whole, stratified_bootstrap(interquartile_mean, scores, resamples=64))


def test_intervals_hold_the_truth_as_often_as_they_say():
    rng = np.random.default_rng(6)
    held = [
        found.low <= 0 <= found.high
        for found in (interquartile_mean_of(rng.normal(size=(4, 16)), seed=each) for each in range(100))
    ]
    assert 0.88 < np.mean(held) <= 1
    assert interquartile_mean_of([1.0, 2.0, 3.0, 10.0]).value == 2.5
    assert improvement_of([[1.0, 2.0]], [[0.0, 0.5]]).words() == "1 [1 … 1], probability of improvement of 4"


def test_impossible_scores_are_refused():
    with pytest.raises(ValueError, match=r"scores = \[nan\]: must be finite"):
        interquartile_mean_of([1.0, np.nan])
    with pytest.raises(ValueError, match="of the same runs to be paired"):
        sensitivity_of(np.zeros((2, 3)), np.zeros((2, 4)))
    with pytest.raises(ValueError, match="of equal tasks"):
        improvement_of(np.zeros((2, 3)), np.zeros((1, 3)))


def test_scales_by_hand():
    assert percentile_range(np.arange(101.0)) == (5, 95)
    assert percentile_range([2.0, 2.0, np.nan]) == (2, 3)
    found = distribution_scores(np.array([0.0, 1.0, 2.5, np.nan, 9.0]), [1.0, 2.0, 2.0, 3.0])
    np.testing.assert_allclose(found, [0, 0.25, 0.75, 0, 1])
    pool = np.random.default_rng(7).normal(size=50)
    np.testing.assert_allclose(distribution_scores(pool, pool), stats.ecdf(pool).cdf.evaluate(pool))


def test_sensitivity_by_hand():
    tuned, shared = np.array([[1.0, 1.0], [0.8, 0.8]]), np.array([[0.4, 0.4], [0.8, 0.8]])
    found = sensitivity_of(tuned, shared)
    np.testing.assert_allclose([found.value, found.low, found.high], 0.3)


def grid(**values):
    return [dict(zip(values, each, strict=True)) for each in itertools.product(*values.values())]


def test_the_effective_dimension_by_hand():
    settings = grid(rate=[0.1, 1.0], decay=[0.0, 0.9])
    # alone, the rate takes 0.5 to 0.9 of a peak of 0.91
    found = effective_dimension(settings, np.array([[0.9, 0.8, 0.1, 0.0], [0.1, 0.2, 0.9, 0.92]]))
    assert found.dimension == 1
    assert found.scores == pytest.approx((0.5, 0.9, 0.91))
    assert found.tuned == ((), ("rate",), ("rate", "decay"))
    # one setting is the best on both tasks: nothing has to be tuned
    assert effective_dimension(settings, np.array([[1.0, 0.5, 0.2, 0.1], [1.0, 0.1, 0.2, 0.3]])).dimension == 0
    # each task wants a corner of its own, from which no single change leads to the other
    assert effective_dimension(settings, np.array([[1.0, 0.0, 0.0, 0.2], [0.0, 0.0, 0.0, 1.0]])).dimension == 2


def test_settings_that_fail_or_do_not_differ_have_no_dimension():
    settings = grid(rate=[0.1, 1.0], kind=["mean"])
    found = effective_dimension(settings, np.array([[np.nan, 0.5]]))
    assert (found.dimension, found.scores) == (0, (0.5, 0.5))
    assert effective_dimension([{}], np.array([[0.3]])) == (0, (0.3,), ((),))


def test_the_expected_best_of_some_settings_is_the_mean_over_all_ways_to_choose():
    rng = np.random.default_rng(8)
    chosen_by, reported = rng.normal(size=6), rng.normal(size=6)
    counts = range(1, 7)
    wanted = [
        np.mean([reported[max(few, key=lambda place: chosen_by[place])] for few in itertools.combinations(range(6), k)])
        for k in counts
    ]
    np.testing.assert_allclose(expected_best(chosen_by, reported, np.array(counts)), wanted)
    with pytest.raises(ValueError, match="from 1 to the number of settings, 6"):
        expected_best(chosen_by, reported, np.array([7]))


def test_a_setting_that_failed_is_never_chosen():
    found = expected_best(np.array([np.nan, 1.0, 2.0]), np.array([np.nan, 10.0, 20.0]), np.array([1, 2, 3]))
    # of one: 10 or 20; of two: 10, 20 or 20
    np.testing.assert_allclose(found, [15, 50 / 3, 20])
