"""Named numbers within bounds, and their places in 0 … 1."""

import numpy as np
import pytest

from motorgrad.search import Range, Space, reflected

SPACE = Space({"width": Range(0.1, 0.5), "stiffness": Range(2.0, 200.0, start=20.0, log=True)})


def test_places_are_equal_differences_or_equal_ratios():
    places = np.array([[0.0, 0.0], [0.5, 0.5], [1.0, 1.0]])
    np.testing.assert_allclose(SPACE.numbers(places), [[0.1, 2.0], [0.3, 20.0], [0.5, 200.0]])


def test_numbers_and_places_are_inverse():
    places = np.random.default_rng(0).random((3, 4, 2))
    np.testing.assert_allclose(SPACE.places(SPACE.numbers(places)), places, atol=1e-12)


def test_the_start_is_what_was_given_or_the_middle():
    assert SPACE.named(SPACE.start) == pytest.approx({"width": 0.3, "stiffness": 20.0})
    assert SPACE.names == ("width", "stiffness")
    assert SPACE.size == 2


def test_places_beyond_the_bounds_are_reflected():
    np.testing.assert_allclose(reflected([-0.2, 0.0, 0.3, 1.0, 1.1, 2.3, -3.25]), [0.2, 0, 0.3, 1, 0.9, 0.3, 0.75])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Range(1.0, 1.0), r"high = 1.0: must be above low = 1.0"),
        (lambda: Range(0.0, 1.0, log=True), r"low = 0.0: must be above 0, as the scale is logarithmic"),
        (lambda: Range(float("nan"), 1.0), r"low = nan: must be a number"),
        (lambda: Range(0.0, 1.0, start=2.0), r"start = 2.0: must be from 0.0 to 1.0"),
        (lambda: Space({}), r"ranges = {}: must be at least one Range by name"),
        (lambda: Space({"a": (0, 1)}), r"ranges.a = \(0, 1\): must be a table of the settings of a Range"),  # type: ignore[dict-item]
        (lambda: SPACE.numbers([[0.5]]), r"places.shape = \(1, 1\): must be \(…, 2\)"),
        (lambda: SPACE.places(0.5), r"numbers.shape = \(\): must be \(…, 2\)"),
    ],
)
def test_what_is_impossible_is_refused_by_name(make, message):
    with pytest.raises(ValueError, match=message):
        make()
