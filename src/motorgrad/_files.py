"""Reading and writing files: atomic writes, and errors that name the file."""

import contextlib
import errno
import glob
import io
import os
import secrets
import stat
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from motorgrad._errors import shown_path
from motorgrad._limits import MAX_ARRAY_BYTES, MAX_JSON_BYTES, MAX_METRICS_BYTES, MAX_SETTINGS_BYTES
from motorgrad._reading import arrays_in, content_of, json_in, toml_in

if TYPE_CHECKING:
    import numpy as np  # loading it would slow down every command's start


def write_atomically(path: Path, content: bytes) -> None:
    """Write `content` to `path`, so that a reader or a crash sees either the old file or the new one."""
    with replacing(path) as file:
        file.write(content)


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """A new file that takes the place of `path` when it is complete, and of nothing if an error ends it. A link at
    `path` is replaced, not followed. **Raises** `OSError` that names `path`."""
    # nobody can foresee the name, and what is there is not opened: a link could lead anywhere
    aside = path.with_name(f".{path.name}.{secrets.token_hex(4)}.partial")
    with _errors_name(path, aside):
        check_replaceable(path)
        try:
            with open(aside, "xb", opener=_not_through_links) as stream:
                yield stream
                stream.flush()
                os.fsync(stream.fileno())
            os.replace(aside, path)
        except BaseException:
            with contextlib.suppress(OSError):  # on a full disk its space is wanted
                aside.unlink()
            raise
    if os.name == "posix":  # the rename itself must reach the disk; Windows cannot sync a folder
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


@contextlib.contextmanager
def changing(path: Path) -> Iterator[BinaryIO]:
    """A file that is changed where it lies; a missing one is made, and one that has other names as well (hard links, as
    of a backup) becomes one of its own first. **Raises** `OSError` that names it, and for a link."""
    with _errors_name(path):
        check_replaceable(path)
        mode = "r+b" if path.exists() else "xb"
        with open(path, mode, opener=_not_through_links) as stream:
            if os.fstat(stream.fileno()).st_nlink == 1:
                yield stream
                return
        write_atomically(path, read_content(path, MAX_METRICS_BYTES))
        with changing(path) as stream:
            yield stream


def _not_through_links(path: str, flags: int) -> int:
    """Opens a file as `open` does, but for a link, which is refused."""
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0), 0o666)


@contextlib.contextmanager
def _errors_name(path: Path, aside: Path | None = None) -> Iterator[None]:
    """Let errors of writing name the file that was to be written. Those of a full disk name none."""
    try:
        yield
    except OSError as error:
        if error.errno is None or error.filename not in (None, str(aside)):
            raise
        raise OSError(error.errno, error.strerror, str(path)) from None


def check_replaceable(path: Path) -> None:
    """Refuse to write where there is neither nothing, nor a file, nor a link. **Raises** `OSError`."""
    with contextlib.suppress(FileNotFoundError):
        mode = os.lstat(path).st_mode
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        if not (stat.S_ISREG(mode) or stat.S_ISLNK(mode)):
            raise OSError(errno.EINVAL, "a device or a pipe, not a file", str(path))


def refuse_links(folder: Path, *inner: str) -> None:
    """Refuse links in a folder of ours and in those `inner` folders: they would lead reading and writing elsewhere. The
    folder itself may be one. **Raises** `ValueError` that names the link."""
    for place in (folder, *(folder / name for name in inner)):
        with contextlib.suppress(FileNotFoundError, NotADirectoryError), os.scandir(place) as entries:
            link = next((entry.path for entry in entries if entry.is_symlink()), None)
            if link is not None:
                raise ValueError(f"{link} is a link: must be a file or a folder; put there what it points to")


def remove_partials(folder: Path, name: str | None = None) -> None:
    """Remove what `write_atomically` left in a folder, where nobody may be writing, when its process was killed; by
    default for files of any `name`."""
    for orphan in folder.glob(".*.partial" if name is None else f".{glob.escape(name)}*.partial"):
        with contextlib.suppress(OSError):
            orphan.unlink()


def write_arrays(path: Path, arrays: "Mapping[str, np.ndarray]") -> None:
    """Write named arrays to an `.npz` file atomically. Missing folders are made."""
    import numpy as np

    path.parent.mkdir(parents=True, exist_ok=True)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    write_atomically(path, buffer.getvalue())


def read_arrays(path: Path) -> "dict[str, np.ndarray]":
    """Read a file written by `write_arrays`. **Raises** `ValueError` for a damaged file."""
    try:
        return arrays_in(content_of(path, MAX_ARRAY_BYTES), MAX_ARRAY_BYTES)
    except ValueError as error:
        raise ValueError(f"{path}: damaged: {error}; delete it, and it is made again") from None


def read_content(path: Path, most: int) -> bytes:
    """The content of a file of at most so many bytes. **Raises** `ValueError` that names the file and the problem."""
    try:
        return content_of(path, most)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file. **Raises** `ValueError` that names the file and the problem."""
    try:
        # some editors begin a file with a byte order mark
        return toml_in(content_of(path, MAX_SETTINGS_BYTES).decode("utf-8-sig"))
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: not UTF-8 text: {error.reason} at byte {error.start}") from None
    except ValueError as error:
        raise ValueError(f"{path}: not TOML: {' '.join(str(error).splitlines())}") from None


def read_json(path: Path) -> Any:
    """Read a JSON file. **Raises** `ValueError` that names the file and the problem."""
    try:
        return json_in(content_of(path, MAX_JSON_BYTES))
    except ValueError as error:
        raise ValueError(f"{path}: damaged: {error}; delete it, or put it back") from None


def check_writable(name: str, path: Path, folder: bool = False) -> None:
    """Refuse a path where no file (or `folder`) can be written. **Raises** `ValueError` that names the argument and
    says why."""
    why = ""
    try:
        if path.exists() and path.is_dir() != folder:
            why = "it is a file" if folder else "it is a folder"
        elif path.exists() and not folder:
            check_replaceable(path)
        above = path if path.is_dir() else next(parent for parent in path.absolute().parents if parent.exists())
    except OSError as error:  # a name too long, for example
        why = error.strerror or str(error)
        above = Path()
    if not why and not above.is_dir():
        why = f"{above} is a file"
    if not why and not os.access(above, os.W_OK | os.X_OK):
        why = f"{above} is not writable"
    if why:
        raise ValueError(f"{name} = {shown_path(path)}: cannot be written: {why}")
