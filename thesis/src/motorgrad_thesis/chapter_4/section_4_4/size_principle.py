"""Section 4.4.1: units of different sizes, and the order in which learning recruits them."""

import dataclasses
import itertools
from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np

from motorgrad.bodies import POSTURES, Posture
from motorgrad.schema import count, number
from motorgrad.statistics import exact, mean_of, share_of
from motorgrad.tasks import ArmRecruitment, LinearRecruitment
from motorgrad.training import agent_for
from motorgrad_thesis._claims import Claim, at_most, negative, positive
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, subplots
from motorgrad_thesis.chapter_4._pools import NATURAL, firing_probability, thresholds_and_gains
from motorgrad_thesis.chapter_4._postures import READ, BothPostures, arm_task

OTHERS = tuple(each for each in POSTURES if each != READ)
GRID = 201  # loads over which the firing of a unit is averaged
MAPPING_LABELS = {
    "linear plain": "linear mapping, plain gradient",
    "linear natural": "linear mapping, natural gradient",
    **{
        f"{posture} arm {gradient}": f"{posture} upper arm, {gradient} gradient"
        for posture in POSTURES
        for gradient in ("plain", "natural")
    },
}


@experiment("sec-4.4.1-size-principle", "units of different sizes", "section 4.4.1")
class SizePrinciple(Experiment):
    """Units whose force grows exponentially from one to the next learn to share a load, from random thresholds. Are
    they recruited in the order of their sizes? In the linear mapping every order has the same reward, so that an order
    can only result from learning; on the arm, whose upper arm is held vertically or horizontally, orders differ in
    reward.
    """

    reading: ClassVar[str] = (
        "The linear mapping is 1.2 x − 0.1, its coefficients swapped, as for figure 4.3; the arm is held in both ways, "
        "as for figure 4.8."
    )

    units: int = count(4, 3, 6, help="number of units in each pool")
    size_ratio: float = number(
        8.0,
        1,
        open_low=True,
        help="the largest unit's force relative to the smallest's. By default each unit has twice the force of "
        "the one before",
    )
    seeds: int = count(48, 2, 10_000, help="number of pools of each kind")
    linear: int = count(
        6_000_000,
        200,
        10**9,
        unit="decisions",
        help="length of the practice of the linear mapping by the plain gradient",
    )
    linear_natural: int = count(
        1_000_000,
        200,
        10**9,
        unit="decisions",
        help="length of the practice of the linear mapping by the natural gradient",
    )
    arm: int = count(
        600_000,
        200,
        10**9,
        unit="decisions",
        help="length of the practice of lifting, in either posture and by either gradient",
    )

    quick = smoke(seeds=4, linear=4_000, linear_natural=2_000, arm=2_000)

    def studies(self) -> dict[str, tuple[LinearRecruitment | ArmRecruitment, dict[str, Any], int]]:
        """For every line: the task, what differs from its own learner, and the decisions."""
        linear = LinearRecruitment(units=self.units, size_ratio=self.size_ratio)
        arms = {posture: self.arm_task(posture) for posture in POSTURES}
        # a threshold in kg is some 14 times one in 0 … 1, and its Fisher information smaller by the square of that
        damping = {"threshold": NATURAL["metric"]["damping"]["threshold"] / ArmRecruitment.high**2}
        scaled = NATURAL | {"metric": {**NATURAL["metric"], "damping": damping}}
        return {
            "linear plain": (linear, {}, self.linear),
            "linear natural": (linear, NATURAL, self.linear_natural),
            **{f"{posture} arm plain": (arm, {}, self.arm) for posture, arm in arms.items()},
            **{f"{posture} arm natural": (arm, scaled, self.arm) for posture, arm in arms.items()},
        }

    def arm_task(self, posture: Posture) -> ArmRecruitment:
        """The task of lifting with units of different sizes and the upper arm held so."""
        return dataclasses.replace(arm_task(posture, self.units), size_ratio=self.size_ratio)

    def run(self, work: Workspace) -> Values:
        found: Values = {"size": LinearRecruitment(units=self.units, size_ratio=self.size_ratio).sizes}
        for name, (task, changes, steps) in self.studies().items():
            run = work.train(task, agent_for(task, **changes), steps, self.seeds)
            loads = np.linspace(max(task.low, 0.0), task.high, GRID)
            found[f"{name} load"] = recruitment_loads(firing_probability(run.policies, loads), loads)
            found[f"{name} gain"] = thresholds_and_gains(run.policies)[1]
            found[f"{name} high"] = np.array(task.high)
        pay = {f"{posture} order pay": order_pay(self.arm_task(posture)) for posture in POSTURES}
        return found | {"orders": np.array(orders_of(self.units))} | pay

    def figure(self, values: Values) -> Figure:
        """For every line: the load from which each unit fires, over its size, and the rank correlations of all pools. A
        grey line joins the units of a pool; units of negative gain are hollow."""
        orders = {name: order(values, name) for name in MAPPING_LABELS}
        figure, axes = subplots(8, 10.0, len(MAPPING_LABELS) // 2, 2, sharex=True)
        size = values["size"]
        for place, (name, title) in zip(axes.flat, MAPPING_LABELS.items(), strict=True):
            loads = values[f"{name} load"]
            shift = np.geomspace(0.88, 1 / 0.88, len(loads))
            for seed, row in enumerate(loads):
                place.plot(size * shift[seed], row, color="0.85", linewidth=0.5, zorder=1)
            for unit, graded in itertools.product(range(len(size)), (True, False)):
                which = (values[f"{name} gain"][:, unit] > 0) == graded
                colour = f"C{unit}"
                face = colour if graded else "white"
                place.scatter(size[unit] * shift[which], loads[which, unit], 12, face, edgecolor=colour, zorder=2)
            mean = mean_of(orders[name])
            place.set_title(
                f"{title}\nrank correlation {mean.value:+.2f} [{mean.low:+.2f} … {mean.high:+.2f}]", fontsize=9
            )
            place.set_xscale("log", base=2)
            place.set_xticks(size, [f"{part:.2f}" for part in size])
            place.minorticks_off()
            place.set_ylim(-0.03 * float(values[f"{name} high"]), 1.03 * float(values[f"{name} high"]))
        for index, row in enumerate(axes):
            row[0].set_ylabel(f"fires above this load{', kg' if index else ''}")
        for place in axes[-1]:
            place.set_xlabel("size / total force (hollow: negative gain)")
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        chance = 1 / len(values["orders"])
        for name, words in MAPPING_LABELS.items():
            found = order(values, name)
            whole = share_of(found > 1 - 1e-9)
            graded = share_of((values[f"{name} gain"] > 0).all(axis=1))
            yield positive(
                f"Units organise by the size principle: small ones are recruited first ({words}).",
                mean_of(found),
                "mean rank correlation of size and recruitment",
                note=f"In exactly this order: {whole}; by chance {chance:.3f}. All gains positive: {graded}.",
                kind="thesis" if name.endswith("plain") else "extension",
                untested=BothPostures.otherwise if name.startswith(OTHERS) else "",
                of="Units of different sizes organise by the size principle.",
            )
        for posture in POSTURES:
            pay = values[f"{posture} order pay"]
            best = values["orders"][pay.argmax()] + 1
            claim = at_most(
                0,
                "On the arm, the order of the size principle has the highest reward.",
                exact(pay.max() - pay[0]),
                "deficit to the best order of noiseless units",
                "reward",
                note=f"The best order, numbered from the smallest, 1, to the largest, {len(best)}: "
                f"{', '.join(map(str, best))}.",
                kind="extension",
            )
            yield BothPostures.as_variant(claim, posture)
        for name in ("linear plain", "linear natural"):
            yield negative(
                f"The larger a unit, the closer to the middle of the range it is recruited ({MAPPING_LABELS[name]}).",
                mean_of(correlations(values, np.abs(values[f"{name} load"] - 0.5))),
                "mean rank correlation of size and distance from the middle",
                note="Stated after the first results.",
                kind="extension",
                source="our own observation",
            )


def orders_of(units: int) -> list[tuple[int, ...]]:
    """All orders of recruitment; the first is that of size."""
    return list(itertools.permutations(range(units)))


def order_pay(task: ArmRecruitment) -> np.ndarray:
    """Average reward over a sweep of noiseless units in each order of `orders_of`, each recruited at its best load."""
    loads = np.linspace(task.low, task.high, GRID)
    found = []
    for order in orders_of(task.units):
        parts = np.concatenate([[0.0], np.cumsum(task.sizes[list(order)])])
        pay = [np.asarray(task.pay(load, parts, task.effect(load, parts))).max() for load in loads]  # type: ignore
        found.append(np.mean(pay))
    return np.array(found)


def recruitment_loads(probability: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """The load from which a unit fires, `(seeds, units)`: for a unit with a sharp threshold, its threshold.

    It is the mean fraction of the range in which the unit is silent, so that it is also defined for units that always
    or never fire.

    **Arguments:** `probability` (seeds, loads, units); the loads, equally spaced.
    """
    return loads[0] + (loads[-1] - loads[0]) * (1 - probability.mean(axis=1))


def correlations(values: Values, places: np.ndarray) -> np.ndarray:
    """Spearman's rank correlation of the units' sizes and these places, for each seed."""
    from scipy import stats

    return np.array([stats.spearmanr(values["size"], row)[0] for row in places])


def order(values: Values, name: str) -> np.ndarray:
    """Rank correlation of size and recruitment load for each seed: 1 if small units come first."""
    return correlations(values, values[f"{name} load"])
