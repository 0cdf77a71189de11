"""The figure of motor primitives: how they are learnt, when they begin, and how they move."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.experiments._experiment import Values
from motorgrad.experiments.chapter_6.growing._growing_figure import draw_band

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = {"both": "C0", "precondition": "C2", "movement": "C1"}
TRIPOD = ("first", "second")


def draw_primitives(
    values: Values, words: Mapping[str, str], start: tuple[float, float], angle_scale: float
) -> "Figure":
    """Learning curves; how long the parts of a step last; and the preconditions of one hexapod."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 7.6), layout="constrained")
    panels: Any = figure.subplots(2, 2)
    records = max(1, len(values["time"]) // 20)
    for kind, label in words.items():
        draw_band(panels[0, 0], values["time"], values[f"{kind} curve"], COLOURS[kind], label, records)
    panels[0, 0].set(xlabel="simulated s of practice", ylabel="speed while learning, m/s")
    panels[0, 0].set_ylim(0, 1.3 * panels[0, 0].get_ylim()[1])
    panels[0, 0].legend(loc="upper left", fontsize=8.5)
    _movements(panels[0, 1], values, start)
    shown: Any = None
    for tripod, axes in enumerate(panels[1]):
        shown = _precondition(axes, values, tripod, angle_scale)
    figure.colorbar(
        shown, ax=panels[1], location="bottom", shrink=0.5, label="probability that a step begins, per decision"
    )
    return figure


def _movements(axes: "Axes", values: Values, start: tuple[float, float]) -> None:
    for tripod, marker in enumerate("os"):
        swing, stance = values["lasting"][:, tripod].T
        axes.plot(swing, stance, marker, markersize=4, alpha=0.8, label=f"{TRIPOD[tripod]} tripod")
    axes.plot(*start, "k+", markersize=12, label="at first")
    axes.set(xlabel="swing lasts, s", ylabel="stance lasts, s", xlim=(0, None), ylim=(0, None))
    axes.legend(fontsize=8.5)


def _precondition(axes: "Axes", values: Values, tripod: int, angle_scale: float) -> Any:
    degrees = values["angles"] * angle_scale
    ends = (degrees[0], degrees[-1])
    begins = values["begins"][tripod]
    shown = axes.imshow(begins, origin="lower", extent=(*ends, *ends), aspect="auto", vmin=0, vmax=1)
    lines = axes.contour(degrees, degrees, begins, levels=np.array([0.25, 0.5, 0.75]), colors="white", linewidths=0.8)
    axes.clabel(lines, fontsize=8)
    axes.set(
        title=f"{TRIPOD[tripod]} tripod, seed of middle speed",
        xlabel="lateral angle of its own legs, degrees (forward +)",
        ylabel="of the other tripod's legs",
    )
    return shown
