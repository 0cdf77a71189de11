"""Beyond section 6.2: the natural step of each local unit, compared with the plain gradient."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from motorgrad.statistics import mean_of, median_of
from motorgrad_thesis._claims import Claim, above, below
from motorgrad_thesis._experiment import Values, Workspace, experiment
from motorgrad_thesis._figures import Figure, draw_band, new_figure
from motorgrad_thesis.chapter_6._local_study import LayoutStudy, late_reward
from motorgrad_thesis.chapter_6.section_6_3_noise import SMOOTH, decisions_to

NATURAL: dict[str, Any] = {"metric": {"kind": "fisher", "rate": 1e-3, "damping": 0.1}, "learning_rate": 1e-3}
"""The best of ten settings in the layout R3, by final reward over 24 other seeds."""

METHOD_LABELS = {"plain": "plain gradient", "natural": "natural step of each unit"}
SHARE = 0.95  # decisions are counted until this fraction of the plain learner's final reward


@experiment("beyond-6.2-natural", "local units by the natural step", "beyond section 6.2")
class NaturalStep(LayoutStudy):
    """Local units learn R1 and R2 by the natural gradient, which preconditions the step of each unit by the inverse of
    its Fisher matrix, and by the plain gradient. Rate and damping were chosen in another layout, R3, in which the plain
    gradient does best at the thesis's rates.
    """

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for layout in self.layouts:
            for name, changes in (("plain", {}), ("natural", NATURAL)):
                run = self.learned(work, layout, **changes)
                found["decision"], found[f"{layout} {name}"] = run.curve()
                found[f"{layout} {name} late"] = late_reward(run)
        return found

    def figure(self, values: Values) -> Figure:
        figure = new_figure(9, 3.6)
        smooth = min(SMOOTH, len(values["decision"]))
        thousand = values["decision"] / 1000
        for axes, layout in zip(figure.subplots(1, len(self.layouts), squeeze=False)[0], self.layouts, strict=True):
            for colour, (name, label) in zip(("C1", "C0"), METHOD_LABELS.items(), strict=True):
                draw_band(axes, thousand, values[f"{layout} {name}"], colour, label, records=smooth)
            axes.axhline(SHARE * values[f"{layout} plain late"].mean(), color="0.6", linewidth=0.8, linestyle="--")
            axes.set(title=layout, xlabel="thousand decisions")
        figure.axes[0].set_ylabel("reward per decision")
        figure.axes[0].legend(loc="lower right")
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        for layout in self.layouts:
            aim = SHARE * values[f"{layout} plain late"].mean()
            times = {name: decisions_to(values["decision"], values[f"{layout} {name}"], aim) for name in METHOD_LABELS}
            never = {name: int((each == values["decision"][-1]).sum()) for name, each in times.items()}
            yield below(
                1,
                f"The natural step takes fewer decisions ({layout}).",
                median_of(times["natural"] / np.median(times["plain"])),
                f"decisions to {SHARE:.0%} of the plain gradient's final mean reward, relative to its median,",
                "of the decisions",
                note=f"Medians {np.median(times['natural']):,.0f} and {np.median(times['plain']):,.0f}; never: "
                f"{never['natural']} and {never['plain']} of {len(times['plain'])}, which count with all decisions.",
                kind="extension",
            )
            yield above(
                -0.005,
                f"It reaches at least the same reward ({layout}).",
                mean_of(values[f"{layout} natural late"] - values[f"{layout} plain late"]),
                "reward in the last 200 of 2,000 episodes minus that of the plain gradient",
                "per decision",
                note=f"{values[f'{layout} natural late'].mean():.4f} and {values[f'{layout} plain late'].mean():.4f}.",
                kind="extension",
            )
