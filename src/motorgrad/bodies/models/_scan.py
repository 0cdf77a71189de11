"""The size of an MJCF document after MuJoCo expands it, counted without expanding it."""

import contextlib
import math
import os
import xml.parsers.expat as expat
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from motorgrad._errors import check
from motorgrad._limits import (
    MAX_MODEL_BYTES,
    MAX_MODEL_CHARACTERS,
    MAX_MODEL_COPIES,
    MAX_MODEL_ELEMENT_DEPTH,
    MAX_MODEL_FILE_DEPTH,
    MAX_MODEL_PARTS,
)
from motorgrad._reading import content_of

_SLOW = 10  # parts for each copy of what refers to a copied part, as MuJoCo copies it that much more slowly
_PER_VERTEX = 8  # parts of a flexcomp: a body, three joints, elements
_MIN_VERTEX_BYTES = 8  # of a file
_MESH_BYTES = 500  # per vertex, with faces, hull and search trees
_DIMENSIONS = {"cone": 1, "wedge": 2, "plate": 2}  # numbers of `params` that multiply, if not three
_WIDE = (b"\xff\xfe", b"\xfe\xff")
_UNCOPIED = ("asset", "compiler", "custom", "default", "extension", "keyframe", "option", "size", "visual", "worldbody")
_SQUARED = ("supersphere", "supertorus")
_NAME_ATTRIBUTES = ("name", "class", "childclass", "file", "user")
"""Attributes that may say "nan"."""
_MUSCLE = ("timeconst", "range", "scale", "lmin", "lmax", "vmax", "fpmax", "fvmax")
"""Numbers of a `muscle` in whose place MuJoCo takes its own if they are negative. A negative force means `scale`."""


class Documents(NamedTuple):
    """What belongs to a model: the `folders` of all its documents, and the `files` that it includes."""

    folders: set[Path]
    files: set[Path]


def scan(text: bytes, folder: Path) -> Documents:
    """Refuse a document that would exhaust memory while MuJoCo reads it.

    Copies, included files, attached models and generated grids are made while reading, before there is a description to
    ask for sizes. What this parser cannot read is refused too, so that no document means less here than to MuJoCo.

    **Arguments:** `text`: the document; `folder`: where its files are.

    **Returns:** the folders of all documents that belong to it, and the files that it includes.

    **Raises:** `ValueError`.
    """
    reading = _Reading()
    _Document(reading, folder).count(text, folder)
    return Documents(reading.folders, reading.files)


class _Reading:
    """What the documents of one model share."""

    def __init__(self) -> None:
        self.text = 0
        self.depth = 0
        self.folders: set[Path] = set()
        self.files: set[Path] = set()


class _Element(NamedTuple):
    tag: str
    name: str
    copies: float  # in its parent
    all_copies: float
    refers: set[str]  # the values of its attributes, and of those of the elements within


class _Document:
    """One model, with the files that it includes."""

    def __init__(self, reading: _Reading, folder: Path) -> None:
        self._reading, self._folder = reading, folder
        self._open: list[_Element] = []
        self._parts = [0.0]  # within each open element so far; first those of the document
        self._named: dict[str, float] = {}  # parts of each named body or frame
        self._models: dict[str, float] = {}  # parts of each model that may be attached
        self._copies: dict[str, float] = {}  # of each named part of the world
        self._attached = 0.0  # how often, at most, attaching copies what refers to a part
        self._referring: list[_Element] = []
        self._inner = {""}  # folders of assets, from the settings of the compiler
        self._points: list[tuple[str, float]] = []  # files of points, and copies of what is made of them

    def count(self, text: bytes, folder: Path) -> float:
        """The parts of the document, with all copies."""
        self._read(text, folder)
        # MuJoCo copies a sensor, an actuator, ... with each copy of what it refers to, and what refers to that in turn
        for _ in range(MAX_MODEL_FILE_DEPTH):
            before = dict(self._copies)
            for each in self._referring:
                if each.name:
                    self._copies[each.name] = max(self._copies.get(each.name, 1.0), self._copies_of(each))
            if before == self._copies:
                break
        parts = self._parts[0]
        parts += _SLOW * sum(self._attached + self._copies_of(each) - 1.0 for each in self._referring)
        for name, copies in self._points:
            found = files_of(name, self._reading.folders, self._inner)
            parts += copies * sum(map(file_size, found)) / _MIN_VERTEX_BYTES
        check_parts(parts)
        return parts

    def _copies_of(self, element: _Element) -> float:
        return max((self._copies.get(name, 1.0) for name in element.refers), default=1.0)

    def _read(self, text: bytes, folder: Path) -> None:
        """Count a file that belongs to the document, where it stands."""
        reading = self._reading
        reading.text += len(text)
        limit = f"at most {MAX_MODEL_CHARACTERS:,} characters"
        check(reading.text <= MAX_MODEL_CHARACTERS, "length of the text", reading.text, limit)
        limit = f"at most {MAX_MODEL_FILE_DEPTH} deep"
        check(reading.depth < MAX_MODEL_FILE_DEPTH, "files within files", reading.depth + 1, limit)
        reading.depth += 1
        reading.folders.add(folder)
        check(b"\0" not in text and not text.startswith(_WIDE), "encoding", "UTF-16 or binary", "UTF-8")
        parser = expat.ParserCreate("utf-8")  # whatever the document says: so does MuJoCo

        def start(tag: str, given: dict[str, str]) -> None:
            try:
                self._begin(tag.lower(), given, folder)
            except ValueError as error:
                raise ValueError(_at(tag, parser.CurrentLineNumber, error)) from None

        def end(tag: str) -> None:
            try:
                self._end()
            except ValueError as error:
                raise ValueError(_at(tag, parser.CurrentLineNumber, error)) from None

        parser.StartElementHandler, parser.EndElementHandler = start, end
        parser.StartDoctypeDeclHandler = _refuse_doctype  # its entities expand
        try:
            parser.Parse(text, True)
        except expat.ExpatError as error:
            raise ValueError(f"not well-formed XML: {error}") from None
        reading.depth -= 1

    def _begin(self, tag: str, given: Mapping[str, str], folder: Path) -> None:
        deep = len(self._open)
        limit = f"at most {MAX_MODEL_ELEMENT_DEPTH}"
        check(deep < MAX_MODEL_ELEMENT_DEPTH, "elements within elements", deep + 1, limit)
        _check_numbers(tag, given)
        copies = product(given.get("count", "1"))
        if tag == "flexcomp":
            points = len(given.get("point", "").split()) / 3
            copies = _PER_VERTEX * max(copies, points, product(given.get("cellcount", "1"), lambda n: 2 * n + 1))
        elif tag == "skin":
            copies *= product(given.get("subgrid", "1")) ** 2
        elif tag == "replicate":
            check(copies <= MAX_MODEL_COPIES, "count", given.get("count"), f"at most {MAX_MODEL_COPIES:,}")
        check_parts(copies)
        all_copies = copies * (self._open[-1].all_copies if self._open else 1.0)
        inside = 0.0
        if tag == "include" and "file" in given:
            for path in self._found(given["file"], folder):
                self._reading.files.add(path)
                text = read_bytes(path)
                with _named(path):
                    self._read(text, path.parent)
        elif tag == "model" and "file" in given:
            for path in self._found(given["file"], folder):
                self._reading.files.add(path)
                text = read_bytes(path)
                with _named(path):
                    parts = _Document(self._reading, path.parent).count(text, path.parent)
                self._models[given.get("name", "")] = parts
                inside += parts
        elif tag == "attach":
            inside = self._attach(given, all_copies)
        elif tag == "compiler":
            self._inner.update(given[name] for name in ("assetdir", "meshdir", "texturedir") if name in given)
        elif tag == "flexcomp" and "file" in given:
            self._points.append((given["file"], all_copies / copies))
        elif tag == "hfield":
            rows, columns = (product(given.get(name, "1")) for name in ("nrow", "ncol"))
            check_bytes("nrow × ncol", f"{rows:,.0f} × {columns:,.0f}", 4 * rows * columns)
        elif tag == "mesh" and "builtin" in given:
            vertices = _vertices(given["builtin"], given.get("params", ""))
            check_bytes("params", given.get("params", ""), _MESH_BYTES * vertices)
        name = given.get("name", "")
        refers = {value for key, value in given.items() if key not in ("name", "class")}
        self._open.append(_Element(tag, name, copies, all_copies, refers))
        self._parts.append(inside)

    def _attach(self, given: Mapping[str, str], all_copies: float) -> float:
        """The parts that an `attach` copies."""
        if "model" in given:
            self._attached += all_copies
            return self._models.get(given["model"], max(self._models.values(), default=0.0))
        # a name that comes with another copy is not known here: no part is larger than all so far
        inside = self._named.get(given.get("body", given.get("frame", "")), sum(self._parts))
        self._attached += all_copies * inside
        return inside

    def _found(self, name: str, folder: Path) -> list[Path]:
        """The files that a name may mean. MuJoCo looks beside the model first, then beside the files that include."""
        folders = {self._folder, folder, *self._reading.folders}
        found = files_of(name, folders)
        check(found, "file", name, "an existing file")
        return found

    def _end(self) -> None:
        element = self._open.pop()
        parts = element.copies * (1.0 + self._parts.pop())
        self._parts[-1] += parts
        check_parts(parts)
        check_parts(self._parts[-1])
        if any(each.tag == "worldbody" for each in self._open):
            if element.name:
                self._copies[element.name] = max(element.all_copies, self._copies.get(element.name, 1.0))
            if element.name and element.tag in ("body", "frame"):
                self._named[element.name] = max(parts, self._named.get(element.name, 0.0))
        elif element.refers and not any(each.tag in _UNCOPIED for each in (*self._open, element)):
            self._referring.append(element)
            if self._open and self._open[-1].name:
                self._open[-1].refers.update(element.refers)


@contextlib.contextmanager
def _named(path: Path) -> Iterator[None]:
    """Let errors name a file that belongs to a document."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{path.name}: {error}") from None


def check_parts(parts: float) -> None:
    """Refuse too many parts."""
    number = int(parts) if parts < 1e18 else parts
    check(parts <= MAX_MODEL_PARTS, "parts, with all copies,", number, f"at most {MAX_MODEL_PARTS:,}")


def check_bytes(what: str, value: object, size: float, most: int = MAX_MODEL_BYTES) -> None:
    """Refuse something that would make a model, or one part of it, of `size` bytes."""
    check(size <= most, what, value, f"such that the model takes at most {most / 2**30:g} GiB, not {size / 2**30:,.2f}")


def read_bytes(path: Path) -> bytes:
    """The content of a file of acceptable length."""
    file_size(path)  # refuses what is no file, and names it
    try:
        return content_of(path, MAX_MODEL_CHARACTERS)
    except ValueError as error:
        raise ValueError(f"{path.name}: {error}") from None


def files_of(name: str, folders: Iterable[Path], inner: Iterable[str] = ("",)) -> list[Path]:
    """The existing files that a name may mean, in any of `folders` or in a folder `inner` of one.

    MuJoCo takes a backslash for a slash, so that both are meant.
    """
    inner = list(inner)
    names = (name, name.replace("\\", "/"))
    inner += [part.replace("\\", "/") for part in inner]
    paths = {os.path.abspath(folder / part / each) for folder in folders for part in inner for each in names}
    return [Path(path) for path in sorted(paths) if os.path.exists(path)]


def file_size(path: Path) -> int:
    """The size of a file in bytes. It must be a regular one: a device may never end, and a pipe never begin."""
    check(path.is_file(), "file", str(path), "a regular file")
    return path.stat().st_size


def product(words: str, change: Callable[[float], float] = float) -> float:
    """The product of the numbers of an attribute, of which those below 1 count as 1."""
    try:
        return math.prod(max(1.0, change(float(word))) for word in words.split())
    except ValueError:
        raise ValueError(f"{words!r}: must be whole numbers") from None


def _check_numbers(tag: str, given: Mapping[str, str]) -> None:
    """Refuse numbers that MuJoCo would read, and put its own in their place."""
    for name, value in given.items():
        if name not in _NAME_ATTRIBUTES and "nan" in value.lower():
            check(not any(map(math.isnan, _floats(value))), name, value, "a number, or left out")
        if tag == "muscle" and name in _MUSCLE:
            check(not any(number < 0 for number in _floats(value)), name, value, "at least 0, or left out")


def _floats(words: str) -> list[float]:
    """The numbers of an attribute; none for a text."""
    try:
        return [float(word) for word in words.split()]
    except ValueError:
        return []


def _vertices(kind: str, params: str) -> float:
    numbers = params.split()
    if kind in _SQUARED:
        return product(" ".join(numbers[:1] * 2))
    return product(" ".join(numbers[: _DIMENSIONS.get(kind, 3)]))


def _refuse_doctype(*given: object) -> None:
    raise ValueError("it declares a document type: must be plain MJCF or URDF")


def _at(tag: str, line: int, error: ValueError) -> str:
    message = str(error)
    return message if message.startswith("<") else f"<{tag}> in line {line}: {message}"
