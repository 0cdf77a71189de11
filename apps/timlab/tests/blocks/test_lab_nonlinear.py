"""Nonlinear blocks, products, and what goes between numbers and lists."""

import numpy as np
import pytest
from block_driver import drive, of
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator

U = np.linspace(-2, 2, 41)


def test_saturation_dead_zone_and_quantiser():
    np.testing.assert_allclose(drive(of("saturation", -0.5, 1.5), 41, u=U)["y"], np.clip(U, -0.5, 1.5), atol=1e-7)
    zone = drive(of("dead zone", -0.5, 1.5), 41, u=U)["y"]
    np.testing.assert_allclose(zone, np.where(U > 1.5, U - 1.5, np.where(U < -0.5, U + 0.5, 0)), atol=2e-7)
    steps = drive(of("quantiser", 0.25), 41, u=U + 0.01)["y"]
    np.testing.assert_allclose(steps, 0.25 * np.round((U + 0.01) / 0.25), atol=1e-7)
    with pytest.raises(ValueError, match=r"low = 2\.0: must be below high = 1\.0"):
        of("saturation", 2.0, 1.0)
    with pytest.raises(ValueError, match=r"interval = 0\.0: must be a finite number above 0"):
        of("quantiser", 0.0)


def test_limits_may_differ_from_element_to_element():
    u = np.tile(U[:, None], (1, 2))
    y = drive(of("saturation", (-1.0, 0.0), (1.0, 0.5), shape=(2,)), 41, u=u)["y"]
    np.testing.assert_allclose(y, np.clip(u, (-1, 0), (1, 0.5)), atol=1e-7)


def test_relay_goes_round_its_loop():
    u = np.array([0.0, 0.4, 0.5, 0.2, -0.4, -0.5, 0.0, 0.6])
    expected = [10, 10, 20, 20, 20, 10, 10, 20]
    np.testing.assert_array_equal(drive(of("relay", -0.5, 0.5, 10.0, 20.0), 8, u=u)["y"], expected)
    begun = drive(of("relay", -0.5, 0.5, 10.0, 20.0, begins_on=True), 2, u=u[3:5])["y"]
    np.testing.assert_array_equal(begun, [20, 20])


def test_backlash_moves_only_where_it_is_pushed():
    u = np.array([0.0, 0.4, 1.0, 0.6, 0.1, -1.0])
    np.testing.assert_allclose(drive(of("backlash", 1.0), 6, u=u)["y"], [0, 0, 0.5, 0.5, 0.5, -0.5], atol=1e-6)


def test_rate_limit_follows_no_faster():
    u = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    y = drive(of("rate limit", 4.0, 8.0), 6, 0.1, u=u)["y"]
    np.testing.assert_allclose(y, [0.4, 0.8, 1.0, 0.2, 0, 0], atol=1e-6)


@pytest.mark.parametrize("beyond", ["stay", "extend"])
def test_look_up_table_is_linear_between_its_points(beyond):
    points, results = np.array([-1.0, 0.0, 0.5]), np.array([2.0, -1.0, 4.0])
    y = drive(of("look-up table", points, results, beyond), 41, u=U)["y"]
    expected = np.interp(U, points, results)
    if beyond == "extend":
        expected = np.where(U < -1, 2 - 3 * (U + 1), np.where(U > 0.5, 4 + 10 * (U - 0.5), expected))
    np.testing.assert_allclose(y, expected, atol=1e-5)


@pytest.mark.parametrize("beyond", ["stay", "extend"])
def test_look_up_table_of_two_numbers_is_bilinear(beyond):
    rng = np.random.default_rng(1)
    points1, points2, results = np.array([-1.0, 0.0, 2.0]), np.array([0.0, 0.5, 0.8, 1.0]), rng.normal(size=(3, 4))
    u1, u2 = rng.uniform(-1.5, 2.5, 60), rng.uniform(-0.2, 1.2, 60)
    y = drive(of("look-up table 2-D", points1, points2, results, beyond), 60, u1=u1, u2=u2)["y"]
    if beyond == "stay":
        u1, u2 = np.clip(u1, -1, 2), np.clip(u2, 0, 1)
    table = RegularGridInterpolator((points1, points2), results, bounds_error=False, fill_value=None)
    np.testing.assert_allclose(y, table(np.stack([u1, u2], axis=1)), atol=1e-5)


def test_tables_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match=r"points = .*: must be a list of at least two numbers that increase"):
        of("look-up table", (0.0, 1.0, 1.0), (1.0, 2.0, 3.0))
    with pytest.raises(ValueError, match=r"results = .*: must be 2 numbers, as many as points"):
        of("look-up table", (0.0, 1.0), (1.0, 2.0, 3.0))
    with pytest.raises(ValueError, match=r"results = .*: must be 2 rows of 2 numbers"):
        of("look-up table 2-D", (0.0, 1.0), (0.0, 1.0), (1.0, 2.0))


def test_product_multiplies_and_divides():
    a, b, c = np.random.default_rng(2).uniform(0.5, 2, (3, 10, 4))
    y = drive(of("product", "*/*", shape=(4,)), 10, u1=a, u2=b, u3=c)["y"]
    np.testing.assert_allclose(y, a / b * c, rtol=1e-5)
    with pytest.raises(ValueError, match=r"signs = '\+': must be a string of \* and /"):
        of("product", "+")


def test_matrix_gain_multiplies_from_the_left():
    matrix, u = np.random.default_rng(3).normal(size=(2, 3)), np.random.default_rng(4).normal(size=(10, 3))
    np.testing.assert_allclose(drive(of("matrix gain", matrix), 10, u=u)["y"], u @ matrix.T, atol=1e-5)
    with pytest.raises(ValueError, match=r"matrix = 1.0: must be a list of rows"):
        of("matrix gain", 1.0)


def test_join_and_select():
    a, b, c = np.arange(5.0), np.arange(10.0).reshape(5, 2), -np.arange(5.0)
    joined = drive(of("join", (0, 2, 0)), 5, u1=a, u2=b, u3=c)["y"]
    np.testing.assert_array_equal(joined, np.column_stack([a, b, c]))
    np.testing.assert_array_equal(drive(of("select", 4, (3, 0)), 5, u=joined)["y"], joined[:, [3, 0]])
    assert drive(of("select", 4, (2,)), 5, u=joined)["y"].shape == (5,)
    assert drive(of("select", 4, (2,), single=False), 5, u=joined)["y"].shape == (5, 1)
    with pytest.raises(ValueError, match=r"entries = \(4,\): must be below size = 4"):
        of("select", 4, (4,))


@pytest.mark.parametrize(
    ("how", "function"),
    [
        ("sum", np.sum),
        ("mean", np.mean),
        ("product", np.prod),
        ("max", np.max),
        ("min", np.min),
        ("norm", np.linalg.norm),
    ],
)
def test_reduce_makes_one_number(how, function):
    u = np.random.default_rng(5).normal(size=(8, 2, 3))
    y = drive(of("reduce", how, (2, 3)), 8, u=u)["y"]
    np.testing.assert_allclose(y, [function(row) for row in u], rtol=1e-5, atol=1e-6)


@pytest.mark.ci
@given(st.lists(st.floats(-10, 10, width=32), min_size=20, max_size=20), st.floats(0.125, 4, width=32))
@settings(max_examples=40, deadline=None)
def test_backlash_and_rate_limit_stay_near_what_they_follow(values, width):
    u = np.array(values, np.float32)
    assert np.all(np.abs(drive(of("backlash", width), 20, u=u)["y"] - u) <= width / 2 * (1 + 1e-5) + 1e-5)
    moves = np.diff(drive(of("rate limit", width, width), 20, 1.0, u=u)["y"], prepend=0)
    assert np.all(np.abs(moves) <= width * (1 + 1e-5) + 1e-5)
