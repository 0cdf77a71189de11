"""Section 4.4.1: gains that decay, so that units keep exploring."""

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from motorgrad._errors import check
from motorgrad.schema import Range, count, number, static
from motorgrad.statistics import mean_of
from motorgrad.tasks import Drift, LinearRecruitment
from motorgrad.training import agent_for
from motorgrad_thesis._claims import Claim, positive
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, subplots
from motorgrad_thesis.chapter_4._pools import entropy, least_error, parameter_history
from motorgrad_thesis.chapter_4.section_4_4.forgetting_baseline import draw_least_error, draw_quartiles, shade_weak

LOADS = np.linspace(0.0, 1.0, 41)
LAST = 0.25  # share of a practice, the last, that counts as its end


@experiment("sec-4.4.1-gain-decay", "gains that decay", "section 4.4.1")
class GainDecay(Experiment):
    """Gains that decay by a small fraction at every decision. Pools that have learned the linear mapping continue to
    learn with decaying gains: with a constant muscle, and with one that loses part of its strength and regains it.
    Measured: how stochastic the pools remain, how well they track the muscle, and what that costs if nothing changes.
    In comparison, pools whose gains decay from the start.
    """

    reading: ClassVar[str] = "The linear mapping is 1.2 x − 0.1, its coefficients swapped, as for figure 4.3."

    units: int = count(2, 1, 10_000, help="number of units in each pool")
    seeds: int = count(20, 2, 10_000, help="number of pools of each kind")
    learned: int = count(4_000_000, 200, 10**9, unit="decisions", help="length of each pool's first practice")
    steps: int = count(3_000_000, 2, 10**9, unit="decisions", help="length of the second practice")
    period: int = count(
        2_000_000,
        2,
        10**9,
        unit="decisions",
        help="period of the muscle's change; it is strong in the first half and weak in the second",
    )
    amount: float = number(
        -0.5, -1, 100, open_low=True, open_high=True, help="relative change of the muscle's strength"
    )
    decays: tuple[float, float, float] = static(
        (1e-7, 1e-6, 1e-5),
        allowed=Range(0, 1, open_low=True),
        help="decays of the gains per decision, λ, rising. By default a gain without gradient falls to 1/e in half a "
        "period, and in ten times and a tenth of that. The middle one is also used from the start",
    )

    def validate(self) -> None:
        super().validate()
        self.check_least(steps=self.period)
        self.check_rising("decays")
        check(self.amount != 0, "amount", self.amount, "not 0: the muscle must change")

    quick = smoke(seeds=3, learned=2_000, steps=3_000, period=2_000, decays=(1e-4, 1e-3, 1e-2))

    def task(self, drifts: bool) -> LinearRecruitment:
        return LinearRecruitment(
            units=self.units, drift=Drift(self.amount, self.period, "steps") if drifts else Drift()
        )

    def run(self, work: Workspace) -> Values:
        still = self.task(False)
        middle = self.decays[1]
        settings = {d: agent_for(still, weight_decay={"gain": d} if d else None) for d in (0.0, *self.decays)}
        first = [work.train(still, settings[decay], self.learned, self.seeds) for decay in (0.0, middle)]
        found: Values = {
            "decay": np.array(list(settings)),
            "changes": np.arange(1, 2 * self.steps // self.period) * (self.period // 2),
            "least": np.array([least_error(still, 1.0), least_error(still, 1.0 + self.amount)]),
            "first decision": first[0].curve()[0],
            "first error": np.stack([run.curve("error")[1] for run in first]),
            "first entropy": np.stack([entropy(*parameter_history(run), LOADS) for run in first]),
        }
        for name, drifts in (("still", False), ("drifting", True)):
            task = self.task(drifts)
            start = first[0].policies
            runs = [work.train(task, each, self.steps, self.seeds, start) for each in settings.values()]
            found["decision"] = runs[0].curve()[0]
            found[f"{name} error"] = np.stack([run.curve("error")[1] for run in runs])
            found[f"{name} entropy"] = np.stack([entropy(*parameter_history(run), LOADS) for run in runs])
        return found

    def figure(self, values: Values) -> Figure:
        figure, axes = subplots(9, 6, 2, 3, sharex="col", sharey="row")
        labels = ["none" if decay == 0 else f"{decay:g}" for decay in values["decay"]]
        columns = {
            "first": "from the start",
            "still": "learned pools: constant muscle",
            "drifting": "learned pools: weak muscle shaded",
        }
        for column, (name, title) in enumerate(columns.items()):
            decision = values["first decision" if name == "first" else "decision"]
            rows = (0, 2) if name == "first" else range(len(labels))
            for row, quantity in enumerate(("error", "entropy")):
                draw_quartiles(
                    axes[row, column], decision, values[f"{name} {quantity}"], [labels[r] for r in rows], rows
                )
                if name == "drifting":
                    shade_weak(axes[row, column], values["changes"], decision[-1])
            changes = values["changes"] if name == "drifting" else []
            draw_least_error(axes[0, column], changes, decision[-1], values["least"])
            axes[0, column].set_title(title, fontsize=10)
            axes[1, column].set_xlabel("decisions, million")
        axes[0, 0].set(ylabel="mean error of the force", ylim=(0, None))
        axes[1, 0].set(ylabel="entropy, bits per unit", ylim=(0, 1.03))
        axes[1, 1].legend(title="decay of the gains per decision", fontsize=8)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        after = values["decision"] > values["changes"][0]
        end = _last(values["decision"])
        first = values["first entropy"][0]
        plain = values["still entropy"][0][:, end].mean(axis=1)
        quarter = len(values["first decision"]) // 4
        yield positive(
            "As learning progresses, the network loses the ability to explore.",
            mean_of(first[:, quarter : 2 * quarter].mean(axis=1) - plain),
            "constant muscle: entropy in the second quarter minus that at the end",
            "bits per unit",
            note=f"{plain.mean():.3f} bits at the end.",
        )
        yield positive(
            f"Decaying gains ({values['decay'][1]:g} per decision) force it to explore.",
            mean_of(values["still entropy"][1][:, end].mean(axis=1) - plain),
            "constant muscle: entropy at the end minus that without decay",
            "bits per unit",
            of="Decaying gains force the network to explore.",
        )
        tracking = values["drifting error"][:, :, after].mean(axis=2)
        still = values["still error"][:, :, end].mean(axis=2)
        for row, decay in enumerate(values["decay"][1:], 1):
            yield positive(
                f"With decay ({decay:g}), a pool adapts better to a changing muscle.",
                mean_of(tracking[0] - tracking[row]),
                "mean error after the first change without decay minus that with it",
                "of the pool's force",
                note=f"Mean error {tracking[row].mean():.4f}; without decay, {tracking[0].mean():.4f}.",
                of="Gains that decay let a network adapt to a changing world.",
            )
            yield positive(
                f"Decay costs precision if nothing changes ({decay:g}).",
                mean_of(still[row] - still[0]),
                "mean error at the end minus that without decay",
                "of the pool's force",
                note=f"Mean error {still[row].mean():.4f}; without decay, {still[0].mean():.4f}.",
                kind="extension",
            )
        error = values["first error"][:, :, _last(values["first decision"])].mean(axis=2)
        yield positive(
            f"Gains that decay from the start ({values['decay'][2]:g}) keep a pool from learning.",
            mean_of(error[1] - error[0]),
            "mean error at the end of the first practice minus that without decay",
            "of the pool's force",
            note=f"Stated after the first results. Mean error {error[1].mean():.4f}; "
            f"without decay, {error[0].mean():.4f}.",
            kind="extension",
            source="our own observation",
        )


def _last(decision: np.ndarray) -> np.ndarray:
    """Mask of the records at the end of a practice."""
    return np.arange(len(decision)) >= round((1 - LAST) * len(decision))
