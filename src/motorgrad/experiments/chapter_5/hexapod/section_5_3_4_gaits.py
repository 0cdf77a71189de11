"""Section 5.3.4: the gaits that are learnt on four synergies, over many seeds."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from motorgrad.experiments._claims import (
    Claim,
    below,
    first_time,
    mean_of,
    median_of,
    more_than_half,
    positive,
    share_of,
)
from motorgrad.experiments._experiment import Values, Workspace, experiment
from motorgrad.experiments._figures import Axes, Figure, new_figure
from motorgrad.experiments.chapter_5.hexapod._gait_study import (
    GAITS,
    INDEPENDENT,
    MODES,
    OURS,
    SynergyStudy,
    controller_speeds,
    gait_readings,
)
from motorgrad.experiments.chapter_6.section_6_4.figure_6_8 import draw_band
from motorgrad.training import learning_curves

SMOOTH = 12.0
"""Simulated seconds over which the speed during practice is averaged."""

COLOURS = {"tripod": "#0072B2", "pronk": "#D55E00", "intermediate": "#bdbdbd", "stalled": "#4d4d4d"}
DRAWN = {"sample": "drawn", "mode": "most probable"}
THESIS = "section 5.3.4"
FAST, SOON, RARE = 1.3, 100.0, 0.25
"""Of the independent model: the speed (m/s) of its slowest seed after 600 s, and the time (s) by which its seeds were
past the fixed controller. And the share of seeds below which something counts as rare."""

ACTIONS = {"sample": "actions that are drawn", "mode": "the most probable actions"}


@experiment("sec-5.3.4-gaits", "the gaits that hexapods learn", "section 5.3.4")
class LearntGaits(SynergyStudy):
    """Hexapods learn to walk on four synergies, swing and stance of each tripod, with observations that are late by 0,
    1 and 2 decisions: their speed during practice beside that of the fixed controller, and what gait they came to, how
    fast they walk and how far they get when they start afresh with frozen policies, with actions that are drawn and
    with the most probable ones.
    """

    def run(self, work: Workspace) -> Values:
        found: Values = {f"controller {name}": value for name, value in controller_speeds(work, self.watched).items()}
        level = float(found["controller speed"][0])
        for lag in self.lags:
            run = self.trained(work, lag)
            record = run.config["run"]["window"] * run.task.period
            (curve,) = learning_curves([run], "speed", x="simulated", smooth=max(SMOOTH, 2 * record)).curves
            found["time"] = curve.x
            found[f"lag {lag} practice"] = curve.values
            found[f"lag {lag} falls"] = self.seconds * run.curve("falls")[1].mean(1)
            # before that the mean is over a few decisions only
            passed = (curve.values > level) & (curve.x >= min(SMOOTH, self.seconds))
            found[f"lag {lag} passed"] = np.nan_to_num(first_time(curve.x, passed), nan=self.seconds)
            for mode in MODES:
                seen = work.part(
                    f"lag {lag} {mode}", lambda run=run, mode=mode: gait_readings(self.watch(work, run, mode))
                )
                found |= {f"lag {lag} {mode} {name}": values for name, values in seen.items()}
        return found

    def figure(self, values: Values) -> Figure:
        return draw_gaits(values, self.lags)

    def claims(self, values: Values) -> Sequence[Claim]:
        made = [claim for lag in self.lags for claim in lag_claims(values, lag)]
        return made + common_claims(values, self.lags)


def draw_gaits(values: Values, lags: Sequence[int]) -> Figure:
    """Speeds during practice; the classes of all seeds; and how far each gets against how fast it walks."""
    from matplotlib.patches import Patch

    figure = new_figure(9.8, 7.6)
    panels: Any = figure.subplot_mosaic(
        [["practice"] * 3, ["classes", *MODES]], width_ratios=[1.1, 1, 1], height_ratios=[1, 1.1]
    )
    _practice(panels["practice"], values, lags)
    _classes(panels["classes"], values, lags)
    most = max(float(values[f"lag {lag} {mode} speed"].max()) for lag in lags for mode in MODES)
    for mode in MODES:
        _distances(panels[mode], values, lags, mode, most)
    panels["sample"].set_ylabel("net displacement in 20 s / 20 s (m/s)")
    shown = [Patch(color=colour, label=kind) for kind, colour in COLOURS.items()]
    figure.legend(handles=shown, loc="outside lower center", ncols=4, title="gait, frozen and from a fresh start")
    return figure


def _practice(axes: Axes, values: Values, lags: Sequence[int]) -> None:
    for lag, colour in zip(lags, ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00"), strict=False):
        draw_band(axes, values["time"], values[f"lag {lag} practice"], colour, f"lag {lag}")
    level = float(values["controller speed"][0])
    axes.axhline(level, color="0.3", linewidth=0.9, linestyle=(0, (5, 3)))
    axes.annotate(
        "fixed controller", (1, level), xycoords=("axes fraction", "data"), xytext=(0, 3), textcoords="offset points",
        ha="right", va="bottom", fontsize=8.5, color="0.3",
    )  # fmt: skip
    seeds = len(values[f"lag {lags[0]} practice"])
    axes.set(
        xlabel="simulated time of practice (s)",
        ylabel="speed along the heading (m/s)",
        ylim=(0, None),
        xlim=(0, values["time"][-1]),
    )
    axes.legend(loc="upper left", title=f"median and quartiles of {seeds} seeds", title_fontsize=8.5)


def _classes(axes: Axes, values: Values, lags: Sequence[int]) -> None:
    """A bar for each lag and kind of action, of as many seeds as came to each class."""
    rows = [(lag, mode) for lag in lags for mode in MODES]
    for row, (lag, mode) in enumerate(rows):
        gaits, left = values[f"lag {lag} {mode} gait"], 0
        for kind in GAITS:
            count = int(np.count_nonzero(gaits == kind))
            axes.barh(row, count, left=left, color=COLOURS[kind])
            if count:
                colour = "black" if kind == "intermediate" else "white"
                axes.text(left + count / 2, row, str(count), ha="center", va="center", fontsize=8, color=colour)
            left += count
    axes.set_yticks(range(len(rows)), [f"lag {lag},\n{DRAWN[mode]}" for lag, mode in rows], fontsize=8)
    axes.invert_yaxis()
    axes.set(xlabel="seeds", xlim=(0, len(values[f"lag {lags[0]} sample gait"])))


def _distances(axes: Axes, values: Values, lags: Sequence[int], mode: str, most: float) -> None:
    """A mark for each seed, in the colour of its class and of the shape of its lag."""
    for lag, marker in zip(lags, "os^Dv", strict=False):
        gaits = values[f"lag {lag} {mode} gait"]
        for kind in GAITS:
            own = gaits == kind
            speed, net = (values[f"lag {lag} {mode} {name}"][own] for name in ("speed", "net"))
            axes.plot(speed, net, marker, color=COLOURS[kind], markersize=4.5, alpha=0.85, zorder=3)
        axes.plot([], [], marker, color="0.4", markersize=4.5, label=f"lag {lag}")
    axes.plot([0, most], [0, most], color="0.8", linewidth=0.8, zorder=0)
    axes.plot(
        values["controller speed"], values["controller net"], "P", color="black", markersize=7,
        label="fixed controller", zorder=4,
    )  # fmt: skip
    axes.set(xlabel="speed along the heading (m/s)", title=f"{DRAWN[mode]} actions", ylim=(-0.05, 1.02 * most))
    axes.legend(loc="upper left", fontsize=8, handletextpad=0.3)


def counted(gaits: np.ndarray) -> str:
    """How many seeds came to each of the four classes, in words."""
    return ", ".join(f"{kind} {np.count_nonzero(gaits == kind)}" for kind in GAITS)


def viable(gaits: np.ndarray) -> np.ndarray:
    """Which seeds came to one of the two gaits that the thesis reports."""
    return np.isin(gaits, ("tripod", "pronk"))


def lag_claims(values: Values, lag: int) -> Sequence[Claim]:
    """What is said of any lag; the thesis has none."""
    late = f"observations late by {lag}" if lag else "no lag"
    source, gaits = (OURS if lag else THESIS), values[f"lag {lag} sample gait"]
    both = {mode: f"{ACTIONS[mode]}: {counted(values[f'lag {lag} {mode} gait'])}" for mode in ACTIONS}
    counts = f"Seeds with {both['sample']}; with {both['mode']}."
    either = viable(gaits)
    converged = share_of(either)
    pronking = share_of(gaits[either] == "pronk") if either.any() else share_of(either)
    passed, final = median_of(values[f"lag {lag} passed"]), median_of(values[f"lag {lag} practice"][:, -1])
    still = share_of(values[f"lag {lag} mode gait"] == "stalled")
    level = float(values["controller net"][0])
    return [
        more_than_half(
            f"Learning consistently converges to one of two gaits, tripod or pronk ({late}).",
            source,
            "frozen, from a fresh start, with actions that are drawn: in most seeds",
            converged,
            note=counts,
        ),
        more_than_half(
            f"Pronking is learnt more often than not ({late}).",
            source,
            "of the seeds that came to either gait: in most",
            pronking,
            note=counts if either.any() else f"No seed came to either gait. {counts}",
        ),
        Claim(
            f"Learning passes the fixed controller's speed after 50 to 100 s of practice ({late}).",
            INDEPENDENT,
            f"median no later than {SOON:g} s",
            passed,
            passed.high <= SOON and passed.high < values["time"][-1],
            "s",
            "Mean speed of 12 s. Sooner counts as holding; a seed that never passes counts as the whole practice, and "
            "if the interval reaches that it does not hold.",
        ),
        Claim(
            f"After {values['time'][-1]:.0f} s of practice hexapods walk at 1.3 to 3.1 m/s ({late}).",
            INDEPENDENT,
            f"after 600 s there; median of the last 12 s at least {FAST:g} m/s",
            final,
            final.low >= FAST,
            "m/s",
            f"{np.count_nonzero(values[f'lag {lag} practice'][:, -1] < 0.3)} seeds end below 0.3 m/s. Falls of all "
            f"seeds during practice: {values[f'lag {lag} falls'].sum():.0f}.",
        ),
        *(
            more_than_half(
                f"What was learnt gets ahead further than the fixed controller, with {words} ({late}).",
                OURS,
                f"net displacement in 20 s above {level:.2f} m/s: in most seeds",
                share_of(values[f"lag {lag} {mode} net"] > level),
                note=f"Medians: {median_of(values[f'lag {lag} {mode} net'])} m/s; heading speed "
                f"{median_of(values[f'lag {lag} {mode} speed'])} m/s.",
            )
            for mode, words in ACTIONS.items()
        ),
        below(
            RARE,
            f"With the most probable actions hardly any seed stands still ({late}).",
            OURS,
            f"the share of seeds of the class stalled: its interval below {RARE:g}",
            still,
            note=f"Parts of stalled seconds: mean {values[f'lag {lag} mode stalls'].mean():.2f}, with actions that are "
            f"drawn {values[f'lag {lag} sample stalls'].mean():.2f}.",
        ),
    ]


def common_claims(values: Values, lags: Sequence[int]) -> list[Claim]:
    """What compares lags, or is said of the first, which is the thesis's."""
    gaits = {lag: values[f"lag {lag} sample gait"] for lag in lags}
    first, *others = lags
    between = share_of(gaits[first] == "intermediate")
    made = [
        Claim(
            f"The {words} gait is found.",
            THESIS,
            f"in at least one seed, with lag {first}",
            share_of(gaits[first] == kind),
            bool((gaits[first] == kind).any()),
        )
        for kind, words in (("pronk", "pronking"), ("tripod", "tripod"))
    ]
    made.append(
        more_than_half(
            "Without lag, seeds end between tripod and pronk.",
            INDEPENDENT,
            f"all of its seeds: in most, with lag {first}",
            between,
        )
    )
    for lag in others:
        more = mean_of(viable(gaits[lag]) * 1.0 - viable(gaits[first]))
        made.append(
            positive(
                f"With observations late by {lag}, more seeds come to tripod or pronk than with {first}.",
                INDEPENDENT,
                "4 of 8 with a lag of 1, 5 of 6 with 2, none without: difference of the shares above 0",
                more,
            )
        )
    return made
