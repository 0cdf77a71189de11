"""Section 4.3: loads that are felt and not told."""

import dataclasses
from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np

from motorgrad.schema import Range, count, static
from motorgrad.statistics import difference_of, mean_of, share_of
from motorgrad.tasks import ArmRecruitment
from motorgrad.training import Run, agent_for
from motorgrad_thesis._claims import Claim, above, at_least, below, more_than_half, negative, positive
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_intervals, new_figure
from motorgrad_thesis._readings import values_of
from motorgrad_thesis.chapter_4._felt import blind, lifted, strained
from motorgrad_thesis.chapter_4._pools import IDEAL, draw_pool, firing_probability, thresholds_and_gains
from motorgrad_thesis.chapter_4._postures import READ, arm_task
from motorgrad_thesis.chapter_4.figure_4_8 import GOOD, pool_rewards

TOLD = "told"
LIFTS = "lifts"
NOTHING = "nothing"
LIGHT = 1.0  # kg
HEAVY = 12.0  # kg, up to which the rise of the activation from `LIGHT` on is measured
SMALL = 0.05
"""The fraction of the reward that a little noise may cost."""
OURS: dict[str, Any] = {"kind": "extension"}


@experiment("sec-4.3-felt-loads", "loads that are felt and not told", "section 4.3")
class FeltLoads(Experiment):
    """Pools learn to lift loads with the arm when the load is told, as in the thesis; when it is hidden and felt before
    the lift, as the strain of a tendon with little, more and much noise; when it is hidden, stays for several attempts,
    and the height and the activity of the last one are felt; and when nothing is felt. Rewards are exact, and compared
    with the best that each sense allows. Below: the median pools that feel strains, over the strain: the probability of
    each number of active units, its expectation (black), the thresholds (red), and the best number (dotted).
    """

    reading: ClassVar[str] = (
        "The thesis tells its pools the load, and calls that unrealistic, as the motor system only observes height or "
        "strain. It says nothing about what happens otherwise, so all claims are ours. We take the strain to be that "
        "of a tendon on which the load hangs at rest, 4.9 % for the heaviest load, and the height to be that of the "
        f"last attempt at the same load. The upper arm is {READ}, as for the thesis's other statements."
    )

    units: int = count(4, 3, 10, help="number of units in each pool")
    noises: tuple[float, ...] = static(
        (0.1, 0.3, 1.0),
        allowed=Range(0, 10, open_low=True),
        unit="%",
        help="standard deviations of the noise of strains, rising",
    )
    attempts: int = count(4, 2, 16, help="attempts at each load whose last lift is felt")
    steps: int = count(400_000, 200, 10**9, unit="decisions", help="length of the practice of every pool")
    seeds: int = count(32, 2, 10_000, help="number of pools for each sense")

    quick = smoke(units=3, noises=(0.1, 1.0), attempts=2, steps=2_000, seeds=3)

    def validate(self) -> None:
        super().validate()
        self.check_rising("noises", 2)

    @property
    def tasks(self) -> dict[str, ArmRecruitment]:
        """The task of each sense, by name."""
        told = arm_task(READ, self.units)
        felt = {self.strain(noise): {"senses": "strain", "noise": noise} for noise in self.noises}
        others = {LIFTS: {"senses": "lifts", "attempts": self.attempts}, NOTHING: {"senses": "nothing"}}
        return {TOLD: told} | {name: dataclasses.replace(told, **each) for name, each in (felt | others).items()}

    def strain(self, noise: float) -> str:
        """The name of a sense of strains."""
        return f"strain {noise:g}"

    @property
    def strains(self) -> list[str]:
        """The names of the senses of strains, from the least noise to the most."""
        return [self.strain(noise) for noise in self.noises]

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for name, task in self.tasks.items():
            run = work.train(task, agent_for(task), self.steps, self.seeds)
            made = work.part(name, lambda task=task, run=run: _measured(task, run))
            found |= {f"{name} {key}": value for key, value in made.items()}
        return found

    def figure(self, values: Values) -> Figure:
        figure = new_figure(3.1 * max(3, len(self.noises)), 6.4)
        parts: Any = figure.subfigures(2, 1, height_ratios=[1.15, 1])
        left, middle, right = parts[0].subplots(1, 3, width_ratios=[1.25, 1, 0.8])
        self._rewards(left, values)
        self._activations(middle, values)
        self._by_attempt(right, values)
        panels = parts[1].subplots(1, len(self.noises), squeeze=False)[0]
        mesh: Any = None
        for axes, name in zip(panels, self.strains, strict=True):
            own = values_of(values, name)
            row = int(np.argsort(own["reward"], kind="stable")[len(own["reward"]) // 2])
            mesh = draw_pool(axes, own["threshold"][row], own["gain"][row], own["felt"])
            axes.plot(own["felt"], own["best count"], color=IDEAL, linestyle=":", linewidth=1.6)
            axes.set(xlim=(-2.5, 6.5), xlabel="strain that is felt (%)")
            axes.set_title(shown(name), fontsize=10)
        panels[0].set_ylabel("active units")
        parts[1].colorbar(mesh, ax=panels, label="probability", aspect=14, pad=0.01)
        return figure

    def _rewards(self, axes: Axes, values: Values) -> None:
        """The reward of every pool, and the best that its sense allows."""
        for place, name in enumerate(self.tasks):
            reward = values[f"{name} reward"]
            spread = np.linspace(-0.25, 0.25, len(reward))
            axes.plot(place + spread, np.sort(reward), ".", color=f"C{place}", markersize=3.5)
            best = float(values[f"{name} best"])
            axes.plot([place - 0.38, place + 0.38], [best, best], color=IDEAL, linestyle=":", linewidth=1.8)
        axes.axhline(float(values[f"{NOTHING} best"]), color="0.5", linestyle="--", linewidth=1, zorder=0)
        words = [shown(name).replace(" ", "\n", 1) for name in self.tasks]
        axes.set_xticks(range(len(words)), words, fontsize=8)
        axes.set(ylabel="mean reward")
        axes.set_title("dotted: the best for what is sensed", fontsize=10)

    def _activations(self, axes: Axes, values: Values) -> None:
        load = values[f"{TOLD} load"]
        for place, name in enumerate(self.tasks):
            axes.plot(load, values[f"{name} activation"].mean(0), color=f"C{place}", linewidth=1.3, label=shown(name))
        axes.plot(load, values[f"{TOLD} best count"] / self.units, color=IDEAL, linestyle=":", linewidth=1.4)
        axes.set(xlabel="load (kg)", ylabel="mean activation", ylim=(-0.03, 1.03), xlim=(load[0], load[-1]))
        axes.legend(fontsize=7.5, loc="lower right", handlelength=1.2)

    def _by_attempt(self, axes: Axes, values: Values) -> None:
        attempt = 1 + np.arange(self.attempts)
        means = [mean_of(each) for each in values[f"{LIFTS} by attempt"].T]
        draw_intervals(axes, attempt, means, fmt="o-", color=f"C{list(self.tasks).index(LIFTS)}", capsize=3)
        best, none = (float(values[f"{name} best"]) for name in (LIFTS, NOTHING))
        axes.axhline(best, color=IDEAL, linestyle=":", linewidth=1.5, label="best, all attempts")
        axes.axhline(none, color="0.5", linestyle="--", linewidth=1, label="best without a sense")
        axes.set(xlabel="attempt", xticks=attempt, ylabel="mean reward")
        axes.set_title("lifts felt", fontsize=10)
        axes.legend(fontsize=7.5, loc="center right")

    def claims(self, values: Values) -> Iterator[Claim]:
        yield from self._learned(values)
        yield from self._telling(values)
        yield from self._noise(values)
        yield from self._lifts(values)

    def _learned(self, values: Values) -> Iterator[Claim]:
        none = float(values[f"{NOTHING} best"])
        for name in self.strains:
            own = values_of(values, name)
            yield positive(
                f"Recruitment is learned from what is felt of a hidden load: {shown(name)}.",
                mean_of(own["reward"] - none),
                "reward minus the best without any information",
                note=f"Pools earn {own['reward'].mean():.3f}; the best number of units for what is felt earns "
                f"{own['best']:.3f}, the best for nothing {none:.3f}.",
                of="Recruitment is learned from the strain of a hidden load.",
                **OURS,
            )
        for name in (TOLD, *self.strains):
            own = values_of(values, name)
            yield at_least(
                GOOD,
                f"Pools come close to the best that their sense allows: {shown(name)}.",
                mean_of(own["reward"] / own["best"]),
                unit="of the best mean reward",
                of="Pools come close to the best that their sense allows.",
                **OURS,
            )
        for name in self.strains:
            told = share_of((values[f"{TOLD} gain"] > 0).all(1))
            yield more_than_half(
                f"Pools that feel recruit: all their gains are positive: {shown(name)}.",
                share_of((values[f"{name} gain"] > 0).all(1)),
                note=f"Where the load is told, {told.words()}.",
                of="Pools that feel the strain recruit: all their gains are positive.",
                **OURS,
            )

    def _telling(self, values: Values) -> Iterator[Claim]:
        told = values_of(values, TOLD)
        for name in self.strains:
            own = values_of(values, name)
            yield positive(
                f"Telling the load is worth something: {shown(name)}.",
                difference_of(told["reward"], own["reward"]),
                "reward with the load told minus that with the load felt",
                note=f"Of the best possible rewards, the difference is {told['best'] - own['best']:.3f}.",
                of="Telling the load is worth something.",
                **OURS,
            )
        least = self.strains[0]
        yield below(
            SMALL,
            f"With little noise, feeling is nearly as good as being told: {shown(least)}.",
            difference_of(told["reward"] / told["best"], values[f"{least} reward"] / told["best"]),
            "loss, relative to the best reward",
            note="Stated after a look at other seeds.",
            **OURS,
        )

    def _noise(self, values: Values) -> Iterator[Claim]:
        quiet, loud = (values_of(values, name) for name in (self.strains[0], self.strains[-1]))
        told = values_of(values, TOLD)
        least, *_, most = (shown(name) for name in self.strains)
        yield negative(
            "Noise lowers the gains that are learned.",
            difference_of(np.median(loud["gain"], 1), np.median(quiet["gain"], 1)),
            f"median gain of a pool, {most} minus {least}",
            "per %",
            note=f"With {least} it is {np.median(quiet['gain']):.2f}. The best gains are infinite whatever the noise: "
            "the best number of units for a strain is certain. Gains only grow more slowly.",
            **OURS,
        )
        rise = [_rise(told["load"], own["activation"]) for own in (loud, told)]
        best = np.stack([loud["best activation"], told["best count"] / self.units])
        loud_best, told_best = _rise(told["load"], best).tolist()
        yield negative(
            "Noise flattens the force over the load.",
            difference_of(rise[0], rise[1]),
            f"rise of the mean activation from {LIGHT:g} to {HEAVY:g} kg, {most} minus the load told",
            note=f"With the load told it is {rise[1].mean():.3f}. The best numbers of units rise by {loud_best:.3f} "
            f"and {told_best:.3f}.",
            **OURS,
        )
        for name in self.strains:
            learned, best = _upper(values_of(values, name))
            if len(learned) < 2:
                continue
            yield above(
                0.5,
                f"Thresholds that are learned on strains spread: {shown(name)}.",
                mean_of(np.ptp(learned, 1) / np.ptp(best)),
                "distance of the second from the last threshold, relative to that of the best ones",
                note="Of pools without a unit of negative gain. The first unit is left out: with much noise, it hardly "
                "matters where it is recruited.",
                of="Thresholds that are learned on strains spread.",
                **OURS,
            )
        (late, best_late), (early, best_early) = (_upper(own) for own in (quiet, loud))
        if min(len(late), len(early)) < 2:
            return
        yield negative(
            "Who is less certain of the load recruits earlier: noise lowers thresholds.",
            difference_of(early.mean(1), late.mean(1)),
            f"mean threshold of all but the first unit, {most} minus {least}",
            "% of strain",
            note=f"Of pools without a unit of negative gain. The best thresholds fall by "
            f"{best_late.mean() - best_early.mean():.2f}: a unit too few drops the load, one too many only costs.",
            **OURS,
        )

    def _lifts(self, values: Values) -> Iterator[Claim]:
        own = values_of(values, LIFTS)
        none = float(values[f"{NOTHING} best"])
        note = (
            f"Pools earn {own['reward'].mean():.3f}, the best without information {none:.3f}, and the best with all "
            f"attempts at the load in mind {own['best']:.3f}."
        )
        yield positive(
            "Recruitment is learned from the last lift of a hidden load.",
            mean_of(own["reward"] - none),
            "reward minus the best without any information",
            note=note,
            **OURS,
        )
        later = own["by attempt"][:, 1:].mean(1) - own["by attempt"][:, 0]
        yield positive(
            "Attempts after the first are better.", mean_of(later), "reward of these minus that of the first", **OURS
        )
        yield at_least(
            0.5,
            "Pools gain from lifts half of what these are worth.",
            mean_of((own["reward"] - none) / (own["best"] - none)),
            "share of the reward that the best attempts gain over no information",
            note=f"{note} Stated after a look at other seeds, which had learned little.",
            **OURS,
        )


def shown(name: str) -> str:
    """A sense's name in words: for strains, with the standard deviation of the noise."""
    return f"{name.replace('strain ', 'strain ± ')} %" if name.startswith("strain") else name


def _measured(task: ArmRecruitment, run: Run) -> Values:
    """The pools of a sense, exactly."""
    if task.senses == "lifts":
        return lifted(task, run.policies)
    threshold, gain = thresholds_and_gains(run.policies)
    pools = {"threshold": threshold, "gain": gain}
    if task.senses == "strain":
        return pools | strained(task, run.policies)
    if task.senses == "nothing":
        return pools | blind(task, run.policies)
    found = pool_rewards(task, run)
    return found | {"activation": firing_probability(run.policies, found["load"]).mean(2)}


def _upper(own: Values) -> tuple[np.ndarray, np.ndarray]:
    """The thresholds of all but the first unit, in their order: those of pools without a unit of negative gain,
    `(pools, units - 1)`, and the best ones."""
    good = (own["gain"] > 0).all(1)
    return np.sort(own["threshold"][good], 1)[:, 1:], own["best threshold"][1:]


def _rise(load: np.ndarray, activation: np.ndarray) -> np.ndarray:
    """By how much the activation `(seeds, loads)` rises from a light to a heavy load."""
    light, heavy = (np.abs(load - each).argmin() for each in (LIGHT, HEAVY))
    return activation[:, heavy] - activation[:, light]
