"""The dynamics of a Hill-type muscle: activation, and a fiber in balance with its tendon.

Lengths of fibers are multiples of the optimal length. Numba compiles these functions for the physics; see
`_hill_curves`. Here they have the curves of De Groote et al.; `with_curves` gives them others.
"""

import math
from typing import Any

import numpy as np

from motorgrad._arrays import Real
from motorgrad.bodies.muscles._hill_curves import (
    MIN_FIBER_LENGTH,
    active_tangent,
    passive_tangent,
    tendon_tangent,
    velocity_tangent,
)

_Muscle = tuple[Real, Real, Real, Real]
_Curves = tuple[Real, Real, Real, Real, Real]
_STEEPEST = math.sin(math.acos(0.1))  # the sine of the greatest pennation angle: such a fiber shortens no further
# of the velocity, in the last step of Newton's method, which squares it
_CLOSE = 1e-3
_STILL = 1e-10
_TRIES = 400
_SLOW = 1e-6


def next_activation(activation: Real, excitation: Real, seconds: Real, rise: Real, fall: Real) -> Any:
    r"""The activation after some time at a constant excitation.

    $$\dot a = (u - a) \cdot \begin{cases} 1 / (\tau_a (0.5 + 1.5 a)) & u > a \\
      (0.5 + 1.5 a) / \tau_d & \text{otherwise}\end{cases}$$

    The exponential midpoint rule: of second order, and it never passes the excitation.

    **Arguments:** $a$ and $u$, from 0 to 1; the time in s; $\tau_a$ and $\tau_d$ in s.

    Source: Thelen (2003); Millard et al. (2013).
    """
    target = np.minimum(np.maximum(excitation, 0.0), 1.0)
    now = np.minimum(np.maximum(activation, 0.0), 1.0)
    half = target + (now - target) * np.exp(-0.5 * seconds * activation_rate(now, target, rise, fall))
    return target + (now - target) * np.exp(-seconds * activation_rate(half, target, rise, fall))


def activation_rate(activation: Real, excitation: Real, rise: Real, fall: Real) -> Any:
    """How fast activation approaches the excitation, in 1/s."""
    ease = 0.5 + 1.5 * activation
    up = excitation > activation
    return up / (rise * ease) + (1.0 - up) * ease / fall


def rigid_tension(
    activation: Real,
    length: Real,
    velocity: Real,
    strength: Real,
    optimal: Real,
    slack: Real,
    pennation: Real,
    fastest: Real,
    damping: Real,
) -> Any:
    """The tension in N of a muscle with a rigid tendon; 0 where the path is too short for it.

    **Arguments:** activation; length of the path in m and its rate in m/s; then the numbers of a `Hill` in its order.
    """
    height = np.sin(pennation)
    along = np.maximum((length - slack) / optimal, 1e-9)
    fiber = np.sqrt(along * along + height * height)
    cosine = along / fiber
    speed = velocity * cosine / (optimal * fastest)
    active = active_tangent(fiber)[0]
    passive = passive_tangent(fiber)[0]
    inner = activation * active * velocity_tangent(speed)[0] + passive + damping * speed
    return strength * (fiber > shortest_fiber(height)) * np.maximum(cosine * inner, 0.0)


def compliant_tension(
    fiber: Real, length: Real, strength: Real, optimal: Real, slack: Real, pennation: Real, stiffness: Real
) -> Any:
    """The tension in N of a muscle whose tendon stretches: that of the tendon, and 0 while it is slack.

    **Arguments:** the fiber's length; that of the path in m; then numbers of a `Hill`.
    """
    stretch = tendon_length(fiber, length, optimal, pennation) / slack
    return strength * np.maximum(tendon_tangent(stretch, stiffness)[0], 0.0)


def tendon_length(fiber: Real, length: Real, optimal: Real, pennation: Real) -> Any:
    """What a fiber leaves of a path to the tendon, in m."""
    height = np.sin(pennation)
    return length - optimal * np.sqrt(np.maximum(fiber * fiber - height * height, 0.0))


def shortest_fiber(height: Real) -> Any:
    """The least length of a fiber whose pennation keeps its `height`."""
    return np.maximum(MIN_FIBER_LENGTH, height / _STEEPEST)


def next_fiber(
    fiber: Real,
    activation: Real,
    later: Real,
    length: Real,
    velocity: Real,
    seconds: Real,
    optimal: Real,
    slack: Real,
    pennation: Real,
    fastest: Real,
    damping: Real,
    stiffness: Real,
) -> Any:
    r"""The length of a fiber after a time step.

    Fiber and tendon are in balance at each moment, which is an implicit equation for the fiber's velocity:

    $$\left(a f_L(\tilde l) f_V(\tilde v) + f_P(\tilde l) + \beta \tilde v\right) \cos\alpha = f_T(\tilde l_T)$$

    The equation is stiff: a fiber that is hardly active follows its tendon within a fraction of a millisecond. So the
    step is implicit, $l_1 = l_0 + h v(l_0 + \theta (l_1 - l_0))$, with $\theta = (1 + z) / (2 + z)$, where $z$ is the
    step times the rate at which the fiber would approach balance. A disturbance then decays by $1 / (1 + z + z^2 / 2)$,
    the Padé approximation of $e^{-z}$: the method is of second order and L-stable. Within a step, the fiber's own
    force–length curves are replaced by their tangents, which keeps the order.

    **Arguments:** the fiber's length; its activation now and after the step; length of the path in m and its rate in
    m/s; the step in s; then numbers of a `Hill`.

    Source: the damped equilibrium of Millard et al. (2013).
    """
    height = np.sin(pennation)
    grip = optimal / slack
    path = length / optimal
    drift = velocity * seconds / optimal
    reach = seconds * fastest
    at = np.maximum(fiber, shortest_fiber(height))
    muscle = (grip, height, damping, stiffness)
    curves = (at, *active_tangent(at), *passive_tangent(at))
    excess, by_length, by_speed, by_path = balance(at, 0.0, activation, path, muscle, curves)
    # z is `stiff` / `by_speed`, whose denominator may be 0
    stiff = np.maximum(reach * by_length, 1e-12)
    theta = (by_speed + stiff) / (2.0 * by_speed + stiff)
    pace = 1.0 / (theta * reach)
    guess = at - (excess + by_path * theta * drift) / _not_zero(by_length + by_speed * pace)
    level = activation + theta * (later - activation)
    within = balanced(guess, at, pace, level, path + theta * drift, muscle, curves)
    return np.maximum(at + (within - at) / theta, shortest_fiber(height))


def steady_fiber(
    activation: Real,
    length: Real,
    velocity: Real,
    optimal: Real,
    slack: Real,
    pennation: Real,
    fastest: Real,
    damping: Real,
    stiffness: Real,
) -> Any:
    """The length of a fiber whose tendon is at rest: in balance with it while the path changes at a constant rate, or
    not at all; the longest where there are several.

    **Arguments:** activation; length of the path in m and its rate in m/s; then numbers of a `Hill`.
    """
    height = np.sin(pennation)
    path = length / optimal
    muscle = (optimal / slack, height, damping, stiffness)
    now = min(max(activation, 0.0), 1.0)
    low, high = bracket(path, height)
    fiber = high
    for number in range(_TRIES):
        curves = (fiber, *active_tangent(fiber), *passive_tangent(fiber))
        # the velocity, (fiber − base) · pace, is given: it hardly depends on the length at so slow a pace
        speed = velocity * np.sqrt(1.0 - (height / fiber) ** 2) / (optimal * fastest)
        new, low, high, flat = newton(fiber, low, high, fiber - speed / _SLOW, _SLOW, now, path, muscle, curves)
        if number % 8 == 7 or flat:  # Newton's method is slow where a tendon is stretched far
            new = 0.5 * (low + high)
        moved = abs(new - fiber)
        fiber = new
        if moved < _STILL:
            break
    return fiber


def balanced(
    guess: Real, base: Real, pace: Real, activation: Real, path: Real, muscle: _Muscle, curves: _Curves
) -> Any:
    """The length l of a fiber in balance whose velocity is (l − base) · pace, by Newton's method within a bracket."""
    low, high = bracket(path, muscle[1])
    fiber = min(max(guess, low), high)
    for number in range(_TRIES):
        new, low, high, _ = newton(fiber, low, high, base, pace, activation, path, muscle, curves)
        if number % 8 == 7:  # Newton's method is slow where a tendon is stretched far
            new = 0.5 * (low + high)
        moved = abs(new - fiber)
        fiber = new
        if moved * pace < _CLOSE:
            break
    return fiber


def bracket(path: Real, height: Real) -> tuple[Any, Any]:
    """The least length of a fiber, and that of one that leaves nothing of the path to the tendon."""
    low = shortest_fiber(height)
    whole = np.maximum(path, 0.0)
    return low, np.maximum(np.sqrt(whole * whole + height * height), low)


def newton(
    fiber: Real,
    low: Real,
    high: Real,
    base: Real,
    pace: Real,
    activation: Real,
    path: Real,
    muscle: _Muscle,
    curves: _Curves,
) -> tuple[Any, Any, Any, Any]:
    """One step of Newton's method towards balance, or of bisection where that leaves the bracket. Returns the new
    length and bracket, and whether the length is in balance with all lengths about it: where neither fiber nor tendon
    has a force.

    **Arguments:**

    - `fiber`, `low`, `high`: the length, and the bracket.
    - `base`, `pace`: the fiber's velocity is (fiber − base) · pace.
    - `activation`, `path`, `muscle`, `curves`: as in `balance`.
    """
    excess, by_length, by_speed, _ = balance(fiber, (fiber - base) * pace, activation, path, muscle, curves)
    # choices by factors of 0 and 1, which are exact
    long = 1.0 * (excess > 0.0)
    high = long * fiber + (1.0 - long) * high
    low = long * low + (1.0 - long) * fiber
    new = fiber - excess / _not_zero(by_length + by_speed * pace)
    inside = 1.0 * ((new >= low) & (new <= high))
    flat = (excess == 0.0) & (by_length == 0.0)
    return inside * new + (1.0 - inside) * 0.5 * (low + high), low, high, flat


def _not_zero(slope: Real) -> Any:
    """A slope to divide by. It is 0 for a fiber without force and damping; any length will do then."""
    return slope + 1.0 * (slope == 0.0)


def balance(
    fiber: Real, speed: Real, activation: Real, path: Real, muscle: _Muscle, curves: _Curves
) -> tuple[Any, Any, Any, Any]:
    """By how much the force of a fiber, along the tendon, exceeds the tendon's; and its derivatives by the length and
    the speed of the fiber, and by the length of the path.

    **Arguments:**

    - `fiber`, `speed`: as multiples of the optimal length and of the greatest velocity.
    - `activation`; `path`: its length as a multiple of the optimal length.
    - `muscle`: optimal fiber length by tendon slack length, sine of the pennation angle, damping, the tendon's
      stiffness.
    - `curves`: a length, and there the active force and its slope, and the passive force and its slope.
    """
    grip, height, damping, stiffness = muscle
    at, active, active_slope, passive, passive_slope = curves
    along = np.sqrt(fiber * fiber - height * height)
    inverse = 1.0 / fiber
    cosine = along * inverse
    away = fiber - at
    factor, factor_slope = velocity_tangent(speed)
    drive = activation * (active + active_slope * away)
    force = drive * factor + passive + passive_slope * away + damping * speed
    pull, pull_slope = tendon_tangent((path - along) * grip, stiffness)
    taut = pull > 0.0
    by_path = -1.0 * taut * pull_slope * grip
    # cos α and the tendon's length change with the fiber's: by sin² α / along, and by −1 / cos α
    bent = force * height * height * inverse * inverse - by_path * fiber
    by_length = cosine * (activation * active_slope * factor + passive_slope) + bent / along
    return cosine * force - taut * pull, by_length, cosine * (drive * factor_slope + damping), by_path


FUNCTIONS = (
    activation_rate,
    next_activation,
    shortest_fiber,
    rigid_tension,
    tendon_length,
    compliant_tension,
    bracket,
    _not_zero,
    balance,
    newton,
    balanced,
    next_fiber,
    steady_fiber,
)
"""All functions of this file, each after those that it calls; the curves come before."""
