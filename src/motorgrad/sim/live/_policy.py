"""Policies of a live run in files and runs."""

from __future__ import annotations

import json
from io import BytesIO
from pathlib import Path
from typing import Any

import jax
import numpy as np

from motorgrad._files import check_writable, write_atomically
from motorgrad.policies import Policy, describe
from motorgrad.training import Run, load

STRUCTURE = "structure"  # the entry of a file that describes the policy


def save_policy(path: str, policy: Policy, task: str) -> None:
    """Write one policy of a task to an `.npz` file, atomically."""
    file = Path(path)
    check_writable("path", file)
    leaves = jax.tree_util.tree_leaves_with_path(policy)
    arrays = {jax.tree_util.keystr(place): np.asarray(leaf) for place, leaf in leaves}
    about = json.dumps({"task": task, "policy": describe(policy)})
    content = BytesIO()
    np.savez(content, **{STRUCTURE: np.array(about)}, **arrays)  # type: ignore[arg-type]
    file.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(file, content.getvalue())


def load_policy(path: Path | str, shape: Policy, task: str, seed: int | None = None) -> tuple[Policy, Any]:
    """Read a policy from a file that `save_policy` wrote, or from a run directory.

    **Arguments:** `shape`: a policy of the structure wanted; `task`: the name of its task; `seed`: of the run, by
    default its first.

    **Returns** the policy, along a leading axis of one, and the task's memory or None.

    **Raises** `ValueError` for a policy of another task or structure, and for a file without a policy.
    """
    if Path(path).is_dir():
        return policy_of_run(path, shape, task, seed)
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = dict(file)
        about = json.loads(str(arrays.pop(STRUCTURE)))
    except (OSError, ValueError, KeyError) as error:
        raise ValueError(f"{path}: not a saved policy: {error}") from None
    _check_task(path, about["task"], task)
    _check_structure(path, about["policy"], shape)
    named = jax.tree_util.tree_map_with_path(lambda place, _: arrays[jax.tree_util.keystr(place)][None], shape)
    return named, None


def policy_of_run(run: Run | Path | str, shape: Policy, task: str, seed: int | None = None) -> tuple[Policy, Any]:
    """The policy that a run, or the run of a directory, has learned; as `load_policy`."""
    run = run if isinstance(run, Run) else load(run)
    where = run.path or "the run"
    _check_task(where, run.task.name, task)
    policy = run.policy(seed)
    _check_structure(where, describe(policy), shape)
    row, memory = 0 if seed is None else run.seeds.index(seed), run.memory
    memory = None if memory is None else jax.tree.map(lambda leaf: leaf[row : row + 1], memory)
    return jax.tree.map(lambda leaf: np.asarray(leaf)[None], policy), memory


def _check_task(where: Any, found: str, task: str) -> None:
    if found != task:
        raise ValueError(f"{where}: holds a policy of the task {found!r}, but this is {task!r}")


def _check_structure(where: Any, found: Any, shape: Policy) -> None:
    """Refuse a policy whose description, which may have been read from JSON, is not that of `shape`."""
    wanted = describe(shape)
    if found != json.loads(json.dumps(wanted)) and found != wanted:
        raise ValueError(f"{where}: holds the policy {_short(found)}, but this learner's is {_short(wanted)}")


def _short(description: Any) -> str:
    parts = [f"{name} {value}" for name, value in description.items() if isinstance(value, str) and name != "kind"]
    return f"{description['kind'].rsplit('.', 1)[-1]}({', '.join(parts)})"
