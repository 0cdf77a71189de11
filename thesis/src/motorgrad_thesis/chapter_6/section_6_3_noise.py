"""Section 6.3: the effect of noise on observations and dynamics on learning."""

from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np

from motorgrad.schema import Range, static
from motorgrad.statistics import first_time, mean_of, median_of, moving_mean
from motorgrad.tasks import FallingParticle
from motorgrad.worlds import ParticlePhysics
from motorgrad_thesis._claims import Claim, above, at_least, positive
from motorgrad_thesis._experiment import Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_band, new_figure
from motorgrad_thesis.chapter_6._local_study import LayoutStudy, frozen_reward

LITTLE = 0.9  # at least this fraction of the reward without noise counts as little effect
EVALUATION_DECISIONS = 5_000  # with noise, of policies that learned without
SMOOTH = 10  # records over which the reward is averaged to determine when it reaches a level
NOISE_LABELS = {"observation": "noise on the observed position", "dynamics": "random force"}


AMOUNTS = "The amount decides the verdict, and the thesis names none: ours reach twice the force of a unit."


@experiment("sec-6.3-noise", "learning in noise", "section 6.3")
class Noise(LayoutStudy):
    """Local units learn R1 and R2 with noise on the observed position, or on the force on the particle, for three times
    as long as in the thesis, in order to distinguish slow learning from worse results.
    """

    reading: ClassVar[str] = "The thesis names no kind and no amount of noise; both are ours."

    decisions: int = 150_000
    seeds: int = 24
    observation: tuple[float, ...] = static(
        (0.03, 0.1),
        allowed=Range(0, open_low=True),
        help="deviations of the noise on each observed coordinate, as fractions of the box, rising",
    )
    dynamics: tuple[float, ...] = static(
        (0.2, 0.8),
        allowed=Range(0, open_low=True),
        help="deviations of the random force in each time step, rising; actions are forces of 0.4",
    )

    def validate(self) -> None:
        super().validate()
        for name in NOISE_LABELS:
            self.check_rising(name)

    quick = smoke(decisions=2_000, seeds=3, layouts=("R1",), observation=(0.1,), dynamics=(0.8,))

    def levels(self, kind: str) -> tuple[float, ...]:
        """The deviations of one kind of noise."""
        return getattr(self, kind)

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for layout in self.layouts:
            changes: dict[str, dict[str, Any]] = {"none": {}}
            changes |= {f"observation {level:g}": {"observation_noise": level} for level in self.observation}
            changes |= {f"dynamics {level:g}": {"physics": ParticlePhysics(noise=level)} for level in self.dynamics}
            policies = None
            for name, change in changes.items():
                task = FallingParticle(layout=layout, **change)  # type: ignore[arg-type]
                run = self.learned(work, task)
                found["decision"], found[f"{layout} {name}"] = run.curve()
                policies = run.policies if policies is None else policies  # those learned without noise
                if change:
                    found[f"{layout} {name} unused"] = frozen_reward(
                        work, task, policies, min(EVALUATION_DECISIONS, self.decisions)
                    )
        return found

    def figure(self, values: Values) -> Figure:
        figure = new_figure(9, 3 * len(self.layouts))
        thousand = values["decision"] / 1000
        style: dict[str, Any] = {"records": min(SMOOTH, len(thousand)), "mean": True}
        for row, layout in zip(
            figure.subplots(len(self.layouts), 2, sharex=True, sharey="row", squeeze=False), self.layouts, strict=True
        ):
            for axes, (kind, words) in zip(row, NOISE_LABELS.items(), strict=True):
                draw_band(axes, thousand, values[f"{layout} none"], "0.3", "none", **style)
                for number, level in enumerate(self.levels(kind)):
                    draw_band(axes, thousand, values[f"{layout} {kind} {level:g}"], f"C{number}", f"{level:g}", **style)
                axes.legend(title=words, loc="center right", fontsize=8, title_fontsize=8)
            row[0].set_ylabel(f"{layout}: reward per decision")
        for axes in figure.axes[-2:]:
            axes.set_xlabel("thousand decisions")
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        for layout in self.layouts:
            for kind, words in NOISE_LABELS.items():
                for level in self.levels(kind):
                    yield from _claims(values, layout, f"{kind} {level:g}", f"{layout}, {words}: {level:g}")


def final_reward(reward: np.ndarray) -> np.ndarray:
    """Mean reward in the last tenth, for each seed."""
    return reward[:, -max(1, reward.shape[1] // 10) :].mean(1)


def decisions_to(decision: np.ndarray, reward: np.ndarray, level: float) -> np.ndarray:
    """When the moving mean first reaches a level, for each seed; the end of learning if it never does."""
    smooth = min(SMOOTH, len(decision))
    return first_time(decision[smooth - 1 :], moving_mean(reward, smooth) >= level, never=float(decision[-1]))


def _claims(values: Values, layout: str, name: str, words: str) -> Iterator[Claim]:
    still = values[f"{layout} none"]
    noisy = values[f"{layout} {name}"]
    decision = values["decision"]
    usual, times = (decisions_to(decision, each, LITTLE * final_reward(still).mean()) for each in (still, noisy))
    never = int((times == decision[-1]).sum())
    yield at_least(
        LITTLE,
        f"Noise has little effect on the final reward ({words}).",
        mean_of(final_reward(noisy) / final_reward(still).mean()),
        "final reward relative to that without noise",
        note=f"Policies learned without noise earn {values[f'{layout} {name} unused'].mean():.3f} with it, "
        f"those learned with it {final_reward(noisy).mean():.3f}; without noise {final_reward(still).mean():.3f}.",
        of="Noise has little effect on the task other than to slow learning.",
        untested=AMOUNTS,
    )
    yield above(
        1,
        f"Noise slows learning ({words}).",
        median_of(times / np.median(usual)),
        f"decisions to {LITTLE:.0%} of the noiseless final reward, relative to the median without noise,",
        "times",
        note=f"{never} of {len(times)} never get there, and count with all {decision[-1]:,} decisions; median without "
        f"noise {np.median(usual):,.0f}.",
        of="Noise slows learning.",
        untested=AMOUNTS,
    )
    yield positive(
        f"Learning with noise compensates for part of it ({words}).",
        mean_of(final_reward(noisy) - values[f"{layout} {name} unused"]),
        "final reward minus that of policies learned without noise, both with noise,",
        "per decision",
        kind="extension",
    )
