"""Section 5.2: what the penalty on active muscles does."""

import dataclasses
from collections.abc import Iterator, Mapping
from typing import ClassVar

import numpy as np

from motorgrad._errors import check
from motorgrad.schema import Range, static
from motorgrad.statistics import mean_of, share_of, tally_of
from motorgrad.tasks import Hopper
from motorgrad_thesis._claims import Claim, above, more_than_half, negative, within
from motorgrad_thesis._experiment import Values, experiment, smoke
from motorgrad_thesis._figures import EXTENSOR, FLEXOR, Figure, draw_intervals, subplots
from motorgrad_thesis.chapter_5._hopper_variants import COLOURS, HopperVariants, draw_practice

THESIS = 0.1
LOST = 0.1
"""A height (m) that a hop may lose to the thesis's penalty and still count as no lower."""


@experiment("sec-5.2-penalty", "the penalty on active muscles", "section 5.2")
class Penalty(HopperVariants):
    """Hoppers learn with several penalties for each active muscle: how high they hop during practice; how high the
    frozen policies hop, and what share of them does not hop at all; and how often their muscles are active."""

    reading: ClassVar[str] = (
        "Sitting still means that a frozen policy makes no hop above 3 cm in 20 s. The thesis does not say how long "
        "its hoppers practised, or which other penalties it tried; both are ours. Penalties up to 1 were measured "
        "first; larger ones were added because all hoppers still hopped."
    )

    penalties: tuple[float, ...] = static(
        (0.0, 0.1, 0.3, 1.0, 3.0, 10.0),
        allowed=Range(0),
        help="costs of an active muscle per decision, rising, with 0 and the thesis's 0.1 before the last",
    )

    def validate(self) -> None:
        super().validate()
        self.check_rising("penalties", 3)
        right = self.penalties[0] == 0 and THESIS in self.penalties[:-1]
        check(right, "penalties", self.penalties, "numbers from 0 with 0.1 before the last")
        check(
            len(self.penalties) <= len(COLOURS), "penalties", self.penalties, f"at most {len(COLOURS)}, to have colours"
        )

    quick = smoke(seconds=6.0, seeds=2, watched=2.0, penalties=(0.0, 0.1, 1.0))

    @property
    def variants(self) -> Mapping[str, Hopper]:
        return {f"{each:g}": dataclasses.replace(self.task, penalty=each) for each in self.penalties}

    def figure(self, values: Values) -> Figure:
        """Heights during practice; then, against the penalty, height, share that sits still, and activity."""
        names = [str(name) for name in values["variants"]]
        figure, ((practice, heights), (still, active)) = subplots(9.5, 7.0, 2, 2)
        draw_practice(practice, values, {name: name for name in names})
        practice.legend(title="penalty per muscle", fontsize=8.5, title_fontsize=8.5)
        places = np.arange(len(names))
        spread = np.linspace(-0.15, 0.15, self.seeds)
        found = np.stack([values[f"{name} height"] for name in names])
        heights.plot(places[:, None] + spread, found, "o", color="0.7", markersize=3.5, markeredgewidth=0)
        draw_intervals(heights, places, [mean_of(each) for each in found], fmt="o-", color="black", markersize=5)
        heights.set(ylabel="height of hops, frozen (m),\n0 for a policy that does not hop", ylim=(-0.02, None))
        shares = [share_of(each == 0) for each in found]
        draw_intervals(still, places, shares, fmt="o-", color="black", markersize=5)
        still.set(ylabel="share of hoppers that sit still", ylim=(-0.03, 1.03))
        for group, (colour, words) in enumerate(((FLEXOR, "flexors"), (EXTENSOR, "extensors"))):
            firing = [mean_of(values[f"{name} firing"][:, group]) for name in names]
            draw_intervals(active, places, firing, fmt="o-", color=colour, markersize=5, label=words)
        active.set(ylabel="share of decisions at which they are active", ylim=(0, None))
        active.legend()
        for axes in (heights, still, active):
            axes.set_xticks(places, names)
            axes.set_xlabel("penalty per active muscle and decision")
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        names = [str(name) for name in values["variants"]]
        free = names[0]
        own = f"{THESIS:g}"
        most = names[-1]
        medians = ", ".join(f"{np.median(values[f'{name} height']):.2f} m at {name}" for name in names)
        muscles = ", ".join(f"{values[f'{name} active'].mean():.2f} at {name}" for name in names)
        yield negative(
            "The penalty of 0.1 keeps learned policies from unnecessary muscle contractions.",
            mean_of(values[f"{own} active"] - values[f"{free} active"]),
            "active muscles of four, difference from learners without a penalty",
            note=f"Means: {muscles}.",
        )
        yield within(
            1,
            1,
            "With a penalty of 0.1, much smaller than the reward of a good jump, no hopper just sits still.",
            tally_of(values[f"{own} height"] > 0),
            "share of these seeds that hop",
        )
        yield more_than_half(
            "With a large penalty, most hoppers sit still rather than try to jump.",
            share_of(values[f"{most} height"] == 0),
            f"with a penalty of {most}, share of seeds that do not hop",
            note=f"The thesis says only that a penalty may have this effect. Medians of the heights: {medians}.",
            kind="extension",
        )
        yield above(
            -LOST,
            f"The thesis's penalty costs no more than {LOST:g} m of height.",
            mean_of(values[f"{own} height"] - values[f"{free} height"]),
            "difference from learners without a penalty, with the same practice",
            "m",
            kind="extension",
        )
