"""What figure 4.8 draws: learnt policies on the arm, samples of their reward, and every seed."""

from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.experiments._experiment import Values
from motorgrad.experiments.chapter_4._pool_drawing import IDEAL, THRESHOLD, draw_pool, draw_thresholds

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_arm_policies(values: Values) -> "Figure":
    """Above the policies of the pools in the middle of all seeds, and samples; below what every seed came to."""
    from matplotlib.figure import Figure

    counts = values["units"].tolist()
    figure = Figure(figsize=(2.7 * (len(counts) + 1) + 0.6, 5.4), layout="constrained")
    panels = figure.subplots(2, len(counts) + 1, height_ratios=[1.5, 1], squeeze=False)
    mesh: Any = None
    for (policy, seeds), units in zip(panels.T, counts, strict=False):
        load, best = values[f"load {units}"], values[f"best count {units}"]
        thresholds, gains, reward = (values[f"{what} {units}"] for what in ("threshold", "gain", "reward"))
        middle = int(values[f"middle {units}"])
        mesh = draw_pool(policy, thresholds[middle], gains[middle], load)
        policy.plot(load, best, color=IDEAL, linestyle=":", linewidth=1.6)
        policy.set_title(f"{units} units")
        for change in load[1:][np.diff(best) != 0]:
            seeds.axvline(change, color=IDEAL, linestyle=":", linewidth=1)
        draw_thresholds(seeds, thresholds, gains, (load[0], load[-1]), np.argsort(-reward, kind="stable"))
        caught = np.sum((gains < 0).any(1))
        seeds.set(xlabel="load (kg)")
        seeds.set_title(f"a unit of negative gain: {caught} of {len(gains)}", fontsize=9)
    panels[0, 0].set_ylabel("active units")
    panels[1, 0].set_ylabel("thresholds, every seed")
    _samples(figure, panels[0, -1], values, counts[-1])
    _earned(panels[1, -1], values)
    figure.colorbar(mesh, ax=panels[0, :-1], label="probability", aspect=14, pad=0.01)
    return figure


def _samples(figure: "Figure", axes: Any, values: Values, units: int) -> None:
    load, count, paid = (values[f"sample {what}"] for what in ("load", "count", "reward"))
    # moved a little up and down, so that no sample hides another
    moved = count + np.random.default_rng(1).uniform(-0.22, 0.22, len(count))
    dots = axes.scatter(load, moved, c=paid, cmap="RdYlBu_r", s=9, edgecolors="0.4", linewidths=0.2)
    axes.set(title=f"samples, {units} units", ylim=(-0.5, units + 0.5), yticks=range(units + 1))
    axes.set(xlim=(values[f"load {units}"][0], values[f"load {units}"][-1]))
    figure.colorbar(dots, ax=axes, label="reward", aspect=14, pad=0.02)


def _earned(axes: Any, values: Values) -> None:
    """What every seed's pool earns, of the best."""
    counts = values["units"].tolist()
    for row, units in enumerate(counts):
        part = values[f"reward {units}"] / values[f"best {units}"]
        good = (values[f"gain {units}"] > 0).all(1)
        place = row + np.linspace(-0.25, 0.25, len(part))
        axes.plot(100 * part[good], place[good], "o", color=THRESHOLD, markersize=3)
        axes.plot(100 * part[~good], place[~good], "x", color="black", markersize=3.5)
    axes.set(yticks=range(len(counts)), yticklabels=counts, ylabel="units", xlabel="reward (% of the best)")
    axes.invert_yaxis()
    axes.set_title("× a unit of negative gain", fontsize=9)
