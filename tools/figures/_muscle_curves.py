"""The curves of Hill-type muscles written out anew from their sources, to check the library's: scalars, and slow."""

import itertools
import math
from collections.abc import Callable
from typing import NamedTuple

from scipy.optimize import root_scalar

Elbow = list[tuple[float, float]]
"""The six control points of a quintic Bézier curve."""


class Curves(NamedTuple):
    """Four curves: of a length, a length, a velocity, and of a tendon's length and its strain at the greatest force."""

    active: Callable[[float], float]
    passive: Callable[[float], float]
    velocity: Callable[[float], float]
    tendon: Callable[[float, float], float]


BELLS = (
    (0.8150671134243542, 1.055033428970575, 0.162384573599574, 0.063303448465465),
    (0.433004984392647, 0.716775413397760, -0.029947116970696, 0.200356847296188),
    (0.1, 1.0, 0.353553390593274, 0.0),
)
"""As OpenSim has them."""


def _bells(length: float) -> float:
    return sum(b1 * math.exp(-0.5 * ((length - b2) / (b3 + b4 * length)) ** 2) for b1, b2, b3, b4 in BELLS)


def _exponential(length: float) -> float:
    offset = math.exp(4 * (0.2 - 1) / 0.6)
    return (math.exp(4 * (length - 1) / 0.6) - offset) / (math.exp(4) - offset)


def _hyperbolic(velocity: float) -> float:
    return -0.3211346127989808 * math.asinh(-8.149 * velocity - 0.374) + 0.8825327733249912


def _stiffening(length: float, strain: float) -> float:
    return 0.2 * math.exp(math.log(6) / strain * (length - 1)) - 0.2


def _chain(*joints: tuple[float, float, float], curviness: tuple[float, ...]) -> list[Elbow]:
    """Elbows through points with given slopes."""
    found = []
    for (x0, y0, slope0), (x1, y1, slope1), bend in zip(joints, joints[1:], curviness, strict=False):
        corner = (y0 - slope0 * x0 - y1 + slope1 * x1) / (slope1 - slope0)
        height = y0 + slope0 * (corner - x0)
        share = 0.1 + 0.8 * bend
        near = (x0 + share * (corner - x0), y0 + share * (height - y0))
        far = (x1 + share * (corner - x1), y1 + share * (height - y1))
        found.append([(x0, y0), near, near, far, far, (x1, y1)])
    return found


def _at(elbow: Elbow, u: float) -> tuple[float, float]:
    """A point of a Bézier curve, by De Casteljau's rule."""
    while len(elbow) > 1:
        elbow = [(a + u * (c - a), b + u * (d - b)) for (a, b), (c, d) in itertools.pairwise(elbow)]
    return elbow[0]


def _along(chain: list[Elbow], x: float) -> float:
    """The height of a chain at x; straight beyond its ends."""
    for end, beside in ((chain[0][0], chain[0][1]), (chain[-1][5], chain[-1][4])):
        if (x < end[0]) if end is chain[0][0] else (x > end[0]):
            return end[1] + (x - end[0]) * (beside[1] - end[1]) / (beside[0] - end[0])
    elbow = next(each for each in chain if x <= each[5][0])
    if x in (elbow[0][0], elbow[5][0]):
        return dict((elbow[0], elbow[5]))[x]
    u = root_scalar(lambda u: _at(elbow, u)[0] - x, bracket=(0.0, 1.0), method="brentq", xtol=1e-15, rtol=1e-14).root
    return _at(elbow, u)[1]


KNEE = 1 - 0.8616 * (0.95 - 0.73)
ACTIVE = _chain(
    (0.4441, 0, 0),
    ((0.4441 + 0.73) / 2, KNEE / 2, 1.25 * KNEE / (0.73 - 0.4441)),
    ((0.73 + 0.95) / 2, (1 + KNEE) / 2, 0.8616),
    (1, 1, 0),
    ((1.05 + 1.8123) / 2, 0.5, -1 / (1.8123 - 0.05 - 1.05)),
    (1.8123, 0, 0),
    curviness=(1, 1, 1, 1, 1),
)
PASSIVE = _chain((1, 0, 0), (1.035, 0.2 * 0.0175, 0.2), (1.7, 1, 2 / 0.7), curviness=(0.75, 0.75))
VELOCITY = _chain(
    (-1, 0, 0), (-0.9, 0.0125, 0.25), (0, 1, 5), (0.9, 1.3925, 0.15), (1, 1.4, 0), curviness=(0.6, 0.6, 0.9, 0.9)
)


def tendon_chain(strain: float) -> list[Elbow]:
    """Millard's curve of a tendon."""
    stiffness = 1.375 / strain
    toe = 1 + strain - (1 / 3) / stiffness
    middle = 1 + strain - (2 / 3) / stiffness
    foot = 1 + (toe - 1) / 10
    slope = (1 / 3) / (middle - foot)
    control = (foot + middle) / 2
    joints = ((1, 0, 0), (control, slope * (control - foot), slope), (toe, 2 / 3, stiffness))
    return _chain(*joints, curviness=(0.5, 0.5))


PUBLISHED = {
    "de-groote": Curves(_bells, _exponential, _hyperbolic, _stiffening),
    "millard": Curves(
        lambda length: _along(ACTIVE, length),
        lambda length: _along(PASSIVE, length),
        lambda velocity: _along(VELOCITY, velocity),
        lambda length, strain: _along(tendon_chain(strain), length),
    ),
}
