"""The curves of a Hill-type muscle (De Groote, Kinney, Rao & Fregly, 2016), each with its slope.

A curve is written once: numba compiles these functions for the physics, NumPy evaluates them in tests and figures, and
TimLab's blocks run them with JAX's NumPy. So they use nothing but arithmetic and functions that all three have.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from motorgrad._arrays import Real

ACTIVE = (
    (0.8150671134243542, 1.055033428970575, 0.162384573599574, 0.063303448465465),
    (0.433004984392647, 0.716775413397760, -0.029947116970696, 0.200356847296188),
    (0.1, 1.0, 0.353553390593274, 0.0),
)
"""Height, centre, width and widening of the three bells of the active force–length curve."""
VELOCITY = (-0.3211346127989808, -8.149, -0.374, 0.8825327733249912)
"""d1 to d4 of the force–velocity curve."""
TENDON = (0.2, 1.0, 0.2)
"""c1 to c3 of the tendon's curve."""
MIN_FIBER_LENGTH = 0.2
"""The length at which the passive force is 0, as a multiple of the optimal length; no fiber is shorter."""
_PASSIVE_SHAPE = 4.0
_PASSIVE_STRAIN = 0.6
STRAIN = 0.049
"""The strain of a tendon at the greatest isometric force, as in OpenSim."""
_MAX_EXPONENT = 200.0  # so that a tendon that is torn apart pulls with a huge force, and not an infinite one


def active_force_length(length: Real, coefficients: Sequence[Sequence[float]] = ACTIVE) -> Any:
    r"""The active force of a fiber that neither shortens nor lengthens, at full activation.

    $$f_L(\tilde l) = \sum_{i=1}^3 b_{1i}
      \exp\left(-\frac12 \left(\frac{\tilde l - b_{2i}}{b_{3i} + b_{4i} \tilde l}\right)^2\right)$$

    **Arguments** (numbers or arrays):

    - `length`: $\tilde l$, the fiber's length as a multiple of its optimal length.
    - `coefficients`: three rows of $b_{1i}$ to $b_{4i}$.

    **Returns:** the force as a multiple of the greatest isometric force.

    Source: De Groote et al. (2016). The coefficients are those of the authors' program, with $b_{11}$ as in OpenSim's
    `DeGrooteFregly2016Muscle`, so that the curve is 1 at the optimal length.
    """
    return active_tangent(length, coefficients)[0]


def passive_force_length(length: Real, least: Real = MIN_FIBER_LENGTH) -> Any:
    r"""The force of a passive fiber.

    $$f_P(\tilde l) = \frac{e^{k_P (\tilde l - 1) / e_0} - e^{k_P (\tilde l_0 - 1) / e_0}}
      {e^{k_P} - e^{k_P (\tilde l_0 - 1) / e_0}}, \qquad k_P = 4,\ e_0 = 0.6$$

    **Arguments** (numbers or arrays):

    - `length`: $\tilde l$, the fiber's length as a multiple of its optimal length.
    - `least`: $\tilde l_0$, where the force is 0. It is 1 in De Groote et al., so that a shorter fiber pushes; by
      default 0.2, as in OpenSim, so that it never does.

    **Returns:** the force as a multiple of the greatest isometric force.
    """
    return passive_tangent(length, _passive(least))[0]


def force_velocity(velocity: Real, coefficients: Sequence[float] = VELOCITY) -> Any:
    r"""The factor by which the velocity of a fiber changes its active force.

    $$f_V(\tilde v) = d_1 \ln\left(d_2 \tilde v + d_3 + \sqrt{(d_2 \tilde v + d_3)^2 + 1}\right) + d_4$$

    **Arguments** (numbers or arrays):

    - `velocity`: $\tilde v$, as a multiple of the greatest velocity of contraction; negative while the fiber shortens.
    - `coefficients`: $d_1$ to $d_4$.

    **Returns:** the factor: 0 at −1, 1 at 0.

    Source: De Groote et al. (2016), with $d_1$ and $d_4$ as in OpenSim's `DeGrooteFregly2016Muscle`; with those of the
    paper the curve misses both points by some thousandths.
    """
    return velocity_tangent(velocity, coefficients)[0]


def tendon_force_length(length: Real, strain: Real = STRAIN, coefficients: Sequence[float] = TENDON) -> Any:
    r"""The force of a tendon.

    $$f_T(\tilde l_T) = c_1 e^{k_T (\tilde l_T - c_2)} - c_3, \qquad
      k_T = \frac{\ln((1 + c_3) / c_1)}{1 + e_T - c_2}$$

    **Arguments** (numbers or arrays):

    - `length`: $\tilde l_T$, the tendon's length as a multiple of its slack length.
    - `strain`: $e_T$, the strain at the greatest isometric force.
    - `coefficients`: $c_1$ to $c_3$. Those of the paper are 0.2, 0.995 and 0.25, with $k_T = 35$, where $e_T$ = 0.0474;
      by default 0.2, 1 and 0.2, as in OpenSim, so that the force is 0 at the slack length.

    **Returns:** the force as a multiple of the greatest isometric force; negative for a tendon that is shorter, which a
    muscle takes for 0.

    Source: De Groote et al. (2016); OpenSim's `DeGrooteFregly2016Muscle`.
    """
    return tendon_tangent(length, tendon_stiffness(strain, coefficients), coefficients)[0]


def active_tangent(length: Real, coefficients: Sequence[Sequence[float]] = ACTIVE) -> tuple[Any, Any]:
    """The active force at a length, and its slope."""
    value = 0.0
    slope = 0.0
    for height, centre, width, widening in coefficients:
        under = width + widening * length
        part = (length - centre) / under
        bell = height * np.exp(-0.5 * part * part)
        value = value + bell
        slope = slope - bell * part * (width + widening * centre) / (under * under)
    return value, slope


def _passive(least: Real) -> tuple[Any, Any, Any]:
    """What `passive_tangent` needs, for a curve that is 0 at a length."""
    rate = _PASSIVE_SHAPE / _PASSIVE_STRAIN
    offset = np.exp(rate * (least - 1.0))
    return rate, offset, 1.0 / (math.exp(_PASSIVE_SHAPE) - offset)


PASSIVE = tuple(map(float, _passive(MIN_FIBER_LENGTH)))


def passive_tangent(length: Real, coefficients: Sequence[float] = PASSIVE) -> tuple[Any, Any]:
    """The passive force at a length, and its slope."""
    rate, offset, scale = coefficients
    rise = np.exp(np.minimum(rate * (length - 1.0), _MAX_EXPONENT))
    return scale * (rise - offset), scale * rate * rise


def velocity_tangent(velocity: Real, coefficients: Sequence[float] = VELOCITY) -> tuple[Any, Any]:
    """The factor at a velocity, and its slope."""
    d1, d2, d3, d4 = coefficients
    inner = d2 * velocity + d3
    root = np.sqrt(inner * inner + 1.0)
    # the logarithm is odd in `inner`, which is used against cancellation
    return d1 * np.copysign(np.log(np.abs(inner) + root), inner) + d4, d1 * d2 / root


def tendon_stiffness(strain: Real, coefficients: Sequence[float] = TENDON) -> Any:
    """The exponent $k_T$ of a tendon that has a strain at the greatest isometric force."""
    c1, c2, c3 = coefficients
    return math.log((1.0 + c3) / c1) / (1.0 + strain - c2)


def tendon_tangent(length: Real, stiffness: Real, coefficients: Sequence[float] = TENDON) -> tuple[Any, Any]:
    """The force of a tendon at a length, and its slope."""
    c1, c2, c3 = coefficients
    rise = c1 * np.exp(np.minimum(stiffness * (length - c2), _MAX_EXPONENT))
    return rise - c3, stiffness * rise
