"""Files of named arrays: whole or not there, read or refused by name."""

import io
import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from motorgrad._files import write_atomically


def write_arrays(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Store arrays by name, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    write_atomically(path, buffer.getvalue())


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """The arrays of a file of `write_arrays`. **Raises** `ValueError` for a damaged file."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except (ValueError, EOFError, zipfile.BadZipFile) as error:
        raise ValueError(f"{path}: damaged: {error}; delete it, and it is made again") from None
