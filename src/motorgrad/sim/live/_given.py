"""From what the user has to a set-up."""

from pathlib import Path
from typing import Any

from motorgrad._errors import check, unknown
from motorgrad.sim.live._setup import BODIES, Setup, bare, learner
from motorgrad.sim.live._stage import Stage
from motorgrad.sim.planet import Planet
from motorgrad.tasks import TASKS, Task


def setup_of(
    subject: Any,
    agent: Any = None,
    seed: int = 0,
    *,
    run: Any = None,
    frozen: bool = False,
    stage: Stage | None = None,
    planet: Planet | None = None,
) -> Setup:
    """The set-up for a task, a body, a model or their names. **Raises** `ValueError` for anything else."""
    if isinstance(subject, Task) or (isinstance(subject, str) and subject in TASKS):
        return learner(subject, agent, seed, run=run, frozen=frozen, stage=stage, planet=planet)
    check(planet is None, "planet", planet, "left out where there is no task: on a planet a learner walks")
    if isinstance(subject, str) and not is_path(subject) and subject not in BODIES:
        raise unknown("task or body", subject, {*TASKS, *BODIES})
    for name, value in (("agent", agent), ("run", run)):
        check(value is None, name, value, "left out where there is no task, but a model")
    known = isinstance(subject, Path | str) or hasattr(subject, "spec") or type(subject).__name__ == "MjModel"
    check(known, "task", subject, "a task, a body, a MuJoCo model, or the path of one")
    return bare(subject, stage)


def is_path(subject: Any) -> bool:
    """Whether a word means a model's file."""
    return isinstance(subject, Path) or (isinstance(subject, str) and subject.lower().endswith((".xml", ".mjcf")))
