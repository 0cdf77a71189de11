"""Policies in files: the numbers by name, and their structure as text."""

import json
from pathlib import Path
from typing import Any

import jax
import numpy as np

from motorgrad._files import check_writable
from motorgrad.policies import Policy, describe
from motorgrad.training import load

STRUCTURE = "structure"


def save_policy(path: str, policy: Policy, task: str) -> None:
    """Write one policy of a task to an `.npz` file, whole or not at all."""
    from io import BytesIO

    from motorgrad._files import write_atomically

    file = Path(path)
    check_writable("path", file)
    leaves = jax.tree_util.tree_leaves_with_path(policy)
    arrays = {_name(place): np.asarray(leaf) for place, leaf in leaves}
    about = json.dumps({"task": task, "policy": describe(policy)})
    content = BytesIO()
    np.savez(content, **{STRUCTURE: np.array(about)}, **arrays)  # type: ignore[arg-type]
    file.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(file, content.getvalue())


def load_policy(path: str, shape: Policy, task: str, seed: int | None = None) -> tuple[Policy, Any]:
    """The policy in a file or a run directory, along a leading axis of one, and the task's memory where a run has one.

    **Arguments:** `shape`: what it must be like; `seed`: of the run, by default its first.

    **Raises** `ValueError` for a policy of another task or structure, and for what is no policy.
    """
    if Path(path).is_dir():
        run = load(path)
        _same_task(path, run.task.name, task)
        policy = run.policy(seed)
        _same_structure(path, describe(policy), shape)
        row = 0 if seed is None else run.seeds.index(seed)
        memory = run.memory
        picked = None if memory is None else jax.tree.map(lambda leaf: leaf[row : row + 1], memory)
        return jax.tree.map(lambda leaf: np.asarray(leaf)[None], policy), picked
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = dict(file)
        about = json.loads(str(arrays.pop(STRUCTURE)))
    except (OSError, ValueError, KeyError) as error:
        raise ValueError(f"{path}: no policy that was saved here: {error}") from None
    _same_task(path, about["task"], task)
    _same_structure(path, about["policy"], shape)
    return jax.tree_util.tree_map_with_path(lambda place, _: arrays[_name(place)][None], shape), None


def _same_task(path: str, found: str, task: str) -> None:
    if found != task:
        raise ValueError(f"{path}: holds a policy of the task {found!r}, but this is {task!r}")


def _same_structure(path: str, found: Any, shape: Policy) -> None:
    wanted = describe(shape)
    if found != json.loads(json.dumps(wanted)) and found != wanted:
        raise ValueError(f"{path}: holds the policy {_short(found)}, but here acts {_short(wanted)}")


def _short(description: Any) -> str:
    parts = [f"{name} {value}" for name, value in description.items() if isinstance(value, str) and name != "kind"]
    return f"{description['kind'].rsplit('.', 1)[-1]}({', '.join(parts)})"


def _name(place: Any) -> str:
    return jax.tree_util.keystr(place)
