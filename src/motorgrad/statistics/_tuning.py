"""What the choice of settings does to a comparison: scales of scores, sensitivity, and the cost of tuning."""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from jaxtyping import Float, Int

from motorgrad._errors import check
from motorgrad.statistics._across_tasks import mean_over_tasks, stratified_bootstrap
from motorgrad.statistics._measured import LEVEL, Measured

NEAR = 0.95
"""The share of the peak that counts as near the peak (Adkins, Bowling & White, 2024)."""
MAX_DIMENSIONS = 12
"""Settings whose effective dimension is found: all their subsets are tried."""


def percentile_range(pool: npt.ArrayLike, low: float = 5.0, high: float = 95.0) -> tuple[float, float]:
    """Two percentiles of the finite values of a pool, by default the 5th and the 95th. They are the 0 and the 1 of
    normalized scores, $(p - p_5) / (p_{95} - p_5)$ (Adkins, Bowling & White, 2024). Where they are equal, the high one
    is raised by 1, so that the common value scores 0."""
    pool = np.asarray(pool, float)
    pool = pool[np.isfinite(pool)]
    check(pool.size > 0, "pool", pool, "at least one finite value")
    bottom, top = (float(each) for each in np.percentile(pool, [low, high]))
    return bottom, top if top > bottom else bottom + 1.0


def distribution_scores(values: Float[np.ndarray, "*any"], pool: npt.ArrayLike) -> Float[np.ndarray, "*any"]:
    """The share of a pool at most as high as each value (Patterson et al., 2024); 0 for a value that is not finite."""
    ordered = np.sort(np.asarray(pool, float)[np.isfinite(pool)])
    check(ordered.size > 0, "pool", pool, "at least one finite value")
    found = np.searchsorted(ordered, values, side="right") / ordered.size
    return np.where(np.isfinite(values), found, 0.0)


def sensitivity_of(tuned: npt.ArrayLike, shared: npt.ArrayLike, level: float = LEVEL, seed: int = 0) -> Measured:
    r"""How much of a method's score comes from tuning it for every task (Adkins, Bowling & White, 2024):

    $$\Phi = \frac 1M \sum_m \Gamma_m(h_m) - \frac 1M \sum_m \Gamma_m(h)$$

    with normalized scores $\Gamma_m$, the best settings $h_m$ of every task, and the one setting $h$ that is best for
    all tasks together. The source takes the maxima of the very runs that it reports. Here the settings must have been
    chosen on other seeds, so that the luck of the chosen is not in it, and the difference may be below 0.

    **Arguments:**

    - `tuned`, `shared`: normalized scores `(tasks, runs)` with $h_m$ and with $h$; run k of both has the same seed.
    - `level`: level of the interval, which is a paired `stratified_bootstrap`.
    """

    def difference(one: np.ndarray, other: np.ndarray) -> np.ndarray:
        return mean_over_tasks(one) - mean_over_tasks(other)

    value, low, high = stratified_bootstrap(difference, tuned, shared, paired=True, level=level, seed=seed)
    return Measured(float(value), float(low), float(high), np.size(tuned), "sensitivity", level)


class EffectiveDimension(NamedTuple):
    """How many of a method's settings have to be tuned for every task.

    - `dimension`: the fewest settings with which 95 % of the peak is reached.
    - `scores`: the best score with 0, 1, 2 … settings tuned for every task and the others as in the setting that is
      best for all tasks; the last is the peak.
    - `tuned`: the names of the settings that reach it.
    """

    dimension: int
    scores: tuple[float, ...]
    tuned: tuple[tuple[str, ...], ...]


def effective_dimension(
    settings: Sequence[Mapping[str, Any]], scores: Float[np.ndarray, "tasks settings"], near: float = NEAR
) -> EffectiveDimension:
    """The effective hyperparameter dimensionality of Adkins, Bowling & White (2024).

    **Arguments:**

    - `settings`: the values of every setting that was tried, by name, such as a grid.
    - `scores`: their normalized scores on every task. Settings with a score that is not finite are left out.
    - `near`: the share of the peak that has to be reached, in (0, 1]; a peak of at most 0 has to be reached itself.

    ```python
    settings = [{"rate": rate, "decay": decay} for rate in (0.1, 1.0) for decay in (0.0, 0.9)]
    found = effective_dimension(settings, np.array([[0.9, 0.8, 0.1, 0.0], [0.1, 0.2, 0.9, 0.92]]))
    print(found.dimension, found.scores, found.tuned[1])  # 1 (0.5, 0.9, 0.91) ('rate',)
    ```
    """
    scores = np.asarray(scores, float)
    usable = np.isfinite(scores).all(axis=0)
    check(bool(usable.any()), "scores", scores, "finite for at least one setting")
    names = list(dict.fromkeys(name for setting in settings for name in setting))
    # a number for every value, equal for equal values
    values = [[repr(setting.get(name)) for setting in settings] for name in names]
    codes = np.array([np.unique(row, return_inverse=True)[1] for row in values], int)
    names = [name for name, row in zip(names, codes, strict=True) if len(set(row)) > 1]
    codes = np.array([row for row in codes if len(set(row)) > 1], int).reshape(len(names), len(settings))
    check(len(names) <= MAX_DIMENSIONS, "settings", names, f"at most {MAX_DIMENSIONS} that differ")
    shared = int(np.argmax(np.where(usable, scores.mean(axis=0), -np.inf)))
    best = []
    chosen = []
    for count in range(len(names) + 1):
        found = []
        for subset in itertools.combinations(range(len(names)), count):
            fixed = [place for place in range(len(names)) if place not in subset]
            allowed = usable & (codes[fixed] == codes[fixed][:, [shared]]).all(axis=0)
            found.append((float(scores[:, allowed].max(axis=1).mean()), subset))
        score, subset = max(found, key=lambda each: each[0])
        best.append(score)
        chosen.append(tuple(names[place] for place in subset))
    target = near * best[-1] if best[-1] > 0 else best[-1]
    dimension = next(count for count, score in enumerate(best) if score >= target)
    return EffectiveDimension(dimension, tuple(best), tuple(chosen))


def expected_best(
    chosen_by: Float[np.ndarray, " settings"], reported: Float[np.ndarray, " settings"], counts: Int[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    r"""The expected score of the best of k settings, for all of the `counts` k, the mean over all ways to try k of n.

    With the settings in the order in which they would be chosen, the i-th of them is the best of k tried in
    $\binom{i-1}{k-1}$ of $\binom nk$ cases. Dodge et al. (2019) estimate this with replacement, and report the number
    that chose; here `reported` may come from other seeds than `chosen_by`, without the luck of the choice. Settings
    whose `chosen_by` is not finite are never chosen, but were tried.
    """
    from scipy.special import gammaln

    chosen_by = np.asarray(chosen_by, float)
    reported = np.asarray(reported, float)
    total = len(chosen_by)
    inside = total > 0 and bool(np.all((np.asarray(counts) >= 1) & (np.asarray(counts) <= total)))
    check(inside, "counts", np.asarray(counts).tolist(), f"from 1 to the number of settings, {total}")
    order = np.argsort(np.where(np.isfinite(chosen_by), chosen_by, -np.inf), kind="stable")
    ordered = reported[order]
    usable = np.isfinite(chosen_by[order])
    rank = np.arange(1, total + 1)

    def ways(of: Int[np.ndarray, " settings"] | int, take: Int[np.ndarray, " settings"] | int) -> np.ndarray:
        """The logarithm of the binomial coefficient, −∞ where there is no way."""
        with np.errstate(invalid="ignore"):
            found = gammaln(of + 1.0) - gammaln(take + 1.0) - gammaln(np.maximum(of - take, 0) + 1.0)
        return np.where(of >= take, found, -np.inf)

    shares = [np.exp(ways(rank - 1, k - 1) - ways(total, k)) * usable for k in np.asarray(counts)]
    return np.array([share[usable] @ ordered[usable] / share.sum() if share.sum() else np.nan for share in shares])
