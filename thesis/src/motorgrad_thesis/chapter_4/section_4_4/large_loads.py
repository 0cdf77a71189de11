"""Section 4.4: learning from large loads only, and the effect of the size of the pool."""

import dataclasses
from collections.abc import Iterator
from typing import Literal

import numpy as np

from motorgrad.bodies import Posture
from motorgrad.schema import Range, count, number, static
from motorgrad.statistics import exact, mean_of, share_of
from motorgrad.tasks import ArmRecruitment
from motorgrad.training import agent_for
from motorgrad_thesis._claims import Claim, Kind, below, more_than_half, negative, positive
from motorgrad_thesis._experiment import Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, SubFigure
from motorgrad_thesis.chapter_4._pools import firing_probability
from motorgrad_thesis.chapter_4._postures import BothPostures, arm_task

SILENT = 0.05  # a pool that fires less than this fraction at large loads counts as silent
REWARD_TYPES = ("height", "complete")
SEEN = ("large", "all")
PROBABILITY = np.linspace(0.0, 1.0, 101)
HALF = 50
TITLES = {"height": "rewarded by height", "complete": "rewarded only if complete"}


@experiment("sec-4.4-large-loads", "only large loads", "section 4.4")
class LargeLoads(BothPostures):
    """Pools of several sizes learn to lift only large loads, for which more than 85 % of the pool must fire, or all
    loads. The reward is the height of the lift, or only a complete lift is rewarded. In addition, computed exactly: the
    reward at large loads of a pool whose units all fire with the same probability. All this with the upper arm held
    vertically, so that a force that is too small lifts little, and horizontally, so that it lifts in proportion.
    """

    sizes: tuple[int, ...] = static(
        (4, 16, 32), allowed=Range(1, 10_000, kind="int"), unit="units", help="sizes of the pools, rising"
    )
    seeds: int = count(40, 2, 10_000, help="number of pools of each size")
    steps: int = count(150_000, 200, 10**9, unit="decisions", help="length of the practice of each pool")
    least: float = number(
        12.0,
        0,
        14,
        open_low=True,
        open_high=True,
        unit="kg",
        help="the smallest of the large loads; the greatest is 14",
    )

    def validate(self) -> None:
        super().validate()
        self.check_rising("sizes", 2)

    quick = smoke(sizes=(2, 4), seeds=3, steps=2_000)
    size = (8, 6.7)

    def task(
        self, reward_type: Literal["height", "complete"], seen: str, units: int, posture: Posture
    ) -> ArmRecruitment:
        """The task of pools of this size, with this reward, these loads and this arm."""
        task = dataclasses.replace(arm_task(posture, units), reward_type=reward_type)
        return dataclasses.replace(task, low=self.least) if seen == "large" else task

    def measure(self, work: Workspace, posture: Posture) -> Values:
        loads = np.linspace(self.least, 14.0, 41)
        found: Values = {"size": np.array(self.sizes), "probability": PROBABILITY}
        for reward_type in REWARD_TYPES:
            pays = [common_pay(self.task(reward_type, "large", units, posture), loads) for units in self.sizes]
            found[f"{reward_type} pay"] = np.array(pays)
            for seen in SEEN:
                tasks = [self.task(reward_type, seen, units, posture) for units in self.sizes]
                found[f"{reward_type} {seen}"] = np.array([self._active(work, task, loads) for task in tasks])
        return found

    def _active(self, work: Workspace, task: ArmRecruitment, loads: np.ndarray) -> np.ndarray:
        """The fraction of each pool that fires at large loads after learning, `(seeds,)`."""
        run = work.train(task, agent_for(task), self.steps, self.seeds)
        return firing_probability(run.policies, loads).mean(axis=(1, 2))

    def draw(self, figure: SubFigure, values: Values, posture: Posture) -> None:
        """Above: the reward for a common probability. Below: the fraction of each pool that fires after learning, and
        the number of silent pools."""
        axes = figure.subplots(2, 2, sharex="row", sharey="row")
        for column, (reward_type, title) in enumerate(TITLES.items()):
            _pay(axes[0, column], values, reward_type)
            axes[0, column].set_title(title, fontsize=11)
            _active(axes[1, column], values, reward_type, SILENT)
        axes[0, 0].set_ylabel("mean reward at large loads")
        axes[1, 0].set_ylabel("fraction that fires at large loads\nafter learning")
        axes[0, 0].legend(title="units")
        axes[1, 0].legend(title="learned from")

    def judge(self, values: Values, posture: Posture) -> Iterator[Claim]:
        sizes = values["size"]
        rewards: tuple[tuple[str, str, Kind], ...] = (
            ("height", "rewarded by height", "thesis"),
            ("complete", "rewarded only if complete", "extension"),
        )
        for reward_type, words, whose in rewards:
            silent = {seen: values[f"{reward_type} {seen}"] < SILENT for seen in SEEN}
            pay = values[f"{reward_type} pay"][-1]
            yield negative(
                f"Silence is a local maximum at large loads (lifts {words}).",
                exact(pay[1] - pay[0]),
                "pay for firing with a small probability minus that for silence",
                "reward",
                note=f"For {sizes[-1]} units with a probability of {PROBABILITY[1]:g}.",
                kind=whose,
                of="Silence is a local maximum at large loads.",
            )
            yield negative(
                f"At half activation, the gradient makes a large pool fire less (lifts {words}).",
                exact((pay[HALF + 1] - pay[HALF - 1]) / (PROBABILITY[HALF + 1] - PROBABILITY[HALF - 1])),
                "slope of the reward in the common probability at one half",
                "reward per unit of probability",
                note=f"For {sizes[-1]} units. For {sizes[0]}: {_slope(values, reward_type, 0):.2f}.",
                kind=whose,
                of="At half activation, the gradient makes a large pool fire less.",
            )
            yield more_than_half(
                f"With only large loads, a large pool falls silent (lifts {words}).",
                share_of(silent["large"][-1]),
                "share of pools",
                note=f"For {sizes[-1]} units; silent: less than {SILENT:.0%} fires. "
                f"For {sizes[0]} units: {share_of(silent['large'][0])}.",
                kind=whose,
                of="With only large loads, a large pool falls silent.",
            )
        silent = {seen: values[f"complete {seen}"] < SILENT for seen in SEEN}
        yield positive(
            "Large pools fall silent more often than small ones (lifts rewarded only if complete).",
            mean_of(silent["large"][-1] * 1.0 - silent["large"][0]),
            f"{sizes[-1]} against {sizes[0]} units, difference of shares",
            kind="extension",
        )
        yield positive(
            "Exposure to small loads prevents it (lifts rewarded only if complete).",
            mean_of(silent["large"][-1] * 1.0 - silent["all"][-1]),
            f"share of pools of {sizes[-1]} that fall silent with large loads only minus that with all loads",
            kind="extension",
        )
        yield below(
            0.5,
            "With it, most large pools stay active (lifts rewarded only if complete).",
            share_of(silent["all"][-1]),
            f"share of pools of {sizes[-1]} that fall silent",
            kind="extension",
        )


def _slope(values: Values, reward_type: str, row: int) -> float:
    return float(np.gradient(values[f"{reward_type} pay"][row], PROBABILITY)[HALF])


def common_pay(task: ArmRecruitment, loads: np.ndarray) -> np.ndarray:
    """Mean reward at these loads if all units fire with the same probability: `(101,)`, for 0 to 1."""
    from scipy import stats

    counts = np.arange(task.units + 1)
    parts = counts / task.units
    pay = np.mean([np.asarray(task.pay(load, parts, task.effect(load, parts))) for load in loads], axis=0)  # type: ignore
    return stats.binom.pmf(counts, task.units, PROBABILITY[:, None]) @ pay


def _pay(axes: Axes, values: Values, reward_type: str) -> None:
    for row, size in enumerate(values["size"]):
        axes.plot(values["probability"], values[f"{reward_type} pay"][row], color=f"C{row}", label=str(size))
    axes.axvline(0.5, color="0.6", linewidth=0.8, linestyle="--")
    axes.text(0.51, 5.9, "start", color="0.4", fontsize=9)
    axes.axhline(0, color="0.8", linewidth=0.8, zorder=0)
    axes.set_xlabel("probability that each unit fires")


def _active(axes: Axes, values: Values, reward_type: str, silent: float) -> None:
    spread = np.linspace(-0.13, 0.13, values[f"{reward_type} large"].shape[1])
    for shift, seen, colour in ((-0.2, "large", "C3"), (0.2, "all", "C0")):
        for place, active in enumerate(values[f"{reward_type} {seen}"]):
            axes.plot(
                place + shift + spread, np.sort(active), ".", color=colour, markersize=5,
                label=f"{seen} loads" if place == 0 else None,
            )  # fmt: skip
            share = share_of(active < silent)
            words = f"{round(share.value * share.count)} of {share.count}\nsilent"
            axes.text(place + shift, 1.04, words, ha="center", va="bottom", fontsize=7.5, color=colour)
    axes.set_xticks(range(len(values["size"])), [str(size) for size in values["size"]])
    axes.set(xlabel="units in the pool", ylim=(-0.04, 1.22), yticks=np.linspace(0, 1, 6))
