"""Section 5.3.4: gaits learned on four synergies, over many seeds."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from motorgrad.statistics import mean_of, median_of, share_of, tally_of
from motorgrad_thesis._claims import Claim, Kind, at_least, below, more_than_half, positive
from motorgrad_thesis._experiment import Values, Workspace, experiment
from motorgrad_thesis._figures import Axes, Figure, draw_band, new_figure
from motorgrad_thesis.chapter_5.hexapod._gait_study import (
    GAITS,
    INDEPENDENT,
    MODES,
    SynergyStudy,
    controller_speeds,
    gait_readings,
)

SMOOTH = 12.0
"""Simulated seconds over which the speed during practice is averaged."""

COLOURS = {"tripod": "#0072B2", "pronk": "#D55E00", "intermediate": "#bdbdbd", "stalled": "#4d4d4d"}
DRAWN = {"sample": "sampled", "mode": "most probable"}
THESIS = "section 5.3.4"
FAST = 1.3
SOON = 100.0
RARE = 0.25
"""The independent model's speed (m/s) of its slowest seed after 600 s, and time (s) by which its seeds exceeded the
fixed controller; and the share of seeds below which something counts as rare."""

ACTIONS = {"sample": "sampled actions", "mode": "most probable actions"}


@experiment("sec-5.3.4-gaits", "the gaits that hexapods learn", "section 5.3.4")
class LearnedGaits(SynergyStudy):
    """Hexapods learn to walk on four synergies, swing and stance of each tripod, with observations delayed by 0, 1 and
    2 decisions: their speed during practice compared with the fixed controller; and the gait, speed and net
    displacement of the frozen policies from a fresh start, with sampled and with most probable actions."""

    def run(self, work: Workspace) -> Values:
        found: Values = {f"controller {name}": value for name, value in controller_speeds(work, self.watched).items()}
        level = float(found["controller speed"][0])
        for lag in self.lags:
            run = self.trained(work, lag)
            found["time"], found[f"lag {lag} practice"] = run.curve("speed", x="simulated", smooth=SMOOTH)
            found[f"lag {lag} falls"] = self.seconds * run.curve("falls")[1].mean(1)
            passed = run.first_time("speed", above=level, x="simulated", smooth=SMOOTH, never=self.seconds)
            found[f"lag {lag} passed"] = passed
            for mode in MODES:
                seen = work.part(
                    f"lag {lag} {mode}", lambda run=run, mode=mode: gait_readings(self.watch(work, run, mode))
                )
                found |= {f"lag {lag} {mode} {name}": values for name, values in seen.items()}
        return found

    def figure(self, values: Values) -> Figure:
        """Speed during practice; gait classes of all seeds; and net displacement against speed."""
        from matplotlib.patches import Patch

        figure = new_figure(9.8, 7.6)
        panels: Any = figure.subplot_mosaic(
            [["practice"] * 3, ["classes", *MODES]], width_ratios=[1.1, 1, 1], height_ratios=[1, 1.1]
        )
        _practice(panels["practice"], values, self.lags)
        _classes(panels["classes"], values, self.lags)
        most = max(float(values[f"lag {lag} {mode} speed"].max()) for lag in self.lags for mode in MODES)
        for mode in MODES:
            _distances(panels[mode], values, self.lags, mode, most)
        panels["sample"].set_ylabel("net displacement in 20 s / 20 s (m/s)")
        shown = [Patch(color=colour, label=kind) for kind, colour in COLOURS.items()]
        figure.legend(
            handles=shown, loc="outside lower center", ncols=4, title="gait of the frozen policy from a fresh start"
        )
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        for lag in self.lags:
            yield from lag_claims(values, lag)
        yield from common_claims(values, self.lags)


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
    """A bar for each lag and kind of action, divided by the number of seeds in each class."""
    rows = [(lag, mode) for lag in lags for mode in MODES]
    for row, (lag, mode) in enumerate(rows):
        gaits = values[f"lag {lag} {mode} gait"]
        left = 0
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
    """A mark for each seed, coloured by class and shaped by lag."""
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
    """Number of seeds in each of the four classes, in words."""
    return ", ".join(f"{kind} {np.count_nonzero(gaits == kind)}" for kind in GAITS)


def viable(gaits: np.ndarray) -> np.ndarray:
    """Which seeds learned one of the two gaits that the thesis reports."""
    return np.isin(gaits, ("tripod", "pronk"))


def whose(lag: int) -> Kind:
    """Whose statement a claim about hexapods with this lag is: the thesis has none."""
    return "extension" if lag else "thesis"


def lag_claims(values: Values, lag: int) -> Iterator[Claim]:
    """Claims made for every lag; the thesis has none."""
    late = f"observations delayed by {lag}" if lag else "no lag"
    kind = whose(lag)
    gaits = values[f"lag {lag} sample gait"]
    both = {mode: f"{ACTIONS[mode]}: {counted(values[f'lag {lag} {mode} gait'])}" for mode in ACTIONS}
    counts = f"Number of seeds with {both['sample']}; with {both['mode']}."
    either = viable(gaits)
    level = float(values["controller net"][0])
    yield more_than_half(
        f"Learning consistently converges to one of two gaits, tripod or pronk ({late}).",
        share_of(either),
        "frozen, from a fresh start, with sampled actions: share of seeds",
        note=counts,
        kind=kind,
    )
    yield more_than_half(
        f"Pronking is learned more often than not ({late}).",
        share_of(gaits[either] == "pronk"),
        "share of the seeds that learned either gait",
        note=counts if either.any() else f"No seed learned either gait. {counts}",
        kind=kind,
    )
    yield below(
        min(SOON, values["time"][-1]),
        f"Learning exceeds the fixed controller's speed after 50 to 100 s of practice ({late}).",
        median_of(values[f"lag {lag} passed"]),
        "median",
        "s",
        note="Mean speed over 12 s. Sooner counts as holding. A seed that never gets there counts with the whole "
        "practice; the claim fails if the interval reaches that.",
        kind="reference model",
        source=INDEPENDENT,
    )
    yield at_least(
        FAST,
        f"After {values['time'][-1]:.0f} s of practice, hexapods walk at 1.3 to 3.1 m/s ({late}).",
        median_of(values[f"lag {lag} practice"][:, -1]),
        "after 600 s in that model; median over the last 12 s",
        "m/s",
        note=f"{np.count_nonzero(values[f'lag {lag} practice'][:, -1] < 0.3)} seeds end below 0.3 m/s. All falls "
        f"during practice: {values[f'lag {lag} falls'].sum():.0f}.",
        kind="reference model",
        source=INDEPENDENT,
    )
    for mode, words in ACTIONS.items():
        yield more_than_half(
            f"Learned policies get farther than the fixed controller, with {words} ({late}).",
            share_of(values[f"lag {lag} {mode} net"] > level),
            f"share of seeds with a net displacement in 20 s above {level:.2f} m/s",
            note=f"Medians: {median_of(values[f'lag {lag} {mode} net']).words('m/s')}; heading speed "
            f"{median_of(values[f'lag {lag} {mode} speed']).words('m/s')}.",
            kind="extension",
        )
    yield below(
        RARE,
        f"With the most probable actions, hardly any seed stands still ({late}).",
        share_of(values[f"lag {lag} mode gait"] == "stalled"),
        "share of seeds of the class stalled",
        note=f"Mean fraction of stalled seconds: {values[f'lag {lag} mode stalls'].mean():.2f}; with sampled actions "
        f"{values[f'lag {lag} sample stalls'].mean():.2f}.",
        kind="extension",
    )


def common_claims(values: Values, lags: Sequence[int]) -> Iterator[Claim]:
    """Claims that compare lags, or concern the first, which is the thesis's."""
    gaits = {lag: values[f"lag {lag} sample gait"] for lag in lags}
    first, *others = lags
    for kind, words in (("pronk", "pronking"), ("tripod", "tripod")):
        yield positive(
            f"The {words} gait is learned.", tally_of(gaits[first] == kind), f"share of these seeds, with lag {first},"
        )
    yield more_than_half(
        "Without lag, gaits lie between tripod and pronk.",
        share_of(gaits[first] == "intermediate"),
        f"in all seeds of that model; share of seeds, with lag {first},",
        kind="reference model",
        source=INDEPENDENT,
    )
    for lag in others:
        yield positive(
            f"With observations delayed by {lag}, more seeds learn tripod or pronk than with {first}.",
            mean_of(viable(gaits[lag]) * 1.0 - viable(gaits[first])),
            "4 of 8 with a lag of 1, 5 of 6 with 2, none without; difference of the shares",
            kind="reference model",
            source=INDEPENDENT,
        )
