"""Figure 5.5: signs of the learned weights over many seeds, as arrows from sensors to muscles."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from motorgrad.statistics import LEVEL, Measured, share_of
from motorgrad_thesis._claims import Claim, more_than_half
from motorgrad_thesis._experiment import Values, Workspace, experiment
from motorgrad_thesis._figures import Axes, Figure, subplots
from motorgrad_thesis.chapter_5._hopper_study import HopperStudy

SENSORS = ("foot contact", "knee angle", "knee velocity", "bias")
MUSCLES = ("flexor", "extensor")
SIGNS = np.array([[-1, 1, -1], [1, -1, 1]])
"""Claimed signs of the weights to flexor and extensor from contact, knee angle and knee velocity. Those of angle and
velocity were named after the first measurement, in which most seeds had them."""

POSITIVE = "#c0392b"
NEGATIVE = "#2c5fa8"
CHANCE = "0.5"
# positions: sensors on the left, from the top, and muscles on the right
HEIGHTS = (3.0, 2.0, 1.0, 0.0)
TARGETS = (2.4, 0.6)
LEFT = 0.0
RIGHT = 4.2
SENSOR = (1.5, 0.56)
MUSCLE = (1.25, 0.7)
# position of each label along its arrow, chosen so that none lies on another arrow
ALONG = ((0.3, 0.16), (0.3, 0.2), (0.2, 0.3), (0.16, 0.3))


SAME = "Learning finds the same signs of the weights in every run."


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
        figure, axes = subplots(8, 5.2)
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

    def claims(self, values: Values) -> Iterator[Claim]:
        signed = SIGNS * values["weights"][:, :, :3] > 0
        yield more_than_half(
            "Foot contact makes the extensor fire: its weight is positive.",
            share_of(signed[:, 1, 0]),
            note="In an independent model, in 8 of 8 runs.",
            source="figures 5.4, 5.5",
        )
        yield more_than_half(
            "Foot contact inhibits the flexor: its weight is negative.",
            share_of(signed[:, 0, 0]),
            note="In an independent model, in 7 of 8 runs.",
            source="figures 5.4, 5.5",
        )
        for sensor in (1, 2):
            for unit, muscle in enumerate(MUSCLES):
                way = "positive" if SIGNS[unit, sensor] > 0 else "negative"
                yield more_than_half(
                    f"Learning finds a {way} weight from {SENSORS[sensor]} to {muscle} in every run.",
                    share_of(signed[:, unit, sensor], level=1 - (1 - LEVEL) / 4),
                    note="The intervals of the four such claims hold jointly at 95 %.",
                    source="section 5.2.2",
                    of=SAME,
                )
        yield more_than_half(
            "Learning finds these signs of all six weights between sensors and muscles in every run.",
            share_of(signed.all(axis=(1, 2))),
            source="section 5.2.2",
            of=SAME,
        )


def common(weights: np.ndarray) -> tuple[Measured, int]:
    """The share of seeds that have the most common sign, and that sign."""
    sign = 1 if np.sum(weights > 0) >= np.sum(weights < 0) else -1
    return share_of(sign * weights > 0), sign


def _arrow(axes: Axes, start: float, end: float, weights: np.ndarray, size: float, along: float) -> None:
    from matplotlib.patches import FancyArrow

    share, sign = common(weights)
    sure = share.low > 0.5
    colour = (POSITIVE if sign > 0 else NEGATIVE) if sure else CHANCE
    # arrows into one muscle end slightly apart, in order of their origins
    x = LEFT + SENSOR[0] / 2 - 0.1
    y = start
    u = RIGHT - MUSCLE[0] / 2 - 0.04
    v = end + 0.2 * (start - 1.5) / 1.5
    width = 0.015 + 0.085 * size
    style: dict[str, Any] = {"facecolor": colour} if sure else {"facecolor": "white", "linestyle": (0, (2, 1))}
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
            **style,
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
