"""Estimates of a gradient at fixed parameters: many runs of GPOMDP on the three-state MDP, in the training engine."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from motorgrad.experiments._claim import LEVEL
from motorgrad.learning import Agent, Baseline, Gpomdp
from motorgrad.policies import Softmax
from motorgrad.tasks import ThreeState
from motorgrad.training import stepper_of


def comparison_point() -> Softmax:
    """The policy at which Baxter & Bartlett compare estimators."""
    return Softmax([[1.0, 1.0], [-1.0, -1.0]])


def estimates(
    decay: float, baseline: Baseline, lengths: Sequence[int], runs: int
) -> Float[np.ndarray, "lengths runs parameters"]:
    """What GPOMDP estimates after so many decisions, run by run.

    A run is longer, not another, at the next length; and it is the same trajectory for every decay and baseline.

    **Arguments:** `decay` of the trace; the baseline; `lengths` in decisions, rising; how many runs.
    """
    stepper = stepper_of(ThreeState(), Agent(comparison_point(), Gpomdp(decay, baseline)), range(runs))
    found = []
    for length in lengths:
        stepper.advance(length - stepper.decision)
        mean = stepper.state["cycle"].agent.gradient.mean
        found.append(np.asarray(mean.weights, float).reshape(runs, -1))
    return np.stack(found)


def relative_error(found: Float[np.ndarray, "*runs parameters"], exact: Float[np.ndarray, " parameters"]) -> np.ndarray:
    """The distance of each estimate from the exact gradient, relative to the latter's length."""
    return np.linalg.norm(found - exact, axis=-1) / np.linalg.norm(exact)


def along(found: Float[np.ndarray, "*runs parameters"], direction: Float[np.ndarray, " parameters"]) -> np.ndarray:
    """How much of `direction` each vector has: 1 for `direction` itself. Unlike a norm it averages to no noise."""
    return found @ direction / (direction @ direction)


def joint_quantile(comparisons: int) -> float:
    """So many standard errors make each interval that wide that all of them hold at once at the level (Bonferroni)."""
    from scipy import stats

    return float(stats.norm.ppf(1 - (1 - LEVEL) / (2 * comparisons)))
