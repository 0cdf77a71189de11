"""The study of local policies: tasks, training, evaluation of frozen policies, and tiles of the particle's plane."""

import dataclasses
from collections.abc import Sequence
from typing import Any, ClassVar, Literal

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check
from motorgrad.plane import draw_paths, draw_reward, draw_units, trajectories
from motorgrad.policies import LocalGaussians, Policy
from motorgrad.schema import count, static
from motorgrad.tasks import FallingParticle, ParticleTask, Task
from motorgrad.training import Run, agent_for
from motorgrad_thesis._experiment import Experiment, Values, Workspace, smoke
from motorgrad_thesis._figures import Axes

Layout = Literal["R1", "R2", "R3"]
LAYOUTS: tuple[Layout, ...] = ("R1", "R2")
LAYOUTS_READ = "The layouts of rewards are ours: the thesis shows its own only as pictures."
EXACT_READ = f"Local units have the exact gradient, z², not the printed score, z² − 1. {LAYOUTS_READ}"
EPISODES = 2_000  # episodes of learning in the thesis
FINAL_SHARE = 0.1  # of the episodes, which counts as the end of learning
FORGETTING: dict[str, Any] = {"baseline": {"kind": "fixed-step", "rate": 1e-3}}
"""A baseline that forgets within a thousand decisions, in place of the mean of all rewards."""

TALL = 0.5  # height of the Gaussians of growing policies


@dataclasses.dataclass(frozen=True)
class LocalStudy(Experiment):
    """Base of experiments on learners of the falling particle in the two layouts R1 and R2."""

    reading: ClassVar[str] = EXACT_READ

    decisions: int = count(50_000, 1_000, 10**8, help="number of decisions of learning; 50,000 contain 2,000 episodes")
    seeds: int = count(48, 2, 10_000, help="number of learners of each kind")

    quick = smoke(decisions=2_000, seeds=3)

    def learned(self, work: Workspace, task: ParticleTask | str, **changes: Any) -> Run:
        """A task, or a layout of the falling particle, learned by its own learner or by a changed one."""
        task = FallingParticle(layout=task) if isinstance(task, str) else task  # type: ignore[arg-type]
        return work.train(task, agent_for(task, **changes), self.decisions, self.seeds)


@dataclasses.dataclass(frozen=True)
class LayoutStudy(LocalStudy):
    """Base of experiments on learners in selectable layouts."""

    layouts: tuple[Layout, ...] = static(LAYOUTS, help="layouts of the falling particle")

    def validate(self) -> None:
        super().validate()
        check(len(self.layouts) > 0, "layouts", self.layouts, "at least one")

    quick = smoke(decisions=2_000, seeds=3, layouts=LAYOUTS[:1])


def late_reward(run: Run, episodes: int = EPISODES) -> np.ndarray:
    """Mean reward per decision in the last tenth of this many episodes, `(seeds,)`.

    Runs are recorded by decisions, so the tenth starts and ends with a record: of 2,000 episodes, it consists of the
    records within episodes 1,801 to 2,000, each of about ten episodes.
    """
    count = np.cumsum(run.curve("episodes")[1], axis=1)
    end = np.minimum(episodes, count[:, -1:])
    inside = (count > (1 - FINAL_SHARE) * end) & (count <= end)
    return (run.curve()[1] * inside).sum(1) / inside.sum(1)


def frozen_reward(work: Workspace, task: Task, policies: Policy, decisions: int, **changes: Any) -> np.ndarray:
    """Mean reward per decision of policies that do not learn, `(policies,)`; policies lead in every array.

    Each acts on the random numbers of its neighbour, so that none is judged on those of its training.
    """
    settings = agent_for(task, **changes, update_every="never")
    moved = jax.tree.map(lambda leaf: jnp.roll(leaf, 1, axis=0), policies)
    count = jax.tree.leaves(policies)[0].shape[0]
    run = work.train(task, settings, decisions, count, moved)
    return np.roll(run.curve()[1].mean(1), -1)


def policy_at(policies: Policy, row: int) -> Any:
    """One of several policies."""
    return jax.tree.map(lambda leaf: jnp.asarray(leaf[row]), policies)


def median_row(values: np.ndarray) -> int:
    """The row of the median, or next above it."""
    return int(np.argsort(values)[len(values) // 2])


def gaussians(centre: Any, log_width: Any) -> LocalGaussians:
    """Local units from stored numbers."""
    return LocalGaussians(jnp.asarray(centre, jnp.float32), jnp.asarray(log_width, jnp.float32))


def visited(task: ParticleTask, policy: Policy, episodes: int, seed: int = 0) -> np.ndarray:
    """Positions at which decisions are made in some episodes, `(decisions, 2)`."""
    return np.concatenate([path[:-1] for path in trajectories(task, policy, episodes, seed)])


def outside(centre: np.ndarray) -> np.ndarray:
    """Whether each centre, `(…, 2)`, lies beyond a wall of the unit square."""
    return np.any((centre < 0) | (centre > 1), axis=-1)


def stored_paths(task: ParticleTask, policy: Any, episodes: int, decisions: int = 200, skipped: int = 0) -> Values:
    """Paths of some episodes as arrays, without the `skipped` decisions at the start of each."""
    paths = [path[skipped:] for path in trajectories(task, policy, episodes, decisions=skipped + decisions)]
    return {"paths": np.concatenate(paths), "ends": np.cumsum([len(path) for path in paths])}


def draw_tile(
    axes: Axes,
    task: ParticleTask,
    values: Values,
    place: str,
    forces: Any = None,
    units: int | None = None,
    height: float = TALL,
) -> None:
    """The task's reward, and the paths and the Gaussians stored under this prefix, the first `units` of them."""
    draw_reward(axes, task)
    draw_paths(axes, np.split(values[f"{place} paths"], values[f"{place} ends"][:-1]))
    centre = values[f"{place} centre"]
    log_width = values[f"{place} log width"]
    pool = LocalGaussians(jnp.asarray(centre[:units]), jnp.asarray(log_width[:units]), p_max=jnp.asarray(height))
    forces = task.dynamics.forces if forces is None else forces
    draw_units(axes, pool, forces[: pool.outputs])


def prefixed(place: str, values: Values) -> Values:
    """The same values under names with a prefix."""
    return {f"{place} {name}": value for name, value in values.items()}


def tile_grid(count: int, columns: int) -> tuple[int, int]:
    """Rows and columns for this many tiles."""
    columns = min(columns, count)
    return -(-count // columns), columns


def hide_axes(axes: Sequence[Axes]) -> None:
    """Hide unused tiles."""
    for each in axes:
        each.set_axis_off()
