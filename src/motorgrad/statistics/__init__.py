"""Statistics: means, medians and shares over seeds with their intervals, and methods compared across tasks.

    import motorgrad as mg

    mg.statistics.median_of(run.final("apex"))  # 0.72 [0.69 … 0.75], median of 16

Every interval is at 95 % unless another level is given. One that cannot reach its level says so.

What compares methods takes scores as `(tasks, runs)`: a row for each task, whose runs are independent.
"""

from motorgrad.statistics._across_tasks import (
    improvement_of,
    interquartile_mean,
    interquartile_mean_of,
    mean_over_tasks,
    median_over_tasks,
    performance_profile,
    probability_of_improvement,
    stratified_bootstrap,
)
from motorgrad.statistics._measured import (
    LEVEL,
    Measured,
    difference_of,
    exact,
    first_time,
    mean_of,
    median_of,
    moving_mean,
    per_case,
    ratio_of,
    share_of,
    tally_of,
)
from motorgrad.statistics._tuning import (
    MAX_DIMENSIONS,
    EffectiveDimension,
    distribution_scores,
    effective_dimension,
    expected_best,
    percentile_range,
    sensitivity_of,
)

__all__ = [
    "LEVEL",
    "MAX_DIMENSIONS",
    "EffectiveDimension",
    "Measured",
    "difference_of",
    "distribution_scores",
    "effective_dimension",
    "exact",
    "expected_best",
    "first_time",
    "improvement_of",
    "interquartile_mean",
    "interquartile_mean_of",
    "mean_of",
    "mean_over_tasks",
    "median_of",
    "median_over_tasks",
    "moving_mean",
    "per_case",
    "percentile_range",
    "performance_profile",
    "probability_of_improvement",
    "ratio_of",
    "sensitivity_of",
    "share_of",
    "stratified_bootstrap",
    "tally_of",
]
