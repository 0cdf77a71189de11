"""Load and save the policies of a live run. Files may be damaged or hold something else."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import jax
import numpy as np

from motorgrad._errors import check, shown
from motorgrad._files import check_writable, write_atomically
from motorgrad._limits import MAX_ARRAY_BYTES, MAX_POLICY_SPARE_BYTES
from motorgrad._reading import array_in, content_of, entries_in, json_in, unpacked
from motorgrad.policies import Interface, Policy, describe, with_interface
from motorgrad.training import Run, load

STRUCTURE = "structure"  # the entry of a file that describes the policy


def save_policy(path: str, policy: Policy, task: str) -> None:
    """Write one policy of a task to an `.npz` file, atomically.

    **Raises** `ValueError` where no file can be written, or where one lies that is no saved policy.
    """
    file = Path(path)
    check_writable("path", file)
    check(not file.exists() or _is_policy(file), "path", path, "new, or a saved policy, which is replaced")
    leaves = jax.tree_util.tree_leaves_with_path(policy)
    arrays = {jax.tree_util.keystr(place): np.asarray(leaf) for place, leaf in leaves}
    meaning = {} if policy.interface is None else {"interface": policy.interface.table()}
    about = json.dumps({"task": task, "policy": describe(policy), **meaning})
    content = BytesIO()
    np.savez(content, **{STRUCTURE: np.array(about)}, **arrays)  # type: ignore[arg-type]
    file.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(file, content.getvalue())


def load_policy(path: Path | str, shape: Policy, task: str, seed: int | None = None) -> tuple[Policy, Any]:
    """Read a policy from a file that `save_policy` wrote, or from a run directory.

    **Arguments:** `shape`: a policy of the structure wanted; `task`: the name of its task; `seed`: of the run, by
    default its first.

    **Returns** the policy, along a leading axis of one, and the task's memory or None.

    **Raises** `ValueError` for a policy of another task, structure or shape, for numbers that are not finite, and for
    anything that is no saved policy, whatever is wrong with it.
    """
    try:
        if Path(path).is_dir():
            return policy_of_run(path, shape, task, seed)
        return _policy_of_file(Path(path), shape, task), None
    except _Misfit as error:
        raise ValueError(str(error)) from None
    except RuntimeError as error:  # of the run directory, which it names
        raise ValueError(" ".join(str(error).split())) from None
    except Exception as error:  # a damaged file may fail in any way
        raise ValueError(f"{path}: not a saved policy: {_line(error)}") from None


def policy_of_run(run: Run | Path | str, shape: Policy, task: str, seed: int | None = None) -> tuple[Policy, Any]:
    """The policy learned by a run or by the run in a directory, checked as by `load_policy`."""
    run = run if isinstance(run, Run) else load(run)
    where = run.path or "the run"
    _check_task(where, run.config["task"]["name"], task)  # making the run's task could import a module
    policy = run.policy(seed)
    _check_structure(where, describe(policy), shape)
    _check_finite(where, policy)
    row = 0 if seed is None else run.seeds.index(seed)
    memory = run.memory
    memory = None if memory is None else jax.tree.map(lambda leaf: leaf[row : row + 1], memory)
    return jax.tree.map(lambda leaf: np.asarray(leaf)[None], policy), memory


def confined(path: str, folders: Sequence[Path]) -> Path:
    """The file or folder that is meant by a path, relative to the first of the `folders`, within one of them.

    **Raises** `ValueError` for any other, also where a link leads out.
    """
    homes = [folder.resolve() for folder in folders]
    try:
        found = (homes[0] / path).resolve()
    except (OSError, ValueError, RuntimeError) as error:  # too long, a zero byte, links in a circle
        raise ValueError(f"path = {path[:100]!r}: cannot be used: {_line(error)}") from None
    inside = ".." not in Path(path).parts and any(found.is_relative_to(home) for home in homes)
    check(path and inside, "path", path, f"within {' or '.join(map(str, dict.fromkeys(homes)))}")
    return found


class _Misfit(ValueError):
    """A valid policy that does not fit this learner."""


def _policy_of_file(path: Path, shape: Policy, task: str) -> Policy:
    """The policy of a file, along a leading axis of one."""
    check(path.is_file(), "path", str(path), "a file that exists")  # not a pipe, which could block for ever
    content = content_of(path, MAX_ARRAY_BYTES)
    with entries_in(content, len(content)) as packed:  # `save_policy` packs nothing, so that nothing unpacks to more
        about = json_in(str(_array(packed, STRUCTURE, 0)))
        _check_task(path, about["task"], task)
        _check_structure(path, about["policy"], shape)
        if "interface" in about:  # not of a file of an earlier version
            shape = with_interface(shape, Interface.of_table(about["interface"]).shapes)

        def leaf(place: tuple[Any, ...], wanted: jax.ShapeDtypeStruct) -> np.ndarray:
            name = jax.tree_util.keystr(place)
            found = _array(packed, name, wanted.size * np.dtype(wanted.dtype).itemsize)
            if (found.shape, found.dtype) != (wanted.shape, wanted.dtype):
                what = f"{found.dtype.name} of shape {found.shape}"
                raise _Misfit(f"{path}: {name} is {what}, but must be {wanted.dtype} of shape {wanted.shape}")
            return found[None]

        policy = jax.tree_util.tree_map_with_path(leaf, shape)
    _check_finite(path, policy)
    if policy.interface is not None:
        policy.interface.check_statistics("statistics of observations")
    return policy


def _array(packed: zipfile.ZipFile, name: str, size: int) -> np.ndarray:
    """An array of an `.npz` file, of about so many bytes."""
    return array_in(unpacked(packed, f"{name}.npy", size + MAX_POLICY_SPARE_BYTES))


def _is_policy(path: Path) -> bool:
    """Whether a file is a saved policy, as it says of itself; others may have an array of that name, too."""
    try:
        content = content_of(path, MAX_ARRAY_BYTES)
        with entries_in(content, len(content)) as packed:
            about = json_in(str(_array(packed, STRUCTURE, 0)))
        return isinstance(about, dict) and about.keys() - {"interface"} == {"task", "policy"}
    except (OSError, ValueError, KeyError):
        return False


def _line(error: Exception) -> str:
    """An error in one line; with its type's name if the text alone says little, as for `KeyError`."""
    text = " ".join(str(error).split())[:200]
    return text if isinstance(error, ValueError | OSError) and text else f"{type(error).__name__} {text}".strip()


def _check_finite(where: Path | str, policy: Policy) -> None:
    """Refuse a policy with NaN or infinite numbers."""
    for place, leaf in jax.tree_util.tree_leaves_with_path(policy):
        if not np.all(np.isfinite(leaf)):
            raise _Misfit(f"{where}: {jax.tree_util.keystr(place)} has numbers that are not finite")


def _check_task(where: Path | str, found: object, task: str) -> None:
    if found != task:
        raise _Misfit(f"{where}: holds a policy of the task {shown(found)}, but this is {task!r}")


def _check_structure(where: Path | str, found: object, shape: Policy) -> None:
    """Refuse a policy whose description, which may have been read from JSON, is not that of `shape`."""
    wanted = describe(shape)
    if found != json.loads(json.dumps(wanted)) and found != wanted:
        raise _Misfit(f"{where}: holds the policy {_words(found)[:300]}, but this learner's is {_words(wanted)[:300]}")


def _words(description: object) -> str:
    """A description in a line: kinds, and shapes by the names of fields."""
    if isinstance(description, list):
        return f"[{', '.join(map(_words, description))}]"
    if not isinstance(description, dict):
        return str(description)
    described = {name: value for name, value in description.items() if isinstance(value, str | dict | list)}
    parts = [f"{name} {_words(value)}" for name, value in described.items() if name != "kind"]
    return f"{description['kind'].rsplit('.', 1)[-1]}({', '.join(parts)})"
