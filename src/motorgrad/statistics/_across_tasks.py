"""Methods compared across tasks, as Agarwal et al. (2021) recommend: scores are `(tasks, runs)`."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from jaxtyping import Float

from motorgrad._errors import check, check_integer
from motorgrad.statistics._measured import LEVEL, Measured, check_level

RESAMPLES = 2000
"""Resamples of a bootstrap, by default."""
AT_ONCE = 2**22  # numbers that a statistic is given at a time

Scores = Float[np.ndarray, "tasks runs"]
Statistic = Callable[..., np.ndarray]


def interquartile_mean(scores: Float[np.ndarray, "*batch tasks runs"]) -> Float[np.ndarray, "*batch"]:
    """The mean of the middle half of all runs of all tasks: of n runs, without the n // 4 lowest and n // 4 highest. It
    is as robust against a few bad runs as a median, and needs fewer runs (Agarwal et al., 2021)."""
    pooled = np.sort(np.asarray(scores, float).reshape(*np.shape(scores)[:-2], -1), axis=-1)
    cut = pooled.shape[-1] // 4
    return pooled[..., cut : pooled.shape[-1] - cut].mean(axis=-1)


def mean_over_tasks(scores: Float[np.ndarray, "*batch tasks runs"]) -> Float[np.ndarray, "*batch"]:
    """The mean over the tasks of the means over their runs."""
    return np.asarray(scores, float).mean(axis=(-2, -1))


def median_over_tasks(scores: Float[np.ndarray, "*batch tasks runs"]) -> Float[np.ndarray, "*batch"]:
    """The median over the tasks of the means over their runs (Agarwal et al., 2021); for a single task, the mean."""
    return np.median(np.asarray(scores, float).mean(axis=-1), axis=-1)


def performance_profile(
    scores: Float[np.ndarray, "*batch tasks runs"], thresholds: Float[np.ndarray, " thresholds"]
) -> Float[np.ndarray, "*batch thresholds"]:
    r"""The share of runs that score above each threshold, the mean over tasks (Agarwal et al., 2021):

    $$F(\tau) = \frac 1M \sum_m \frac 1N \sum_n \mathbb 1[x_{mn} > \tau]$$
    """
    scores = np.asarray(scores, float)
    return np.stack([(scores > threshold).mean(axis=(-2, -1)) for threshold in np.asarray(thresholds)], axis=-1)


def probability_of_improvement(
    one: Float[np.ndarray, "*batch tasks runs"], other: Float[np.ndarray, "*batch tasks others"]
) -> Float[np.ndarray, "*batch"]:
    """The probability that a run of one method scores higher than a run of the other on the same task, the mean over
    the tasks; equal scores count half (Agarwal et al., 2021). On one task it is the statistic of Mann and Whitney
    (1947), divided by the number of pairs."""
    one = np.asarray(one, float)[..., :, None]
    other = np.asarray(other, float)[..., None, :]
    return ((one > other).mean(axis=(-2, -1)) + 0.5 * (one == other).mean(axis=(-2, -1))).mean(axis=-1)


def stratified_bootstrap(
    statistic: Statistic,
    *samples: npt.ArrayLike,
    paired: bool = False,
    level: float = LEVEL,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A statistic of several tasks with its percentile interval: every task's runs are drawn again from themselves,
    with replacement and independently of the other tasks' (Agarwal et al., 2021; Efron, 1979).

    **Arguments:**

    - `statistic`: a function of as many arrays as there are samples, with any leading axes: `(…, tasks, runs)` to
      `(…, *shape)`, such as `interquartile_mean`.
    - `samples`: finite scores `(tasks, runs)`, for each method.
    - `paired`: whether run k of every sample has the same random numbers, so that the samples are drawn together.
    - `level`: level of the interval, in (0, 1).
    - `resamples`: how often everything is drawn.
    - `seed`: seed of the draws.

    **Returns** the statistic of the samples themselves, and the low and high ends of its interval.

    ```python
    scores = np.random.default_rng(0).random((3, 16))
    value, low, high = stratified_bootstrap(interquartile_mean, scores)
    ```
    """
    check_level(level)
    check_integer("resamples", resamples, 1, 10**7)
    given = [_scores(sample) for sample in samples]
    check(given and len({len(sample) for sample in given}) == 1, "samples", len(given), "at least one, of equal tasks")
    same = len({sample.shape for sample in given}) == 1
    check(same or not paired, "samples", [sample.shape for sample in given], "of the same runs to be paired")
    random = np.random.default_rng(seed)
    found = []
    most = max(1, AT_ONCE // (max(sample.size * sample.shape[1] for sample in given)))
    for start in range(0, resamples, most):
        count = min(most, resamples - start)
        drawn = []
        rows = None
        for sample in given:
            if rows is None or not paired:
                rows = random.integers(sample.shape[1], size=(count, *sample.shape))
            drawn.append(np.take_along_axis(sample[None], rows, axis=-1))
        found.append(statistic(*drawn))
    ends = np.quantile(np.concatenate(found), [(1 - level) / 2, (1 + level) / 2], axis=0)
    return np.asarray(statistic(*given)), ends[0], ends[1]


def interquartile_mean_of(scores: npt.ArrayLike, level: float = LEVEL, seed: int = 0) -> Measured:
    """`interquartile_mean` with its interval by `stratified_bootstrap`, of scores `(tasks, runs)` or the runs of a
    task."""
    return _measured("interquartile mean", interquartile_mean, _scores(scores), level=level, seed=seed)


def improvement_of(one: npt.ArrayLike, other: npt.ArrayLike, level: float = LEVEL, seed: int = 0) -> Measured:
    """`probability_of_improvement` of one method over the other with its interval by `stratified_bootstrap`."""
    found = (_scores(one), _scores(other))
    return _measured("probability of improvement", probability_of_improvement, *found, level=level, seed=seed)


def _measured(kind: str, statistic: Statistic, *samples: np.ndarray, level: float, seed: int) -> Measured:
    """A single number with its bootstrapped interval."""
    value, low, high = (float(each) for each in stratified_bootstrap(statistic, *samples, level=level, seed=seed))
    return Measured(value, low, high, sum(sample.size for sample in samples), kind, level)


def _scores(values: npt.ArrayLike) -> Scores:
    """Finite scores as `(tasks, runs)`."""
    found = np.asarray(values, float)
    found = found[None] if found.ndim == 1 else found
    shaped = found.ndim == 2 and found.size > 0
    check(shaped, "scores", np.shape(values), "a table (tasks, runs), or the runs of one task")
    check(bool(np.isfinite(found).all()), "scores", found[~np.isfinite(found)][:5].tolist(), "finite")
    return found
