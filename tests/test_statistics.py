"""Intervals hold the truth as often as they say, and say so where they cannot."""

import re

import numpy as np
import pytest

from motorgrad.statistics import (
    difference_of,
    exact,
    first_time,
    mean_of,
    median_of,
    moving_mean,
    per_case,
    ratio_of,
    share_of,
    tally_of,
)


def test_an_exact_number_has_no_interval():
    assert (exact(2).low, exact(2).high, str(exact(2))) == (2, 2, "2")


def test_the_interval_of_a_mean_is_students():
    found = mean_of([1.0, 2.0, 3.0, 4.0])
    # t(.975, 3) = 3.18245, standard deviation 1.29099
    assert found.value == 2.5
    np.testing.assert_allclose([found.low, found.high], [2.5 - 2.05426, 2.5 + 2.05426], atol=1e-5)


def test_one_seed_has_an_unbounded_interval():
    assert mean_of([1.0]).high == np.inf


def test_the_interval_of_a_median_is_of_order_statistics():
    found = median_of(np.arange(16.0))  # the 4th and the 13th of 16 hold the median with probability .9787
    assert (found.value, found.low, found.high) == (7.5, 3.0, 12.0)
    assert (median_of([3.0, 1.0, 2.0]).low, median_of([3.0, 1.0, 2.0]).high) == (1.0, 3.0)


@pytest.mark.parametrize(("interval", "draw", "truth"), [
    (mean_of, lambda rng: rng.normal(2.0, 1.0, 12), 2.0),
    (median_of, lambda rng: rng.exponential(1.0, 16), np.log(2)),
    (share_of, lambda rng: rng.random(16) < 0.7, 0.7),
])  # fmt: skip
def test_intervals_hold_the_truth_as_often_as_they_say(interval, draw, truth):
    rng = np.random.default_rng(1)
    found = [interval(draw(rng)) for _ in range(1000)]
    covered = np.mean([f.low <= truth <= f.high for f in found])
    assert 0.93 < covered < 0.99


def test_the_interval_of_a_share_is_wilsons():
    found = share_of([True] * 8)
    np.testing.assert_allclose([found.low, found.high], [8 / (8 + 1.959964**2), 1.0], atol=1e-6)


@pytest.mark.parametrize("values", [[], [1.0, np.nan]])
def test_what_never_occurred_cannot_be_averaged(values):
    with pytest.raises(ValueError, match=r"values = .*finite"):
        mean_of(values)


@pytest.mark.parametrize("count", range(1, 9))
def test_the_interval_of_a_median_says_which_level_it_reaches(count):
    found = median_of(np.arange(float(count)))
    if count < 6:
        # the sample spans the median unless all numbers lie on one side of it
        assert found.level == 1 - 0.5 ** (count - 1) < 0.95
        assert str(found).endswith(f"median of {count} (interval at {100 * found.level:.3g} %)")
    else:
        assert found.level == 0.95
        assert str(found).endswith(f"median of {count}")


def test_a_short_median_covers_as_often_as_it_says():
    rng = np.random.default_rng(2)
    found = [median_of(rng.normal(size=4)) for _ in range(2000)]
    assert np.mean([f.low <= 0 <= f.high for f in found]) == pytest.approx(found[0].level, abs=0.02)


@pytest.mark.parametrize("interval", [mean_of, median_of])
def test_a_higher_level_is_wider(interval):
    values = np.random.default_rng(0).normal(size=40)
    wide, narrow = interval(values, 0.99), interval(values, 0.8)
    assert wide.low < narrow.low < narrow.high < wide.high
    assert (wide.level, narrow.level) == (0.99, 0.8)
    with pytest.raises(ValueError, match=r"level = 95: must be between 0 and 1"):
        interval(values, 95)


def test_the_share_of_nobody_is_unknown():
    found = share_of([])
    assert np.isnan(found.value)
    assert (found.low, found.high, str(found)) == (0, 1, "unknown [0 … 1], share of none")


def test_a_tally_is_no_estimate():
    found = tally_of([True, True, False, False])
    assert (found.low, found.high, found.level, str(found)) == (0.5, 0.5, 1, "0.5, share of 4")


def test_the_words_of_an_unbounded_interval():
    assert str(mean_of([2.0])) == "2 [−∞ … ∞], mean of 1"
    assert mean_of([1.0, 3.0]).words("m") == "2 [-10.71 … 14.71] m, mean of 2"


def test_a_ratio_and_its_inverse_agree():
    rng = np.random.default_rng(0)
    one, other = rng.uniform(1, 2, 10), rng.uniform(1, 2, 10)
    ratio, inverse = ratio_of(one, other), ratio_of(other, one)
    np.testing.assert_allclose([ratio.low * inverse.high, ratio.value * inverse.value], 1)


@pytest.mark.parametrize(
    ("above", "below", "said"),
    [
        ([1.0, 0.0, 2.0], [1.0, 1.0, 1.0], "above = [0.0]: must be above 0"),
        ([1.0, 2.0], [3.0, -1.0], "below = [-1.0]: must be above 0"),
        ([1.0, np.nan], [1.0, 1.0], "above = array([ 1., nan]): must be at least one, all finite"),
        ([], [], "above = array([], dtype=float64): must be at least one"),
        ([1.0, 2.0], [1.0, 2.0, 3.0], "above, below = (2, 3): must be as many numbers in each"),
        (["one"], [1.0], "above = ['one']: must be numbers"),
        ([[1.0], [2.0, 3.0]], [1.0], "above = [[1.0], [2.0, 3.0]]: must be numbers, as many in each row"),
    ],
)
def test_what_has_no_ratio_is_refused(above, below, said):
    with pytest.raises(ValueError, match=re.escape(said)):
        ratio_of(above, below)


def test_nothing_over_no_cases_is_unknown():
    np.testing.assert_array_equal(per_case([0, 3, 4], np.array([0, 2, 0])), [np.nan, 1.5, np.nan])


def test_a_difference_covers_unequal_variances():
    rng = np.random.default_rng(3)
    found = [difference_of(rng.normal(1, 1, 12), rng.normal(0, 4, 8)) for _ in range(400)]
    assert 0.92 < np.mean([f.low <= 1 <= f.high for f in found]) < 0.98
    with pytest.raises(ValueError, match="at least two numbers"):
        difference_of([1.0], [1.0, 2.0])


def test_first_times_and_moving_means():
    time = np.array([10, 20, 30])
    happened = np.array([[False, True, False], [True, True, True], [False] * 3])
    np.testing.assert_array_equal(first_time(time, happened), [20, 10, np.nan])
    np.testing.assert_array_equal(first_time(time, happened, never=99), [20, 10, 99])
    np.testing.assert_array_equal(moving_mean(np.array([[1.0, 3.0, 5.0]]), 2), [[2, 4]])
