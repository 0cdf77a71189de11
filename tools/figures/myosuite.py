"""The figure of MyoSuite: what is stored of learning its tasks, every seed, and the peers."""

import math

import numpy as np
from matplotlib.figure import Figure

from tools.figures._style import COLOURS, level, panels
from tools.myosuite import TASKS, stored

WORDS = {"success": "successful episodes", "solved": "solved steps"}


def learning() -> Figure:
    """Shares of successful episodes and of solved steps while learning; of ours every seed, median and quartiles."""
    runs = stored()
    tasks = [name for name in TASKS if any(run["task"] == name for run in runs)]
    learners = list(dict.fromkeys(run["learner"] for run in runs))
    figure, axes = panels(len(WORDS), 2.5 * len(tasks), len(tasks), squeeze=False, sharey=True)
    for row, task in zip(axes, tasks, strict=True):
        for panel, (reading, words) in zip(row, WORDS.items(), strict=True):
            for run in (run for run in runs if run["task"] == task):
                round_, place = divmod(learners.index(run["learner"]), len(COLOURS))
                colour, dashes = COLOURS[place], ("-", "--")[round_]
                x = np.array(run["curves"]["steps"]) / 1000
                values = np.array(run["curves"][reading], float)
                if len(values) > 1:
                    panel.plot(x, values.T, color=colour, alpha=0.3, linewidth=0.5)
                    low, middle, high = np.nanpercentile(values, [25, 50, 75], axis=0)
                    panel.fill_between(x, low, high, color=colour, alpha=0.25, linewidth=0)
                    values = middle[None]
                panel.plot(x, values[0], color=colour, linestyle=dashes, linewidth=1.6, label=run["learner"])
            level(panel, 0.9, "")
            panel.set(title=f"{task}: {words}", xlabel="thousand decisions", ylim=(0, 1))
            lengths = [run["steps"] for run in runs if run["task"] == task]
            if max(lengths) > 4 * min(lengths):
                panel.set(xscale="log", xlim=(min(lengths) / 1e5, None))
    named = {label: line for panel in axes.flat for line, label in zip(*panel.get_legend_handles_labels(), strict=True)}
    figure.legend(named.values(), named.keys(), loc="outside upper center", ncols=math.ceil(len(named) / 2))
    return figure
