"""What a worker does: one job, which is one run directory."""

import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import filelock
import numpy as np
import pyarrow as pa

from motorgrad._signals import interrupt_when_asked
from motorgrad.studies._partition import Job
from motorgrad.training import Run, final_metrics, train

PATIENCE = 60.0  # seconds for a process that is being killed to let go of a run directory


class Outcome(NamedTuple):
    """What comes back from a worker.

    - `rows`: one per setting and seed, with the final metrics; `None` where the run was stopped before its end.
    - `learned`: seconds of learning, including compiling.
    - `busy`: whether another process has the run directory.
    """

    rows: pa.Table | None
    learned: float
    busy: bool = False


def work(
    job: Job,
    path: Path | str,
    threads: int = 0,
    checkpoint_every: float = 30.0,
    imports: Sequence[str] = (),
    trust: bool = False,
) -> Outcome:
    """Do a job, or what is left of it, in its run directory.

    **Arguments:** `threads`, `checkpoint_every` and `trust` as in `train`; `imports`: modules that register the job's
    tasks and parts.
    """
    path = Path(path)
    path.mkdir(parents=True, exist_ok=True)
    with interrupt_when_asked():
        for name in imports:
            importlib.import_module(name)
        try:
            # an earlier worker of the same job, whose driver was killed, may still hold the directory
            with filelock.FileLock(path / ".lock", timeout=PATIENCE):
                pass
        except filelock.Timeout:
            return Outcome(None, 0.0, busy=True)
        run = train(
            job.make_task(),
            job.agent,
            job.steps,
            job.seeds,
            path,
            sweep=job.sweep,
            window=job.window,
            checkpoint_every=checkpoint_every,
            threads=threads,
            trust=trust,
            progress=False,
        )
    return Outcome(rows_of(run) if run.complete else None, learned_seconds(run))


def rows_of(run: Run) -> pa.Table:
    """The rows of a run in the index: the lanes in order, with their final metrics."""
    columns = {name: np.asarray(values, float) for name, values in final_metrics(run).items()}
    return pa.table({"decision": np.full(run.lanes, run.decision, np.int64), **columns})


def learned_seconds(run: Run) -> float:
    """The seconds of learning in a run."""
    return float(run.metrics["wall_time"][-1].as_py()) if run.metrics.num_rows else 0.0
