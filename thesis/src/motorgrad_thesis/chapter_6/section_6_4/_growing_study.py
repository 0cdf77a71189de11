"""The study of growing policies: a pool that receives its units one by one, and its history."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from motorgrad.learning import Learner
from motorgrad.schema import count, static
from motorgrad.tasks import FallingParticle, Task
from motorgrad.training import Run, agent_for
from motorgrad_thesis._experiment import Experiment, Workspace, smoke
from motorgrad_thesis.chapter_6._local_study import EXACT_READ, Layout

RATES = {"centre": 1e-4, "log_width": 5e-4}
INTERVAL = 10_000
SETTLED = 0.24
"""The fraction of each interval in which the newest unit no longer shrinks: 2,412 of 10,000 decisions."""


@dataclasses.dataclass(frozen=True)
class GrowingStudy(Experiment):
    """Base of experiments on growing policies."""

    reading: ClassVar[str] = EXACT_READ

    units: int = count(20, 2, 1_000, help="number of units of the complete pool; they take 400 episodes each in R3")
    seeds: int = count(24, 2, 10_000, help="number of independent learners of each kind")

    quick = smoke(units=4, seeds=3)

    @property
    def decisions(self) -> int:
        """Decisions of learning: one interval per unit."""
        return INTERVAL * self.units

    def growing(self, task: Task, **changes: Any) -> Learner:
        """The constructive learner of section 6.4.4, whose numbers are the defaults, or a changed one."""
        return agent_for(task, **{"policy": "growing", "learning_rate": RATES, **changes})

    def learned(self, work: Workspace, task: Task, settings: Learner) -> Run:
        return work.train(task, settings, self.decisions, self.seeds)

    def counts(self, wanted: tuple[int, ...]) -> tuple[int, ...]:
        """The numbers of units among these that are reached."""
        return tuple(count for count in wanted if count <= self.units)


@dataclasses.dataclass(frozen=True)
class GrowthComparison(GrowingStudy):
    """Base of experiments that compare ways of growing in several layouts of rewards.

    **Attributes:** `ways`, the settings that each way of growing changes, by its name.
    """

    ways: ClassVar[Mapping[str, Mapping[str, Any]]]

    layouts: tuple[Layout, ...] = static(("R3", "R1"), help="layouts of the falling particle")

    quick = smoke(units=4, seeds=3, layouts=("R3",))

    def runs(self, work: Workspace) -> Iterator[tuple[str, Run]]:
        """The run of each layout and way, with its name, such as "R3 clock"."""
        for layout in self.layouts:
            task = FallingParticle(layout=layout, units=self.units)
            for way, changes in self.ways.items():
                yield f"{layout} {way}", self.learned(work, task, self.growing(task, **changes))


def after_units(decision: np.ndarray, values: np.ndarray, units: int) -> np.ndarray:
    """Mean of a curve in the learning phase after each addition by the clock, when the newest unit has stopped
    shrinking and the next has not been added: `(seeds, records)` to `(seeds, units)`."""
    phase = np.stack([learning_phase(decision, unit) for unit in range(units)])
    return np.stack([values[:, rows].mean(1) for rows in phase], axis=1)


def learning_phase(decision: np.ndarray, unit: int) -> np.ndarray:
    """Mask of the records entirely within the learning phase after the addition of this unit, numbered from 0, by the
    clock."""
    end = (unit + 1) * INTERVAL
    return (decision - decision[0] >= end - SETTLED * INTERVAL) & (decision <= end)


def disturbance(decision: np.ndarray, values: np.ndarray, units: int) -> np.ndarray:
    """Drop of a curve from the last record before each addition by the clock to the first one after it, `(seeds, units
    − 1)`."""
    last = np.array([np.flatnonzero(decision <= unit * INTERVAL)[-1] for unit in range(1, units)])
    return values[:, last] - values[:, last + 1]


def grown_policies(run: Run, counts: Sequence[int]) -> Any:
    """Policies of all seeds that grow by the clock, just before the unit after each of these counts acts: along a
    leading axis, seeds along the second. A record at an addition already contains the new unit in its initial state,
    which is masked here."""
    decision = run.curve()[0]
    policies = run.policies_at([int(np.flatnonzero(decision <= count * INTERVAL)[-1]) for count in counts])
    active = jnp.arange(policies.active.shape[-1]) < jnp.asarray(counts)[:, None, None]
    return eqx.tree_at(lambda each: each.active, policies, jnp.broadcast_to(active, policies.active.shape))
