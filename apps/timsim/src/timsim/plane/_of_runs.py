"""Films of how runs in a particle's plane were learned, restored from their records."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from motorgrad._arguments import check_arguments
from motorgrad._errors import check
from timsim.plane._learning_film import Course, film_learning

if TYPE_CHECKING:
    from motorgrad.training import Run
    from timsim.film import Film

SECONDS = 12.0  # length of a film
FINAL_SHARE = 0.25  # of the records, by which is decided which seed is the median one


def course_of(run: Run, seed: int | None = None) -> Course:
    """The course of learning of a run in a particle's plane: policies and rewards before the first decision and at
    every record.

    **Arguments:** `run`; `seed`, the seed whose policy is shown. The default is the median seed (or the next above it)
    by mean reward over the last quarter of the records: a typical seed, not the best.

    **Raises:** `ValueError` for a run of another task, a run without records, and a seed that the run does not have.
    """
    check_arguments(course_of, locals())
    import jax
    import jax.numpy as jnp

    from motorgrad.policies import with_interface
    from motorgrad.tasks import TASKS, ParticleTask

    task, seeds = run.task, run.seeds
    if not isinstance(task, ParticleTask):
        known = [name for name, kind in TASKS.items() if isinstance(kind, type) and issubclass(kind, ParticleTask)]
        raise ValueError(f"task {task.name!r} cannot be filmed: it must be a task on a particle: {', '.join(known)}")
    decision, reward = run.curve()
    if seed is None:
        late = run.final("reward", FINAL_SHARE)
        seed = seeds[int(np.argsort(late, kind="stable")[len(seeds) // 2])]
    check(seed in seeds, "seed", seed, f"one of the run's seeds, {', '.join(map(str, seeds))}")
    row = seeds.index(seed)
    initial = with_interface(run.initial, None)
    first = jax.tree.map(lambda leaf: jnp.asarray(leaf[row])[None], initial)
    later = run.policies_at(seed=seed)
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
    """Film how a run in a particle's plane was learned; `timsim.film_learning` describes the film.

    **Arguments:**

    - `run`: of a task on a particle, finished or not.
    - `path`: a file ending in ".mp4" or ".gif"; by default `figures/learning.mp4` in the run directory.
    - `seed`: the seed whose units are shown; by default the median one, see `course_of`.
    - `seconds`: length of the film, by default 12.
    - `progress`: whether to show progress.

    **Raises:** `ValueError` as `course_of` and `film_learning` do, before any work, and for a run in memory without a
    path.
    """
    check_arguments(animate, locals())
    if path is None:
        check(run.path is not None, "path", path, "a file, for a run in memory")
        path = Path(run.path or "") / "figures" / "learning.mp4"
    course = course_of(run, seed)
    with _bar(f"filming {os.path.basename(path)}", progress) as advance:
        return film_learning(course, path, seconds=SECONDS if seconds is None else seconds, progress=advance)


def _units(run: Run) -> Float[np.ndarray, "seeds moments"] | None:
    """Number of units of each seed at the start and at every record; `None` if it is constant."""
    from motorgrad.policies import Masked

    if "units" not in run.metrics.column_names:
        return None
    assert isinstance(run.initial, Masked)
    return np.concatenate([np.asarray(run.initial.active).sum(1)[:, None], run.curve("units")[1]], axis=1)


@contextmanager
def _bar(what: str, shown: bool) -> Iterator[Any]:
    """Context manager for a progress bar, or for a single line if this is no terminal. Yields a function of (frames
    done, frames in all)."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(file=sys.stderr)
    with Progress(console=console, disable=not (shown and console.is_terminal)) as bar:
        task = bar.add_task(what, total=None)
        if shown and not console.is_terminal:
            console.print(f"{what} …", soft_wrap=True, highlight=False)
        yield lambda done, total: bar.update(task, completed=done, total=total)
