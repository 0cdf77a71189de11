"""Soft spheres and soft boxes: where they fire, how hard, and what shapes they take."""

import jax
import numpy as np
import pytest
from policy_examples import Compiled, started

from motorgrad.policies import SoftBoxes, SoftSpheres, initial, soft_boxes, soft_spheres


def test_a_sphere_fires_half_the_time_at_its_radius_in_every_direction():
    sphere = SoftSpheres([[0.3, -0.2, 0.1]], [np.log(0.7)], [np.log(20.0)])
    ask = Compiled(sphere)
    for direction in np.random.default_rng(0).normal(size=(5, 3)):
        unit = direction / np.linalg.norm(direction)
        p = [float(ask.prob(np.float32([0.3, -0.2, 0.1] + r * unit))[0]) for r in (0.5, 0.7, 0.9)]
        assert p == pytest.approx([1 / (1 + np.exp(-4)), 0.5, 1 / (1 + np.exp(4))], rel=1e-4)


def test_a_hard_unit_is_nearly_deterministic_within_and_without():
    sphere = SoftSpheres([[0.0, 0.0]], [0.0], [np.log(1e3)])
    box = SoftBoxes([[0.0, 0.0]], [[0.0, np.log(0.2)]], [np.log(1e3)])
    for unit, inside, outside in ((sphere, (0.6, 0.7), (0.8, 0.7)), (box, (0.9, 0.15), (0.9, 0.25))):
        ask = Compiled(unit)
        assert ask.prob(np.array(inside))[0] > 0.999
        assert ask.prob(np.array(outside))[0] < 0.001


def test_a_box_is_the_product_of_two_opposed_sigmoids_an_input():
    with jax.enable_x64(True):
        box = SoftBoxes([[0.2, -0.4]], np.log([[0.5, 0.3]]), [np.log(6.0)])
        y = np.array([0.5, -0.2])
        away, half = y - np.array([0.2, -0.4]), np.array([0.5, 0.3])
        walls = 6 * np.concatenate([half - away, half + away])
        assert float(Compiled(box).prob(y)[0]) == pytest.approx(np.prod(1 / (1 + np.exp(-walls))))


def test_the_score_of_a_spheres_centre_points_outwards_and_is_zero_at_the_tip():
    sphere = SoftSpheres([[0.0, 0.0]], [0.0], [0.0])
    score = Compiled(sphere).score(np.array([0.3, 0.4]), np.ones(1)).centre[0]
    np.testing.assert_allclose(score / np.linalg.norm(score), [0.6, 0.8], rtol=1e-5)
    with jax.enable_x64(True):
        sphere = SoftSpheres([[0.0, 0.0]], [0.0], [0.0])
        ask, tip = Compiled(sphere), np.zeros(2)
        np.testing.assert_array_equal(ask.score(tip, np.ones(1)).centre, 0)
        slope = ask.derivatives(tip, np.ones((1, 1)))[0]
        np.testing.assert_array_equal(slope[:2], 0)  # and no NaN of the root


@pytest.mark.parametrize("name", ["soft-spheres", "soft-boxes"])
def test_initial_units_have_their_size_and_hardness_and_centres_in_the_interval(name):
    size = "radius" if name == "soft-spheres" else "width"
    policy = started(initial(name, 2, units=500, hardness=7.0, low=0.0, high=3.0, **{size: 0.2}))
    centre = np.asarray(policy.centre)
    np.testing.assert_allclose(np.exp(getattr(policy, f"log_{size}")), 0.2, rtol=1e-6)
    np.testing.assert_allclose(np.exp(policy.log_hardness), 7.0, rtol=1e-6)
    assert 0 <= centre.min() < 0.1 < 2.9 < centre.max() <= 3


one, square = np.zeros(1), np.zeros((2, 2))


@pytest.mark.parametrize(
    ("build", "names"),
    [
        (lambda: SoftSpheres(one, one, one), "centre = (1,)"),
        (lambda: SoftSpheres(square, one, np.zeros(2)), "log_radius = (1,): must be of shape (2,)"),
        (lambda: SoftSpheres(square, np.zeros(2), one), "log_hardness = (1,): must be of shape (2,)"),
        (lambda: SoftBoxes(one, one, one), "centre = (1,)"),
        (lambda: SoftBoxes(square, one, np.zeros(2)), "log_width = (1,): must be of shape (2, 2)"),
        (lambda: SoftBoxes(square, square, one), "log_hardness = (1,): must be of shape (2,)"),
        (lambda: soft_spheres(2, 3, radius=0.0), "radius = 0.0: must be a finite number above 0"),
        (lambda: soft_boxes(2, 3, width=-1.0), "width = -1.0: must be a finite number above 0"),
        (lambda: soft_boxes(2, 3, hardness=0.0), "hardness = 0.0: must be a finite number above 0"),
        (lambda: soft_spheres(2, 3, low=1.0, high=0.0), "low, high = (1.0, 0.0)"),
        (lambda: soft_spheres(2, 0), "units = 0"),
    ],
)
def test_impossible_units_are_refused_by_name(build, names):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        build()
    assert names in str(error.value)
