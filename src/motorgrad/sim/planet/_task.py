"""Tasks on a planet."""

import copy
from collections.abc import Sequence
from typing import Any, TypeVar

from motorgrad._errors import check
from motorgrad.bodies import Body
from motorgrad.sim.planet._batch import PlanetBatch
from motorgrad.sim.planet._body import OnPlanet
from motorgrad.sim.planet._planet import Planet
from motorgrad.tasks import BodyTask, Task

T = TypeVar("T", bound=Task)


def on_planet(task: T, planet: Planet) -> T:
    """The same task with its body on a planet, for one seed.

    What it observes and pays is measured in local coordinates, in which x and y go on as the body goes around.

    **Raises:** `ValueError` for a task without a body, or one that brings its own dynamics or a terrain.
    """
    check(isinstance(task, BodyTask), "task", getattr(task, "name", task), "a task on a body")
    assert isinstance(task, BodyTask)
    kind: Any = type(task)
    check(kind.batch is BodyTask.batch, "task", task.name, "a task on level ground, to be put on a planet")
    moved = OnPlanet(task.dynamics, planet)
    moved.spec()

    class Moved(kind):
        """The task, whose body is on a planet."""

        @property
        def dynamics(self) -> Body:
            return moved

        def batch(self, seeds: Sequence[int], threads: int = 0) -> PlanetBatch:
            del threads
            return PlanetBatch(moved, len(seeds), substeps=self.substeps)

    Moved.__name__ = Moved.__qualname__ = f"{kind.__name__}OnPlanet"
    new = copy.copy(task)
    object.__setattr__(new, "__class__", Moved)
    return new
