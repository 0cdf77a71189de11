"""Figure 5.5: signs of the learned weights over many seeds, as arrows from sensors to muscles."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from motorgrad.experiments._claims import Claim, Measured, more_than_half, share_of
from motorgrad.experiments._experiment import Values, Workspace, experiment
from motorgrad.experiments._figures import Axes, Figure, new_figure
from motorgrad.experiments.chapter_5._hopper_study import HopperStudy

SENSORS = ("foot contact", "knee angle", "knee velocity", "bias")
MUSCLES = ("flexor", "extensor")
POSITIVE, NEGATIVE, CHANCE = "#c0392b", "#2c5fa8", "0.5"
# positions: sensors on the left, from the top, and muscles on the right
HEIGHTS, TARGETS = (3.0, 2.0, 1.0, 0.0), (2.4, 0.6)
LEFT, RIGHT = 0.0, 4.2
SENSOR, MUSCLE = (1.5, 0.56), (1.25, 0.7)
# position of each label along its arrow, chosen so that none lies on another arrow
ALONG = ((0.3, 0.16), (0.3, 0.2), (0.2, 0.3), (0.16, 0.3))


@experiment("fig-5.5", "the policy that hoppers learn", "figure 5.5")
class HopperWeights(HopperStudy):
    """Signs of the weights that hoppers have learned, from each sensor to the firing probability of each muscle. The
    colour of an arrow is the sign that most seeds have, its width the median size of the weight, and its label the
    number of seeds with this sign; for a hollow arrow, the sign could be chance."""

    def run(self, work: Workspace) -> Values:
        policies: Any = self.trained(work).policies
        return {"weights": np.concatenate([policies.weights, policies.bias[:, :, None]], axis=2)}

    def figure(self, values: Values) -> Figure:

        weights = values["weights"]
        figure = new_figure(8, 5.2)
        axes = figure.subplots()
        size = np.median(np.abs(weights), axis=0)
        for sensor, height in enumerate(HEIGHTS):
            _node(axes, (LEFT, height), SENSOR, SENSORS[sensor], "0.2", dashed=SENSORS[sensor] == "bias")
            for unit, target in enumerate(TARGETS):
                _arrow(
                    axes, height, target, weights[:, unit, sensor], size[unit, sensor] / size.max(), ALONG[sensor][unit]
                )
        for muscle, height in zip(MUSCLES, TARGETS, strict=True):
            _node(axes, (RIGHT, height), MUSCLE, f"{muscle}\nfires", "0.2")
        for line, (colour, words) in enumerate(
            ((POSITIVE, "positive weight"), (NEGATIVE, "negative weight"), (CHANCE, "no common sign"))
        ):
            axes.text(RIGHT - MUSCLE[0] / 2, -0.1 - 0.22 * line, f"▬ {words}", color=colour, va="center", fontsize=9)
        axes.text(
            LEFT - SENSOR[0] / 2,
            -0.54,
            f"Width: median size over {len(weights)} seeds (widest {size.max():.1f}). Label: seeds with this sign.",
            color="0.4",
            fontsize=8.5,
            va="center",
        )
        axes.set(xlim=(-0.85, RIGHT + 0.75), ylim=(-0.7, 3.4), aspect="equal")
        axes.set_axis_off()
        return figure

    def claims(self, values: Values) -> Sequence[Claim]:
        weights = values["weights"]
        extends, inhibits = share_of(weights[:, 1, 0] > 0), share_of(weights[:, 0, 0] < 0)
        made = [
            more_than_half(
                "Foot contact makes the extensor fire: its weight is positive.",
                "figures 5.4, 5.5",
                "in every run (8 of 8 in an independent model): in most runs",
                extends,
            ),
            more_than_half(
                "Foot contact inhibits the flexor: its weight is negative.",
                "figures 5.4, 5.5",
                "in every run (7 of 8 in an independent model): in most runs",
                inhibits,
            ),
        ]
        for sensor in (1, 2):
            for unit, muscle in enumerate(MUSCLES):
                share, sign = common(weights[:, unit, sensor])
                made.append(
                    Claim(
                        f"Learning finds the same sign of the weight from {SENSORS[sensor]} to {muscle} in every run.",
                        "section 5.2.2",
                        "the same in every run: more than chance, for all four jointly",
                        share,
                        beyond_chance(share, 4),
                        note=f"The common sign is {'positive' if sign > 0 else 'negative'}.",
                    )
                )
        signs = np.sign(weights[:, :, :3])
        whole = share_of((signs == np.sign(np.median(weights[:, :, :3], axis=0))).all(axis=(1, 2)))
        made.append(
            more_than_half(
                "Learning finds the same signs of all six weights between sensors and muscles in every run.",
                "section 5.2.2",
                "the same in every run: in most runs",
                whole,
            )
        )
        return made


def common(weights: np.ndarray) -> tuple[Measured, int]:
    """The share of seeds that have the most common sign, and that sign."""
    sign = 1 if np.sum(weights > 0) >= np.sum(weights < 0) else -1
    return share_of(sign * weights > 0), sign


def beyond_chance(share: Measured, tests: int) -> bool:
    """Whether so many signs agree that chance has less than 5 % for any of `tests` claims (Bonferroni). The test is
    two-sided, because the common sign is determined afterwards."""
    from scipy import stats

    return bool(stats.binomtest(round(share.value * share.count), share.count).pvalue < 0.05 / tests)


def _arrow(axes: Axes, start: float, end: float, weights: np.ndarray, size: float, along: float) -> None:
    from matplotlib.patches import FancyArrow

    share, sign = common(weights)
    sure = share.low > 0.5
    colour = (POSITIVE if sign > 0 else NEGATIVE) if sure else CHANCE
    # arrows into one muscle end slightly apart, in order of their origins
    (x, y), (u, v) = (
        (LEFT + SENSOR[0] / 2 - 0.1, start),
        (RIGHT - MUSCLE[0] / 2 - 0.04, end + 0.2 * (start - 1.5) / 1.5),
    )
    width = 0.015 + 0.085 * size
    look: dict[str, Any] = {"facecolor": colour} if sure else {"facecolor": "white", "linestyle": (0, (2, 1))}
    head = 0.06 + 1.5 * width
    axes.add_patch(
        FancyArrow(
            *(x, y, u - x, v - y),
            width=width,
            head_width=head,
            head_length=1.2 * head,
            length_includes_head=True,
            edgecolor=colour,
            linewidth=0.8,
            **look,
        )
    )
    label = f"{round(share.value * share.count)}/{share.count}"
    box = {"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": colour, "linewidth": 0.6}
    place = (x + along * (u - x), y + along * (v - y))
    axes.text(*place, label, color=colour, fontsize=8, ha="center", va="center", bbox=box, zorder=5)


def _node(
    axes: Axes, place: tuple[float, float], size: tuple[float, float], words: str, colour: str, dashed: bool = False
) -> None:
    from matplotlib.patches import FancyBboxPatch

    corner = (place[0] - size[0] / 2, place[1] - size[1] / 2)
    axes.add_patch(
        FancyBboxPatch(
            corner,
            *size,
            boxstyle="round,pad=0,rounding_size=0.12",
            facecolor="white",
            edgecolor=colour,
            linewidth=1.6,
            linestyle="--" if dashed else "-",
            zorder=4,
        )
    )
    axes.text(*place, words, ha="center", va="center", fontsize=11, color=colour, zorder=5)
