"""The dynamics of a Hill-type muscle: activation, and a fiber in balance with its tendon.

Lengths of fibers are multiples of the optimal length. Numba compiles these functions for the physics; see
`_hill_curves`.
"""

import math
from typing import Any

import numpy as np

from motorgrad.bodies.muscles._hill_curves import (
    SHORTEST,
    active_tangent,
    passive_tangent,
    tendon_tangent,
    velocity_tangent,
)

_STEEPEST = math.sin(math.acos(0.1))  # the sine of the greatest pennation angle: such a fiber shortens no further
_STAGE = 1.0 - math.sqrt(0.5)  # with it, the implicit method of two stages is of second order and L-stable
_CLOSE = 1e-3  # of the velocity, in the last step of Newton's method, which squares it
_STILL = 1e-10
_TRIES = 100
_LONG = 1e6


def next_activation(activation: Any, excitation: Any, seconds: Any, rise: Any, fall: Any) -> Any:
    r"""The activation after some time at a constant excitation.

    $$\dot a = (u - a) \cdot \begin{cases} 1 / (\tau_a (0.5 + 1.5 a)) & u > a \\
      (0.5 + 1.5 a) / \tau_d & \text{otherwise}\end{cases}$$

    The exponential midpoint rule: of second order, and it never passes the excitation.

    **Arguments:** $a$ and $u$, from 0 to 1; the time in s; $\tau_a$ and $\tau_d$ in s.

    Source: Thelen (2003); Millard et al. (2013).
    """
    target, now = np.minimum(np.maximum(excitation, 0.0), 1.0), np.minimum(np.maximum(activation, 0.0), 1.0)
    half = target + (now - target) * np.exp(-0.5 * seconds * activation_rate(now, target, rise, fall))
    return target + (now - target) * np.exp(-seconds * activation_rate(half, target, rise, fall))


def activation_rate(activation: Any, excitation: Any, rise: Any, fall: Any) -> Any:
    """How fast activation approaches the excitation, in 1/s."""
    ease, up = 0.5 + 1.5 * activation, excitation > activation
    return up / (rise * ease) + (1.0 - up) * ease / fall


def rigid_tension(
    activation: Any,
    length: Any,
    velocity: Any,
    strength: Any,
    optimal: Any,
    slack: Any,
    pennation: Any,
    fastest: Any,
    damping: Any,
) -> Any:
    """The tension in N of a muscle with a rigid tendon; 0 where the path is too short for it.

    **Arguments:** activation; length of the path in m and its rate in m/s; then the numbers of a `Hill` in its order.
    """
    height = np.sin(pennation)
    along = np.maximum((length - slack) / optimal, 1e-9)
    fiber = np.sqrt(along * along + height * height)
    cosine = along / fiber
    speed = velocity * cosine / (optimal * fastest)
    active, passive = active_tangent(fiber)[0], passive_tangent(fiber)[0]
    inner = activation * active * velocity_tangent(speed)[0] + passive + damping * speed
    return strength * (fiber > shortest_fiber(height)) * np.maximum(cosine * inner, 0.0)


def compliant_tension(
    fiber: Any, length: Any, strength: Any, optimal: Any, slack: Any, pennation: Any, stiffness: Any
) -> Any:
    """The tension in N of a muscle whose tendon stretches: that of the tendon, and 0 while it is slack.

    **Arguments:** the fiber's length; that of the path in m; then numbers of a `Hill`.
    """
    stretch = tendon_length(fiber, length, optimal, pennation) / slack
    return strength * np.maximum(tendon_tangent(stretch, stiffness)[0], 0.0)


def tendon_length(fiber: Any, length: Any, optimal: Any, pennation: Any) -> Any:
    """What a fiber leaves of a path to the tendon, in m."""
    height = np.sin(pennation)
    return length - optimal * np.sqrt(np.maximum(fiber * fiber - height * height, 0.0))


def shortest_fiber(height: Any) -> Any:
    """The least length of a fiber whose pennation keeps its `height`."""
    return np.maximum(SHORTEST, height / _STEEPEST)


def next_fiber(
    fiber: Any,
    activation: Any,
    later: Any,
    length: Any,
    velocity: Any,
    seconds: Any,
    optimal: Any,
    slack: Any,
    pennation: Any,
    fastest: Any,
    damping: Any,
    stiffness: Any,
) -> Any:
    r"""The length of a fiber after a time step.

    Fiber and tendon are in balance at each moment, which is an implicit equation for the fiber's velocity:

    $$\left(a f_L(\tilde l) f_V(\tilde v) + f_P(\tilde l) + \beta \tilde v\right) \cos\alpha = f_T(\tilde l_T)$$

    The equation is stiff: a fiber that is hardly active follows its tendon within a fraction of a millisecond. So the
    step is implicit, by the two-stage Runge–Kutta method of second order that is L-stable (Alexander, 1977). Within a
    step, the fiber's own force–length curves are replaced by their tangents, which keeps the order.

    **Arguments:** the fiber's length; its activation now and after the step; length of the path in m and its rate in
    m/s; the step in s; then numbers of a `Hill`.

    Source: the damped equilibrium of Millard et al. (2013), with the curves of De Groote et al. (2016).
    """
    height, share = np.sin(pennation), slack / optimal
    path, drift = length / optimal, velocity / optimal
    at, time = np.maximum(fiber, shortest_fiber(height)), _STAGE * seconds * fastest
    muscle = (share, height, damping, stiffness)
    curves = (at, *active_tangent(at), *passive_tangent(at))
    early = path + _STAGE * seconds * drift
    first = balanced(at, at, time, activation + _STAGE * (later - activation), early, muscle, curves)
    moved = (first - at) / _STAGE
    base = at + (1.0 - _STAGE) * moved
    return balanced(at + moved, base, time, later, path + seconds * drift, muscle, curves)


def steady_fiber(
    activation: Any,
    length: Any,
    velocity: Any,
    optimal: Any,
    slack: Any,
    pennation: Any,
    fastest: Any,
    damping: Any,
    stiffness: Any,
) -> Any:
    """The length of a fiber whose tendon is at rest: in balance with it while the path changes at a constant rate, or
    not at all; the longest where there are several.

    **Arguments:** activation; length of the path in m and its rate in m/s; then numbers of a `Hill`.
    """
    height, path = np.sin(pennation), length / optimal
    muscle, now = (slack / optimal, height, damping, stiffness), min(max(activation, 0.0), 1.0)
    low, high = bracket(path, height)
    fiber = high
    for number in range(_TRIES):
        curves = (fiber, *active_tangent(fiber), *passive_tangent(fiber))
        # the velocity, (fiber − base) / time, is given: it does not depend on the length over so long a time
        speed = velocity * np.sqrt(1.0 - (height / fiber) ** 2) / (optimal * fastest)
        new, low, high = newton(fiber, low, high, fiber - speed * _LONG, _LONG, now, path, muscle, curves)
        if number % 4 == 3:  # Newton's method is slow where a tendon is stretched far
            new = 0.5 * (low + high)
        moved, fiber = abs(new - fiber), new
        if moved < _STILL:
            break
    return fiber


def balanced(guess: Any, base: Any, time: Any, activation: Any, path: Any, muscle: Any, curves: Any) -> Any:
    """The length l = base + time · v of a fiber in balance, by Newton's method within a bracket."""
    low, high = bracket(path, muscle[1])
    fiber = min(max(guess, low), high)
    for number in range(_TRIES):
        new, low, high = newton(fiber, low, high, base, time, activation, path, muscle, curves)
        if number % 4 == 3:  # Newton's method is slow where a tendon is stretched far
            new = 0.5 * (low + high)
        moved, fiber = abs(new - fiber), new
        if moved < _CLOSE * time:
            break
    return fiber


def bracket(path: Any, height: Any) -> tuple[Any, Any]:
    """The least length of a fiber, and that of one that leaves nothing of the path to the tendon."""
    low = shortest_fiber(height)
    whole = np.maximum(path, 0.0)
    return low, np.maximum(np.sqrt(whole * whole + height * height), low)


def newton(
    fiber: Any, low: Any, high: Any, base: Any, time: Any, activation: Any, path: Any, muscle: Any, curves: Any
) -> tuple[Any, Any, Any]:
    """One step of Newton's method towards balance, or of bisection where that leaves the bracket. Returns the new
    length and bracket.

    **Arguments:**

    - `fiber`, `low`, `high`: the length, and the bracket.
    - `base`, `time`: the fiber's velocity is (fiber − base) / time.
    - `activation`; `path`: its length as a multiple of the optimal length.
    - `muscle`: the tendon's slack length as such a multiple, sine of the pennation angle, damping,
      the tendon's stiffness.
    - `curves`: a length, and there the active force and its slope, and the passive force and its slope.
    """
    share, height, damping, stiffness = muscle
    at, active, active_slope, passive, passive_slope = curves
    along = np.sqrt(fiber * fiber - height * height)
    cosine, away, speed = along / fiber, fiber - at, (fiber - base) / time
    factor, factor_slope = velocity_tangent(speed)
    drive = activation * (active + active_slope * away)
    force = drive * factor + passive + passive_slope * away + damping * speed
    slope = activation * active_slope * factor + passive_slope + (drive * factor_slope + damping) / time
    pull, pull_slope = tendon_tangent((path - along) / share, stiffness)
    taut = pull > 0.0
    excess = cosine * force - taut * pull
    rate = cosine * slope + force * height * height / (along * fiber * fiber) + taut * pull_slope / (share * cosine)
    # choices by factors of 0 and 1, which are exact
    long = 1.0 * (excess > 0.0)
    high, low = long * fiber + (1.0 - long) * high, long * low + (1.0 - long) * fiber
    new = fiber - excess / rate
    inside = 1.0 * ((new >= low) & (new <= high))
    return inside * new + (1.0 - inside) * 0.5 * (low + high), low, high


FUNCTIONS = (
    active_tangent,
    passive_tangent,
    velocity_tangent,
    tendon_tangent,
    activation_rate,
    next_activation,
    shortest_fiber,
    rigid_tension,
    tendon_length,
    compliant_tension,
    bracket,
    newton,
    balanced,
    next_fiber,
    steady_fiber,
)
"""All of them, each after those that it calls."""
