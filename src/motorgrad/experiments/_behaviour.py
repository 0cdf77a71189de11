"""Figure 5.3 of the thesis: what the hopper does before and after learning."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from motorgrad.training import Evaluation, Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {"flexor": "#3b6fb6", "extensor": "#c8452f"}


def behaviour_figure(
    run: Run, before: Evaluation, after: Evaluation, seed: int, path: Path | str | None = None, seconds: float = 4.0
) -> "Figure":
    """Knee angle, foot height and muscle activations of one seed over the last `seconds`, before (left) and after."""
    import matplotlib
    from matplotlib.figure import Figure

    row, groups = run.seeds.index(seed), run.task.dynamics.groups  # type: ignore[union-attr]
    with matplotlib.rc_context({"font.size": 10, "axes.spines.top": False, "axes.spines.right": False}):
        figure = Figure(figsize=(9, 5.4), layout="constrained")
        axes = figure.subplots(3, 2, sharex="col", sharey="row", height_ratios=[3, 3, 1.2])
        for column, (outcome, title) in enumerate(((before, "before learning"), (after, "after learning"))):
            assert outcome.sensors is not None
            assert outcome.activation is not None
            part = outcome.time > outcome.time[-1] - seconds
            time = outcome.time[part] - outcome.time[part][0]
            angle, height, muscles = axes[:, column]
            angle.plot(time, 90 + np.rad2deg(outcome.sensors["knee_angle"][row, part]), color="0.25", linewidth=1)
            flight = outcome.sensors["foot_height"][row, part]
            height.fill_between(time, np.maximum(flight, 0), color="0.8", linewidth=0)
            height.plot(time, flight, color="0.25", linewidth=1)
            edges = np.append(time, time[-1] + run.task.period)
            for line, group in enumerate(groups):
                firing = outcome.activation[row, part, line] > 0.5
                muscles.stairs(
                    np.where(firing, line + 0.8, line),
                    edges,
                    baseline=line,
                    fill=True,
                    color=COLOURS.get(group, f"C{line}"),
                )
            muscles.set_yticks([line + 0.4 for line in range(len(groups))], groups)
            muscles.set_ylim(-0.2, len(groups))
            muscles.set_xlabel("time (s)")
            angle.set_title(title)
            angle.margins(x=0)
        axes[0, 0].set_ylabel("knee angle (°)")
        axes[1, 0].set_ylabel("foot height (m)")
        axes[2, 0].tick_params(left=False)
        figure.suptitle(f"Hopper, seed {seed}", fontsize=10, color="0.4", x=0.99, ha="right")
        if path is not None:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
            figure.savefig(path, dpi=160)
    return figure
