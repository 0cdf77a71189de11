"""Reading files that may be a stranger's, within the limits of `motorgrad._limits`.

Sizes are checked before anything is unpacked, and what is unpacked is counted, as what a file says of itself may be a
lie. All functions raise `ValueError` of one line, without the name of the file, which their callers add.
"""

import errno
import io
import json
import math
import os
import re
import stat
import tokenize
import tomllib
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motorgrad._errors import check, shown
from motorgrad._limits import (
    MAX_INTEGER_DIGITS,
    MAX_JSON_BYTES,
    MAX_KEY_PARTS,
    MAX_NESTING_DEPTH,
    MAX_TABLE_COLUMNS,
    MAX_ZIP_ENTRIES,
)

if TYPE_CHECKING:
    import zipfile  # loading these would slow down every command's start

    import numpy as np
    import pyarrow as pa

ENTRY = b"PK\1\2"  # how every entry begins in the table of contents of a zip file
PLAIN = (0, 8)  # stored and deflated; the others are unpacked as a whole, however much it becomes
LAST_CHARACTER = 0x10FFFF
PIECE = 2**20  # bytes that are unpacked at a time
MAX_EMPTY_ARRAY_BYTES = 2**20  # if each length of 0 were 1
_PART = r"""(?>[A-Za-z0-9_-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')[ \t]*+"""
_LONG_KEY = re.compile(rf"(?<![A-Za-z0-9_-])(?:{_PART}\.[ \t]*+){{{MAX_KEY_PARTS}}}")
_DAMAGED = (
    EOFError,
    OverflowError,
    MemoryError,
    RecursionError,
    SyntaxError,
    tokenize.TokenError,  # of NumPy, which tries the heads of arrays as Python 2 wrote them
    TypeError,
    KeyError,
    IndexError,
)


def content_of(path: Path, most: int) -> bytes:
    """The content of a file of at most so many bytes. It must be a regular one: a device may never end, and a pipe
    never begin. **Raises** `OSError` where there is none."""
    file = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    if stat.S_ISDIR(os.fstat(file).st_mode):  # of which `fdopen` would name the number alone
        os.close(file)
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    with os.fdopen(file, "rb") as stream:
        about = os.fstat(file)
        if not stat.S_ISREG(about.st_mode):
            raise ValueError("must be a file, not a folder, a pipe or a device")
        _check_bytes(about.st_size, most)
        content = stream.read()
    _check_bytes(len(content), most)
    return content


def json_in(content: bytes | str, most: int = MAX_JSON_BYTES) -> Any:
    """What a JSON text says."""
    _check_bytes(len(content), most)
    try:
        found = json.loads(content if isinstance(content, str) else content.decode())  # not UTF-16, as it would guess
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None
    check_plain(found)
    return found


def toml_in(text: str) -> dict[str, Any]:
    """What a TOML text says."""
    if (key := _LONG_KEY.search(text)) is not None:
        raise ValueError(f"key {shown(key[0])}: must be of at most {MAX_KEY_PARTS} names")
    try:
        found = tomllib.loads(text)
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None
    check_plain(found)
    return found


def check_plain(data: object) -> None:
    """Refuse lists and tables nested too deeply, whole numbers too large to work with, and the dates of TOML."""
    todo: list[tuple[object, int]] = [(data, 0)]
    largest = 10**MAX_INTEGER_DIGITS
    while todo:
        value, depth = todo.pop()
        if isinstance(value, dict | list):
            if depth >= MAX_NESTING_DEPTH:
                raise ValueError(_TOO_DEEP)
            todo += [(each, depth + 1) for each in (value.values() if isinstance(value, dict) else value)]
        elif isinstance(value, int) and not -largest < value < largest:
            digits = int(value.bit_length() * math.log10(2)) + 1
            raise ValueError(f"whole number of about {digits:,} digits: must be of at most {MAX_INTEGER_DIGITS}")
        elif not (value is None or isinstance(value, int | float | str)):
            raise ValueError(f"{value}: must not be a date or a time, unless it is a text, in quotes")


def entries_in(content: bytes, most: int) -> "zipfile.ZipFile":
    """A zip file whose entries unpack to at most so many bytes in all, as it says itself. `unpacked` reads them."""
    import zipfile

    number = content.count(ENTRY)
    check(number <= MAX_ZIP_ENTRIES, "entries", number, f"at most {MAX_ZIP_ENTRIES:,}")  # before they are listed
    try:
        packed = zipfile.ZipFile(io.BytesIO(content))
    except (zipfile.BadZipFile, *_DAMAGED, NotImplementedError, OSError) as error:
        raise ValueError(error_message(error)) from None
    check_unpacked(sum(entry.file_size for entry in packed.infolist()), most)
    return packed


def unpacked(packed: "zipfile.ZipFile", name: str, most: int) -> bytes:
    """An entry of a zip file, of at most so many bytes whatever the file says of it."""
    from zipfile import BadZipFile

    try:
        entry = packed.getinfo(name)
    except KeyError:
        raise ValueError(f"holds no {shown(name)}") from None
    check(entry.compress_type in PLAIN, f"packing of {shown(name)}", entry.compress_type, "stored or deflated")
    check_unpacked(entry.file_size, most)
    try:
        with packed.open(entry) as stream:  # as a whole, it would unpack all before it looks at the length
            return b"".join(iter(lambda: stream.read(PIECE), b""))
    except (BadZipFile, zlib.error, *_DAMAGED, NotImplementedError, RuntimeError, OSError) as error:
        raise ValueError(f"{shown(name)}: {error_message(error)}") from None


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
        # numbers of no size could be any number, and an array of none of any length
        size = math.prod(max(length, 1) for length in shape) * max(dtype.itemsize, 1)
        most = max(rest, MAX_EMPTY_ARRAY_BYTES) if 0 in shape else rest
        fits = all(length >= 0 for length in shape) and (dtype.hasobject or size <= most)
        check(fits, "array", f"{shown(shape)} of {shown(str(dtype))}", f"of the {rest:,} bytes that there are")
        stream.seek(0)
        found = npy.read_array(stream, allow_pickle=False)
        if dtype.kind == "U" and found.nbytes:
            codes = found.astype(dtype.newbyteorder("=")).ravel().view("u4")
            check((codes <= LAST_CHARACTER).all(), "text", hex(codes.max()), "of characters of Unicode")
        return found
    except _DAMAGED as error:
        raise ValueError(error_message(error)) from None


def numbers_in(array: "np.ndarray", most: int) -> "np.ndarray":
    """An array in double precision, of at most so many bytes. What is no number, such as a date, is refused."""
    check(array.dtype.kind in "biuf", "type of an array", str(array.dtype), "numbers")
    check_unpacked(8 * array.size, most)
    return array.astype(float)


def csv_in(content: bytes, most: int) -> "pa.Table":
    """The table of a CSV file with a line of names, of at most so many bytes where a number takes 8."""
    import pyarrow as pa
    from pyarrow import csv

    columns = content.partition(b"\n")[0].count(b",") + 1
    check(columns <= MAX_TABLE_COLUMNS, "columns", columns, f"at most {MAX_TABLE_COLUMNS:,}")
    check_unpacked(8 * (content.count(b",") + content.count(b"\n")), most)
    try:
        return csv.read_csv(pa.BufferReader(content))
    except (pa.ArrowException, OSError) as error:
        raise ValueError(f"not a CSV table: {error_message(error)}") from None


_TOO_DEEP = f"nested too deeply: must be of at most {MAX_NESTING_DEPTH} lists and tables within each other"


def _check_bytes(size: int, most: int) -> None:
    check(size <= most, "bytes", size, f"at most {most:,}")


def check_unpacked(size: int, most: int) -> None:
    check(size <= most, "bytes when unpacked", size, f"at most {most:,}")


def error_message(error: BaseException) -> str:
    return " ".join(str(error).split())[:300] or type(error).__name__
