"""From a run in the plane of a particle to a film of how it was learnt."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from motorgrad._errors import check
from motorgrad.experiments._recorded import recorded
from motorgrad.policies import Masked
from motorgrad.sim import Course, Film, film_learning
from motorgrad.tasks import TASKS, ParticleTask
from motorgrad.training import Run

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
    later = recorded(run, range(len(decision)), seed)
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
