"""Reading and writing files: atomic writes, and errors that name the file."""

import contextlib
import io
import json
import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np  # loading it would slow down every command's start

LARGEST = 2**20  # bytes of a settings file


def write_atomically(path: Path, content: bytes) -> None:
    """Write `content` to `path`, so that a reader or a crash sees either the old file or the new one."""
    aside = partial(path)
    try:
        with aside.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
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


def remove_partials(folder: Path) -> None:
    """Remove what `write_atomically` left in a folder when its process was killed. Nobody may be writing there."""
    for orphan in folder.glob(".*.partial"):
        with contextlib.suppress(OSError):
            orphan.unlink()


def partial(path: Path) -> Path:
    """The temporary file of `write_atomically` for a path."""
    return path.with_name(f".{path.name}.partial")


def write_arrays(path: Path, arrays: "Mapping[str, np.ndarray]") -> None:
    """Write named arrays to an `.npz` file atomically. Missing folders are made."""
    import numpy as np

    path.parent.mkdir(parents=True, exist_ok=True)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    write_atomically(path, buffer.getvalue())


def read_arrays(path: Path) -> "dict[str, np.ndarray]":
    """Read a file written by `write_arrays`. **Raises** `ValueError` for a damaged file."""
    import zipfile

    import numpy as np

    try:
        with np.load(path, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except (ValueError, EOFError, zipfile.BadZipFile) as error:
        raise ValueError(f"{path}: damaged: {error}; delete it, and it is made again") from None


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file. **Raises** `ValueError` that names the file and the problem."""
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST + 1)
        if len(content) > LARGEST:
            raise ValueError(f"larger than {LARGEST:,} bytes")
        return tomllib.loads(content.decode("utf-8-sig"))  # some editors begin a file with a byte order mark
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: not UTF-8 text: {error.reason} at byte {error.start}") from None
    except RecursionError:
        raise ValueError(f"{path}: nested too deeply") from None
    except ValueError as error:
        raise ValueError(f"{path}: not TOML: {' '.join(str(error).splitlines())}") from None


def read_json(path: Path) -> Any:
    """Read a JSON file. **Raises** `ValueError` that names the file and the problem."""
    try:
        return json.loads(path.read_bytes())
    except ValueError as error:
        raise ValueError(f"{path}: damaged: {error}; delete it, or put it back") from None


def check_writable(name: str, path: Path, folder: bool = False) -> None:
    """Refuse a path where no file (or `folder`) can be written. Nothing is created.

    **Raises:** `ValueError` that names the argument `name` and says why.
    """
    why = ""
    try:
        if path.exists() and path.is_dir() != folder:
            why = "it is a file" if folder else "it is a folder"
        above = path if path.is_dir() else next(parent for parent in path.absolute().parents if parent.exists())
    except OSError as error:  # a name too long, for example
        why, above = error.strerror or str(error), Path()
    if not why and not above.is_dir():
        why = f"{above} is a file"
    if not why and not os.access(above, os.W_OK | os.X_OK):
        why = f"{above} is not writable"
    if why:
        raise ValueError(f"{name} = {str(path)!r}: cannot be written: {why}")
