"""OLGARB as hand-written compiled loops, one per task: the yardstick for the library's general learner."""

from typing import Any

import numba
import numpy as np

single = np.float32
Number = np.floating
Flag = np.bool_
CAP = single(1 - 1e-6)


@numba.njit
def three_state_loop(
    steps: int,
    seed: int,
    features: np.ndarray,
    cumulative: np.ndarray,
    successors: np.ndarray,
    rewards: np.ndarray,
    decay: float,
    rate: float,
) -> tuple[np.ndarray, Any]:
    """Learn the three-state MDP for `steps` decisions; the final weights `(2, 2)` and the mean reward."""
    np.random.seed(seed)  # noqa: NPY002 (compiled code has no Generator as quick)
    weights = np.zeros((2, 2), np.float32)
    trace = np.zeros((2, 2), np.float32)
    baseline = 0.0
    total = 0.0
    state = 0
    for t in range(steps):
        y = features[state]
        potential = (weights[1, 0] - weights[0, 0]) * y[0] + (weights[1, 1] - weights[0, 1]) * y[1]
        second = 1.0 / (1.0 + np.exp(-potential))
        action = 1 if np.random.random() < second else 0  # noqa: NPY002
        surprise = action - second
        for j in range(2):
            trace[0, j] = decay * trace[0, j] - surprise * y[j]
            trace[1, j] = decay * trace[1, j] + surprise * y[j]
        which = 0 if np.random.random() < cumulative[action, state, 0] else 1  # noqa: NPY002
        state = successors[action, state, which]
        reward = rewards[state]
        delta = reward - baseline
        baseline += delta / (t + 1)
        total += reward
        for k in range(2):
            for j in range(2):
                weights[k, j] += rate * delta * trace[k, j]
    return weights, total / steps


@numba.njit
def recruitment_loop(
    steps: int, seed: int, units: int, slope: float, intercept: float, rate: float
) -> tuple[np.ndarray, np.ndarray, Any, Any]:
    """Learn linear recruitment, in the count form and without a trace, for `steps` decisions. Returns thresholds and
    gains `(units,)`, the mean reward, and the mean error of the force as a ratio."""
    np.random.seed(seed)  # noqa: NPY002 (compiled code has no Generator as quick)
    single = np.float32
    threshold = np.random.random(units).astype(single)  # noqa: NPY002
    gain = np.zeros(units, single)
    surprise = np.empty(units, single)
    step = single(rate)
    baseline = 0.0
    total = 0.0
    missed = 0.0
    for t in range(steps):
        load = single(np.random.random())  # noqa: NPY002
        firing = single(0)
        for i in range(units):
            p = single(1) / (single(1) + np.exp(-gain[i] * (load - threshold[i])))
            action = single(1) if np.random.random() < p else single(0)  # noqa: NPY002
            surprise[i] = action - p
            firing += action
        error = firing / units - (slope * load + intercept)
        reward = -((units * error) ** 2)
        delta = single(reward - baseline)
        baseline += delta / (t + 1)
        total += reward
        missed += abs(error)
        for i in range(units):
            credit = step * delta * surprise[i]
            away = load - threshold[i]
            threshold[i] -= credit * gain[i]
            gain[i] += credit * away
    return threshold, gain, total / steps, missed / steps


@numba.njit
def particle_loop(
    steps: int,
    seed: int,
    centre: np.ndarray,
    log_width: np.ndarray,
    forces: np.ndarray,
    regions: np.ndarray,
    numbers: tuple[Number, ...],
    decay: np.float32,
    rates: tuple[np.float32, np.float32],
    limits: tuple[np.float32, np.float32],
) -> tuple[np.ndarray, np.ndarray, Any]:
    """Learn the falling particle for `steps` decisions: centres, log-widths and the mean reward. Only what this task
    needs is implemented: forces along x, and a floor that ends the episode. `regions` are `(regions, 5)`; `numbers` are
    time step, gravity, drag, restitution and friction; `rates` and `limits` those of centres and log-widths."""
    np.random.seed(seed)  # noqa: NPY002 (compiled code has no Generator as quick)
    units = len(forces)
    centre = centre.copy()
    log_width = log_width.copy()
    z_centre = np.zeros((units, 2), single)
    z_width = np.zeros((units, 2), single)
    baseline = 0.0
    total = 0.0
    fallen = True
    x = y = vx = vy = single(0)
    for t in range(steps):
        if fallen:
            x = single(np.random.random())  # noqa: NPY002
            y = single(0.9 + 0.1 * np.random.random())  # noqa: NPY002
            vx = single(0)
            vy = single(0)
            z_centre[:] = 0
            z_width[:] = 0
        push = single(0)
        for i in range(units):
            ix = np.exp(-log_width[i, 0])
            iy = np.exp(-log_width[i, 1])
            zx = (x - centre[i, 0]) * ix
            zy = (y - centre[i, 1]) * iy
            p = min(np.exp(single(-0.5) * (zx * zx + zy * zy)), CAP)
            if np.random.random() < p:  # noqa: NPY002
                push += forces[i]
                surprise = single(1)
            else:
                surprise = -p / (1 - p)
            if p >= CAP:
                surprise = single(0)
            z_centre[i, 0] = decay * z_centre[i, 0] + surprise * zx * ix
            z_centre[i, 1] = decay * z_centre[i, 1] + surprise * zy * iy
            z_width[i, 0] = decay * z_width[i, 0] + surprise * zx * zx
            z_width[i, 1] = decay * z_width[i, 1] + surprise * zy * zy
        fallen = False
        for _ in range(2):
            x, y, vx, vy = _fall(x, y, vx, vy, push, numbers)
            if y <= 0:
                y = single(0)
                fallen = True
        reward = single(0)
        for k in range(len(regions)):
            away = (x - regions[k, 1]) / regions[k, 3]
            above = (y - regions[k, 2]) / regions[k, 4]
            reward += regions[k, 0] * np.exp(single(-0.5) * (away * away + above * above))
        delta = single(reward - baseline)
        baseline += delta / (t + 1)
        total += reward
        for i in range(units):
            for j in range(2):
                centre[i, j] += rates[0] * delta * z_centre[i, j]
                moved = log_width[i, j] + rates[1] * delta * z_width[i, j]
                log_width[i, j] = min(max(moved, limits[0]), limits[1])
    return centre, log_width, total / steps


@numba.njit
def _fall(x: Number, y: Number, vx: Number, vy: Number, push: Number, numbers: tuple[Number, ...]) -> Any:
    """One Runge–Kutta step between two walls, for a particle of mass 1."""
    h, gravity, drag, restitution, friction = numbers
    left = x <= 0 and vx <= 0
    right = x >= 1 and vx >= 0
    half = h / 2
    ax, ay = _acceleration(vx, vy, push, gravity, drag, friction, left, right)
    ux = vx + half * ax
    uy = vy + half * ay
    bx, by = _acceleration(ux, uy, push, gravity, drag, friction, left, right)
    wx = vx + half * bx
    wy = vy + half * by
    cx, cy = _acceleration(wx, wy, push, gravity, drag, friction, left, right)
    tx = vx + h * cx
    ty = vy + h * cy
    dx, dy = _acceleration(tx, ty, push, gravity, drag, friction, left, right)
    sixth = h / 6
    x += sixth * (vx + 2 * ux + 2 * wx + tx)
    y += sixth * (vy + 2 * uy + 2 * wy + ty)
    vx += sixth * (ax + 2 * bx + 2 * cx + dx)
    vy += sixth * (ay + 2 * by + 2 * cy + dy)
    if (x < 0 and vx < 0) or (x > 1 and vx > 0):
        weak = restitution * abs(vx) <= np.sign(vx) * h * (push - drag * vx)
        vx = single(0) if weak else -restitution * vx
    return min(max(x, single(0)), single(1)), y, vx, vy


@numba.njit
def _acceleration(
    vx: Number, vy: Number, push: Number, gravity: Number, drag: Number, friction: Number, left: Flag, right: Flag
) -> Any:
    """The acceleration; `left` and `right`: whether the particle rests on that wall."""
    fx = push - drag * vx
    fy = gravity - drag * vy
    if (left and fx < 0) or (right and fx > 0):
        return single(0), fy - friction * abs(fx) * vy
    return fx, fy
