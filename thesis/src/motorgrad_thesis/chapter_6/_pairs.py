"""Experiments on local units with both pairs of probability and score of section 6.2.2."""

import abc
import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, Literal, get_args

from motorgrad._errors import check
from motorgrad.schema import static
from motorgrad.statistics import mean_of
from motorgrad_thesis._claims import Claim
from motorgrad_thesis._experiment import Values
from motorgrad_thesis._figures import Figure
from motorgrad_thesis._readings import Readings, values_of
from motorgrad_thesis.chapter_6._local_study import LAYOUTS_READ

Pair = Literal["printed", "exact"]
PAIRS: tuple[Pair, ...] = get_args(Pair)


@dataclasses.dataclass(frozen=True)
class BothPairs(Readings[Pair]):
    """Base of experiments that are done with each pair of probability and score of local units: a subclass measures,
    draws and judges one."""

    reading: ClassVar[str] = (
        "Section 6.2.2 ties the height of a unit to its widths by equation 6.1 and yet prints the score of a free "
        "height, z² − 1. Statements of the thesis are judged with this pair, which it ran although it is biased; the "
        f"exact gradient, z², is reported beside it. {LAYOUTS_READ}"
    )
    judging: ClassVar[str] = "printed"
    modelled: ClassVar[str] = "exact"
    what: ClassVar[str] = "pair"
    otherwise: ClassVar[str] = "The thesis ran the printed pair of height and score, not the exact gradient."

    pairs: tuple[Pair, ...] = static(
        PAIRS,
        help='pairs of probability and score of the local units: `"printed"`, the biased one that the thesis prints '
        'and ran (`PrintedGaussians`), `"exact"`, whose score is the gradient (`LocalGaussians`), or both; the figure '
        "shows the first",
    )

    def validate(self) -> None:
        super().validate()
        once = 0 < len(self.pairs) == len(set(self.pairs))
        check(once, "pairs", self.pairs, "printed, exact, or both")

    @abc.abstractmethod
    def draw(self, values: Values) -> Figure:
        """Draw the results of one pair."""

    def learned_reward(self, values: Values) -> Mapping[str, Any]:
        """Reward after learning with one pair, `(seeds,)`, by what was learned, for a comparison; by default none."""
        del values
        return {}

    @property
    def readings(self) -> tuple[Pair, ...]:
        return self.pairs

    def figure(self, values: Values) -> Figure:
        figure = self.draw(values_of(values, self.pairs[0]))
        figure.supxlabel(f"{self.pairs[0]} pair", x=0.995, ha="right", fontsize=7, color="0.4")  # which makes room
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        yield from super().claims(values)
        if len(self.pairs) == 2:
            printed, exact = (self.learned_reward(values_of(values, pair)) for pair in PAIRS)
            for name, reward in exact.items():
                yield Claim(
                    f"The exact gradient learns better than the printed pair: {name}.",
                    mean_of(reward - printed[name]),
                    "reward by the exact gradient minus that by the printed pair, from the same starts,",
                    "per decision",
                    note=f"{reward.mean():.4f} and {printed[name].mean():.4f}.",
                    low=0.0,
                    kind="extension",
                )


def settings_of(pair: Pair) -> dict[str, Any]:
    """What a learner with this pair has otherwise than its task's own."""
    return {} if pair == "exact" else {"policy.pair": pair}
