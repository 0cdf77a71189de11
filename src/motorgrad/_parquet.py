"""Reading tables of Parquet files that may be a stranger's, within the limits of `motorgrad._limits`."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from motorgrad._errors import check, shown
from motorgrad._limits import MAX_PARQUET_CHUNKS, MAX_TABLE_COLUMNS
from motorgrad._reading import check_unpacked, error_message

if TYPE_CHECKING:
    import pyarrow as pa  # loading it would slow down every command's start

# Of Thrift's compact protocol, in which the foot of a file and the heads of pages are written.
_STOP = 0
_BYTE = 3
_OF_NONE = (1, 2)  # true and false, which are in the type
_WHOLE = (4, 5, 6)
_DOUBLE = 7
_TEXT = 8
_LISTS = (9, 10)
_TABLE = 12
_MAX_TABLE_DEPTH = 16  # a head has fewer than five
_UNPACKED = 2  # the number of a head's field: the bytes of its page, unpacked
_PACKED = 3
_GROUPS = 4  # of the foot of a file: its groups of rows
_COLUMNS = 1  # of a group of rows
_ABOUT = 3  # of a column
_VALUES = 5  # of what is said about a column: how many values it has
_COLUMN_PACKED = 7
_DATA_PAGES = 9
_TEXT_PAGES = 11


def parquet_in(content: bytes, most: int) -> "pa.Table":
    """The table of a Parquet file, of at most so many bytes where a number takes 8. A column has numbers or texts; one
    may have as many numbers in each row."""
    import pyarrow as pa
    from pyarrow import parquet

    try:
        head = parquet.ParquetFile(pa.BufferReader(content))
        about, schema = head.metadata, head.schema_arrow
        check(about.num_columns <= MAX_TABLE_COLUMNS, "columns", about.num_columns, f"at most {MAX_TABLE_COLUMNS:,}")
        parts = about.num_row_groups * about.num_columns
        check(parts <= MAX_PARQUET_CHUNKS, "groups of rows times columns", parts, f"at most {MAX_PARQUET_CHUNKS:,}")
        columns = list(_columns(content))
        check(len(columns) == parts, "columns of all groups of rows", len(columns), f"{parts:,}, as many in each")
        numbers = sum(column[_VALUES] for column in columns)
        # what the file says of its columns may be a lie; pages are unpacked into the bytes that their own heads say
        pages = sum(_page_bytes(content, column) for column in columns)
        check_unpacked(max(pages, 8 * numbers, 8 * about.num_rows * about.num_columns), most)
        for name in schema.names:
            kind = schema.field(name).type
            check(_is_plain(kind), f"type of column {shown(name)}", str(kind), "numbers or texts")
        # texts as they are stored: a long one that many rows share would take its length in each
        texts = [name for name in schema.names if pa.types.is_string(schema.field(name).type)]
        reader = parquet.ParquetFile(pa.BufferReader(content), read_dictionary=texts)
        # Arrow's threads live on after the last row, and Python crashes where its tracemalloc is stopped beside them
        found = _with_texts(reader.read(use_threads=False), schema, most)
        found.validate(full=True)  # texts, which are else looked at where they are used
        return found
    except (pa.ArrowException, OSError, OverflowError, MemoryError, KeyError) as error:
        raise ValueError(f"not a Parquet table: {error_message(error)}") from None


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
        column = table.column(place)
        kind = schema.field(name).type
        if column.type == kind or not pa.types.is_dictionary(column.type):
            continue
        for part in column.chunks:
            lengths = pc.call_function("binary_length", [part.dictionary]).take(part.indices)
            size += pc.call_function("sum", [lengths.cast(pa.int64())]).as_py() or 0
        check_unpacked(size, most)
        table = table.set_column(place, schema.field(name), column.cast(kind))
    return table


def _columns(content: bytes) -> Iterator[dict[int, int]]:
    """What the foot of a file says about each column of each group of rows (`parquet.thrift`: `FileMetaData`). Arrow is
    not asked: what it makes of a damaged one ends the process."""
    try:
        _, _, foot = _table(content, len(content) - 8 - int.from_bytes(content[-8:-4], "little"))
        for group in _items(content, foot.get(_GROUPS)):
            for column in _items(content, _table(content, group)[2].get(_COLUMNS)):
                kind, place = _table(content, column)[2].get(_ABOUT, (_STOP, 0))
                about = _table(content, place)[1] if kind == _TABLE else {}
                there = about.keys() >= {_VALUES, _COLUMN_PACKED, _DATA_PAGES}
                check(there and about[_VALUES] >= 0, "what the file says about a column", about, "its size and place")
                yield about
    except IndexError:
        raise ValueError("its foot ends beyond the end of the file") from None


def _items(content: bytes, found: tuple[int, int] | None) -> Iterator[int]:
    """The places of the tables in a list, of which the kind and the place are given."""
    if found is None or found[0] not in _LISTS:
        return
    place, count, kind = _list(content, found[1])
    check(kind == _TABLE, "type in the foot of a file", kind, "a table")
    for _ in range(count):
        yield place
        place = _table(content, place)[0]


def _page_bytes(content: bytes, column: dict[int, int]) -> int:
    """The bytes of a column's pages, unpacked, as their heads say, each before its page (Apache Parquet,
    `parquet.thrift`: `PageHeader`). **Raises** `ValueError` for other heads."""
    place = min(column[_DATA_PAGES], column.get(_TEXT_PAGES) or column[_DATA_PAGES])
    size = column[_COLUMN_PACKED]
    check(place >= 0 and size >= 0, "place of a column", place, "within the file")
    end = place + size
    total = 0
    while place < end:
        try:
            place, fields, _ = _table(content, place)
            total += _size(fields, _UNPACKED)
            place += _size(fields, _PACKED)
        except IndexError:
            raise ValueError("a page ends beyond the end of the file") from None
    return total


def _size(fields: dict[int, int], number: int) -> int:
    size = fields.get(number, -1)
    check(size >= 0, "size of a page", size, "at least 0")
    return size


def _table(content: bytes, place: int, depth: int = 0) -> tuple[int, dict[int, int], dict[int, tuple[int, int]]]:
    """Where a table of Thrift's compact protocol ends; its whole numbers, and the kinds and places of its other values,
    by the numbers of their fields."""
    check(depth < _MAX_TABLE_DEPTH, "tables within a table", depth, f"less than {_MAX_TABLE_DEPTH}")
    wholes: dict[int, int] = {}
    others: dict[int, tuple[int, int]] = {}
    number = 0
    while (kind := content[place] & 15) != _STOP:
        step = content[place] >> 4
        place += 1
        if step:
            number += step
        else:
            place, number = _whole(content, place)
        if kind in _WHOLE:
            place, wholes[number] = _whole(content, place)
        elif kind not in _OF_NONE:
            others[number] = kind, place
            place = _after(content, place, kind, depth)
    return place + 1, wholes, others


def _after(content: bytes, place: int, kind: int, depth: int) -> int:
    """Where a value ends."""
    if kind == _BYTE or kind in _OF_NONE:
        return place + 1
    if kind in _WHOLE:
        return _whole(content, place)[0]
    if kind == _DOUBLE:
        return place + 8
    if kind == _TEXT:
        place, length = _count(content, place)
        return place + length
    if kind == _TABLE:
        return _table(content, place, depth + 1)[0]
    check(kind in _LISTS, "type of a value", kind, "one of Thrift's")
    place, count, kind = _list(content, place)
    for _ in range(count):
        place = _after(content, place, kind, depth + 1)
    return place


def _list(content: bytes, place: int) -> tuple[int, int, int]:
    """Where the items of a list begin, their number and their kind."""
    first = content[place]
    count = first >> 4
    place += 1
    if count == 15:
        place, count = _count(content, place)
    check(count <= len(content), "items in a list", count, "at most as many as there are bytes")
    return place, count, first & 15


def _count(content: bytes, place: int) -> tuple[int, int]:
    """Where a number of seven bits to a byte ends, and the number."""
    number = 0
    for shift in range(0, 70, 7):
        byte = content[place]
        place += 1
        number |= (byte & 127) << shift
        if byte < 128:
            return place, number
    raise ValueError("a number in the head of a page has more than 64 bits")


def _whole(content: bytes, place: int) -> tuple[int, int]:
    """Where a whole number with a sign ends, and the number (zigzag)."""
    place, number = _count(content, place)
    return place, (number >> 1) ^ -(number & 1)
