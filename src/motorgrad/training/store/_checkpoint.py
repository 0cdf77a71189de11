"""Checkpoints: the complete state of an engine in a file with a checksum."""

import errno
import hashlib
import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jaxtyping import PyTree

from motorgrad._files import read_content, write_atomically
from motorgrad._limits import MAX_CHECKPOINT_BYTES
from motorgrad._reading import arrays_in, json_in
from motorgrad.schema import numbers_of, path_of

FORMAT = 2


class CorruptCheckpoint(ValueError):
    """A checkpoint file that is truncated or altered."""


def fingerprint(tree: PyTree[np.ndarray]) -> str:
    """A hash of all numbers of a tree, to compare the initial learners of two runs."""
    digest = hashlib.sha256()
    for name, leaf in numbers_of(tree).items():
        digest.update(name.encode() + np.ascontiguousarray(leaf).tobytes())
    return digest.hexdigest()[:16]


def save(path: Path, state: PyTree[np.ndarray], about: dict[str, Any]) -> str:
    """Write a `state` and facts `about` it. The first line is the checksum of what follows, which is returned.
    **Raises** `OSError` for one of more bytes than `load` reads, as a disk does that is too small."""
    arrays = numbers_of(state)
    buffer = io.BytesIO()
    np.savez(buffer, **{f"{i}": np.asarray(leaf) for i, leaf in enumerate(arrays.values())})  # type: ignore[arg-type]
    head = json.dumps({"format": FORMAT, "names": list(arrays), **about})
    body = head.encode() + b"\n" + buffer.getvalue()
    mark = checksum(body)
    content = mark.encode() + b"\n" + body
    if len(content) > MAX_CHECKPOINT_BYTES:
        why = f"it takes {len(content):,} bytes, more than the {MAX_CHECKPOINT_BYTES:,} that are read: use fewer seeds"
        raise OSError(errno.EFBIG, why, str(path))
    write_atomically(path, content)
    return mark


def load(path: Path) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """The arrays by path, and the facts about them. **Raises** `CorruptCheckpoint` unless the checksum matches;
    `ValueError` for what is none, or too large."""
    mark, _, body = read_content(path, MAX_CHECKPOINT_BYTES).partition(b"\n")
    if checksum(body).encode() != mark:
        raise CorruptCheckpoint(f"{path}: the checksum does not match: the file is truncated or altered")
    head, _, content = body.partition(b"\n")
    try:
        about = json_in(head)
        if about["format"] != FORMAT:
            raise ValueError(f"format {about['format']}: this version of motorgrad reads format {FORMAT}")
        arrays = arrays_in(content, len(content))  # `save` packs nothing, so that nothing can unpack to more
        found = {name: arrays[f"{i}"] for i, name in enumerate(about["names"])}
    except (KeyError, TypeError) as error:
        raise ValueError(f"{path}: not a checkpoint of motorgrad: {type(error).__name__}: {error}") from None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return found, {**about, "checksum": mark.decode()}


def is_whole(path: Path) -> bool:
    """Whether a file matches its checksum. One that is gone was replaced by a newer one."""
    try:
        mark, _, body = read_content(path, MAX_CHECKPOINT_BYTES).partition(b"\n")
    except FileNotFoundError:
        return True
    return checksum(body).encode() == mark


def checksum(content: bytes) -> str:
    """The SHA-256 of bytes, in hexadecimal."""
    return hashlib.sha256(content).hexdigest()


def part_of(arrays: Mapping[str, np.ndarray], place: str) -> dict[str, np.ndarray]:
    """The arrays at and below a place in a state, by their paths within it."""
    return {name[len(place) + 1 :]: array for name, array in arrays.items() if f"{name}.".startswith(f"{place}.")}


def fill_tree(template: PyTree[Any], arrays: Mapping[str, np.ndarray]) -> PyTree[np.ndarray]:
    """Stored arrays in the structure of a template. **Raises** `ValueError` where a path, shape or dtype differs."""

    def find(path: tuple[Any, ...], leaf: np.ndarray) -> np.ndarray:
        name = path_of(path)
        # states of environments are byte strings of different lengths
        compatible = name in arrays and (
            arrays[name].dtype == leaf.dtype or arrays[name].dtype.kind == leaf.dtype.kind == "S"
        )
        if not compatible or arrays[name].shape != leaf.shape:
            found = f"{arrays[name].dtype}{arrays[name].shape}" if name in arrays else "nothing"
            raise ValueError(f"checkpoint: {name}: found {found}, but this run needs {leaf.dtype}{leaf.shape}")
        return arrays[name]

    return jax.tree_util.tree_map_with_path(find, template)
