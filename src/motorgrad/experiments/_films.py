"""From a run in the plane of a particle to a film of how it was learnt."""

import math
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Float, Int

from motorgrad._errors import check
from motorgrad.bodies import compile_model
from motorgrad.policies import Masked, Policy, split
from motorgrad.sim import Course, Film, Motion, film_learning
from motorgrad.tasks import TASKS, BodyTask, ParticleTask
from motorgrad.training import Evaluation, Run

SECONDS = 12.0  # of film
LATE = 0.25  # of the records, by which the seed in the middle is chosen


def course_of(run: Run, seed: int | None = None) -> Course:
    """What happened in a run of a task on a particle, before the first decision and at every record.

    **Arguments:** `run`; `seed`, whose policy is followed, by default the one in the middle, or next above it, by
    its mean reward over the last quarter of the records: not the best, but what to expect.

    **Raises:** `ValueError` for a run of another task, without records, and for a seed that it does not have.
    """
    task, seeds = run.task, run.seeds
    if not isinstance(task, ParticleTask):
        known = [name for name, kind in TASKS.items() if isinstance(kind, type) and issubclass(kind, ParticleTask)]
        raise ValueError(f"task {task.name!r} cannot be animated: it must be one on a particle: {', '.join(known)}")
    decision, reward = run.curve()
    if seed is None:
        late = reward[:, -max(1, round(LATE * reward.shape[1])) :].mean(axis=1)
        seed = seeds[int(np.argsort(late, kind="stable")[len(seeds) // 2])]
    check(seed in seeds, "seed", seed, f"one of the run's seeds, {', '.join(map(str, seeds))}")
    row = seeds.index(seed)
    first = jax.tree.map(lambda leaf: jnp.asarray(leaf[row])[None], run.initial)
    later = recorded_policies(run, range(len(decision)), seed)
    return Course(
        task=task,
        decision=np.concatenate([[0], decision]),
        policies=jax.tree.map(lambda *parts: jnp.concatenate(parts), first, later),
        reward=np.pad(reward, ((0, 0), (1, 0)), constant_values=np.nan),
        shown=row,
        units=_units(run),
        label=f"seed {seed}",
    )


def animate(
    run: Run,
    path: Path | str | None = None,
    seed: int | None = None,
    seconds: float | None = None,
    *,
    progress: bool = True,
) -> Film:
    """Write a film of how a run in the plane of a particle was learnt; `motorgrad.sim.film_learning` has what is seen.

    **Arguments:**

    - `run`: of a task on a particle, finished or not.
    - `path`: a file ending in ".mp4" or ".gif", by default `figures/learning.mp4` of the run directory.
    - `seed`: whose units are shown; by default the one in the middle, see `course_of`.
    - `seconds`: of film, by default 12.
    - `progress`: whether to show how far it is.

    **Raises:** `ValueError` as `course_of` and `film_learning` do, before any work, and for a run in memory without a
    path.
    """
    if path is None:
        check(run.path is not None, "path", path, "a file, for a run in memory")
        path = Path(run.path or "") / "figures" / "learning.mp4"
    course = course_of(run, seed)
    with _bar(f"filming {os.path.basename(path)}", progress) as advance:
        return film_learning(course, path, seconds=SECONDS if seconds is None else seconds, progress=advance)


def _units(run: Run) -> Float[np.ndarray, "seeds moments"] | None:
    """How many units each seed has at the start and at every record; `None` where that does not change."""
    if "units" not in run.metrics.column_names:
        return None
    assert isinstance(run.initial, Masked)
    return np.concatenate([np.asarray(run.initial.active).sum(1)[:, None], run.curve("units")[1]], axis=1)


@contextmanager
def _bar(what: str, shown: bool) -> Iterator[Any]:
    """A progress bar on a terminal; elsewhere a line. Gives what takes the frames done and their total."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(file=sys.stderr)
    with Progress(console=console, disable=not (shown and console.is_terminal)) as bar:
        task = bar.add_task(what, total=None)
        if shown and not console.is_terminal:
            console.print(f"{what} …", soft_wrap=True, highlight=False)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def recorded_policies(run: Run, records: Sequence[int] | Int[np.ndarray, " _"], seed: int | None = None) -> Any:
    """The policies as they were at some records, along a leading axis; of one seed, or of all along a second axis.

    **Arguments:** `run`; `records`, by number from 0, or from the end if negative; `seed`.
    """
    count, seeds = len(run.seeds), run.seeds if seed is None else [seed]
    check(set(seeds) <= set(run.seeds), "seed", seed, f"one of the run's seeds, {', '.join(map(str, run.seeds))}")
    rows, which = np.array([run.seeds.index(each) for each in seeds]), np.asarray(records, int)
    total = run.metrics.num_rows // count
    inside = bool(np.all((-total <= which) & (which < total)))
    check(inside, "records", which.tolist(), f"of the {total} that the run has")
    column = run.metrics["parameters"].combine_chunks()
    numbers = column.flatten().to_numpy().reshape(total, count, -1)[which][:, rows]
    initial = jax.tree.map(lambda leaf: jnp.asarray(leaf[rows]), run.initial)
    policies: Any = jax.vmap(jax.vmap(_with), (None, 0))(initial, jnp.asarray(numbers))
    if "units" in run.metrics.column_names:
        policies = _switched(policies, run.curve("units")[1][rows][:, which].T)
    return policies if seed is None else jax.tree.map(lambda leaf: leaf[:, 0], policies)


def _with(policy: Policy, numbers: Float[jax.Array, " parameters"]) -> Policy:
    """A policy with other parameters."""
    learnt, fixed = split(policy)
    return eqx.combine(ravel_pytree(learnt)[1](numbers), fixed)


def _switched(policies: Masked, units: Float[np.ndarray, "records seeds"]) -> Masked:
    """Growing pools with so many units: growth switches on the first unit that is off."""
    start = np.asarray(policies.active)
    place_in_queue = np.cumsum(~start, axis=-1) * ~start
    active = place_in_queue <= (units - start.sum(-1))[..., None]
    return eqx.tree_at(lambda each: each.active, policies, jnp.asarray(active))


def motion_of(run: Run, outcome: Evaluation, seed: int, label: str = "", seconds: float = 10.0) -> Motion:
    """The motion of one seed in an evaluation, its first `seconds`."""
    check(0 < seconds < math.inf, "seconds", seconds, "a positive time")
    task = run.task
    if not isinstance(task, BodyTask) or outcome.position is None or outcome.activation is None:
        raise ValueError(f"task {task.name!r} has no body to film")
    body, row = task.dynamics, run.seeds.index(seed)
    frames = min(len(outcome.time), max(2, round(seconds / task.period)))
    group_of = [body.groups.index(muscle.group) for muscle in body.muscles]
    activation = np.take(outcome.activation[row, :frames], group_of, axis=-1)
    return Motion(compile_model(body), outcome.time[:frames], outcome.position[row, :frames], activation, label)
