"""Elevation data in files that may be a stranger's: grey pictures, arrays of NumPy, tables of numbers, ESRI grids."""

import functools
import hashlib
import io
import re
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from motorgrad._errors import check, choice, shown_path
from motorgrad._limits import MAX_ELEVATION_BYTES, MAX_ELEVATION_POINTS
from motorgrad._reading import array_in, content_of, error_message, numbers_in

PICTURE = ".png"
MAX_KEPT_FILES = 4
_WHITE = {"L": 2**8 - 1, "I;16": 2**16 - 1, "I": 2**16 - 1}  # by Pillow's mode of a grey picture; "I" until version 11
_COUNTS = ("ncols", "nrows")
_PLACES = ("xllcorner", "xllcenter", "yllcorner", "yllcenter", "cellsize")
_MISSING = "nodata_value"

Points = Float[np.ndarray, "rows columns"]


class Elevation(NamedTuple):
    """Elevation data: the first row is at the greatest y and the first column at the least x, as a map shows them.

    - `numbers` (rows, columns): of the file.
    - `white`: the number of white in a picture, whose black is 0; None for other files.
    - `checksum`: of the file's content.
    """

    numbers: Points
    white: int | None
    checksum: str

    @property
    def shares(self) -> Points:
        """The numbers on a scale from 0 to 1: from black to white, or from the least number of a table to the
        greatest. A table of equal numbers is 0 everywhere."""
        if self.white is not None:
            return self.numbers / self.white
        return (self.numbers - self.numbers.min()) / (np.ptp(self.numbers) or 1.0)


def read_elevation(path: Path, checksum: str | None = None) -> Elevation:
    """The elevation data of a file: `.png`, `.npy`, `.csv` or `.asc`.

    **Arguments:** the `path`; the `checksum` that its content must have, if any.

    **Raises:** `ValueError` in one line that names the file, for one that cannot be read, is beyond the limits of size,
    is not what its checksum says, or is no rectangle of finite numbers.
    """
    kind = path.suffix.lower()
    try:
        choice("kind of elevation file", kind, (PICTURE, *_TABLES))
        content = content_of(path, MAX_ELEVATION_BYTES)
        found = hashlib.sha256(content).hexdigest()[:32]
        wanted = f"{found!r}, the checksum of the file, which is not what it was: put it back, or leave this out"
        check(checksum in (None, found), "checksum", checksum, wanted)
        numbers, white = _picture(content) if kind == PICTURE else (_TABLES[kind](content), None)
        right = numbers.ndim == 2 and min(numbers.shape) >= 2
        check(right, "shape", numbers.shape, "(rows, columns) of at least two each")
        wrong = np.argwhere(~np.isfinite(numbers))
        if len(wrong):
            row, column = map(int, wrong[0])
            check(False, f"row {row + 1}, column {column + 1}", float(numbers[row, column]), "a finite number")
    except OSError as error:
        raise ValueError(f"map = {shown_path(path)}: {error.strerror or error_message(error)}") from None
    except ValueError as error:
        raise ValueError(f"map = {shown_path(path)}: {error_message(error)}") from None
    numbers.flags.writeable = False
    return Elevation(numbers, white, found)


@functools.lru_cache(maxsize=MAX_KEPT_FILES)
def known_elevation(path: Path, checksum: str) -> Elevation:
    """The elevation data of a file that was read before, as `read_elevation` with its checksum, kept in memory."""
    return read_elevation(path, checksum)


def _picture(content: bytes) -> tuple[Points, int]:
    """The grey levels of a PNG picture, and that of white."""
    from PIL import Image, UnidentifiedImageError  # loading it would slow down every command's start

    with warnings.catch_warnings():
        warnings.simplefilter("error")  # such as of a picture of very many points
        try:
            with Image.open(io.BytesIO(content), formats=["PNG"]) as image:
                width, height = image.size
                _check_points(height * width)
                grey = image.mode in _WHITE
                check(grey, "colours of the picture", image.mode, "grey levels of 8 or 16 bits, without transparency")
                return np.asarray(image).astype(float), _WHITE[image.mode]
        except UnidentifiedImageError:
            raise ValueError("not a PNG picture") from None
        except (Image.DecompressionBombError, Image.DecompressionBombWarning) as error:
            raise ValueError(error_message(error)) from None
        except (OSError, SyntaxError, EOFError, OverflowError, MemoryError, TypeError, KeyError, IndexError) as error:
            raise ValueError(f"not a PNG picture: {error_message(error)}") from None


def _array(content: bytes) -> Points:
    array = array_in(content)
    _check_points(array.size)
    return numbers_in(array, 8 * MAX_ELEVATION_POINTS)


def _table(content: bytes) -> Points:
    """The numbers of a table, a line for each row, with commas between the columns and without a line of names."""
    text = _text(content)
    check(text.strip(), "table", "empty", "lines of numbers with commas between them")
    points = text.count(",") + text.count("\n")  # that there may be, before they take memory
    check(points <= 2 * MAX_ELEVATION_POINTS, "points", points, f"at most {MAX_ELEVATION_POINTS:,}")
    try:
        numbers = np.loadtxt(io.StringIO(text), delimiter=",", comments=None, ndmin=2)
    except ValueError as error:
        said = error_message(error).partition(";")[0]  # the rest advises users of NumPy
        raise ValueError(re.sub(r" at row \d+, column .*", "", said)) from None  # a row from 0 and a column from 1
    _check_points(numbers.size)
    return numbers


def _grid(content: bytes) -> Points:
    """The numbers of an ESRI grid: lines of a key and a number, then all numbers, row by row."""
    rest = _text(content)
    found: dict[str, float] = {}
    while (words := rest.split(None, 2)) and words[0][0].isalpha():
        key = words[0].lower()
        choice("key of the grid", key, (*_COUNTS, *_PLACES, _MISSING))
        check(len(words) > 1 and key not in found, key, " ".join(words[1:2]), "a number, given once")
        found[key] = float(words[1])
        rest = words[2] if len(words) > 2 else ""
    for key in _COUNTS:
        whole = key in found and found[key] >= 1 and found[key].is_integer()
        check(whole, key, found.get(key), "given, a whole number above 0")
    columns, rows = (int(found[key]) for key in _COUNTS)
    _check_points(rows * columns)
    numbers = rest.split(None, rows * columns)[: rows * columns + 1]
    check(len(numbers) == rows * columns, "numbers of the grid", len(numbers), f"nrows × ncols = {rows * columns:,}")
    grid = np.array(numbers, float).reshape(rows, columns)
    missing = int(np.sum(grid == found.get(_MISSING, np.nan)))
    check(missing == 0, f"points without data ({_MISSING})", missing, "none: fill them, or cut them away")
    return grid


_TABLES: dict[str, Callable[[bytes], Points]] = {".npy": _array, ".csv": _table, ".asc": _grid}


def _text(content: bytes) -> str:
    try:
        return content.decode("utf-8-sig")  # with the mark with which some programs begin a table
    except UnicodeDecodeError:
        raise ValueError("not a text in UTF-8") from None


def _check_points(points: int) -> None:
    check(points <= MAX_ELEVATION_POINTS, "points", points, f"at most {MAX_ELEVATION_POINTS:,}")
