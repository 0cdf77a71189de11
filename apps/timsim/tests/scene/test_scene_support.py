"""The support polygon against closed forms."""

import numpy as np
import pytest

from timsim.scene._contacts import level_axes, stability_margin, support_polygon

UP = np.array([0.0, 0.0, 1.0])
SQUARE = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], float)


def area(polygon, up=UP):
    x, y = level_axes(up) @ polygon.T
    return 0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1))


def test_points_inside_are_left_out_and_the_order_is_anticlockwise():
    inside = np.random.default_rng(0).uniform(0.1, 0.9, (20, 3)) * [1, 1, 0.3]
    polygon = support_polygon(np.concatenate([inside, SQUARE]), UP)
    assert {tuple(corner) for corner in polygon} == {tuple(corner) for corner in SQUARE}
    assert area(polygon) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("place", "expected"),
    [((0.5, 0.5), 0.5), ((0.9, 0.5), 0.1), ((0.5, 1.25), -0.25), ((1.3, 1.4), -0.5), ((0.5, 0.0), 0.0)],
)
def test_the_margin_in_a_square(place, expected):
    polygon = support_polygon(SQUARE, UP)
    for height in (0.0, 3.0):  # how high the mass is does not count
        assert stability_margin(polygon, np.array([*place, height]), UP) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("corners", [3, 5, 6, 12])
@pytest.mark.parametrize("tilt", [0.0, 0.4])
def test_a_regular_polygon_on_a_slope(corners, tilt):
    """In the middle of a regular polygon the margin is its apothem, seen along gravity."""
    angle = 2 * np.pi * np.arange(corners) / corners
    flat = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
    turn = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    polygon = support_polygon(flat @ turn.T, turn @ UP)
    assert len(polygon) == corners
    assert area(polygon, turn @ UP) == pytest.approx(corners / 2 * np.sin(2 * np.pi / corners))
    assert stability_margin(polygon, turn @ [0, 0, 0.7], turn @ UP) == pytest.approx(np.cos(np.pi / corners))


def test_too_few_points_to_stand_on():
    assert len(support_polygon(np.empty((0, 3)), UP)) == 0
    assert stability_margin(np.empty((0, 3)), UP, UP) == -np.inf
    one = support_polygon(SQUARE[:1], UP)
    assert stability_margin(one, np.array([3.0, 4.0, 0.0]), UP) == pytest.approx(-5.0)
    line = np.linspace((0, 0, 0), (2, 2, 0), 5)
    ends = support_polygon(line[[2, 0, 4, 1, 3]], UP)
    np.testing.assert_allclose(sorted(map(tuple, ends)), [(0, 0, 0), (2, 2, 0)])
    assert stability_margin(ends, np.array([1.0, 1.0, 0.0]), UP) == pytest.approx(0.0)
    assert stability_margin(ends, np.array([2.0, 0.0, 0.0]), UP) == pytest.approx(-np.sqrt(2))
    assert len(support_polygon(np.repeat(line[:1], 3, axis=0), UP)) == 1
