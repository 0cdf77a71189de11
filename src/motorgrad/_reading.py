"""Reading files that may be a stranger's, within the limits of `motorgrad._limits`.

Sizes are checked before anything is unpacked, and what is unpacked is counted, as what a file says of itself may be a
lie. All functions raise `ValueError` of one line, without the name of the file, which their callers add.
"""

import io
import json
import math
import os
import re
import stat
import tomllib
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motorgrad._errors import check, shown
from motorgrad._limits import (
    MOST_DIGITS,
    MOST_ENTRIES,
    MOST_JSON_BYTES,
    MOST_KEY_PARTS,
    MOST_NESTED,
    MOST_TABLE_COLUMNS,
    MOST_TABLE_PARTS,
)

if TYPE_CHECKING:
    import zipfile  # loading these would slow down every command's start

    import numpy as np
    import pyarrow as pa

ENTRY = b"PK\1\2"  # how every entry begins in the table of contents of a zip file
PLAIN = (0, 8)  # stored and deflated; the others are unpacked as a whole, however much it becomes
PIECE = 2**20  # bytes that are unpacked at a time
_PART = r"""(?>[A-Za-z0-9_-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')[ \t]*+"""
_LONG_KEY = re.compile(rf"(?<![A-Za-z0-9_-])(?:{_PART}\.[ \t]*+){{{MOST_KEY_PARTS}}}")
_DAMAGED = (EOFError, OverflowError, MemoryError, RecursionError, SyntaxError, TypeError, KeyError, IndexError)


def content_of(path: Path, most: int | None = None) -> bytes:
    """The content of a file of at most so many bytes, by default of any length.

    It must be a regular one: a device may never end, and a pipe never begin. **Raises** `OSError` where there is none.
    """
    file = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    with os.fdopen(file, "rb") as stream:
        about = os.fstat(file)
        if not stat.S_ISREG(about.st_mode):
            raise ValueError("must be a file, not a folder, a pipe or a device")
        _check_bytes(about.st_size, most)
        content = stream.read()
    _check_bytes(len(content), most)
    return content


def json_in(content: bytes | str, most: int = MOST_JSON_BYTES) -> Any:
    """What a JSON text says."""
    _check_bytes(len(content), most)
    try:
        found = json.loads(content)
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None
    check_plain(found)
    return found


def toml_in(text: str) -> dict[str, Any]:
    """What a TOML text says."""
    if (key := _LONG_KEY.search(text)) is not None:
        raise ValueError(f"key {shown(key[0])}: must be of at most {MOST_KEY_PARTS} names")
    try:
        found = tomllib.loads(text)
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None
    check_plain(found)
    return found


def check_plain(data: Any) -> None:
    """Refuse lists and tables nested too deeply, and whole numbers too large to work with."""
    todo, largest = [(data, 0)], 10**MOST_DIGITS
    while todo:
        value, depth = todo.pop()
        if isinstance(value, dict | list):
            if depth >= MOST_NESTED:
                raise ValueError(_TOO_DEEP)
            todo += [(each, depth + 1) for each in (value.values() if isinstance(value, dict) else value)]
        elif isinstance(value, int) and not -largest < value < largest:
            digits = int(value.bit_length() * math.log10(2)) + 1
            raise ValueError(f"whole number of about {digits:,} digits: must be of at most {MOST_DIGITS}")


def entries_in(content: bytes, most: int) -> "zipfile.ZipFile":
    """A zip file whose entries unpack to at most so many bytes in all, as it says itself. `unpacked` reads them."""
    import zipfile

    number = content.count(ENTRY)
    check(number <= MOST_ENTRIES, "entries", number, f"at most {MOST_ENTRIES:,}")  # before they are listed
    try:
        packed = zipfile.ZipFile(io.BytesIO(content))
    except (zipfile.BadZipFile, *_DAMAGED, NotImplementedError, OSError) as error:
        raise ValueError(_told(error)) from None
    _check_unpacked(sum(entry.file_size for entry in packed.infolist()), most)
    return packed


def unpacked(packed: "zipfile.ZipFile", name: str, most: int) -> bytes:
    """An entry of a zip file, of at most so many bytes whatever the file says of it."""
    from zipfile import BadZipFile

    try:
        entry = packed.getinfo(name)
    except KeyError:
        raise ValueError(f"holds no {shown(name)}") from None
    check(entry.compress_type in PLAIN, f"packing of {shown(name)}", entry.compress_type, "stored or deflated")
    _check_unpacked(entry.file_size, most)
    try:
        with packed.open(entry) as stream:  # as a whole, it would unpack all before it looks at the length
            return b"".join(iter(lambda: stream.read(PIECE), b""))
    except (BadZipFile, zlib.error, *_DAMAGED, NotImplementedError, RuntimeError, OSError) as error:
        raise ValueError(f"{shown(name)}: {_told(error)}") from None


def arrays_in(content: bytes, most: int) -> "dict[str, np.ndarray]":
    """The arrays of an NPZ file, of at most so many bytes in all."""
    with entries_in(content, most) as packed:
        return {name.removesuffix(".npy"): array_in(unpacked(packed, name, most)) for name in packed.namelist()}


def array_in(content: bytes) -> "np.ndarray":
    """The array of an NPY file. Objects, which are pickled, are refused."""
    from numpy.lib import format as npy

    stream = io.BytesIO(content)
    try:
        version = npy.read_magic(stream)
        # the third version has the lengths of the second
        shape, _, dtype = (npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0)(stream)
        rest = len(content) - stream.tell()
        size = math.prod(shape) * max(dtype.itemsize, 1)  # entries of no size could be any number
        fits = all(length >= 0 for length in shape) and (dtype.hasobject or size <= rest)
        check(fits, "array", f"{shown(shape)} of {shown(str(dtype))}", f"of the {rest:,} bytes that there are")
        stream.seek(0)
        return npy.read_array(stream, allow_pickle=False)
    except _DAMAGED as error:
        raise ValueError(_told(error)) from None


def parquet_in(content: bytes, most: int) -> "pa.Table":
    """The table of a Parquet file, of at most so many bytes where a number takes 8. A column has numbers or texts; one
    may have as many numbers in each row.
    """
    import pyarrow as pa
    from pyarrow import parquet

    try:
        head = parquet.ParquetFile(pa.BufferReader(content))
        about, schema = head.metadata, head.schema_arrow
        check(about.num_columns <= MOST_TABLE_COLUMNS, "columns", about.num_columns, f"at most {MOST_TABLE_COLUMNS:,}")
        parts = about.num_row_groups * about.num_columns
        check(parts <= MOST_TABLE_PARTS, "groups of rows times columns", parts, f"at most {MOST_TABLE_PARTS:,}")
        groups = [about.row_group(i) for i in range(about.num_row_groups)]
        numbers = sum(group.column(i).num_values for group in groups for i in range(about.num_columns))
        _check_unpacked(8 * max(numbers, about.num_rows * about.num_columns), most)
        for name in schema.names:
            kind = schema.field(name).type
            check(_is_plain(kind), f"type of column {shown(name)}", str(kind), "numbers or texts")
        # texts as they are stored: a long one that many rows share would take its length in each
        texts = [name for name in schema.names if pa.types.is_string(schema.field(name).type)]
        return _with_texts(parquet.ParquetFile(pa.BufferReader(content), read_dictionary=texts).read(), schema, most)
    except (pa.ArrowException, OSError, OverflowError, MemoryError, KeyError) as error:
        raise ValueError(f"not a Parquet table: {_told(error)}") from None


def _is_plain(kind: "pa.DataType") -> bool:
    """Whether a column holds numbers, as many in each row, or texts, which can be read as they are stored."""
    import pyarrow.types as kinds

    if kinds.is_fixed_size_list(kind):
        kind = kind.value_type
    elif kinds.is_dictionary(kind):
        return kinds.is_string(kind.value_type)
    elif kinds.is_string(kind):
        return True
    return kinds.is_primitive(kind) or kinds.is_null(kind)


def _with_texts(table: "pa.Table", schema: "pa.Schema", most: int) -> "pa.Table":
    """The table with its texts in the types of its schema."""
    import pyarrow as pa
    import pyarrow.compute as pc

    size = table.nbytes
    for place, name in enumerate(table.column_names):
        column, kind = table.column(place), schema.field(name).type
        if column.type == kind or not pa.types.is_dictionary(column.type):
            continue
        for part in column.chunks:
            lengths = pc.call_function("binary_length", [part.dictionary]).take(part.indices)
            size += pc.call_function("sum", [lengths.cast(pa.int64())]).as_py() or 0
        _check_unpacked(size, most)
        table = table.set_column(place, schema.field(name), column.cast(kind))
    return table


def csv_in(content: bytes, most: int) -> "pa.Table":
    """The table of a CSV file with a line of names, of at most so many bytes where a number takes 8."""
    import pyarrow as pa
    from pyarrow import csv

    columns = content.partition(b"\n")[0].count(b",") + 1
    check(columns <= MOST_TABLE_COLUMNS, "columns", columns, f"at most {MOST_TABLE_COLUMNS:,}")
    _check_unpacked(8 * (content.count(b",") + content.count(b"\n")), most)
    try:
        return csv.read_csv(pa.BufferReader(content))
    except (pa.ArrowException, OSError) as error:
        raise ValueError(f"not a CSV table: {_told(error)}") from None


_TOO_DEEP = f"nested too deeply: must be of at most {MOST_NESTED} lists and tables within each other"


def _check_bytes(size: int, most: int | None) -> None:
    check(most is None or size <= most, "bytes", size, f"at most {most:,}" if most is not None else "")


def _check_unpacked(size: int, most: int) -> None:
    check(size <= most, "bytes when unpacked", size, f"at most {most:,}")


def _told(error: BaseException) -> str:
    return " ".join(str(error).split())[:300] or type(error).__name__
