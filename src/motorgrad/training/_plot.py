"""Learning curves."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from motorgrad.tasks import Task

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LABELS = {
    "reward": "mean reward per decision",
    "apex": "height of the foot at a hop's apex (m)",
    "baseline": "baseline",
    "episodes": "episodes ended",
}


class Plotted(Protocol):
    """What is plotted of a run."""

    @property
    def config(self) -> dict[str, Any]: ...

    @property
    def path(self) -> Path | None: ...

    @property
    def task(self) -> Task: ...

    def curve(self, quantity: str) -> tuple[np.ndarray, np.ndarray]: ...


def learning_curves(runs: Sequence[Plotted], quantity: str = "reward", path: Path | str | None = None) -> "Figure":
    """Learning curves of several runs in one figure: every seed, their median and their interquartile band.

    Values are means over each record's window of decisions, without further smoothing. **Arguments:** the runs; a
    column of their metrics; where to save the figure, by suffix (`.png`, `.svg`, `.pdf`).
    """
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context({"font.size": 10, "axes.spines.top": False, "axes.spines.right": False}):
        figure = Figure(figsize=(7, 4.2), layout="constrained")
        axes = figure.subplots()
        for index, run in enumerate(runs):
            decision, values = run.curve(quantity)
            timed = run.task.period != 1
            x = decision * run.task.period if timed else decision
            colour = f"C{index}"
            label = run.path.name if run.path else run.config["task"]["name"]
            axes.plot(x, values.T, color=colour, alpha=min(0.5, 2 / len(values)), linewidth=0.6)
            seen = np.isfinite(values).any(axis=0)
            bands = np.nanpercentile(values[:, seen], [25, 50, 75], axis=0) if seen.any() else np.empty((3, 0))
            low, median, high = bands
            axes.fill_between(x[seen], low, high, color=colour, alpha=0.25, linewidth=0)
            axes.plot(x[seen], median, color=colour, linewidth=2, label=f"{label}: median of {len(values)} seeds")
            axes.set_xlabel("simulated time (s)" if timed else "decisions")
        axes.set_ylabel(LABELS.get(quantity, quantity.replace("_", " ")))
        window = runs[0].config["run"]["window"]
        axes.set_title(f"means over {window:,} decisions; band: quartiles over seeds", fontsize=9, color="0.4")
        axes.legend(frameon=False, loc="best")
        axes.margins(x=0.01)
        if path is not None:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
            figure.savefig(path, dpi=160)
    return figure
