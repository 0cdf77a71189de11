"""Columns of numbers in a file: CSV, Parquet or NPZ."""

import io
import stat
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from motorgrad._errors import shown, unknown

LARGEST = 2**30  # bytes of a file, packed or not
KINDS = (".csv", ".parquet", ".npz")


def read_columns(path: str, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """These columns of a table, each `(rows,)` in double precision.

    **Raises** `ValueError` that names the file and says what is wrong: that it cannot be read, has no such column, or
    that a column has no rows, or something in it that is no finite number in single precision.
    """
    if Path(path).suffix.lower() not in KINDS:
        raise ValueError(f"path = {shown(path)}: must be a file whose name ends in {', '.join(KINDS)}")
    try:
        status = Path(path).stat()
        if not stat.S_ISREG(status.st_mode):  # to read a pipe might never end
            raise ValueError("must be a file, not a folder, a pipe or a device")
        _check_size(status.st_size)
        content = Path(path).read_bytes()
        table = _table(Path(path).suffix.lower(), content)
        for name in names:
            if name not in table:
                raise unknown("column", name, table)
        columns = {name: _numbers(name, table[name]) for name in names}
        lengths = {name: len(column) for name, column in columns.items()}
        if len(set(lengths.values())) > 1:
            raise ValueError(f"columns of different lengths: {', '.join(f'{n} {m}' for n, m in lengths.items())}")
    except OSError as error:
        raise ValueError(f"path = {shown(path)}: cannot be read: {error.strerror or error}") from None
    except ValueError as error:
        raise ValueError(f"path = {shown(path)}: {' '.join(str(error).splitlines())}") from None
    return columns


def _table(kind: str, content: bytes) -> dict[str, Any]:
    import pyarrow as pa

    if kind == ".npz":
        try:
            with zipfile.ZipFile(io.BytesIO(content)) as packed:
                _check_size(sum(part.file_size for part in packed.infolist()))
            with np.load(io.BytesIO(content), allow_pickle=False) as stored:
                return {name: stored[name] for name in stored.files}
        except (ValueError, EOFError, OSError, MemoryError, zipfile.BadZipFile) as error:
            raise ValueError(f"no NPZ file of arrays: {error}") from None
    from pyarrow import csv, parquet

    try:
        if kind == ".parquet":
            packed = parquet.ParquetFile(pa.BufferReader(content))
            _check_size(8 * packed.metadata.num_rows * packed.metadata.num_columns)
            table = packed.read()
        else:
            table = csv.read_csv(pa.BufferReader(content))
    except (pa.ArrowException, OSError) as error:
        raise ValueError(f"no {kind.lstrip('.').upper()} table: {error}") from None
    return {name: table[name].to_numpy() for name in table.column_names}


def _numbers(name: str, column: np.ndarray) -> np.ndarray:
    if column.ndim != 1 or column.dtype.kind not in "biuf" or len(column) == 0:
        raise ValueError(f"column {name}: must be a list of numbers, at least one")
    numbers = column.astype(float)
    with np.errstate(over="ignore"):
        wrong = np.flatnonzero(~np.isfinite(numbers.astype(np.float32)))
    if wrong.size:
        raise ValueError(f"column {name}, row {wrong[0]}: must be a finite number, not {numbers[wrong[0]]}")
    return numbers


def _check_size(size: int) -> None:
    if size > LARGEST:
        raise ValueError(f"larger than {LARGEST:,} bytes")
