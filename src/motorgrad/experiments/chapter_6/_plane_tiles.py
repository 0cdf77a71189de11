"""Tiles of a particle's plane: units and paths as they were at some moments, from stored numbers."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np

from motorgrad.experiments._experiment import Values
from motorgrad.policies import LocalGaussians
from motorgrad.sim import draw_paths, draw_reward, draw_units, trajectories
from motorgrad.tasks import ParticleTask

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TALL = 0.5  # the height of the Gaussians that are added one by one


def stored_paths(task: ParticleTask, policy: Any, episodes: int, decisions: int = 200, skipped: int = 0) -> Values:
    """Paths of some episodes as arrays, without what was `skipped` at the beginning of each."""
    paths = [path[skipped:] for path in trajectories(task, policy, episodes, decisions=skipped + decisions)]
    return {"paths": np.concatenate(paths), "ends": np.cumsum([len(path) for path in paths])}


def draw_tile(
    axes: "Axes",
    task: ParticleTask,
    values: Values,
    place: str,
    forces: Any = None,
    units: int | None = None,
    height: float = TALL,
) -> None:
    """The task's reward, the paths and the Gaussians stored under the name of a place, of these the first `units`."""
    draw_reward(axes, task)
    draw_paths(axes, np.split(values[f"{place} paths"], values[f"{place} ends"][:-1]))
    centre, log_width = values[f"{place} centre"], values[f"{place} log width"]
    pool = LocalGaussians(jnp.asarray(centre[:units]), jnp.asarray(log_width[:units]), p_max=jnp.asarray(height))
    forces = task.dynamics.forces if forces is None else forces
    draw_units(axes, pool, forces[: pool.outputs])


def named(place: str, values: Values) -> Values:
    """The same values under names that begin with a place."""
    return {f"{place} {name}": value for name, value in values.items()}


def grid(count: int, columns: int) -> tuple[int, int]:
    """Rows and columns for so many tiles."""
    columns = min(columns, count)
    return -(-count // columns), columns


def blank(axes: Sequence["Axes"]) -> None:
    """Tiles that are left over."""
    for each in axes:
        each.set_axis_off()
