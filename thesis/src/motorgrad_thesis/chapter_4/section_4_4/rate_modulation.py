"""Section 4.4.1: units with graded activation (rate modulation)."""

from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np
from scipy.special import expit

from motorgrad._errors import check
from motorgrad.schema import Range, count, number, static
from motorgrad.statistics import first_time, median_of
from motorgrad.tasks import LinearRecruitment
from motorgrad.training import agent_for, evaluate
from motorgrad_thesis._claims import Claim, below
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_band, subplots
from motorgrad_thesis.chapter_4._pools import NATURAL, least_error

POLICY_NAMES = {"binary": "motoneurons", "graded": "graded-motoneurons"}
DAMPING = NATURAL["metric"]["damping"] | {"log_deviation": 0.01}
"""Without damping of its own, the logarithm of the deviation would diverge: see the page about graded units."""

REACHED = 1.25  # a pool has learned at this multiple of the least error of binary units
LAST = 0.1  # share of the records, the last, that counts as the end
INPUTS = np.linspace(0, 1, 201)
CURVES = (("binary", "C1", "binary"), ("graded", "C0", "graded"))


@experiment("sec-4.4.1-rate-modulation", "units of graded activation", "section 4.4.1")
class RateModulation(Experiment):
    """Motoneurons with graded activation, a sigmoid of the load plus noise, compared with binary ones. Both learn the
    linear mapping by the natural gradient. How accurately do equally many units grade the force, and how soon?
    """

    reading: ClassVar[str] = "The linear mapping is 1.2 x − 0.1, its coefficients swapped, as for figure 4.3."

    units: tuple[int, ...] = static((1, 2, 4), allowed=Range(1, 64, kind="int"), help="sizes of the pools, rising")
    steps: int = count(300_000, 200, 10**9, unit="decisions", help="length of the practice of each pool")
    deviation: float = number(
        0.3, 0, 10, open_low=True, help="standard deviation of the graded units' noise before learning"
    )
    floor: float = number(0.02, 0, 10, open_low=True, help="lower bound of the deviation")
    seeds: int = count(24, 2, 10_000, help="number of pools of each kind")

    def validate(self) -> None:
        super().validate()
        self.check_rising("units")
        check(self.floor < self.deviation, "floor", self.floor, f"less than deviation, {self.deviation}")

    quick = smoke(steps=2_000, seeds=3)

    def run(self, work: Workspace) -> Values:
        found: Values = {"units": np.array(self.units)}
        found["least"] = np.array([least_error(LinearRecruitment(units=units)) for units in self.units])
        for units in self.units:
            task = LinearRecruitment(units=units)
            for kind, policy in POLICY_NAMES.items():
                changes: dict[str, Any] = NATURAL | {"policy": policy}
                if kind == "graded":
                    noise = {"deviation": self.deviation, "floor": self.floor}
                    changes |= {
                        "policy": {"kind": policy, **noise},
                        "metric": {**NATURAL["metric"], "damping": DAMPING},
                    }
                run = work.train(task, agent_for(task, **changes), self.steps, self.seeds)
                found["decision"], found[f"{units} {kind} error"] = run.curve("error")
                found[f"{units} {kind} end"] = run.final("error", LAST)
                found[f"{units} {kind} without noise"] = evaluate(run, mode="mode").metrics["error"]
                for name in ("threshold", "gain"):
                    found[f"{units} {kind} {name}"] = np.asarray(getattr(run.policies, name))
                if kind == "graded":
                    log_deviation = np.asarray(run.policies_at().log_deviation, float)
                    found[f"{units} deviation"] = self.floor + np.exp(log_deviation.swapaxes(0, 1))
        return found

    def figure(self, values: Values) -> Figure:
        """For every number of units: the error over decisions, the noise of graded units, and the mean force of each
        pool. Bars at the right: the error without noise, by the mean or the most probable action."""

        units = [int(count) for count in values["units"]]
        figure, axes = subplots(3 * len(units) + 0.6, 7.6, 3, len(units), squeeze=False, height_ratios=[1.3, 1, 1])
        decision = values["decision"] / 1e3
        for column, size in enumerate(units):
            above, noise, below = axes[:, column]
            for kind, colour, label in CURVES:
                draw_band(above, decision, values[f"{size} {kind} error"], colour, label)
                above.plot(
                    decision[-1] * 1.06,
                    np.median(values[f"{size} {kind} without noise"]),
                    "_",
                    color=colour,
                    markersize=12,
                )
                for threshold, gain in zip(
                    values[f"{size} {kind} threshold"], values[f"{size} {kind} gain"], strict=True
                ):
                    force = expit(gain * (INPUTS[:, None] - threshold)).mean(1)
                    below.plot(INPUTS, force, color=colour, linewidth=0.6, alpha=0.5)
            above.axhline(values["least"][column], color="0.4", linewidth=0.9, linestyle="--")
            above.set(title=f"{size} unit{'s' * (size > 1)}", xlabel="thousand decisions", ylim=(0, None))
            draw_band(noise, decision, np.median(values[f"{size} deviation"], axis=2), "C0")
            noise.set(xlabel="thousand decisions", ylim=(0, None))
            below.plot(INPUTS, LinearRecruitment(units=size).target(INPUTS), color="0.3", linewidth=1, linestyle="--")
            below.set(xlabel="load", ylim=(-0.12, 1.12))
        axes[0, 0].set_ylabel("mean error of the force")
        axes[1, 0].set_ylabel("deviation of the noise")
        axes[2, 0].set_ylabel("mean force")
        axes[0, 0].legend(fontsize=8)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        steps = values["decision"][-1]
        for row, units in enumerate(map(int, values["units"])):
            least = values["least"][row]
            graded = values[f"{units} graded end"]
            reached = [values[f"{units} {kind} error"] < REACHED * least for kind in POLICY_NAMES]
            times = [first_time(values["decision"], each, never=float(steps)) for each in reached]
            deviation = np.median(values[f"{units} deviation"], axis=2)
            falls = deviation[:, -1] / deviation[:, deviation.shape[1] // 2]
            said = f"{units} unit{'s' * (units > 1)}"
            quiet = [np.median(values[f"{units} {kind} without noise"]) for kind in POLICY_NAMES]
            never = [int((~each.any(-1)).sum()) for each in reached]
            yield below(
                1,
                f"Graded units have a smaller error than as many binary units could have at best ({said}).",
                median_of(graded / least),
                "mean error in the last tenth, relative to the least possible for binary units,",
                note=f"Median errors with the mean or most probable action: graded {quiet[1]:.4f}, "
                f"binary {quiet[0]:.4f}; least possible for binary units {least:.4f}.",
                kind="extension",
            )
            yield below(
                1,
                f"They learn sooner ({said}).",
                median_of(times[1] / times[0]),
                f"decisions to {REACHED} times that least error, relative to binary units,",
                note=f"Medians {np.median(times[1]):,.0f} and {np.median(times[0]):,.0f}; never within "
                f"{steps:,} decisions: {never[1]} and {never[0]}.",
                kind="extension",
            )
            yield below(
                0.1,
                f"During learning, graded units converge to a deterministic output ({said}).",
                median_of(deviation[:, -1]),
                "deviation of the noise at the end",
                note=f"Initially {self.deviation:g}; the floor is {self.floor:g}. In the second half of learning it "
                f"fell to {np.median(falls):.2f} of its value.",
                source="section 6.2.3",
                of="As learning progresses, units with noise converge to a deterministic output.",
                untested="The section speaks of a schedule that slows learning down; learner and time are ours.",
            )
