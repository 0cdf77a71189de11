"""The figure of synergies found in learnt gaits."""

from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.bodies import TRIPODS
from motorgrad.experiments._experiment import Values
from motorgrad.experiments.chapter_6.growing._growing_figure import draw_band

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = {"found": "#0072B2", "by lot": "#D55E00", "by hand": "#4d4d4d"}
MUSCLES = ("protractor", "levator", "retractor", "depressor")


def draw_synergies(values: Values) -> "Figure":
    """The synergies of the gait that leads furthest beside those made by hand; what is learnt on them."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.8, 7.6), layout="constrained")
    panels: Any = figure.subplot_mosaic(
        [["found", "found"], ["hand", "hand"], ["practice", "frozen"]],
        height_ratios=[1, 1, 2.2],
        width_ratios=[1.7, 1],
    )
    part = f"{100 * float(values['explained'][0]):.0f} %"
    _matrix(panels["found"], values, values["weights"][0], f"found in the gait that leads furthest, {part} explained")
    _matrix(panels["hand"], values, values["hand"], "made by hand: swing and stance of each tripod")
    _practice(panels["practice"], values)
    _frozen(panels["frozen"], values)
    return figure


def _matrix(axes: "Axes", values: Values, weights: np.ndarray, title: str) -> None:
    """Weights by unit and muscle, those of one tripod beside each other."""
    groups = [str(name) for name in values["groups"]]
    order = [groups.index(f"{muscle}_{leg}") for tripod in TRIPODS for muscle in MUSCLES for leg in tripod]
    axes.imshow(weights[:, order], cmap="Blues", vmin=0, vmax=1, aspect="auto")
    legs = len(TRIPODS[0])
    for start in range(0, len(order), legs):
        axes.axvline(start - 0.5, color="0.3" if start == len(order) // 2 else "0.85", linewidth=1.2)
    names = [muscle + "s" for _ in TRIPODS for muscle in MUSCLES]
    axes.set_xticks(np.arange(1, len(order), legs), names, fontsize=8)
    axes.set_yticks(range(len(weights)), [f"unit {index + 1}" for index in range(len(weights))], fontsize=8)
    axes.tick_params(length=0)
    axes.set_title(f"{title} (left: the first tripod's muscles, right: the second's)", fontsize=9)


def _practice(axes: "Axes", values: Values) -> None:
    for kind, colour in COLOURS.items():
        curves = values[f"{kind} practice"]
        draw_band(axes, values["time"], curves, colour, f"synergies {kind}, {len(curves)} seeds")
    level = float(values["controller speed"][0])
    axes.axhline(level, color="0.3", linewidth=0.9, linestyle=(0, (5, 3)), label="fixed controller")
    axes.set(xlabel="simulated time of practice (s)", ylabel="speed along the heading (m/s)", ylim=(0, None))
    axes.set_xlim(0, values["time"][-1])
    axes.legend(loc="upper left", fontsize=8, title="medians and quartiles", title_fontsize=8)


def _frozen(axes: "Axes", values: Values) -> None:
    rows = [(kind, mode) for kind in COLOURS for mode in ("sample", "mode")]
    for place, (kind, mode) in enumerate(rows):
        net = values[f"{kind} {mode} net"]
        across = place + 0.25 * np.linspace(-1, 1, len(net))
        face = COLOURS[kind] if mode == "sample" else "none"
        axes.plot(across, net, "o", color=COLOURS[kind], markerfacecolor=face, markersize=4, alpha=0.75)
        axes.plot([place - 0.32, place + 0.32], [np.median(net)] * 2, color=COLOURS[kind], linewidth=2)
    axes.set_xticks(
        range(len(rows)), [f"{kind},\n{'drawn' if mode == 'sample' else 'mode'}" for kind, mode in rows], fontsize=7.5
    )
    axes.set(ylabel="net displacement over 20 s, frozen (m/s)", ylim=(-0.05, None))
