"""Recording signals to tables and Parquet files."""

import contextlib
import dataclasses
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from motorgrad._errors import check
from motorgrad._files import check_writable, replacing
from timlab.blocks._scopes import Labelled
from timlab.diagram import Record

if TYPE_CHECKING:
    import pyarrow as pa
    from matplotlib.figure import Figure


@dataclasses.dataclass(frozen=True)
class Recorder(Labelled):
    """Record signals for a table, which `write` saves as a Parquet file; running a diagram writes no file.

        recorder.write(run.stream(100_000), "recorder", "signals.parquet")

    The columns are `seed`, `tick`, `time` in seconds, and one per number: `u`, or `u[0]`, `u[1]`, … for a list. Labels
    may not be named like the first three.
    """

    name: ClassVar[str] = "recorder"
    drawing: ClassVar[str] = "table"

    def validate(self) -> None:
        super().validate()
        taken = [label for label in self.labels if label in ("seed", "tick", "time")]
        check(not taken, "labels", self.labels, "names other than seed, tick and time")

    def table(self, record: Record, path: str, seeds: Sequence[int] | None = None) -> "pa.Table":
        """The recorded signals as an Arrow table, one row per seed and sample, grouped by seed.

        **Arguments:** a record; the sink's `path` in the diagram; the seeds, by default 0, 1, …
        """
        import pyarrow as pa

        signals = [self.recorded(record, path, label) for label in self.labels]
        count, samples, _ = signals[0].shape
        own = np.arange(count) if seeds is None else np.asarray(seeds)
        check(own.shape == (count,), "seeds", own.tolist(), f"as many as the record has, {count}")
        times = record.times(f"{path}.{self.labels[0]}")
        numbers = np.concatenate(signals, axis=-1).reshape(count * samples, -1)
        columns = {
            "seed": np.repeat(own.astype(np.int64), samples),
            "tick": np.tile(np.rint(times / record.tick).astype(np.int64), count),
            "time": np.tile(times, count),
        }
        return pa.table(columns | dict(zip(self.columns(), numbers.T, strict=True)))

    def write(
        self, records: Record | Iterable[Record], path: str, file: str | Path, seeds: Sequence[int] | None = None
    ) -> Path:
        """Write a Parquet file atomically.

        **Arguments:** a record, or consecutive records such as those of `Run.stream`, of which only one is in memory at
        a time; the sink's `path` in the diagram; the file; the seeds, by default 0, 1, …

        **Returns** the file's path. **Raises** `ValueError` before anything runs if the file cannot be written.
        """
        from pyarrow import parquet

        file = Path(file)
        check_writable("file", file)
        file.parent.mkdir(parents=True, exist_ok=True)
        with replacing(file) as aside, contextlib.ExitStack() as opened:
            writer = None
            for record in [records] if isinstance(records, Record) else records:
                table = self.table(record, path, seeds)
                writer = writer or opened.enter_context(parquet.ParquetWriter(aside, table.schema))
                writer.write_table(table)
            check(writer, "records", "none", "at least one")
        return file

    def figure(self, record: Record, path: str) -> "Figure":
        from timlab.blocks._scopes import Scope

        return Scope(self.labels, self.shape).figure(record, path)
