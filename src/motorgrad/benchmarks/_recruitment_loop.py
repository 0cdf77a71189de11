"""OLGARB on linear recruitment as one hand-written compiled loop: the measure of the library's general learner."""

from typing import Any

import numba
import numpy as np


@numba.njit
def recruitment_loop(
    steps: int, seed: int, units: int, slope: float, intercept: float, rate: float
) -> tuple[np.ndarray, np.ndarray, Any, Any]:
    """Learn the count form without a trace for `steps` decisions; thresholds and gains `(units,)`, the mean reward and
    the mean error of the force as a ratio."""
    np.random.seed(seed)  # noqa: NPY002 (compiled code has no Generator as quick)
    single = np.float32
    threshold, gain = np.random.random(units).astype(single), np.zeros(units, single)  # noqa: NPY002
    surprise = np.empty(units, single)
    step, baseline, total, missed = single(rate), 0.0, 0.0, 0.0
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
