"""Files: whole or not there, read or refused by name."""

import json
import os
import tomllib
from pathlib import Path
from typing import Any

LARGEST = 2**20  # bytes of a file of settings


def write_atomically(path: Path, content: bytes) -> None:
    """Put `content` at `path` so that a reader, or a crash, sees the old file or the new one and nothing between."""
    aside = path.with_name(f".{path.name}.partial")
    with aside.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    os.replace(aside, path)
    if os.name == "posix":  # the rename itself must reach the disk; Windows cannot sync a folder
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def read_toml(path: Path) -> dict[str, Any]:
    """The table in a TOML file. **Raises** `ValueError` that names the file and says what is wrong with it."""
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST + 1)
        if len(content) > LARGEST:
            raise ValueError(f"larger than {LARGEST:,} bytes")
        return tomllib.loads(content.decode("utf-8-sig"))  # some editors begin a file with a mark that says UTF-8
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: not UTF-8 text: {error.reason} at byte {error.start}") from None
    except RecursionError:
        raise ValueError(f"{path}: nested too deeply") from None
    except ValueError as error:
        raise ValueError(f"{path}: not TOML: {' '.join(str(error).splitlines())}") from None


def read_json(path: Path) -> Any:
    """What a JSON file holds. **Raises** `ValueError` that names the file and says what is wrong with it."""
    try:
        return json.loads(path.read_bytes())
    except ValueError as error:
        raise ValueError(f"{path}: damaged: {error}; delete it, or put it back") from None


def check_writable(name: str, path: Path, folder: bool = False) -> None:
    """Refuse a place where no file (or `folder`) can be written, and make nothing there.

    **Raises** `ValueError` that names the setting and says why.
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
