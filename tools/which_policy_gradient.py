"""The figures and the numbers of "which policy gradient, when", from the folder of its comparison.

motorgrad compare tools/studies/which-policy-gradient.toml
python -m tools.which_policy_gradient runs/which-policy-gradient

Run it from the root of a checkout. It draws `docs/images/which-*.png` and prints what the page quotes.
"""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from motorgrad.statistics import interquartile_mean, stratified_bootstrap
from motorgrad.studies import ComparisonResults
from tools.figures._style import COLOURS, FAINT, STYLE, panels

METHOD_STYLES = [(colour, mark) for mark in "os^D" for colour in COLOURS]
"""Colours and marks of methods in a figure."""
LINES = {"o": "-", "s": "--", "^": ":", "D": "-."}
"""Lines in place of marks."""
FLOOR = -0.25
"""Scores below are drawn here: a policy that has got much worse than at its start."""


def ranking(results: ComparisonResults) -> Figure:
    """Every method over all tasks: tuned for each, and with one setting for all."""
    rows = {(row["method"], row["chosen"]): row for row in _summary(results, "interquartile mean")}
    order = sorted(results.methods, key=lambda method: rows[method, "tuned"]["value"])
    figure, axes = panels(1, height=0.6 + 0.2 * len(order))
    for shift, chosen, colour in ((0.12, "tuned", COLOURS[0]), (-0.12, "shared", COLOURS[1])):
        found = [rows[method, chosen] for method in order]
        middle = np.array([row["value"] for row in found])
        ends = np.abs(np.array([[row["low"], row["high"]] for row in found]).T - middle)
        label = {"tuned": "tuned for each task", "shared": "one setting for all tasks"}[chosen]
        axes.errorbar(
            middle, np.arange(len(order)) + shift, xerr=ends, fmt="o", markersize=4, color=colour, label=label
        )
    axes.set(yticks=range(len(order)), yticklabels=order, xlabel="score, interquartile mean over all tasks and seeds")
    axes.grid(axis="x", color="0.9")
    figure.legend(loc="outside upper right", ncols=2)
    return figure


def tasks(results: ComparisonResults) -> Figure:
    """The score of every method on each task, tuned for it."""
    names = list(results.comparison.tasks)
    score = np.full((len(results.comparison.methods), len(names)), np.nan)
    for i, method in enumerate(results.comparison.methods):
        for task in results.tasks_of(method):
            earned = results.normalized(task, results.earned((method, task)))
            score[i, names.index(task)] = interquartile_mean(earned[None, None])[0]
    figure, axes = panels(1, height=0.7 + 0.2 * len(score))
    image = axes.imshow(score, vmin=0, vmax=1, aspect="auto", cmap="viridis")
    for (i, j), value in np.ndenumerate(score):
        if np.isfinite(value):
            axes.text(j, i, f"{value:.2f}", ha="center", va="center", fontsize=7.5, color="w" if value < 0.6 else "k")
    axes.set_yticks(range(len(score)), results.comparison.methods)
    axes.set_xticks(range(len(names)), names, rotation=20)
    axes.spines[:].set_visible(False)
    figure.colorbar(image, ax=axes, label="score", shrink=0.6)
    return figure


def rates(results: ComparisonResults) -> Figure:
    """What a learning rate earns on four tasks, with the best decay for it."""
    shown = ("three-state", "recruitment-16", "load-unload", "particle")
    methods = ("OLPOMDP", "OLGARB", "OLGARB, normalized", "OLGARB, Adam", "OLGARB, natural", "AC(λ)")
    figure, axes = panels(2, height=4.6, rows=2, sharex=True)
    for each, task in zip(axes.flat, shown, strict=True):
        for (colour, _), method in zip(METHOD_STYLES, methods, strict=False):
            rate, score = _by("learning_rate", results, (method, task))
            best = [score[rate == value].max() for value in np.unique(rate)]
            each.plot(np.unique(rate), np.maximum(best, FLOOR), color=colour, marker=".", label=method)
        each.set(xscale="log", title=task)
    for each in axes[1]:
        each.set_xlabel("learning rate")
    for each in axes[:, 0]:
        each.set_ylabel("score, best decay")
    axes[0, 0].legend(fontsize=7)
    return figure


def traces(results: ComparisonResults) -> Figure:
    """What a decay earns on each task, at the best learning rate for it."""
    figure, axes = panels(3, height=2.8, sharey=True)
    for each, method in zip(axes, ("OLGARB", "OLGARB, natural", "AC(λ)"), strict=True):
        for (colour, mark), task in zip(METHOD_STYLES, results.comparison.tasks, strict=False):
            decay, score = _by("decay", results, (method, task))
            best = [score[decay == value].max() for value in np.unique(decay)]
            each.plot(np.unique(decay), np.maximum(best, FLOOR), LINES[mark], color=colour, marker=".", label=task)
        each.set(xlabel="decay of the trace", title=method)
    axes[0].set_ylabel("score, best learning rate")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=7, fontsize=7)
    return figure


def versus(*methods: str) -> Callable[[ComparisonResults], Figure]:
    """A figure of some methods side by side on each task, with intervals."""

    def draw(results: ComparisonResults) -> Figure:
        names = list(results.comparison.tasks)
        figure, axes = panels(1, height=2.9)
        for number, ((colour, mark), method) in enumerate(zip(METHOD_STYLES, methods, strict=False)):
            shift = (number - (len(methods) - 1) / 2) * 0.7 / len(methods)
            for task in results.tasks_of(method) if method in results.comparison.methods else ():
                earned = results.normalized(task, results.earned((method, task)))[None]
                middle, low, high = map(float, stratified_bootstrap(interquartile_mean, earned))
                place = names.index(task) + shift
                label = method if task == results.tasks_of(method)[0] else None
                axes.plot([place, place], np.maximum([low, high], FLOOR), color=colour)
                axes.plot(place, max(middle, FLOOR), mark, color=colour, markersize=5, label=label)
        axes.axhline(0, color=FAINT, linewidth=0.6)
        axes.set(xticks=range(len(names)), xticklabels=names, ylabel="score")
        axes.legend(ncols=3, fontsize=7, loc="upper center", bbox_to_anchor=(0.5, 1.25))
        return figure

    return draw


def tuning(results: ComparisonResults) -> Figure:
    """The score to expect from the best of so many settings drawn from the grid, mean over the tasks."""
    figure, axes = panels(1, height=3.2)
    rows = results.tables["tuning"].to_pylist()
    for (colour, mark), method in zip(METHOD_STYLES, results.methods, strict=False):
        own = [(row["settings"], row["score"]) for row in rows if row["method"] == method]
        axes.plot(*np.maximum(np.transpose(own), FLOOR), LINES[mark], color=colour, label=method)
    axes.set(xscale="log", xlabel="settings tried", ylabel="score of the best")
    axes.legend(ncols=2, fontsize=6.5, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def cost(results: ComparisonResults) -> Figure:
    """The score of every method beside the processor time of a decision."""
    figure, axes = panels(1, height=3.4)
    rows = {row["method"]: row for row in _summary(results, "interquartile mean") if row["chosen"] == "tuned"}
    for (colour, mark), method in zip(METHOD_STYLES, results.methods, strict=False):
        points = [results.judged_point((method, task)) for task in results.tasks_of(method)]
        each = [1e6 * results.cost("judging", point) for point in points]
        row = rows[method]
        seconds = float(np.exp(np.mean(np.log(each))))
        axes.plot([seconds, seconds], [row["low"], row["high"]], color=colour)
        axes.plot(seconds, row["value"], mark, color=colour, label=method)
    axes.set(xscale="log", xlabel="processor time of a decision (µs), geometric mean over the tasks", ylabel="score")
    axes.legend(ncols=1, fontsize=6.5, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


FIGURES: dict[str, Callable[[ComparisonResults], Figure]] = {
    "ranking": ranking,
    "tasks": tasks,
    "rates": rates,
    "traces": traces,
    "baselines": versus("OLPOMDP", "OLGARB", "OLGARB, optimal baseline", "action transitions"),
    "critics": versus("OLGARB", "AC(λ)", "AC(λ), SwiftTD", "AC(λ), bounded steps"),
    "steps": versus("OLGARB", "OLGARB, normalized", "OLGARB, Adam", "OLGARB, natural", "AC(λ), natural"),
    "metrics": versus("OLGARB, natural", "OLGARB, stationary metric", "incremental natural", "LSTD-NAC"),
    "filters": versus("OLGARB", "OLGARB, window", "OLGARB, learned filter"),
    "batches": versus("OLGARB", "batches of 100", "LSTD-NAC", "CONJPOMDP", "PPO", "natural"),
    "tuning": tuning,
    "cost": cost,
}


def _summary(results: ComparisonResults, statistic: str) -> list[dict[str, Any]]:
    rows = results.summary.to_pylist()
    return [row for row in rows if row["statistic"] == statistic and row["scored"] == "final"]


def _by(name: str, results: ComparisonResults, pair: tuple[str, str]) -> tuple[np.ndarray, np.ndarray]:
    """A number of every setting of a method, and its score in tuning."""
    settings: Sequence[Any] = results.comparison.settings(*pair)
    score = results.normalized(pair[1], results.tried(pair).mean(axis=1))
    return np.array([each[name] for each in settings], float), np.where(np.isfinite(score), score, FLOOR)


def main(folder: str, out: str = "docs/images") -> None:
    """Draw every figure into a folder, and print the numbers that the page quotes."""
    results = ComparisonResults.load(folder)
    for row in _summary(results, "interquartile mean"):
        print(f"{row['method']:28} {row['chosen']:8} {row['value']:.3f} [{row['low']:.3f} … {row['high']:.3f}]")
    with matplotlib.rc_context(STYLE):
        for name, draw in FIGURES.items():
            path = Path(out) / f"which-{name}.png"
            draw(results).savefig(path, dpi=110)
            print(path)


if __name__ == "__main__":
    main(*sys.argv[1:])
