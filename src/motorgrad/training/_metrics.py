"""The metrics of a run: records while it learns, means and totals at the end."""

import math
from collections.abc import Mapping

import jax
import numpy as np
import pyarrow as pa
from jaxtyping import Int

from motorgrad._arrays import AnyArray
from motorgrad._arrow import column_of, numbers_in
from motorgrad._errors import check
from motorgrad.policies import Policy
from motorgrad.training._run import Run
from motorgrad.training.engines import Record, mean_reward, without_broken
from motorgrad.training.plots import mean_of_last


class Records:
    """The records since the last checkpoint: rows of a table (`docs/training.md`), one per window, lane and setting.

    Columns have their `unit` as metadata where one of these `units` is theirs.
    """

    def __init__(self, seeds: np.ndarray, period: float, settings: int = 0, units: Mapping[str, str] | None = None):
        self.seeds, self.period = seeds, period
        self._units = units or {}
        self._setting = np.repeat(np.arange(settings), len(seeds) // settings) if settings else None
        self._tables: list[pa.Table] = []

    def add(self, record: Record, decision: int, since: int, wall: float, cpu: float = 0.0) -> float:
        """Add the record of the window from `since` to `decision`. Returns its mean reward over the lanes where it is
        known, NaN where it is in none."""
        count = len(self.seeds)
        record = without_broken(record)
        reward = mean_reward(record, decision - since)
        columns = {
            **({} if self._setting is None else {"setting": self._setting}),
            "seed": self.seeds,
            "decision": np.full(count, decision, np.int64),
            "simulated_time": np.full(count, decision * self.period),
            "wall_time": np.full(count, wall),
            "cpu_time": np.full(count, cpu),
            "reward": reward.astype(np.float32),
            **{name: values for name, values in record.items() if name not in ("reward", "parameters")},
        }
        parameters = pa.FixedSizeListArray.from_arrays(
            column_of(record["parameters"].ravel().astype(np.float32)), record["parameters"].shape[1]
        )
        arrays = {name: column_of(values) for name, values in columns.items()}
        self._tables.append(pa.table({**arrays, "parameters": parameters}))
        known = reward[np.isfinite(reward)]
        return float(known.mean()) if len(known) else math.nan

    def newest(self) -> dict[str, np.ndarray]:
        """The columns of the newest record but the parameters, `(lanes,)` each."""
        table = self._tables[-1]
        return {name: numbers_in(table[name]) for name in table.column_names if name != "parameters"}

    def take(self) -> pa.Table | None:
        """Remove and return all rows."""
        if not self._tables:
            return None
        table = pa.concat_tables(self._tables)
        self._tables = []
        units = {name: {"unit": unit} for name, unit in self._units.items()}
        fields = [field.with_metadata(units[field.name]) if field.name in units else field for field in table.schema]
        return pa.table(table.columns, schema=pa.schema(fields))


CLOCKS = ("simulated_time", "wall_time", "cpu_time")
NOT_FINAL = frozenset({"setting", "seed", "decision", *CLOCKS, "parameters", "baseline"})
"""Columns of the metrics that say nothing about what learning has led to."""


def final_metrics(run: Run, share: float = 0.1) -> dict[str, np.ndarray]:
    """One number per lane for every column of a run's metrics: the results of learning, over the last `share` of the
    records, at least one. Empty for a run without records.

    **Returns** means over all that occurred in these records (NaN where nothing did in any, and for policies that are
    not finite): a record counts as often as the quantity occurred in it, or for its decisions; of what is counted, such
    as episodes and divergences, the totals of the whole run as `NAME_total`.
    """
    check(0 < share <= 1, "share", share, "above 0, at most 1")
    found: dict[str, np.ndarray] = {}
    for name in run.metrics.column_names if run.metrics.num_rows else ():
        if name in NOT_FINAL:
            continue
        values = run.curve(name)[1]
        if name.endswith("_count") or name in ("episodes", "diverged"):
            found[f"{name}_total"] = values.sum(axis=1)
            continue
        found[name] = mean_of_last(run, name, max(1, int(values.shape[1] * share)))
    return found


def mean_of_samples(mean: Policy, count: Int[AnyArray, " lanes"]) -> Policy:
    """The mean of some number of gradient samples of each lane: NaN of none, not 0, at which learning would be over."""
    none = np.asarray(count) == 0
    return jax.tree.map(lambda leaf: np.where(none.reshape(-1, *[1] * (np.ndim(leaf) - 1)), np.nan, leaf), mean)
