"""How long the hopper takes to learn, in simulated and in wall time."""

import time

import numpy as np

from motorgrad.benchmarks._measure import Row
from motorgrad.training import train

HEIGHT = 0.3  # metres


def learning_rows(seeds: int, seconds: float) -> list[Row]:
    """Time until the median seed's apex, averaged over 25 s windows, passes 0.3 m; NaN if it does not."""
    start = time.perf_counter()
    run = train("hopper", steps=round(100 * seconds), seeds=seeds, window=2500, progress=False)
    wall = time.perf_counter() - start
    decision, apex = run.curve("apex")
    passed = np.flatnonzero(np.nanmedian(apex, axis=0) > HEIGHT)
    simulated = decision[passed[0]] * run.task.period if len(passed) else float("nan")
    each = [decision[row > HEIGHT][0] * run.task.period if (row > HEIGHT).any() else np.inf for row in apex]
    low, high = np.quantile(each, [0, 1])
    last = apex[:, -8:]
    final = np.nanmean(last, axis=1)
    return [
        Row(f"hopper, median apex > {HEIGHT} m, {seeds} seeds", float(simulated), 315.0, "simulated s", None, (low, high)),
        Row("   the same", wall * simulated / seconds, None, "wall s", None, None),
        Row(
            f"   apex at {seconds:.0f} s (median seed)", float(np.median(final)), 0.72, "m", None, (final.min(), final.max())
        ),
    ]
