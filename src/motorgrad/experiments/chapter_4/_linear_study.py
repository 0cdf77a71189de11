"""What the experiments on the linear mapping share: the learner of section 4.3.1, and how well its pools are spaced."""

import dataclasses
from typing import Self

import numpy as np

from motorgrad._errors import check
from motorgrad.experiments._experiment import Experiment
from motorgrad.experiments._workspace import Workspace
from motorgrad.tasks import LinearRecruitment, spacing_error
from motorgrad.training import Run, settings_for

RATE = 2e-4
"""The thesis's step size."""
SPACED = 0.25
"""A pool counts as equally spaced when no threshold is further than this from its ideal place, in spacings."""


@dataclasses.dataclass(frozen=True)
class LinearStudy(Experiment):
    """An experiment on pools that have learnt the linear mapping, by default with the thesis's numbers.

    **Arguments:**

    - `units`: of the pools, each number once.
    - `steps` (decisions): for which every pool learns.
    - `seeds`: pools of each number of units.
    - `rate`: the step size of all parameters.
    """

    units: tuple[int, ...] = (2, 3, 4, 8)
    steps: int = 6_000_000
    seeds: int = 24
    rate: float = RATE

    def __post_init__(self) -> None:
        check_units(self.units, 2)
        check(200 <= self.steps <= 10**9, "steps", self.steps, "in 200 … 1,000,000,000 decisions")
        check(1 <= self.seeds <= 10_000, "seeds", self.seeds, "in 1 … 10,000")
        settings_for(self.task(min(self.units)), rate=self.rate)

    @classmethod
    def quick(cls) -> Self:
        return cls(units=(2, 4), steps=2_000, seeds=3)

    def task(self, units: int) -> LinearRecruitment:
        """The task in its count form: the ratio form needs `units`² times as long."""
        return LinearRecruitment(units=units)

    def trained(self, work: Workspace, task: LinearRecruitment) -> Run:
        """Pools that have learnt; those of another experiment with the same settings, where there are some."""
        return work.train(task, settings_for(task, rate=self.rate), self.steps, self.seeds)


def check_units(units: tuple[int, ...], least: int) -> None:
    """Refuse numbers of units that do not rise from 2 or more to at most 64, or fewer than `least` of them."""
    rising = len(units) >= least and list(units) == sorted(set(units)) and 2 <= min(units) <= max(units) <= 64
    check(rising, "units", units, f"at least {least} rising numbers from 2 to 64")


def spaced_from(decision: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """For each pool the decision from which its units are equally spaced up to the end of the run; infinity where they
    are not.

    **Arguments:** `decision` (records,); `errors` (pools, records), in spacings; what is no number is not spaced.
    """
    wrong = ~(errors < SPACED)
    last = np.where(wrong.any(1), wrong.shape[1] - 1 - np.argmax(wrong[:, ::-1], axis=1), -1)
    return np.append(decision.astype(float), np.inf)[last + 1]


def off_place(threshold: np.ndarray, gain: np.ndarray, task: LinearRecruitment) -> np.ndarray:
    """How far each pool is from equal spacing, in spacings (`spacing_error`); infinite with a unit of negative gain.

    **Arguments:** thresholds and gains `(..., units)`; the task. **Returns:** (...).
    """
    return np.where((gain > 0).all(-1), spacing_error(threshold, task), np.inf)
