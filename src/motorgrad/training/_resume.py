"""Resuming a run from its directory alone."""

from pathlib import Path
from typing import Any

from motorgrad.learning import Agent
from motorgrad.tasks import Task
from motorgrad.training._agents import agent_from_table
from motorgrad.training._run import Run, given_initial, task_of
from motorgrad.training._train import train
from motorgrad.training.store._directory import RunDirectory, RunDirectoryError


def resume(
    path: Path | str,
    steps: int | None = None,
    *,
    checkpoint_every: float = 30.0,
    threads: int = 0,
    progress: bool = True,
) -> Run:
    """Resume the run in a directory: its task, its learner, its seeds.

    **Arguments:** `path`; `steps`, decisions per seed, by default as many as were asked for before; the others as
    in `train`: they change no number.

    **Returns** the `Run`; a finished one is given back.

    **Raises** `RunDirectoryError` where there is no run, or one whose task or agent is not made from settings: give
    these to `train` with `out=path`.
    """
    config = RunDirectory(path).read_config()
    task, run = task_of(config), config["run"]
    agent = agent_in(task, config["agent"], f"{path}: agent")
    asked = run["steps"] if steps is None else steps
    return train(
        task,
        agent,
        asked,
        run["seeds"],
        path,
        checkpoint_every=checkpoint_every,
        threads=threads,
        progress=progress,
        initial=given_initial(path),
        sweep=config.get("sweep"),
    )


def agent_in(task: Task, settings: dict[str, Any], where: str) -> Agent:
    """The learner of a run's configuration. **Raises** `RunDirectoryError` where a part of it was made in Python."""
    try:
        return agent_from_table(task, settings, where)
    except ValueError as error:
        raise RunDirectoryError(f"{error}: train(task, agent, out=...)") from None
