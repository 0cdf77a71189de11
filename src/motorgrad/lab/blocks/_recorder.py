"""Signals as a table in a file."""

import dataclasses
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from motorgrad._errors import check
from motorgrad._files import check_writable
from motorgrad.lab._record import Record
from motorgrad.lab.blocks._viewer import Labelled

if TYPE_CHECKING:
    import pyarrow as pa
    from matplotlib.figure import Figure


@dataclasses.dataclass(frozen=True)
class Recorder(Labelled):
    """Keeps signals for a table, which `write` puts into a Parquet file when asked: running a diagram writes no file.

    The columns are `seed`, `tick`, `time` in seconds, and one for each number: `u`, or `u[0]`, `u[1]`, … of a list. Two
    labels may not be the names of the first three.
    """

    name: ClassVar[str] = "recorder"
    drawing: ClassVar[str] = "table"

    def validate(self) -> None:
        super().validate()
        taken = [label for label in self.labels if label in ("seed", "tick", "time")]
        check(not taken, "labels", self.labels, "other names than seed, tick and time")

    def table(self, record: Record, path: str, seeds: Sequence[int] | None = None) -> "pa.Table":
        """What was seen as an Arrow table, a row for each seed and sample, seed by seed.

        **Arguments:** a record; the sink's `path` in the diagram; the seeds, by default 0, 1, …
        """
        import pyarrow as pa

        signals = [self.seen(record, path, label) for label in self.labels]
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
        """Write a Parquet file, whole or not at all.

        **Arguments:** a record, or records one after the other, such as those of `Run.stream`, of which only one is in
        memory; the sink's `path` in the diagram; the file; the seeds, by default 0, 1, …

        **Returns** the file's path. **Raises** `ValueError` before anything runs where it cannot be written.
        """
        from pyarrow import parquet

        file = Path(file)
        check_writable("file", file)
        file.parent.mkdir(parents=True, exist_ok=True)
        aside = file.with_name(f".{file.name}.partial")
        writer = None
        try:
            for record in [records] if isinstance(records, Record) else records:
                table = self.table(record, path, seeds)
                writer = writer or parquet.ParquetWriter(aside, table.schema)
                writer.write_table(table)
            check(writer, "records", "none", "at least one")
        except BaseException:
            if writer is not None:
                writer.close()
            aside.unlink(missing_ok=True)
            raise
        assert writer is not None
        writer.close()
        os.replace(aside, file)
        return file

    def figure(self, record: Record, path: str) -> "Figure":
        from motorgrad.lab.blocks._scope import Scope

        return Scope(self.labels, self.shape).figure(record, path)
