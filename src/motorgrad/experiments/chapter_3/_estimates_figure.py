"""The drawing of figure 3.1: the algorithm beside what was measured about it."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from motorgrad.experiments._claim import mean_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from motorgrad.experiments._experiment import Values

# (indent, text, emphasis): figure 3.1, its two slips put right
LISTING = (
    (0, r"given $\beta \in [0, 1)$, $\alpha$, $\theta_0$", "plain"),
    (0, r"$z_0 = 0$,  $b_0 = 0$", "plain"),
    (0, r"for $t = 0, 1, 2 \ldots$", "plain"),
    (1, "act", "head"),
    (2, r"observe $y_t$", "plain"),
    (2, r"sample $a_t \sim \pi(\cdot \mid y_t, \theta_t)$", "plain"),
    (2, r"$z_{t+1} = \beta\, z_t + \nabla_\theta \log \pi(a_t \mid y_t, \theta_t)$", "plain"),
    (1, "reinforce", "head"),
    (2, r"receive $r_{t+1}$", "plain"),
    (2, r"$\delta_{t+1} = r_{t+1} - b_t$", "plain"),
    (2, r"$b_{t+1} = b_t + \delta_{t+1} / (t + 1)$", "mended"),
    (1, "improve", "head"),
    (2, r"$\theta_{t+1} = \theta_t + \alpha\, \delta_{t+1}\, z_{t+1}$", "mended"),
)
LOOKS = {"none": ("--", "o", "none"), "mean": ("-", "o", None)}
NAMES = {"none": "no baseline", "mean": "running mean"}
HEAD, MENDED = "#3b6fb6", "#c8452f"


def draw_estimates(values: "Values", independent: Mapping[str, Mapping[int, float]], good: float) -> "Figure":
    """The listing, and four panels: bias, error against the run's length and against the decay, learning."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.5, 7), layout="constrained")
    panels = figure.subplot_mosaic(
        [["listing", "bias", "length"], ["listing", "decay", "learning"]], width_ratios=[1, 1, 1]
    )
    _listing(panels["listing"])
    _bias(panels["bias"], values)
    _length(panels["length"], values, independent)
    _decay(panels["decay"], values)
    _learning(panels["learning"], values, good)
    return figure


def _listing(axes: "Axes") -> None:
    axes.set_axis_off()
    axes.set(xlim=(0, 1), ylim=(-15.2, 1))
    axes.set_title("the learner", loc="left")
    for line, (indent, text, kind) in enumerate(LISTING):
        colour = {"head": HEAD, "mended": MENDED, "plain": "black"}[kind]
        weight = "bold" if kind == "head" else "normal"
        axes.text(0.09 * indent, -line, text, color=colour, fontweight=weight, fontsize=11, va="center")
    words = (
        "Red: where the printed algorithm slips. It divides by $t$,\n"
        "which begins at 0, and its last step takes $\\delta$ and $z$ from\n"
        "before the action. All three steps at every decision:\n"
        "OLGARB; with $b = 0$ OLPOMDP; with $\\theta$ at rest and\n"
        "$\\delta z$ averaged GPOMDP, which the panels are about."
    )
    axes.text(0, -len(LISTING) + 0.2, words, fontsize=8.5, color="0.35", va="top", linespacing=1.5)


def _reach(values: "Values") -> np.ndarray:
    return 1 / (1 - values["decay"])


def _bias(axes: "Axes", values: "Values") -> None:
    axes.plot(_reach(values), values["exact bias"], color="0.5", linewidth=1, label="exact")
    _points(
        axes,
        _reach(values),
        values["bias"],
        label=f"measured, {values['bias'].shape[1]:,} runs",
        color="C0",
        marker="o",
    )
    axes.set(xscale="log", yscale="log", xlabel=r"reach of the trace, $1/(1-\beta)$ decisions", ylabel="relative bias")
    axes.set_title(r"bias of $\nabla_\beta$", loc="left")
    axes.legend()


def _length(axes: "Axes", values: "Values", independent: Mapping[str, Mapping[int, float]]) -> None:
    row = list(values["decay"]).index(0.95)
    for colour, (name, (line, marker, face)) in zip(("C1", "C0"), LOOKS.items(), strict=True):
        errors = values[f"error {name}"][row]
        _points(
            axes,
            values["length"],
            errors,
            color=colour,
            marker=marker,
            linestyle=line,
            markerfacecolor=face,
            label=NAMES[name],
        )
        axes.plot(
            *zip(*independent[name].items(), strict=True),
            "kx",
            markersize=9,
            label="independent" if name == "mean" else None,
        )
    axes.set(xscale="log", yscale="log", xlabel="decisions $T$", ylabel="mean relative error")
    axes.set_title(r"error of the estimate, $\beta = 0.95$", loc="left")
    axes.legend()


def _decay(axes: "Axes", values: "Values") -> None:
    decades = [at for at, length in enumerate(values["length"]) if length in (1_000, 10_000, 100_000)]
    for colour, at in zip(("C3", "C2", "C0"), decades, strict=False):
        for name, (line, marker, face) in LOOKS.items():
            label = f"$T$ = {int(values['length'][at]):,}" if name == "mean" else None
            errors = values[f"error {name}"][:, at]
            look = {"color": colour, "linestyle": line, "marker": marker, "markerfacecolor": face}
            _points(axes, _reach(values), errors, label=label, **look)
    axes.plot(_reach(values), values["exact bias"], color="0.5", linewidth=1, label="bias alone")
    axes.set(
        xscale="log", yscale="log", xlabel=r"reach of the trace, $1/(1-\beta)$ decisions", ylabel="mean relative error"
    )
    axes.set_title("bias against variance (dashed: no baseline)", loc="left")
    axes.legend(fontsize=8)


def _learning(axes: "Axes", values: "Values", good: float) -> None:
    decision, short = values["decision"][1:], 0.8 - values["earned"][:, 1:]
    axes.plot(decision, short.T, color="C0", linewidth=0.5, alpha=0.25)
    axes.plot(decision, np.median(short, axis=0), color="C0", linewidth=2, label=f"median of {len(short)} seeds")
    axes.axhline(0.8 - good, color="0.4", linewidth=1, linestyle=":")
    axes.annotate(rf"$\eta = {good}$", (decision[0], 0.8 - good), (0, 3), textcoords="offset points", color="0.4")
    axes.set(xscale="log", yscale="log", xlabel="decisions", ylabel=r"short of the best, $0.8 - \eta$")
    axes.set_title(r"OLGARB from $\theta = 0$", loc="left")
    axes.legend(loc="upper right")


def _points(axes: "Axes", where: np.ndarray, samples: np.ndarray, **look: object) -> None:
    """Means with their intervals; `samples` are (places, runs)."""
    found = [mean_of(each) for each in samples]
    error = [[m.value - m.low for m in found], [m.high - m.value for m in found]]
    style = {"markersize": 4, "linewidth": 1, "linestyle": "none", **look}
    axes.errorbar(where, [m.value for m in found], error, **style)  # type: ignore[arg-type]
