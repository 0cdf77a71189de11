"""Reading the run in a directory, or only its configuration."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import jax
import numpy as np
import pyarrow as pa
from jax.tree_util import KeyPath
from jaxtyping import PyTree

from motorgrad._arguments import check_arguments
from motorgrad._errors import check
from motorgrad._interface import Interface
from motorgrad.learning import Learner
from motorgrad.policies import Policy, rebuild, trainable, with_interface
from motorgrad.schema import path_of
from motorgrad.tasks import Task
from motorgrad.training._agents import USUAL
from motorgrad.training._evaluating import STATE
from motorgrad.training._metrics import mean_of_samples
from motorgrad.training._run import Run
from motorgrad.training.store import (
    RunDirectory,
    RunDirectoryError,
    part_of,
    release_changes,
    versions,
    warn_of_reading,
)

MEMORY = "cycle.memory"
"""Where a state has the task's memory."""
Given = TypeVar("Given")
Found = TypeVar("Found")


def load(path: Path | str, task: Task | None = None, *, trust: bool = False, allow_changed: bool = False) -> Run:
    """Load the run in a directory. Reading takes no lock, so the run may still be training.

    **Arguments:**

    - `path`: the run directory.
    - `task`: for a run of a task that is not in the registry.
    - `trust`: whether the run's `task` may import a module that its configuration names. Loading itself runs no code
      of the directory.
    - `allow_changed`: whether the settings in `config.toml` may differ from those with which the run was made. They are
      then used.

    It warns (`RunWarning`) of damaged files, and loads what is whole. It warns, too, where another release of motorgrad
    or MuJoCo made the run.

    **Raises:** `RunDirectoryError` where there is no run or no whole checkpoint, and where a setting in `config.toml`
    was changed.
    """
    check_arguments(load, locals())
    directory = RunDirectory(path)
    found = directory.latest()
    config = directory.config(found and found[1], allow_changed)
    if found is None:
        raise RunDirectoryError(f"{path} has no whole checkpoint yet")
    arrays, about = found
    if (learner := directory.learner()) is None:
        raise RunDirectoryError(f"{path}: checkpoint/initial.policies is missing; training on restores it")
    directory.check_rest(about)
    if not allow_changed and (changes := release_changes(about["versions"], versions(), ("motorgrad", "mujoco"))):
        warn_of_reading(f"{path}: {'; '.join(changes)}: what it computes may differ")
    shapes = _shapes(path, learner)
    lanes = len(config["run"]["seeds"]) * max(1, len(config.get("sweep", [])))
    policies = _filled(path, shapes, arrays, lanes, "kept.")
    initial = _filled(path, shapes, directory.initial(), lanes)
    if policies.interface is not None and initial.interface is not None:
        for interface in (policies.interface, initial.interface):
            _checked(path, interface.check_statistics, "statistics of observations")
    metrics = directory.metrics(about)
    if metrics is not None and metrics.num_rows % lanes:
        raise RunDirectoryError(f"{path}: {metrics.num_rows:,} rows of records: must be {lanes:,} for each record")
    mean = "cycle.agent.gradient.mean."
    estimate = None
    if any(name.startswith(mean) for name in arrays):
        count = _filled(path, jax.ShapeDtypeStruct((), np.uint32), arrays, lanes, "cycle.agent.gradient.count")
        learned = trainable(with_interface(policies, None))
        one = jax.tree.map(lambda leaf: jax.ShapeDtypeStruct(leaf.shape[1:], leaf.dtype), learned)
        estimate = mean_of_samples(_filled(path, one, arrays, lanes, mean), count)
    records = pa.table({}) if metrics is None else metrics
    parts = [part_of(arrays, place) for place in (MEMORY, STATE)]
    parts.append(critic_of(arrays, config["agent"]))
    return Run(config, about["decision"], records, policies, initial, estimate, Path(path), task, trust, *parts)


def critic_of(arrays: Mapping[str, np.ndarray], agent: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """What the baseline or critic knew, by path, of the arrays of a state and the table of its learner; empty for a
    learner without one, or one of a kind that is not registered."""
    critic = getattr(Learner.kinds().get(agent.get("kind", USUAL)), "critic", None)
    return {} if critic is None else part_of(arrays, f"cycle.agent.{critic}")


def saved_config(path: Path | str, allow_changed: bool = False) -> dict[str, Any]:
    """The configuration of the run in a directory, compared with that of its newest checkpoint. **Raises**
    `RunDirectoryError` where there is no run, or a setting was changed, unless `allow_changed`."""
    directory = RunDirectory(path)
    found = directory.latest() if directory.is_run else None
    return directory.config(found and found[1], allow_changed)


def given_initial(path: Path | str) -> Policy | None:
    """The `initial` policies that a stored run was given, seeds leading; `None` without any, or without a run.
    **Raises** `RunDirectoryError` where they are missing."""
    directory = RunDirectory(path)
    found = directory.latest() if directory.is_run else None
    run = found[1]["config"]["run"] if found else directory.read_config()["run"] if directory.is_run else {}
    if "initial" not in run:
        return None
    learner = directory.learner() if directory.has_initial_policies else None
    if learner is None:
        lost = "checkpoint/initial.policies is missing: give the initial policies again, train(..., initial=...)"
        raise RunDirectoryError(f"{path}: {lost}")
    lanes = len(run["seeds"]) * max(1, len((found[1]["config"] if found else directory.read_config()).get("sweep", [])))
    stored = _filled(path, _shapes(path, learner), directory.initial(), lanes)
    # in a sweep the seeds of every setting begin from the same policies
    return jax.tree.map(lambda leaf: leaf[: len(run["seeds"])], stored)


def _shapes(path: Path | str, learner: Mapping[str, Any]) -> Policy:
    """The policy of a stored learner, with placeholders for its arrays. **Raises** `RunDirectoryError`."""
    try:
        found = rebuild(learner["structure"])
        check(isinstance(found, Policy), "kind", learner["structure"].get("kind"), "that of a policy")
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        why = " ".join(str(error).split())
        raise RunDirectoryError(f"{path}: the structure of its policy: {type(error).__name__}: {why}") from None
    table = learner.get("interface")
    if table is None:  # of an earlier version, or of a task that does not know it
        return found
    return with_interface(found, _checked(path, Interface.of_table, table).shapes)


def _checked(path: Path | str, read: Callable[[Given], Found], given: Given) -> Found:
    """What a function makes of stored data. **Raises** `RunDirectoryError`, where that refuses them."""
    try:
        return read(given)
    except ValueError as error:
        raise RunDirectoryError(f"{path}: {error}") from None


def _filled(path: Path | str, shapes: PyTree, arrays: Mapping[str, np.ndarray], lanes: int, prefix: str = "") -> PyTree:
    """Stored arrays by name in the structure of `shapes`, lanes leading. **Raises** `RunDirectoryError` for others."""

    def fitting(place: KeyPath, shape: jax.ShapeDtypeStruct) -> np.ndarray:
        name = prefix + path_of(place)
        found = arrays.get(name)
        wanted = (lanes, *shape.shape)
        if found is None or (found.shape, found.dtype) != (wanted, shape.dtype):
            said = "nothing" if found is None else f"{found.dtype}{found.shape}"
            raise RunDirectoryError(f"{path}: {name}: found {said}: must be {shape.dtype}{wanted}")
        return found

    return jax.tree_util.tree_map_with_path(fitting, shapes)
