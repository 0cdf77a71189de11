"""The drawing of section 3.2.1: six panels about baselines and traces."""

from typing import TYPE_CHECKING

import numpy as np

from motorgrad.experiments._claim import Measured, mean_of
from motorgrad.experiments.chapter_3._baseline_claims import shared_rewards, variances
from motorgrad.experiments.chapter_3._mixing import WORLDS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from motorgrad.experiments._experiment import Values

WITHOUT, WITH = "C1", "C0"


def draw_baselines(values: "Values") -> "Figure":
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 7.4), layout="constrained")
    panels = (_constants, _best, _variances, _bias, _learning, _mixing)
    for axes, draw in zip(figure.subplots(2, 3).flat, panels, strict=True):
        draw(axes, values)
    return figure


def _constants(axes: "Axes", values: "Values") -> None:
    if not len(values["swept"]):
        axes.set_axis_off()
        return
    level, longest = np.linspace(-0.05, 0.95, 201), int(values["length"][-1])
    for row, decay in enumerate(values["swept"]):
        best, least, curvature = values["parabola swept"][row]
        colour = f"C{row}"
        axes.plot(level, (least + curvature * (level - best) ** 2) / least, color=colour, linewidth=1)
        axes.plot(best, 1, "v", color=colour, markersize=7, zorder=3)
        measured = [mean_of(variances(each, longest) / least) for each in values["estimate constant"][row]]
        _points(axes, values["constant"], measured, color=colour, label=rf"$\beta$ = {decay:g}")
    axes.axvline(float(values["average reward"]), color="0.4", linestyle=":", linewidth=1)
    axes.text(
        float(values["average reward"]) + 0.01,
        0.97,
        "average reward",
        transform=axes.get_xaxis_transform(),
        color="0.4",
        va="top",
        fontsize=8,
    )
    axes.set(yscale="log", xlabel="constant baseline $b$", ylabel="variance, of the least")
    axes.set_title("the best constant (triangles)", loc="left")
    axes.legend(fontsize=8, title="lines: exact", title_fontsize=8)


def _best(axes: "Axes", values: "Values") -> None:
    reach = 1 / (1 - values["limit"])
    axes.plot(reach, values["limit best"], color="C0", label="best constant")
    axes.axhline(float(values["average reward"]), color="0.4", linestyle=":", linewidth=1, label="average reward")
    axes.set(xscale="log", xlabel=r"reach of the trace, $1/(1-\beta)$ decisions", ylabel="baseline", ylim=(0.2, None))
    axes.set_title("… and where it goes", loc="left")
    more = axes.twinx()
    more.plot(reach, 100 * values["limit excess"], color="C3", linestyle="--", label="variance that the average costs")
    more.spines["right"].set_visible(True)
    more.set(ylabel="% above the least")
    more.yaxis.label.set_color("C3")
    lines = [*axes.get_lines(), *more.get_lines()]
    axes.legend(lines, [str(line.get_label()) for line in lines], fontsize=8)


def _variances(axes: "Axes", values: "Values") -> None:
    reach, longest = 1 / (1 - values["decay"]), int(values["length"][-1])
    best, least, curvature = values["parabola decay"].T
    for name, level, colour, words in (
        ("none", 0.0, WITHOUT, "no baseline"),
        ("mean", float(values["average reward"]), WITH, "running mean"),
    ):
        axes.plot(reach, least + curvature * (level - best) ** 2, color=colour, linewidth=1)
        _points(
            axes,
            reach,
            [mean_of(variances(each, longest)) for each in values[f"estimate {name}"]],
            color=colour,
            label=words,
        )
    axes.set(
        xscale="log", yscale="log", xlabel=r"reach of the trace, $1/(1-\beta)$ decisions", ylabel="variance × decisions"
    )
    axes.set_title(f"variance over {values['estimate none'].shape[1]:,} runs", loc="left")
    axes.legend(fontsize=8, title="lines: exact, long runs", title_fontsize=8)


def _bias(axes: "Axes", values: "Values") -> None:
    length, decay = values["length"], float(values["bias decay"])
    fine = np.geomspace(length[0], length[-1], 100).round()
    axes.axhline(0, color="0.8", linewidth=0.8)
    axes.plot(
        fine,
        100 * shared_rewards(decay, fine),
        color="0.5",
        linestyle="--",
        linewidth=1,
        label="running mean, to first order",
    )
    for name, colour, words in (("mean", WITH, "running mean"), ("constant", "C2", "constant, average reward")):
        _points(axes, length, [mean_of(100 * each) for each in values[f"added by {name}"]], color=colour, label=words)
    axes.set(xscale="log", xlabel="decisions $T$", ylabel="% of the gradient", ylim=(-110, 30))
    axes.set_title(rf"bias that a baseline adds, $\beta$ = {decay:g}", loc="left")
    axes.legend(fontsize=8, loc="lower right")


def _learning(axes: "Axes", values: "Values") -> None:
    decision = values["decision"]
    for name, colour, words in (
        ("olpomdp", WITHOUT, "no baseline: the reward itself"),
        ("olgarb", WITH, "running mean"),
    ):
        axes.plot(decision, np.median(values[f"surprise {name}"], axis=0), color=colour, label=words)
        low, high = np.quantile(values[f"surprise {name}"], (0.25, 0.75), axis=0)
        axes.fill_between(decision, low, high, color=colour, alpha=0.25, linewidth=0)
    axes.set(xscale="log", xlabel="decisions", ylabel=r"mean $|\delta|$", ylim=(0, 1))
    axes.set_title(f"surprise while learning, median of {len(values['surprise olgarb'])} seeds", loc="left")
    axes.legend(fontsize=8)


def _mixing(axes: "Axes", values: "Values") -> None:
    for number, name in enumerate(WORLDS):
        reset, mixes = name.startswith("reset"), int(values[f"mixing {name}"])
        look = {"color": f"C{number}", "linestyle": "--" if reset else "-", "linewidth": 1.3}
        axes.plot(values[f"reach {name}"], values[f"bias {name}"], label=f"{name} ({mixes})", **look)
    axes.axvline(1, color="0.4", linestyle=":", linewidth=1)
    axes.set(
        xscale="log", yscale="log", xlabel=r"$1/(1-\beta)$ in mixing times", ylabel="relative bias", ylim=(1e-3, 1.3)
    )
    axes.set_title("reach and mixing time", loc="left")
    axes.legend(fontsize=8, title="mixing time in brackets", title_fontsize=8, loc="upper left", bbox_to_anchor=(1, 1))


def _points(axes: "Axes", where: np.ndarray, found: list[Measured], **look: object) -> None:
    error = [[m.value - m.low for m in found], [m.high - m.value for m in found]]
    style = {"fmt": "o", "markersize": 4, "linewidth": 1, **look}
    axes.errorbar(where, [m.value for m in found], error, **style)  # type: ignore[arg-type]
