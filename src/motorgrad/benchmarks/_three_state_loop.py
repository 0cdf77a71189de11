"""OLGARB on the three-state MDP as one hand-written compiled loop: the measure of the library's general learner."""

from typing import Any

import numba
import numpy as np


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
    """Learn for `steps` decisions; the final weights `(2, 2)` and the mean reward."""
    np.random.seed(seed)  # noqa: NPY002 (compiled code has no Generator as quick)
    weights = np.zeros((2, 2), np.float32)
    trace = np.zeros((2, 2), np.float32)
    baseline, total, state = 0.0, 0.0, 0
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
