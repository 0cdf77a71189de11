"""The folder of a study.

study.toml       the study
jobs/NAME/       the run directory of every job
failures/*.json  jobs that were set aside, with their reasons
index.parquet    one row per setting and seed; it is made again from the run directories
index.html       the page
"""

import contextlib
import itertools
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Self

import filelock
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import tomli_w

from motorgrad._files import refuse_links, remove_partials, write_atomically
from motorgrad._limits import MAX_TABLE_BYTES
from motorgrad._parquet import parquet_in
from motorgrad._reading import content_of, json_in
from motorgrad.studies._jobs import JobFolder
from motorgrad.studies._partition import Job
from motorgrad.studies._plan import StudyPlan
from motorgrad.training import RunDirectoryError, differences, load


def check_folder(path: Path, file: str, kind: str, given: Mapping[str, Any], stored: Mapping[str, Any] | None) -> None:
    """Refuse a folder that cannot belong to a study.

    **Arguments:**

    - `file`: what describes the study in its folder.
    - `kind`: of study: a noun for messages.
    - `given`, `stored`: the study as a plain table, and the one in the folder; `None` where there is none.

    **Raises** `RunDirectoryError` for a folder that holds something else, or another study.
    """
    if stored is not None:
        for where, now, then in differences(given, stored):
            raise RunDirectoryError(
                f"{path} holds another {kind}: {where} was {then!r} and is now {now!r}; choose another folder"
            )
    elif path.exists() and (not path.is_dir() or any(not name.startswith(".") for name in os.listdir(path))):
        raise RunDirectoryError(f"{path} holds other files and no {file}: not the folder of a {kind}")


@contextlib.contextmanager
def locked(path: Path, kind: str) -> Iterator[None]:
    """The folder of a study, created if missing, and locked against other drivers.

    **Raises** `RunDirectoryError` where another process has it.
    """
    path.mkdir(parents=True, exist_ok=True)
    refuse_links_of(path)
    lock = filelock.FileLock(path / ".lock", timeout=0)
    try:
        lock.acquire()
    except filelock.Timeout:
        raise RunDirectoryError(f"{path} is in use by another process, which drives this {kind}") from None
    try:
        yield
    finally:
        lock.release()


def refuse_links_of(path: Path) -> None:
    """Refuse links in the folder of a study, and in its folders. Each run directory refuses its own.

    **Raises** `RunDirectoryError` that names the link.
    """
    try:
        refuse_links(path, *(each.name for each in path.glob("*") if each.is_dir()))
    except ValueError as error:
        raise RunDirectoryError(str(error)) from None


class StudyFolder(JobFolder[Job, pa.Table]):
    """The folder of a study. As a context manager, it is locked against other drivers.

    **Raises** `RunDirectoryError` for a folder that holds something else, or another study.
    """

    kind: ClassVar[type[StudyPlan]] = StudyPlan
    """What reads `study.toml`: `Study`, which says so itself, as it stands above the folders in which it runs."""

    def __init__(self, path: Path | str, study: StudyPlan | None = None, trust: bool = False):
        super().__init__(path)
        refuse_links_of(self.path)
        file = self.path / "study.toml"
        stored = self.kind.read(file, trust=trust) if file.is_file() else None
        if study is not None:
            check_folder(self.path, file.name, "study", study.as_table(), stored and stored.as_table())
        found = stored or study
        if found is None:
            raise RunDirectoryError(f"{self.path} is not the folder of a study: it has no study.toml")
        self.study = found
        if stored is not None:
            try:
                stored.check()
            except ValueError as error:
                raise ValueError(f"{file}: {error}") from None
        self._rows: dict[str, pa.Table] = {}
        self._begun: dict[str, pa.Table] = {}
        self._lock = contextlib.ExitStack()

    def __enter__(self) -> Self:
        self._lock.enter_context(locked(self.path, "study"))
        for folder in (self.path, self.path / "failures"):
            remove_partials(folder)
        if not (self.path / "study.toml").is_file():
            write_atomically(self.path / "study.toml", tomli_w.dumps(self.study.as_table()).encode())
        for name in ("jobs", "failures"):
            (self.path / name).mkdir(exist_ok=True)
        try:
            self.read_rows()
        except BaseException:
            self._lock.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._lock.close()

    @property
    def jobs(self) -> list[Job]:
        """The compiled calls of the study."""
        return self.study.jobs

    def place(self, job: Job) -> Path:
        """The run directory of a job."""
        return self.path / "jobs" / job.name

    def saved(self, job: Job) -> int:
        """The decisions per seed that a job has saved."""
        return int(newest.stem) if (newest := self._newest(job)) else 0

    def read_rows(self) -> None:
        """Find the jobs that are done: in the index if it is as new as their run directories, or else in these."""
        stored = self._stored()
        for job in self.study.jobs:
            if self.saved(job) < job.steps or not job.is_measured(self.place(job)):
                continue
            mark, rows = stored.get(job.name, (None, None))
            lanes = len(job.points) * len(self.study.seed_list)
            known = rows is not None and mark == self._mark(job) and rows.num_rows == lanes
            self._rows[job.name] = rows if known else self._rows_of(job)

    def read_begun(self) -> None:
        """Read what the unfinished jobs have saved so far."""
        found = {}
        for job in self.study.jobs:
            if not self.is_done(job) and self.saved(job):
                with contextlib.suppress(RunDirectoryError):  # it has been begun again just now
                    found[job.name] = self._rows_of(job)
        self._begun = found

    def _rows_of(self, job: Job) -> pa.Table:
        """The rows of a job in the index, from its run directory. **Raises** `RunDirectoryError` where that is of
        another job."""
        rows = job.rows(load(self.place(job)))
        lanes = len(job.points) * len(self.study.seed_list)
        if rows.num_rows != lanes:
            raise RunDirectoryError(
                f"{self.place(job)}: rows of settings and seeds = {rows.num_rows:,}: must be {lanes:,}, as study.toml "
                "asks for; one of them was changed"
            )
        return rows

    def add(self, job: Job, result: pa.Table) -> None:
        """Record a job that is done."""
        self._rows[job.name] = result

    def is_done(self, job: Job) -> bool:
        """Whether a job is done."""
        return job.name in self._rows

    def index(self) -> pa.Table:
        """One row per setting and seed: `job`, `point`, `seed`, the settings by path, `status` (`"done"`, `"failed"`,
        `"begun"` or `"waiting"`), `decision` and the final metrics; of jobs that have begun, those so far, as
        `read_begun` found them."""
        jobs, settings, seeds = self.study.jobs, self.study.settings, self.study.seed_list
        order = np.concatenate([job.points for job in jobs])
        paths = list(dict.fromkeys(path for setting in settings for path in setting))
        failed = {failure["job"] for failure in self.failures()}
        metrics = []
        lanes = [len(job.points) * len(seeds) for job in jobs]
        status = []
        decisions = []
        for job, count in zip(jobs, lanes, strict=True):
            rows = self._rows.get(job.name)
            decision = self.saved(job)
            state = "failed" if job.name in failed else "begun" if decision else "waiting"
            status.append("done" if rows is not None else state)
            decisions.append(decision)
            blank = self._begun.get(job.name, pa.table({"decision": np.full(count, decision, np.int64)}))
            metrics.append(blank if rows is None else rows)
        columns: dict[str, Any] = {
            "job": pa.array(np.repeat([job.name for job in jobs], lanes)).dictionary_encode(),
            "point": np.repeat(order, len(seeds)),
            "seed": np.tile(np.asarray(seeds, np.int64), len(order)),
        }
        for path in paths:
            values = _column([settings[point].get(path) for point in order])
            columns[path] = values.take(np.repeat(np.arange(len(order)), len(seeds)))
        columns["status"] = pa.array(np.repeat(status, lanes)).dictionary_encode()
        found = pa.table(columns)
        results = pa.concat_tables(metrics, promote_options="default")
        for name in results.column_names:
            found = found.append_column(name, results[name])
        return found

    def write_index(self) -> pa.Table:
        """Write the index, and return it."""
        table = self.index()
        marks = {job.name: self._mark(job) for job in self.study.jobs if self.is_done(job)}
        kept = table.replace_schema_metadata({"marks": json.dumps(marks)})
        sink = pa.BufferOutputStream()
        pq.write_table(kept, sink, compression="zstd")
        write_atomically(self.path / "index.parquet", sink.getvalue().to_pybytes())
        return table

    def about(self, job: Job) -> dict[str, Any]:
        """The record of a failed job: its points, and the settings of the first."""
        return {"points": list(job.points), "settings": [self.study.settings[point] for point in job.points[:10]]}

    def _stored(self) -> dict[str, tuple[Any, pa.Table]]:
        """The rows of the jobs in the index file, with the marks of their run directories then."""
        try:
            table = parquet_in(content_of(self.path / "index.parquet", MAX_TABLE_BYTES), MAX_TABLE_BYTES)
            marks = json_in((table.schema.metadata or {})[b"marks"])
            names = table["job"].cast(pa.string()).to_numpy()
            metrics = table.select(range(table.column_names.index("status") + 1, table.num_columns))
        except (OSError, ValueError, KeyError, pa.ArrowException):  # the run directories have everything
            return {}
        numbers = all(map(_is_number, metrics.schema.types)) and len({*metrics.column_names}) == metrics.num_columns
        if not (isinstance(marks, dict) and len(names) and numbers):
            return {}
        starts = [0, *(np.flatnonzero(names[1:] != names[:-1]) + 1).tolist(), len(names)]
        found = {}
        for start, end in itertools.pairwise(starts):
            part = metrics.slice(start, end - start)
            filled = [name for name in part.column_names if part[name].null_count < part.num_rows]
            found[names[start]] = (marks.get(names[start]), part.select(filled))
        return found

    def _newest(self, job: Job) -> Path | None:
        return max((self.place(job) / "checkpoint").glob("[0-9]*.state"), default=None)

    def _mark(self, job: Job) -> list[Any] | None:
        """What changes when a run directory does."""
        newest = self._newest(job)
        return None if newest is None else [newest.name, newest.stat().st_size, newest.stat().st_mtime_ns]


def _is_number(kind: pa.DataType) -> bool:
    return pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_null(kind)


def _column(values: Sequence[Any]) -> pa.Array:
    """Values of one setting; as JSON where they are of several types."""
    kinds = {bool if isinstance(v, bool) else float if isinstance(v, int | float) else type(v) for v in values}
    if kinds - {type(None)} == {float}:
        return pa.array([None if value is None else float(value) for value in values])
    if len(kinds - {type(None)}) == 1 and not kinds & {list, dict}:
        return pa.array(values)
    return pa.array([None if v is None else v if isinstance(v, str) else json.dumps(v) for v in values])
