"""Section 5.3.4: the gaits that are learnt on four synergies, over many seeds."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from motorgrad.experiments._claim import Claim
from motorgrad.experiments._curves import first_time
from motorgrad.experiments._experiment import Values
from motorgrad.experiments._workspace import Workspace
from motorgrad.experiments.chapter_5.hexapod._gait_claims import common_claims, lag_claims
from motorgrad.experiments.chapter_5.hexapod._gaits_figure import draw_gaits
from motorgrad.experiments.chapter_5.hexapod._synergy_study import MODES, SynergyStudy, controller_speeds, judged
from motorgrad.training import learning_curves

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SMOOTH = 12.0
"""Simulated seconds over which the speed during practice is averaged."""


@dataclasses.dataclass(frozen=True)
class LearntGaits(SynergyStudy):
    """Hexapods learn to walk on four synergies, swing and stance of each tripod, with observations that are late by 0,
    1 and 2 decisions: their speed during practice beside that of the fixed controller, and what gait they came to, how
    fast they walk and how far they get when they start afresh with frozen policies, with actions that are drawn and
    with the most probable ones.
    """

    name: ClassVar[str] = "sec-5.3.4-gaits"
    title: ClassVar[str] = "the gaits that hexapods learn"
    source: ClassVar[str] = "section 5.3.4"

    def run(self, work: Workspace) -> Values:
        found: Values = {f"controller {name}": value for name, value in controller_speeds(work, self.watched).items()}
        level = float(found["controller speed"][0])
        for lag in self.lags:
            run = self.trained(work, lag)
            record = run.config["run"]["window"] * run.task.period
            (curve,) = learning_curves([run], "speed", x="simulated", smooth=max(SMOOTH, 2 * record)).curves
            found["time"] = curve.x
            found[f"lag {lag} practice"] = curve.values
            found[f"lag {lag} falls"] = self.seconds * run.curve("falls")[1].mean(1)
            # before that the mean is over a few decisions only
            passed = (curve.values > level) & (curve.x >= min(SMOOTH, self.seconds))
            found[f"lag {lag} passed"] = np.nan_to_num(first_time(curve.x, passed), nan=self.seconds)
            for mode in MODES:
                seen = work.part(f"lag {lag} {mode}", lambda run=run, mode=mode: judged(self.watch(work, run, mode)))
                found |= {f"lag {lag} {mode} {name}": values for name, values in seen.items()}
        return found

    def figure(self, values: Values) -> "Figure":
        return draw_gaits(values, self.lags)

    def claims(self, values: Values) -> Sequence[Claim]:
        made = [claim for lag in self.lags for claim in lag_claims(values, lag)]
        return made + common_claims(values, self.lags)
