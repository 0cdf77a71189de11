"""Section 5.3.4: how many episodes of random actions it takes until a reward is more than likely."""

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from motorgrad.schema import count, number
from motorgrad.statistics import exact
from motorgrad_thesis._claims import Claim, above, within
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment
from motorgrad_thesis._figures import Figure, subplots

PRINTED = 1e10
"""The number of episodes that the thesis states."""

ALMOST_ALL = 0.95
"""The part of correct actions to which that number belongs."""


@experiment("sec-5.3.4-episodes", "episodes until a first reward", "section 5.3.4")
class Episodes(Experiment):
    """The number of episodes of random binary actions until a reward is more than likely, if it is given for a certain
    part of correct actions: by the binomial distribution, and by its Gaussian approximation, which the thesis used.
    """

    reading: ClassVar[str] = (
        '"More than likely to receive reward" is read as a probability above one half, and "at least 55 % correct" as '
        "at least 28 of 50 actions."
    )

    interactions: int = count(5, 1, 100, help="number of decisions in an episode")
    actions: int = count(10, 1, 100, help="number of binary actions in each decision")
    correct: float = number(0.55, 0, 1, help="the least part of the actions that must be correct")

    def run(self, work: Workspace) -> Values:
        del work
        count = self.interactions * self.actions
        needed = np.arange(count // 2, count + 1)
        return {
            "count": np.array(count),
            "needed": needed,
            "exact": episodes(chance(needed, count)),
            "approximate": episodes(approximate_chance(needed / count, count)),
        }

    def figure(self, values: Values) -> Figure:
        figure, axes = subplots(7, 4)
        part = 100 * values["needed"] / values["count"]
        axes.plot(part, values["exact"], "o-", markersize=3, label="binomial distribution")
        axes.plot(part, values["approximate"], "--", color="0.5", label="its Gaussian approximation")
        axes.axhline(PRINTED, color="C3", linewidth=1, linestyle=":", label="as printed")
        axes.axvline(100 * self.correct, color="C3", linewidth=1, linestyle=":")
        axes.set(
            yscale="log", xlabel="correct actions that a reward requires (%)", ylabel="episodes until it is likely"
        )
        axes.legend()
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        count = int(values["count"])
        many = int(np.ceil(round(ALMOST_ALL * count, 9)))
        yield above(
            PRINTED,
            f"If {self.correct:.0%} of {count} actions must be correct, it takes over 10^10 episodes before a reward "
            "is more than likely.",
            exact(float(episodes(chance(np.ceil(round(self.correct * count, 9)), count)))),
            "episodes",
        )
        yield within(
            PRINTED / 2,
            PRINTED,
            f"The number is that for {ALMOST_ALL:.0%}, by the approximation.",
            exact(float(episodes(approximate_chance(ALMOST_ALL, count)))),
            "episodes",
            note=f"By the binomial distribution, {float(episodes(chance(many, count))):.2g} episodes.",
            kind="extension",
        )


def chance(needed: np.ndarray | float, count: int) -> np.ndarray:
    """Probability that at least so many of `count` fair coins are heads."""
    from scipy import stats

    return stats.binom.sf(np.asarray(needed) - 1, count, 0.5)


def approximate_chance(part: np.ndarray | float, count: int) -> np.ndarray:
    """The same for a part of the coins, by the integral of a Gaussian of equal mean and variance."""
    from scipy import stats

    return stats.norm.sf((np.asarray(part) - 0.5) * 2 * np.sqrt(count))


def episodes(probability: np.ndarray) -> np.ndarray:
    """The number of episodes after which an event of this probability in each is more likely than not to have
    happened."""
    return np.floor(np.log(0.5) / np.log1p(-np.minimum(probability, 0.999))) + 1
