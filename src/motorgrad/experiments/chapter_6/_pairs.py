"""Experiments on local units, run and judged with both pairs of probability and score of section 6.2.2."""

import abc
import dataclasses
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, ClassVar, Literal

from motorgrad._errors import check
from motorgrad.experiments._claims import Claim
from motorgrad.experiments._experiment import Experiment, Values, Workspace
from motorgrad.experiments._figures import Figure
from motorgrad.experiments.chapter_6._local_study import LAYOUTS_READ
from motorgrad.statistics import mean_of

READ = "printed"
"""The pair by which statements of the thesis are judged: the one that it prints, and so the one that it ran."""

OTHER = "The thesis ran the printed pair of height and score, not the exact gradient."


@dataclasses.dataclass(frozen=True)
class BothPairs(Experiment):
    """Base of experiments that are done with each pair of probability and score of local units: a subclass measures,
    draws and judges one. The results of a pair have its name before their own.

    **Arguments:** `pairs`: `"printed"`, the biased pair that the thesis prints and ran (`PrintedGaussians`), `"exact"`,
    whose score is the gradient (`LocalGaussians`), or both; the figure shows the first.
    """

    reading: ClassVar[str] = (
        "Section 6.2.2 ties the height of a unit to its widths by equation 6.1 and yet prints the score of a free "
        "height, z² − 1. Statements of the thesis are judged with this pair, which it ran although it is biased; the "
        f"exact gradient, z², is reported beside it. {LAYOUTS_READ}"
    )

    pairs: tuple[Literal["printed", "exact"], ...] = ("printed", "exact")

    def __post_init__(self) -> None:
        super().__post_init__()
        known = 0 < len(self.pairs) == len(set(self.pairs)) and set(self.pairs) <= {"printed", "exact"}
        check(known, "pairs", self.pairs, "printed, exact, or both")

    @abc.abstractmethod
    def measure(self, work: Workspace, pair: str) -> Values:
        """What `run` returns, for one pair."""

    @abc.abstractmethod
    def draw(self, values: Values) -> Figure:
        """Draw the results of one pair."""

    @abc.abstractmethod
    def judge(self, values: Values) -> Iterable[Claim]:
        """The claims about one pair."""

    def learned_reward(self, values: Values) -> Mapping[str, Any]:
        """Reward after learning with one pair, `(seeds,)`, by what was learned, for a comparison; by default none."""
        del values
        return {}

    def run(self, work: Workspace) -> Values:
        return {f"{pair} {name}": value for pair in self.pairs for name, value in self.measure(work, pair).items()}

    def figure(self, values: Values) -> Figure:
        figure = self.draw(values_of(values, self.pairs[0]))
        figure.text(0.995, 0.005, f"{self.pairs[0]} pair", ha="right", va="bottom", fontsize=7, color="0.4")
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        for pair in self.pairs:
            for claim in self.judge(values_of(values, pair)):
                if pair == "exact" or claim.kind != "reference model":  # the models have the exact gradient
                    yield with_pair(claim, pair)
        if len(self.pairs) == 2:
            printed, exact = (self.learned_reward(values_of(values, pair)) for pair in ("printed", "exact"))
            for name, reward in exact.items():
                difference = mean_of(reward - printed[name])
                yield Claim(
                    f"The exact gradient learns better than the printed pair: {name}.",
                    difference,
                    "reward by the exact gradient minus that by the printed pair, from the same starts,",
                    "per decision",
                    note=f"{reward.mean():.4f} and {printed[name].mean():.4f}.",
                    low=0.0,
                    kind="extension",
                )


def values_of(values: Values, pair: str) -> Values:
    """The results of one pair, by their own names."""
    return {name.removeprefix(f"{pair} "): value for name, value in values.items() if name.startswith(f"{pair} ")}


def with_pair(claim: Claim, pair: str) -> Claim:
    """A claim as one about this pair, the variant of a statement that it shares with the other."""
    changes: dict[str, Any] = {"statement": f"{claim.statement.removesuffix('.')} ({pair} pair)."}
    if claim.kind == "thesis":
        changes["of"] = claim.of or claim.statement
        changes["untested"] = claim.untested or ("" if pair == READ else OTHER)
    return dataclasses.replace(claim, **changes)


def settings_of(pair: str) -> dict[str, Any]:
    """What a learner with this pair has otherwise than its task's own."""
    return {} if pair == "exact" else {"policy.pair": pair}
