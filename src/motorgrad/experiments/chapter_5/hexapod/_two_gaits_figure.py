"""The figure of the two gaits that hexapods learn."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.experiments._experiment import Values
from motorgrad.experiments.chapter_5.hexapod._walk_record import TRIPOD_COLOURS, draw_angles, draw_contacts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAMES = {"pronk": "pronking", "tripod": "tripod"}


def draw_two_gaits(values: Values, shown: Sequence[str]) -> "Figure":
    """Lateral angles and feet on the ground, of one seed for each gait; words in place of a gait that no seed has."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    figure = Figure(figsize=(8.6, 8.0), layout="constrained")
    panels: Any = figure.subplots(2 * len(shown), 1, height_ratios=[1.15, 1] * len(shown), sharex=True)
    time, seeds = values["time"], len(values["gait"])
    for number, kind in enumerate(shown):
        angles, feet = panels[2 * number : 2 * number + 2]
        row, count = int(values[f"{kind} row"]), int(np.count_nonzero(values["gait"] == kind))
        if row < 0:
            for axes in (angles, feet):
                axes.set_axis_off()
            words = f"None of {seeds} seeds came to the {NAMES[kind]} gait."
            angles.text(0.5, 0.5, words, ha="center", va="center", transform=angles.transAxes, color="0.3")
            continue
        draw_angles(angles, time, values[f"{kind} lateral"])
        draw_contacts(feet, time, values[f"{kind} contact"])
        feet.tick_params(labelsize=8, axis="y")
        feet.set_title("feet on the ground", fontsize=9)
        angles.set_title(
            f"{NAMES[kind]}: the clearest of {count} of {seeds} seeds; lag {values['lag'][row]}, seed "
            f"{values['seed'][row]}, {values['speed'][row]:.2f} m/s, phase {values['phase'][row]:.2f} cycles, "
            f"correlation {values['correlation'][row]:.2f}".replace(" -", " −"),
            fontsize=9,
        )
    panels[-1].set(xlabel="time (s)", xlim=(0, time[-1]))
    for axes in panels[1::2]:
        axes.tick_params(labelbottom=True)
    shown_as = [
        Patch(color=colour, label=f"{which} tripod")
        for colour, which in zip(TRIPOD_COLOURS, ("first", "second"), strict=True)
    ]
    figure.legend(handles=shown_as, loc="outside upper center", ncols=2)
    return figure
