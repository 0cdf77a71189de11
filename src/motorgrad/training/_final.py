"""The numbers that are left of a run: means over the end of its records, and totals."""

import numpy as np

from motorgrad._errors import check
from motorgrad.training._run import Run

SKIPPED = frozenset({"setting", "seed", "decision", "simulated_time", "wall_time", "parameters", "baseline"})


def final_metrics(run: Run, share: float = 0.1) -> dict[str, np.ndarray]:
    """One number per lane for every column of a run's metrics: what learning has led to.

    **Arguments:** `share`: of the records, the last ones, at least one.

    **Returns** means over these records, without those in which nothing occurred (NaN where nothing occurred in any);
    of what is counted, such as episodes and divergences, the totals of the whole run as `NAME_total`. Empty for a run
    without records.
    """
    check(0 < share <= 1, "share", share, "above 0, at most 1")
    found: dict[str, np.ndarray] = {}
    for name in run.metrics.column_names if run.metrics.num_rows else ():
        if name in SKIPPED:
            continue
        values = run.curve(name)[1]
        if name.endswith("_count") or name in ("episodes", "diverged"):
            found[f"{name}_total"] = values.sum(axis=1)
            continue
        last = values[:, -max(1, int(values.shape[1] * share)) :]
        with np.errstate(invalid="ignore"):
            found[name] = np.nansum(last, axis=1) / np.isfinite(last).sum(axis=1)
    return found
