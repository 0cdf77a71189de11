"""The closed formula of the wrapped path, by itself and against MuJoCo."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorgrad import bodies
from motorgrad.bodies import Hopper

DISTANCE, RADIUS = 0.12, 0.04
geometry = st.tuples(st.floats(0.05, 0.3), st.floats(0.05, 0.3), st.floats(0.01, 0.049))


@pytest.mark.parametrize(("muscle", "behind"), [("flexor", False), ("extensor", True)])
@pytest.mark.parametrize("side", ["left", "right"])
def test_length_and_rate_are_those_of_mujoco(muscle, behind, side):
    model = bodies.compile_model(Hopper())
    data = mujoco.MjData(model)
    tendon = model.tendon(f"{muscle}_{side}").id
    for degrees in np.arange(36.0, 176.0, 1.3):
        interior, rate = np.radians(degrees), 3.1
        knee = interior - np.pi / 2
        data.qpos[:] = (0.1, -knee / 2, knee, -knee / 2, -knee / 2, knee)
        data.qvel[:] = (0.0, -rate / 2, rate, -rate / 2, -rate / 2, rate)
        mujoco.mj_forward(model, data)
        theta = bodies.away_angle(interior, behind)
        velocity = rate if behind else -rate
        length = bodies.wrapped_length(theta, DISTANCE, DISTANCE, RADIUS)
        speed = bodies.wrapped_rate(theta, velocity, DISTANCE, DISTANCE, RADIUS)
        assert data.ten_length[tendon] == pytest.approx(length, abs=1e-12)
        assert data.ten_velocity[tendon] == pytest.approx(speed, abs=1e-11)


def test_flexor_starts_to_wrap_at_141_degrees():
    critical = bodies.wrapping_angle(DISTANCE, DISTANCE, RADIUS)
    assert np.degrees(2 * np.pi - critical) == pytest.approx(141.06, abs=0.01)
    # the extensor always wraps: no interior angle reaches the critical one
    assert critical > np.pi


@given(geometry, st.floats(-1e-7, 1e-7))
def test_length_and_rate_are_continuous_where_wrapping_starts(shape, step):
    critical = bodies.wrapping_angle(*shape)
    at, near = (bodies.wrapped_length(critical + d, *shape) for d in (0.0, step))
    assert near == pytest.approx(at - shape[2] * step, abs=1e-12)
    rate = bodies.wrapped_rate(critical + step, 1.0, *shape)
    assert rate == pytest.approx(-shape[2], abs=1e-6)


@given(geometry, st.floats(0.1, 2 * np.pi - 0.1))
def test_rate_is_the_derivative_of_length(shape, angle):
    h = 1e-6
    difference = (bodies.wrapped_length(angle + h, *shape) - bodies.wrapped_length(angle - h, *shape)) / (2 * h)
    assert bodies.wrapped_rate(angle, 1.0, *shape) == pytest.approx(difference, abs=1e-6)


@given(geometry, st.floats(0.2, np.pi - 0.05), st.booleans(), st.floats(0, 6.0))
def test_drawn_path_has_the_formula_s_length(shape, interior, behind, turned):
    origin_distance, insertion_distance, radius = shape

    def at(angle, distance):
        return np.array((1.0, 2.0, 3.0)) + distance * np.array((np.cos(angle + turned), 0.0, np.sin(angle + turned)))

    centre = at(0.0, 0.0)
    middle = interior / 2 + (np.pi if behind else 0.0)
    points = bodies.path_points(
        at(0.0, origin_distance), at(interior, insertion_distance), centre, radius, at(middle, 0.06), arc_points=400
    )
    drawn = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert drawn == pytest.approx(bodies.wrapped_length(bodies.away_angle(interior, behind), *shape), abs=1e-5)
    assert np.linalg.norm(points - centre, axis=1).min() > radius * (1 - 1e-9)


def test_bad_geometry_is_refused():
    with pytest.raises(ValueError, match=r"origin_distance = 0.03: must be at least the capsule's radius 0.04"):
        bodies.wrapped_length(1.0, 0.03, 0.1, 0.04)
    with pytest.raises(ValueError, match=r"radius = 0\.0"):
        bodies.wrapped_length(1.0, 0.03, 0.1, 0.0)
    with pytest.raises(ValueError, match="arc_points = 1"):
        bodies.path_points((1, 0, 0), (0, 0, 1), (0, 0, 0), 0.1, (1, 0, 1), arc_points=1)
