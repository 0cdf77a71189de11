r"""The curves of a Hill-type muscle by Millard, Uchida, Seth & Delp (2013), each with its slope.

A curve is a chain of elbows. An elbow joins two points, at given slopes there, by a quintic Bézier curve whose six
control points are the two ends and, twice each, a point on the tangent of either end, at a share c of the way to the
corner where the tangents meet. So neighbours agree in value, slope and curvature. Outside, a curve goes on straight.

To evaluate a Bézier curve at x, one must solve x(u) = x. The physics would do that many times a step, so here each
curve becomes a table once: polynomials of degree 5 in x, on equal cells, which have the curve's value, slope and
curvature at both ends of a cell. They differ from the curve by less than 1e-8 in value and 1e-5 in slope, and are as
smooth as it is.

These functions run in numba, NumPy and JAX, as those of `_hill_curves`.
"""

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

from motorgrad._arrays import Real

_CELLS = 512
_HALVINGS = 60  # of an interval, until nothing is left of it in double precision
_U = Polynomial((0.0, 1.0))
_SHARES = (
    (1.0 - _U) ** 5,
    5.0 * _U * (1.0 - _U) ** 4 + 10.0 * _U**2 * (1.0 - _U) ** 3,
    10.0 * _U**3 * (1.0 - _U) ** 2 + 5.0 * _U**4 * (1.0 - _U),
    _U**5,
)
"""The Bernstein polynomials of degree 5, by control point; an elbow has the inner two twice."""


class _Joint(NamedTuple):
    """Where elbows meet."""

    x: float
    y: float
    slope: float


def _elbow(one: _Joint, other: _Joint, curviness: float) -> tuple[Polynomial, Polynomial]:
    """x(u) and y(u) of an elbow, for u from 0 to 1."""
    share = 0.1 + 0.8 * curviness
    corner = (other.y - one.y + one.x * one.slope - other.x * other.slope) / (one.slope - other.slope)
    inner = [share * (corner - each.x) for each in (one, other)]
    x = (one.x, one.x + inner[0], other.x + inner[1], other.x)
    y = (one.y, one.y + inner[0] * one.slope, other.y + inner[1] * other.slope, other.y)
    blended = [sum((p * b for p, b in zip(points, _SHARES, strict=True)), Polynomial((0.0,))) for points in (x, y)]
    return blended[0], blended[1]


def _table(joints: Sequence[_Joint], curviness: Sequence[float]) -> tuple[float, float, np.ndarray]:
    """A chain of elbows: where it begins, cells per unit, and six coefficients for each cell."""
    start = joints[0].x
    pace = _CELLS / (joints[-1].x - joints[0].x)
    knots = np.linspace(start, joints[-1].x, _CELLS + 1)
    found = np.empty((3, _CELLS + 1))
    for (one, other), bend in zip(itertools.pairwise(joints), curviness, strict=True):
        x, y = _elbow(one, other, bend)
        inside = (knots >= one.x) & (knots <= other.x)
        low = np.zeros(inside.sum())
        high = np.ones(inside.sum())
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            short = x(middle) < knots[inside]
            low = np.where(short, middle, low)
            high = np.where(short, high, middle)
        slope = y.deriv()(high) / x.deriv()(high)
        curvature = (y.deriv(2)(high) - slope * x.deriv(2)(high)) / x.deriv()(high) ** 2
        found[:, inside] = y(high), slope / pace, curvature / pace**2
    # an elbow is straight at its ends; not up to rounding, so that a curve that is 0 beyond them is 0
    found[:, 0], found[:, -1] = ((each.y, each.slope / pace, 0.0) for each in (joints[0], joints[-1]))
    (y0, y1), (s0, s1), (c0, c1) = ((each[:-1], each[1:]) for each in found)
    # what is left to the other end of the cell, in value, slope and curvature
    value = y1 - y0 - s0 - 0.5 * c0
    slope = s1 - s0 - c0
    curvature = c1 - c0
    last = (
        10.0 * value - 4.0 * slope + 0.5 * curvature,
        -15.0 * value + 7.0 * slope - curvature,
        6.0 * value - 3.0 * slope + 0.5 * curvature,
    )
    return start, pace, np.stack((y0, s0, 0.5 * c0, *last), axis=1).ravel()


def _active(
    shortest: float = 0.4441, transition: float = 0.73, longest: float = 1.8123, shallow: float = 0.8616
) -> tuple[float, float, np.ndarray]:
    """The active force–length curve: a steep and a shallow ascending limb, a shoulder and a descending limb."""
    half = 0.05  # of the width of the shoulder
    bend = 1.0 - shallow * (1.0 - half - transition)  # the force where the ascending limb becomes shallow
    joints = (
        _Joint(shortest, 0.0, 0.0),
        _Joint(0.5 * (shortest + transition), 0.5 * bend, 1.25 * bend / (transition - shortest)),
        _Joint(0.5 * (transition + 1.0 - half), 0.5 * (1.0 + bend), shallow),
        _Joint(1.0, 1.0, 0.0),
        _Joint(0.5 * (1.0 + half + longest), 0.5, -1.0 / (longest - 1.0 - 2.0 * half)),
        _Joint(longest, 0.0, 0.0),
    )
    return _table(joints, (1.0,) * 5)


def _passive(strain: float = 0.7, low_stiffness: float = 0.2, curviness: float = 0.75) -> tuple[float, float, Any]:
    """The passive force–length curve: 0 up to the optimal length, 1 at a strain."""
    stiffness = 2.0 / strain
    toe = 0.1 / stiffness
    joints = (
        _Joint(1.0, 0.0, 0.0),
        _Joint(1.0 + toe, 0.5 * toe * low_stiffness, low_stiffness),
        _Joint(1.0 + strain, 1.0, stiffness),
    )
    return _table(joints, (curviness,) * 2)


def _velocity(
    most: float = 1.4, shortening: float = 0.25, isometric: float = 5.0, lengthening: float = 0.15
) -> tuple[float, float, np.ndarray]:
    """The force–velocity curve: 0 at −1, 1 at 0, and the greatest force at 1; slopes of 0 at both ends, and given ones
    at −0.9, 0 and 0.9."""
    joints = (
        _Joint(-1.0, 0.0, 0.0),
        _Joint(-0.9, 0.05 * shortening, shortening),
        _Joint(0.0, 1.0, isometric),
        _Joint(0.9, most - 0.05 * lengthening, lengthening),
        _Joint(1.0, most, 0.0),
    )
    return _table(joints, (0.6, 0.6, 0.9, 0.9))


def _tendon(
    stiffness: float = 1.375, toe_force: float = 2.0 / 3.0, curviness: float = 0.5
) -> tuple[float, float, np.ndarray]:
    """The force of a tendon over its strain, as a multiple of that at the greatest isometric force, by which all of the
    curve scales: a toe, and a straight line."""
    toe = 1.0 + (toe_force - 1.0) / stiffness
    foot = 0.1 * toe
    middle = 1.0 + (0.5 * toe_force - 1.0) / stiffness
    slope = 0.5 * toe_force / (middle - foot)
    joints = (
        _Joint(0.0, 0.0, 0.0),
        _Joint(0.5 * (foot + middle), 0.25 * toe_force, slope),
        _Joint(toe, toe_force, stiffness),
    )
    return _table(joints, (curviness,) * 2)


ACTIVE = _active()
PASSIVE = _passive()
VELOCITY = _velocity()
TENDON = _tendon()


def tabulated(x: Real, start: float, pace: float, table: np.ndarray) -> tuple[Any, Any]:
    """A curve and its slope at x, straight beyond its ends."""
    place = (x - start) * pace
    # `fmax` and `fmin` make a place even of what is not a number, which the last line passes on
    inside = np.fmin(np.fmax(place, 0.0), _CELLS)
    cell = np.int32(np.fmin(inside, _CELLS - 1))
    at = inside - cell
    numbers = np.asarray(table)
    first = 6 * cell
    c0 = numbers[first]
    c1 = numbers[first + 1]
    c2 = numbers[first + 2]
    c3 = numbers[first + 3]
    c4 = numbers[first + 4]
    c5 = numbers[first + 5]
    value = c0 + at * (c1 + at * (c2 + at * (c3 + at * (c4 + at * c5))))
    slope = c1 + at * (2.0 * c2 + at * (3.0 * c3 + at * (4.0 * c4 + at * (5.0 * c5))))
    return value + slope * (place - inside), slope * pace


def active_tangent(length: Real) -> tuple[Any, Any]:
    """The active force at a length, and its slope."""
    return tabulated(length, *ACTIVE)


def passive_tangent(length: Real) -> tuple[Any, Any]:
    """The passive force at a length, and its slope."""
    return tabulated(length, *PASSIVE)


def velocity_tangent(velocity: Real) -> tuple[Any, Any]:
    """The factor at a velocity, and its slope."""
    return tabulated(velocity, *VELOCITY)


def tendon_stiffness(strain: Real) -> Any:
    """What `tendon_tangent` needs of a tendon that has a strain at the greatest isometric force: the inverse."""
    return 1.0 / strain


def tendon_tangent(length: Real, stiffness: Real) -> tuple[Any, Any]:
    """The force of a tendon at a length, and its slope."""
    force, slope = tabulated((length - 1.0) * stiffness, *TENDON)
    return force, slope * stiffness
