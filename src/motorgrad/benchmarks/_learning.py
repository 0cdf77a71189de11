"""How long the hopper takes to learn, in simulated and in wall time."""

import time
from collections.abc import Iterator
from typing import Literal

import numpy as np

from motorgrad.benchmarks._measure import Row
from motorgrad.tasks import Hopper
from motorgrad.training import settings_for, train

HEIGHT = 0.3  # metres


SETTINGS: tuple[tuple[Literal["landing", "apex"], float], ...] = (("landing", 0.98), ("apex", 0.98), ("landing", 0.995))
"""What is paid for, and the trace's decay: the thesis's decay twice, and the task's own learner."""


def learning_rows(seeds: int, seconds: float) -> Iterator[Row]:
    """Until the median seed's apex, averaged over 25 s windows, passes 0.3 m; and the apex at the end.

    The other column has the figures of an independent model with the same numbers, paid at the first apex with a decay
    of 0.98: 315 s (270 to 450) and 0.72 m at 1,500 s, 8 seeds.
    """
    for paid, decay in SETTINGS:
        start = time.perf_counter()
        task = Hopper(paid=paid)
        run = train(
            task,
            settings_for(task, decay=decay).agent(task),
            round(seconds / task.period),
            seeds,
            window=round(25 / task.period),
            progress=False,
        )
        wall = time.perf_counter() - start
        decision, apex = run.curve("apex")
        each = np.array([next(iter(decision[row > HEIGHT]), np.inf) for row in apex]) * task.period
        simulated, last = float(np.median(each)), np.nanmean(apex[:, -8:], axis=1)
        name = f"hopper paid at {paid}, decay {decay}, {seeds} seeds"
        yield Row(f"{name}: apex > {HEIGHT} m", simulated, 315.0, "simulated s", None, (each.min(), each.max()))
        yield Row("   the same in wall time, all seeds together", wall * simulated / seconds, None, "s", None, None)
        yield Row(f"   apex at {seconds:.0f} s", float(np.median(last)), 0.72, "m", None, (last.min(), last.max()))
