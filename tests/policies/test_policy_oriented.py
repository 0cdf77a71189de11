"""Oriented units: Gaussians of full covariance, and boxes that turn."""

import itertools

import jax
import numpy as np
import pytest
from policy_examples import Compiled, compiled

from motorgrad.policies import (
    Factored,
    LocalGaussians,
    OrientedBoxes,
    OrientedGaussians,
    SoftBoxes,
    abilities,
    growing,
    oriented_boxes,
    oriented_gaussians,
    reach,
)


def cayley(turn, inputs):
    """The rotation by its definition."""
    skew = np.zeros((inputs, inputs))
    skew[np.tril_indices(inputs, -1)] = turn
    skew -= skew.T
    return (np.eye(inputs) + skew) @ np.linalg.inv(np.eye(inputs) - skew)


@pytest.mark.parametrize("inputs", [1, 2, 4])
def test_a_gaussian_has_the_covariance_that_its_factor_says(inputs):
    rng = np.random.default_rng(inputs)
    with jax.enable_x64(True):
        shear = rng.normal(size=(1, inputs * (inputs - 1) // 2))
        centre, log_width = rng.normal(size=(2, 1, inputs))
        unit = OrientedGaussians(centre, log_width, shear, p_max=0.7)
        factor = np.eye(inputs)
        factor[np.tril_indices(inputs, -1)] = shear[0]
        factor = np.exp(-log_width[0])[:, None] * factor
        covariance = np.linalg.inv(factor.T @ factor)
        axes = abilities.regions(unit).axes[0]
        np.testing.assert_allclose(axes @ axes.T, covariance, rtol=1e-9)
        away = rng.normal(size=inputs)
        wanted = 0.7 * np.exp(-0.5 * away @ np.linalg.solve(covariance, away))
        assert float(Compiled(unit).prob(centre[0] + away)[0]) == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("inputs", [1, 2, 4])
def test_a_box_that_turned_is_a_box_in_turned_coordinates(inputs):
    rng = np.random.default_rng(inputs)
    with jax.enable_x64(True):
        turn = rng.normal(size=(1, inputs * (inputs - 1) // 2), scale=2)
        centre, log_width = rng.normal(size=(2, 1, inputs))
        straight = SoftBoxes(centre, log_width, [1.5])
        turned = OrientedBoxes(centre, log_width, [1.5], turn)
        rotation = cayley(turn[0], inputs)
        np.testing.assert_allclose(rotation.T @ rotation, np.eye(inputs), atol=1e-12)
        np.testing.assert_allclose(abilities.regions(turned).axes[0], rotation * np.exp(log_width[0]), rtol=1e-9)
        away = rng.normal(size=inputs)
        wanted = Compiled(straight).prob(centre[0] + away)
        np.testing.assert_allclose(Compiled(turned).prob(centre[0] + rotation @ away), wanted, rtol=1e-9)


def test_in_two_inputs_the_angle_is_twice_the_arctangent():
    for turn, angle in ((0.0, 0.0), (1.0, np.pi / 2), (-0.5, -2 * np.arctan(0.5))):
        first = abilities.regions(OrientedBoxes([[0.0, 0.0]], [[0.0, -1.0]], [1.0], [[turn]])).axes[0, :, 0]
        np.testing.assert_allclose(first, [np.cos(angle), np.sin(angle)], atol=1e-6)


def test_every_orientation_is_reached_by_small_numbers():
    """A box is the same if an axis points the other way: one of these rotations has entries of at most 1."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        wanted = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        found = []
        for signs in itertools.product((-1, 1), repeat=3):
            rotation = wanted * signs
            if np.linalg.det(rotation) > 0:
                skew = np.linalg.solve((rotation + np.eye(3)).T, (rotation - np.eye(3)).T).T
                found.append(np.abs(skew).max())
                np.testing.assert_allclose(cayley(skew[np.tril_indices(3, -1)], 3), rotation, atol=1e-6)
        assert min(found) <= 1


@pytest.mark.parametrize("inputs", [1, 3])
def test_units_start_along_the_inputs(inputs):
    rng = np.random.default_rng(3)
    centre, log_width = rng.normal(size=(2, 2, inputs))
    look = rng.normal(size=inputs)
    gaussians, boxes = LocalGaussians(centre, log_width, 0.6), SoftBoxes(centre, log_width, [0.5, 1.0])
    for straight, free in ((gaussians, OrientedGaussians.of(gaussians)), (boxes, OrientedBoxes.of(boxes))):
        np.testing.assert_allclose(Compiled(free).prob(look), Compiled(straight).prob(look), rtol=1e-6)
        every = zip(abilities.regions(free), abilities.regions(straight), strict=True)
        assert all(np.allclose(own, theirs) for own, theirs in every)


def test_a_pool_of_both_kinds_knows_where_it_responds():
    one, other = (start(2, units=2)(jax.random.key(0)) for start in (oriented_gaussians, oriented_boxes))
    regions = abilities.regions(Factored([one, other]))
    assert regions.axes.shape == (4, 2, 2)
    assert regions.box.tolist() == [False, False, True, True]
    assert isinstance(growing(2, 3, shape="oriented-gaussians").pool, OrientedGaussians)
    assert isinstance(growing(2, 3, shape="oriented-boxes").pool, OrientedBoxes)


one, square = np.zeros(1), np.zeros((2, 2))


@pytest.mark.parametrize(
    ("build", "names"),
    [
        (lambda: OrientedGaussians(one, one, one), "centre = (1,)"),
        (lambda: OrientedGaussians(square, one, one), "log_width = (1,): must be of shape (2, 2)"),
        (lambda: OrientedGaussians(square, square, square), "shear = (2, 2): must be of shape (2, 1)"),
        (lambda: OrientedGaussians(square, square, square[:, :1], 2.0), "p_max = 2.0: must be in (0, 1]"),
        (lambda: OrientedBoxes(one, one, one, one), "centre = (1,)"),
        (lambda: OrientedBoxes(square, square, np.zeros(2), square), "turn = (2, 2): must be of shape (2, 1)"),
        (lambda: growing(2, 4, shape="oriented-gaussians", pair="printed"), "must be exact for oriented-gaussians"),
        (lambda: reach(OrientedBoxes(square, square, np.zeros(2), square[:, :1]), 0.0, 1.0), "parallel to the inputs"),
    ],
)
def test_impossible_units_are_refused_by_name(build, names):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        build()
    assert names in str(error.value)


@pytest.mark.parametrize("inputs", [2, 12])
def test_large_turns_lose_no_precision(inputs):
    """In single precision, far from where the axes began: elimination without an exchange of rows is enough."""
    rng = np.random.default_rng(inputs)
    turn = rng.normal(size=(3, inputs * (inputs - 1) // 2), scale=30)
    boxes = OrientedBoxes(np.zeros((3, inputs)), np.zeros((3, inputs)), np.zeros(3), np.float32(turn))
    axes = np.asarray(compiled(lambda each: each._inverse())(boxes))
    rotations = 2 * axes - np.eye(inputs)
    np.testing.assert_allclose(rotations @ np.swapaxes(rotations, 1, 2), np.broadcast_to(np.eye(inputs), axes.shape),
                               atol=2e-4)  # fmt: skip
