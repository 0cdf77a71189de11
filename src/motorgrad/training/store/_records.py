"""Records: what happened in a window of decisions, as rows of a table, one per seed and setting."""

import numpy as np
import pyarrow as pa

from motorgrad.training.engines._stepper import Record


class Records:
    """The rows since the last checkpoint. The columns are those of `docs/training.md`, in this order."""

    def __init__(self, seeds: np.ndarray, period: float, settings: int = 0):
        self.seeds, self.period = seeds, period
        self._setting = np.repeat(np.arange(settings), len(seeds) // settings) if settings else None
        self._tables: list[pa.Table] = []

    def add(self, record: Record, decision: int, since: int, wall: float) -> float:
        """Add a window that began after decision `since` and ended with `decision`; its mean reward over the seeds."""
        count = len(self.seeds)
        lost = record.get("diverged", 0)
        reward = record["reward"] / np.maximum(decision - since - lost, 1)
        columns = {
            **({} if self._setting is None else {"setting": self._setting}),
            "seed": self.seeds,
            "decision": np.full(count, decision, np.int64),
            "simulated_time": np.full(count, decision * self.period),
            "wall_time": np.full(count, wall),
            "reward": reward.astype(np.float32),
            **{name: values for name, values in record.items() if name not in ("reward", "parameters")},
        }
        parameters = pa.FixedSizeListArray.from_arrays(
            pa.array(record["parameters"].ravel().astype(np.float32)), record["parameters"].shape[1]
        )
        self._tables.append(pa.table({**columns, "parameters": parameters}))
        return float(np.mean(reward))

    def take(self) -> pa.Table | None:
        """All rows so far; the next call gives what came after."""
        table = pa.concat_tables(self._tables) if self._tables else None
        self._tables = []
        return table
