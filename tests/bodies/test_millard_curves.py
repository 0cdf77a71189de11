"""The curves of Millard et al. (2013): the points that define them, and Bézier curves solved by bisection."""

from pathlib import Path
from typing import Any, get_args, get_type_hints

import jax
import numpy as np
import pytest
from scipy.special import comb

from motorgrad import bodies
from motorgrad.bodies import CURVES, Hill, Hopper, Mjcf, hill_curves, hill_in_jax
from motorgrad.bodies.muscles._curve_sets import with_curves
from motorgrad.bodies.muscles._machine_code import compiled_hill

MILLARD = hill_curves("millard")
STRAIN = 0.049
TANGENTS = {
    "active": MILLARD.active_tangent,
    "passive": MILLARD.passive_tangent,
    "velocity": MILLARD.velocity_tangent,
    "tendon": lambda length: MILLARD.tendon_tangent(length, MILLARD.tendon_stiffness(STRAIN)),
}


@pytest.fixture(scope="module")
def chains():
    """The control points, from OpenSim's construction written out anew: `(elbows, 6, 2)` by curve."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(Path(__file__).parents[2]))
        from tools.figures._muscle_curves import ACTIVE, PASSIVE, VELOCITY, tendon_chain
    found = {"active": ACTIVE, "passive": PASSIVE, "velocity": VELOCITY, "tendon": tendon_chain(STRAIN)}
    return {name: np.array(chain) for name, chain in found.items()}


def bezier(points: np.ndarray, u: Any) -> np.ndarray:
    """A point of a Bézier curve, by Bernstein polynomials: `(…, 2)`."""
    degree = len(points) - 1
    i = np.arange(degree + 1)
    u = np.asarray(u)[..., None]
    return (comb(degree, i) * u**i * (1 - u) ** (degree - i)) @ points


def solved(points: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Height and slope of one elbow at x, by bisection."""
    low, high = np.zeros_like(x), np.ones_like(x)
    for _ in range(60):
        middle = (low + high) / 2
        short = bezier(points, middle)[:, 0] < x
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    rate = bezier(5 * np.diff(points, axis=0), low)
    return bezier(points, low)[:, 1], rate[:, 1] / rate[:, 0]


# height and slope at the points that define each curve
POINTS = {
    "active": {0.4441: (0, 0), 1.0: (1, 0), (1.05 + 1.8123) / 2: (0.5, -1 / 0.7123), 1.8123: (0, 0)},
    "passive": {1.0: (0, 0), 1.035: (0.0035, 0.2), 1.7: (1, 2 / 0.7)},
    "velocity": {-1.0: (0, 0), -0.9: (0.0125, 0.25), 0.0: (1, 5), 0.9: (1.3925, 0.15), 1.0: (1.4, 0)},
    "tendon": {1.0: (0, 0), 1 + STRAIN * (1 - 1 / 4.125): (2 / 3, 1.375 / STRAIN), 1 + STRAIN: (1, 1.375 / STRAIN)},
}


@pytest.mark.parametrize("curve", POINTS)
def test_curves_pass_through_the_points_that_define_them(curve):
    places, wanted = np.array(list(POINTS[curve])), np.array(list(POINTS[curve].values()))
    value, slope = TANGENTS[curve](places)
    np.testing.assert_allclose(value, wanted[:, 0], rtol=0, atol=1e-8)
    np.testing.assert_allclose(slope, wanted[:, 1], rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("curve", POINTS)
def test_curves_are_the_bezier_curves(curve, chains):
    for points in chains[curve]:
        x = np.linspace(points[0, 0], points[-1, 0], 2001)
        (value, slope), (height, rise) = TANGENTS[curve](x), solved(points, x)
        np.testing.assert_allclose(value, height, rtol=0, atol=1e-8)
        np.testing.assert_allclose(slope, rise, rtol=0, atol=1e-5 / (STRAIN if curve == "tendon" else 1))


@pytest.mark.parametrize("curve", POINTS)
def test_curves_are_straight_beyond_their_ends(curve, chains):
    first, last = chains[curve][0, 0], chains[curve][-1, -1]
    for end, side in ((first, -1), (last, 1)):
        slope = TANGENTS[curve](end[0])[1]
        for far in (0.01, 3.0, 1e6):
            value, beyond = TANGENTS[curve](end[0] + side * far)
            assert value == pytest.approx(end[1] + side * far * slope, rel=1e-12, abs=1e-12)
            assert beyond == slope
    assert np.isnan(TANGENTS[curve](np.nan)[0])


@pytest.mark.parametrize("curve", POINTS)
def test_curves_are_smooth_to_second_order(curve, chains):
    """At the borders of elbows, at the ends, and at the borders of the cells of their tables."""
    chain, tangent = chains[curve], TANGENTS[curve]
    start, end = chain[0, 0, 0], chain[-1, -1, 0]
    borders = np.concatenate([chain[:, 0, 0], [end], np.linspace(start, end, 513)])
    width = end - start
    low, at, high = borders - 1e-7 * width, borders, borders + 1e-7 * width
    (left, left_slope), (value, slope), (right, right_slope) = map(tangent, (low, at, high))
    height, steep = np.ptp(chain[..., 1]), np.abs(tangent(np.linspace(start, end, 999))[1]).max()
    np.testing.assert_allclose(right - left, slope * (high - low), rtol=0, atol=1e-11 * height)
    np.testing.assert_allclose(left_slope, right_slope, rtol=0, atol=1e-4 * steep)
    bent = np.array([(slope - left_slope) / (at - low), (right_slope - slope) / (high - at)])
    np.testing.assert_allclose(*bent, rtol=0, atol=1e-3 * np.abs(bent).max())
    assert np.isfinite(value).all()


def test_curves_rise_and_fall_where_they_should():
    for curve, (low, high) in {"passive": (0.5, 2), "velocity": (-1.5, 1.5), "tendon": (0.9, 1.1)}.items():
        assert (np.diff(TANGENTS[curve](np.linspace(low, high, 20001))[0]) >= -1e-15).all(), curve
    rising, falling = (TANGENTS["active"](np.linspace(*span, 20001))[0] for span in ((0.3, 1.0), (1.0, 2.0)))
    assert (np.diff(rising) >= -1e-10).all()
    assert (np.diff(falling) <= 1e-10).all()


@pytest.mark.parametrize("strain", [0.01, 0.033, 0.1])
def test_the_curve_of_a_tendon_scales_with_its_strain(strain):
    share = np.linspace(-0.2, 1.5, 50)
    force, same = (MILLARD.tendon_force_length(1 + share * each, each) for each in (strain, STRAIN))
    np.testing.assert_allclose(force, same, rtol=0, atol=1e-12)


def test_machine_code_and_jax_have_the_functions_of_python():
    numbers, rows = np.random.default_rng(0), 60
    active, length = numbers.uniform(0, 1, rows), numbers.uniform(0.22, 0.31, rows)
    active[:20] = 0.0  # of which those of short muscles have neither a passive force nor a tight tendon
    held = (0.1, 0.2, 0.3, 10.0, 0.1, MILLARD.tendon_stiffness(STRAIN))
    plain, compiled, traced = with_curves("millard"), compiled_hill("millard"), hill_in_jax("millard")
    rest, fast = (
        np.array([law.steady_fiber(*row, 0.0, *held) for row in zip(active, length, strict=True)])
        for law in (plain, compiled)
    )
    np.testing.assert_allclose(fast, rest, rtol=0, atol=1e-12)
    moving = (rest * numbers.uniform(0.98, 1.02, rows), active, active, length, numbers.uniform(-0.3, 0.3, rows))
    new = [plain.next_fiber(*map(float, row), 0.001, *held) for row in zip(*moving, strict=True)]

    @jax.jit
    def both(*moving):
        return traced.steady_fiber(moving[1], moving[3], 0.0, *held), traced.next_fiber(*moving, 0.001, *held)

    single, later = both(*moving)
    np.testing.assert_allclose(single, rest, rtol=0, atol=1e-3)  # in a toe a length makes hardly any force
    np.testing.assert_allclose(later, new, rtol=0, atol=2e-6)


def test_a_fiber_without_force_has_the_greatest_length_of_those_in_balance():
    held = (0.1, 0.2, 0.0, 10.0, 0.1, MILLARD.tendon_stiffness(STRAIN))
    steady = compiled_hill("millard").steady_fiber
    assert steady(0.0, 0.31, 0.0, *held) > 1.0  # tendon and fiber pull on each other
    assert steady(0.0, 0.25, 0.0, *held) == pytest.approx(1.0, abs=1e-3)  # the tendon is slack, the fiber just so
    assert steady(0.0, 0.07, 0.0, *held) == pytest.approx(0.7)  # a path shorter than the fiber
    assert steady(0.5, 0.07, 0.0, *held) == pytest.approx(0.4441, abs=1e-3)  # where the active force ends


def test_every_setting_knows_the_curves():
    for kind in (Hill, Hopper, Mjcf):
        assert get_args(get_type_hints(kind)["curves"]) == tuple(CURVES)
    model = Mjcf("arm6", muscle_model="hill", curves="millard").model
    assert (model.actuator_biasprm[:, 7] == 1).all()
    with pytest.raises(ValueError, match="unknown curves 'milard': did you mean 'millard'"):
        hill_curves("milard")
    assert bodies.hill_of(Mjcf("arm6").model, 0, curves="millard").curves == "millard"
