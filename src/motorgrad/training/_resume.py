"""Going on with a run from its directory alone."""

from pathlib import Path
from typing import Any

from motorgrad._settings import build
from motorgrad.training._directory import RunDirectory, RunDirectoryError
from motorgrad.training._run import Run, given_initial, task_of
from motorgrad.training._settings import AgentSettings
from motorgrad.training._train import train


def resume(
    path: Path | str,
    steps: int | None = None,
    *,
    checkpoint_every: float = 30.0,
    threads: int = 0,
    progress: bool = True,
) -> Run:
    """Go on with the run in a directory: its task, its learner's settings, its seeds.

    **Arguments:** `path`; `steps`, decisions per seed, by default as many as were asked for before; the others as
    in `train`: they change no number.

    **Returns** the `Run`; a finished one is given back.

    **Raises** `RunDirectoryError` where there is no run, or one whose task or agent is not made from settings: give
    these to `train` with `out=path`.
    """
    config = RunDirectory(path).read_config()
    settings = settings_in(config["agent"], f"the agent of {path}")
    run: dict[str, Any] = config["run"]
    asked = run["steps"] if steps is None else steps
    return train(
        task_of(config),
        settings,
        asked,
        run["seeds"],
        path,
        checkpoint_every=checkpoint_every,
        threads=threads,
        progress=progress,
        initial=given_initial(path),
    )


def settings_in(agent: dict[str, Any], where: str) -> AgentSettings:
    """The learner's settings in a run's configuration. **Raises** `RunDirectoryError` where it was made by hand."""
    if isinstance(agent["policy"], dict):
        raise RunDirectoryError(
            f"{where}: made in Python, not from settings: give the agent, train(task, agent, out=...)"
        )
    return build(AgentSettings, agent, "agent")
