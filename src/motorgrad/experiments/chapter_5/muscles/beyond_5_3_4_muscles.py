"""Beyond section 5.3.4: the hexapod learns to walk on 24 muscles that fire independently."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from motorgrad._errors import check
from motorgrad.experiments._claim import Claim
from motorgrad.experiments._experiment import Values
from motorgrad.experiments._workspace import Workspace
from motorgrad.experiments.chapter_5.muscles._muscle_study import FULL, VARIANTS, MuscleStudy
from motorgrad.experiments.chapter_5.muscles._muscles_claims import ablation_claims, muscle_claims
from motorgrad.experiments.chapter_5.muscles._muscles_figure import draw_muscles
from motorgrad.training import learning_curves

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SMOOTH = 40.0
"""Simulated seconds over which the speed during learning is averaged."""


@dataclasses.dataclass(frozen=True)
class Muscles(MuscleStudy):
    """Hexapods learn to walk on 24 muscles, each of which fires by itself, from policies that know nothing: their speed
    while they learn, and how they walk frozen and from a fresh start. Beside them learners that have one thing changed.

    **Arguments:**

    - `updates`: steps of the parameters; what the learner anneals goes with them.
    - `seeds`: hexapods that learn, each by itself.
    - `watched` (simulated s): for which the frozen policies are watched, a multiple of 20.
    - `compared`: seeds of each changed learner; as many of the unchanged one are beside them.
    - `variants`: the changed learners, by name.
    """

    name: ClassVar[str] = "beyond-5.3.4-muscles"
    title: ClassVar[str] = "twenty-four independent muscles"
    source: ClassVar[str] = "beyond section 5.3.4"

    compared: int = 5
    variants: tuple[str, ...] = tuple(VARIANTS)[1:]

    def __post_init__(self) -> None:
        super().__post_init__()
        check(2 <= self.compared <= self.seeds, "compared", self.compared, f"in 2 … seeds, {self.seeds}")
        for variant in self.variants:
            check(variant != FULL, "variants", variant, "changed learners only")
            _ = self.learner(variant)

    @classmethod
    def quick(cls) -> Self:
        return cls(updates=4, seeds=2, watched=20.0, compared=2, variants=("mirror tie", "no critic"))

    def run(self, work: Workspace) -> Values:
        found: Values = {"variants": np.array(self.variants), "compared": np.array(self.compared)}
        for variant in (FULL, *self.variants):
            run = self.trained(work, variant, None if variant == FULL else self.compared)
            record = run.config["run"]["window"] * run.task.period
            (curve,) = learning_curves([run], "speed", x="simulated", smooth=max(SMOOTH, 2 * record)).curves
            found |= {f"{variant} time": curve.x, f"{variant} practice": curve.values}
            found |= self.judged(work, run, variant)
        return found

    def figure(self, values: Values) -> "Figure":
        return draw_muscles(values)

    def claims(self, values: Values) -> Sequence[Claim]:
        return [*muscle_claims(values), *ablation_claims(values)]
