"""What a hopper does before and after learning, side by side: the picture of figure 5.3 and of the demonstration."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from motorgrad.experiments._style import EXTENSOR, FLEXOR, STYLE
from motorgrad.training import Evaluation, Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {"flexor": FLEXOR, "extensor": EXTENSOR}
TITLES = ("before learning", "after learning")


def behaviour_of(
    run: Run, before: Evaluation, after: Evaluation, seed: int, seconds: float = 4.0
) -> dict[str, np.ndarray]:
    """What `draw_behaviour` shows of one seed: the last `seconds` of both evaluations, `before` leading.

    **Returns** by name: `angle` (degrees) and `height` (m) of shape `(2, decisions)`, `firing` of shape
    `(2, decisions, groups)`, `groups`, `period` (s), `seed`.
    """
    row, both = run.seeds.index(seed), (before, after)
    part = before.time > before.time[-1] - seconds
    sensors = [outcome.sensors or {} for outcome in both]
    return {
        "angle": np.stack([90 + np.rad2deg(sensed["knee_angle"][row, part]) for sensed in sensors]),
        "height": np.stack([sensed["foot_height"][row, part] for sensed in sensors]),
        "firing": np.stack([outcome.activation[row, part] > 0.5 for outcome in both if outcome.activation is not None]),
        "groups": np.array(run.task.dynamics.groups),  # type: ignore[union-attr]
        "period": np.array(run.task.period),
        "seed": np.array(seed),
    }


def draw_behaviour(shown: dict[str, np.ndarray]) -> "Figure":
    """Knee angle, foot height and muscle activations, before (left) and after (right)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 5.4), layout="constrained")
    axes = figure.subplots(3, 2, sharex="col", sharey="row", height_ratios=[3, 3, 1.2])
    groups, period = shown["groups"].tolist(), float(shown["period"])
    edges = period * np.arange(shown["angle"].shape[1] + 1)
    time = edges[:-1]
    for column, title in enumerate(TITLES):
        angle, height, muscles = axes[:, column]
        angle.plot(time, shown["angle"][column], color="0.25", linewidth=1)
        flight = shown["height"][column]
        height.fill_between(time, np.maximum(flight, 0), color="0.8", linewidth=0)
        height.plot(time, flight, color="0.25", linewidth=1)
        for line, group in enumerate(groups):
            level = np.where(shown["firing"][column, :, line], line + 0.8, line)
            muscles.stairs(level, edges, baseline=line, fill=True, color=COLOURS.get(group, f"C{line}"))
        muscles.set_yticks([line + 0.4 for line in range(len(groups))], groups)
        muscles.set_ylim(-0.2, len(groups))
        muscles.set_xlabel("time (s)")
        angle.set_title(title)
        angle.margins(x=0)
    axes[0, 0].set_ylabel("knee angle (°)")
    axes[1, 0].set_ylabel("foot height (m)")
    axes[2, 0].tick_params(left=False)
    figure.suptitle(f"Hopper, seed {int(shown['seed'])}", fontsize=10, color="0.4", x=0.99, ha="right")
    return figure


def behaviour_figure(
    run: Run, before: Evaluation, after: Evaluation, seed: int, path: Path | str | None = None, seconds: float = 4.0
) -> "Figure":
    """`draw_behaviour` of one seed of a run, saved to `path`, if any."""
    import matplotlib

    with matplotlib.rc_context(STYLE):
        figure = draw_behaviour(behaviour_of(run, before, after, seed, seconds))
        if path is not None:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
            figure.savefig(path, dpi=160)
    return figure
