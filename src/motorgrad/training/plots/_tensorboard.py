"""Runs as TensorBoard event files.

The bytes of a file are a function of the records of the run, and those for the first records are a prefix of those for
all. So a file is updated by appending what is missing, whatever a killed process left of it, and an open TensorBoard
follows.
"""

import io
import math
import time
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

import pyarrow as pa

from motorgrad._extras import require
from motorgrad._files import changing, read_content, read_json, write_atomically
from motorgrad._limits import MAX_METRICS_BYTES
from motorgrad.training.plots._plot_curves import Plotted

FILE = "events.out.tfevents.motorgrad"  # TensorBoard looks for "tfevents" in the name
# TensorBoard has its own axes for the first ones; parameters are not scalars
SKIPPED = ("seed", "decision", "simulated_time", "wall_time", "cpu_time", "parameters")


def write_tensorboard(run: Plotted, folder: Path | str) -> Path:
    """Write a run's records as TensorBoard event files, in a subfolder `seed-N` of `folder`, which is returned, for
    each seed.

    Scalars are the columns of the metrics under their own names: `reward`, `apex` … A quantity that did not occur in a
    window has no point there. The step is the decision. The time is the start of the run plus the seconds spent on
    decisions, so TensorBoard's relative time excludes the pauses between sessions. Existing files are updated.
    **Raises** `RuntimeError` without the package (`motorgrad[tensorboard]`), `ValueError` for a run without records.
    """
    check_tensorboard()
    run.curve("reward")  # refuses a run without records
    # a run in memory is taken to have ended now
    start = time.time() - run.metrics["wall_time"][-1].as_py() if run.path is None else start_time(run.path)
    EventFiles(folder, run.seeds, start).add(run.metrics)
    return Path(folder)


def check_tensorboard() -> None:
    """**Raises** `RuntimeError` where the package tensorboard is missing; it names the extra."""
    require("event files need", "tensorboard", "tensorboard")


class EventFiles:
    """The event files of a run, one in the `folder` for each of its `seeds`; its `start` is in seconds since 1970."""

    def __init__(self, folder: Path | str, seeds: Sequence[int], start: float):
        self.files = [Path(folder) / f"seed-{seed}" / FILE for seed in seeds]
        self.start = start
        self.complete = False
        """Whether the files have all records but those to come; `add` then takes the new ones only."""

    def add(self, records: pa.Table | None) -> None:
        """Append records: at the first call all of the run, later the new ones."""
        new = [b""] * len(self.files) if records is None else self._encoded(records)
        for file, content in zip(self.files, new, strict=True):
            if not self.complete:
                content = self._missing(file, _event(self.start, file_version="brain.Event:2") + content)
            if content:
                with changing(file) as end:
                    end.seek(0, io.SEEK_END)
                    end.write(content)
        self.complete = True

    def _encoded(self, records: pa.Table) -> list[bytes]:
        """Records as events, for each seed."""
        names = [name for name in records.column_names if name not in SKIPPED]
        columns = {name: records[name].to_pylist() for name in ("decision", "wall_time", *names)}
        content = [io.BytesIO() for _ in self.files]
        for row in range(records.num_rows):  # records are ordered by decision, then by seed
            # what did not occur is not finite, and None in a column that only some files of a run have
            found = {name: columns[name][row] for name in names}
            known = {name: value for name, value in found.items() if value is not None and math.isfinite(value)}
            summary = {"value": [{"tag": name, "simple_value": value} for name, value in known.items()]}
            event = _event(self.start + columns["wall_time"][row], step=columns["decision"][row], summary=summary)
            content[row % len(content)].write(event)
        return [each.getvalue() for each in content]

    def _missing(self, file: Path, whole: bytes) -> bytes:
        """The part of its `whole` content that a file lacks; a file with other content is emptied."""
        file.parent.mkdir(parents=True, exist_ok=True)
        there = read_content(file, MAX_METRICS_BYTES) if file.exists() else b""
        if not whole.startswith(there):
            write_atomically(file, there := b"")
        return whole[len(there) :]


def _event(wall_time: float, **parts: object) -> bytes:
    """An event in the format of a file: its length, its bytes, their checksums."""
    from tensorboard.compat.proto.event_pb2 import Event  # type: ignore
    from tensorboard.summary.writer.record_writer import RecordWriter  # type: ignore

    content = io.BytesIO()
    RecordWriter(content).write(Event(wall_time=wall_time, **parts).SerializeToString())
    return content.getvalue()


def start_time(path: Path) -> float:
    """The start of the first session in a run directory, in seconds since 1970."""
    file = path / "provenance.json"
    try:
        return datetime.fromisoformat(read_json(file)["sessions"][0]["started"]).timestamp()
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise ValueError(f"{file}: damaged: {type(error).__name__}: {error}") from None
