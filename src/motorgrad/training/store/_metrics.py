"""The records of a run: Parquet files, and the list of their checksums.

The list is in the format of `sha256sum`, in the order of the decisions. Each commit appends a line, and its checkpoint
has the length and the checksum of the list up to there. So saving costs the same however long a run is, and every file
is covered. What the last checkpoint does not cover is no part of the run.
"""

import hashlib
import math
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

from motorgrad._errors import check, shown
from motorgrad._files import changing, read_content, write_atomically
from motorgrad._limits import MAX_METRICS_BYTES, MAX_TABLE_BYTES
from motorgrad._parquet import parquet_in
from motorgrad.training.store._checkpoint import checksum

LIST = "SHA256SUMS"
COLUMNS = {
    "setting": pa.int64(),
    "seed": pa.int32(),
    "decision": pa.int64(),
    "simulated_time": pa.float64(),
    "wall_time": pa.float64(),
    "cpu_time": pa.float64(),
    "reward": pa.float32(),
    "parameters": None,
}
"""Of all records; of the first and the sixth, there may be none."""
PART = re.compile(r"[0-9]{1,20}-[0-9]{1,20}\.parquet")


class Damage(NamedTuple):
    """A damaged or missing file: its name, the last decision that it has records of, and what is wrong."""

    name: str
    decision: int
    what: str


class MetricsFiles:
    """The files of the folder `metrics/`."""

    def __init__(self, folder: Path):
        self.folder = folder
        self._list = folder / LIST
        self._length = 0
        self._digest = hashlib.sha256()

    @property
    def mark(self) -> dict[str, Any]:
        """What a checkpoint holds to identify the list."""
        return {"length": self._length, "checksum": self._digest.hexdigest()}

    def write(self, records: pa.Table) -> tuple[str, str]:
        """Write records to a file. Returns its name and checksum."""
        first, last = (records["decision"][i].as_py() for i in (0, -1))
        sink = pa.BufferOutputStream()
        # what was measured hardly repeats: dictionaries of it take time and space
        repeats = [field.name for field in records.schema if field.type in (pa.int32(), pa.int64(), pa.float64())]
        pq.write_table(records, sink, use_dictionary=repeats)  # type: ignore[arg-type]
        content = sink.getvalue().to_pybytes()
        name = f"{first:012d}-{last:012d}.parquet"
        write_atomically(self.folder / name, content)
        return name, checksum(content)

    def append(self, name: str, mark: str) -> None:
        """Add a file to the list."""
        line = _line(name, mark)
        with changing(self._list) as file:
            file.seek(self._length)
            file.truncate()  # what a write that failed has left
            file.write(line)
            file.flush()
            os.fsync(file.fileno())
        self._length += len(line)
        self._digest.update(line)

    def roll_back(self, recorded: int, known: dict[str, str], kept: str | None = None) -> None:
        """Discard records after the decision `recorded`, but for the file `kept`. `known` are the files of the run with
        their checksums."""
        content = b"".join(_line(name, mark) for name, mark in known.items() if last_of(name) <= recorded)
        if content != (read_content(self._list, MAX_METRICS_BYTES) if self._list.exists() else b""):
            write_atomically(self._list, content)
        self._length = len(content)
        self._digest = hashlib.sha256(content)
        for part in self._parts(after=recorded):
            if part != kept:
                (self.folder / part).unlink()

    def listed(self, mark: dict[str, Any], recorded: int) -> tuple[dict[str, str], list[Damage]]:
        """The files that a checkpoint covers with their checksums, and what is wrong with the list."""
        content = read_content(self._list, MAX_METRICS_BYTES)[: mark["length"]] if self._list.exists() else b""
        if checksum(content) == mark["checksum"]:
            return dict(_entries(content)), []
        what = "is damaged" if self._list.exists() else "is missing"
        again = {
            name: checksum(read_content(self.folder / name, MAX_TABLE_BYTES)) for name in self._parts(upto=recorded)
        }
        if checksum(b"".join(_line(*entry) for entry in again.items())) == mark["checksum"]:
            return again, [Damage(LIST, 0, f"{what}; the files that it lists are whole")]
        known = {name: value for name, value in _entries(content) if last_of(name) <= recorded}
        unknown = [Damage(name, last_of(name), f"is not in {LIST}") for name in again if name not in known]
        return known, [Damage(LIST, 0, what), *unknown]

    def read(self, files: dict[str, str]) -> tuple[list[pa.Table], list[Damage]]:
        """The records of the files that are whole, in order, and what is wrong with the others."""
        tables = []
        damage = []
        rest = MAX_METRICS_BYTES
        for name, mark in files.items():
            try:
                content = read_content(self.folder / name, MAX_TABLE_BYTES)
            except FileNotFoundError:
                damage.append(Damage(name, last_of(name), "is missing"))
                continue
            if checksum(content) == mark:
                try:
                    tables.append(parquet_in(content, min(rest, MAX_TABLE_BYTES)))
                    _check_records(tables[-1])
                except ValueError as error:
                    raise ValueError(f"{self.folder / name}: {error}") from None
                rest -= tables[-1].nbytes
            else:
                damage.append(Damage(name, last_of(name), "is damaged: its checksum does not match"))
        return tables, damage

    def _parts(self, after: int = -1, upto: float = math.inf) -> list[str]:
        names = sorted(part.name for part in self.folder.glob("*.parquet") if PART.fullmatch(part.name))
        return [name for name in names if after < last_of(name) <= upto]


def _check_records(table: pa.Table) -> None:
    """Refuse a table of other columns than records have. **Raises** `ValueError`."""
    names = table.column_names
    check(len(set(names)) == len(names), "columns", names, "each there once")
    check(set(COLUMNS) - {"setting", "cpu_time"} <= set(names), "columns", names, "those of records")
    for field in table.schema:
        kind = field.type
        place = f"type of column {shown(field.name)}"
        if field.name == "parameters":
            right = pa.types.is_fixed_size_list(kind) and kind.value_type == pa.float32()
            check(right, place, str(kind), "as many numbers of single precision in each row")
        else:
            wanted = COLUMNS.get(field.name)
            right = kind == wanted if wanted else pa.types.is_integer(kind) or pa.types.is_floating(kind)
            check(right, place, str(kind), str(wanted or "a number"))
        check(table[field.name].null_count == 0, f"column {shown(field.name)}", "gaps", "a number in each row")


def last_of(name: str) -> int:
    """The last decision of the records in a file."""
    return int(name.removesuffix(".parquet").split("-")[1])


def _line(name: str, mark: str) -> bytes:
    return f"{mark}  {name}\n".encode()


def _entries(content: bytes) -> Iterator[tuple[str, str]]:
    """The names and checksums in a list; lines that are none are left out."""
    for line in content.decode(errors="replace").split("\n"):
        mark, _, name = line.partition("  ")
        if PART.fullmatch(name):
            yield name, mark
