"""Sections 6.4.3 and 6.5.4: where a new unit starts."""

from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

import numpy as np

from motorgrad.plane import draw_regions
from motorgrad.statistics import mean_of
from motorgrad.tasks import FallingParticle
from motorgrad_thesis._claims import Claim, negative, positive
from motorgrad_thesis._experiment import Values, Workspace, experiment
from motorgrad_thesis._figures import Axes, Figure, draw_band, subplots
from motorgrad_thesis.chapter_6.section_6_4._growing_study import (
    INTERVAL,
    GrowthComparison,
    after_units,
    grown_policies,
)
from motorgrad_thesis.chapter_6.section_6_4.figure_6_7 import at_own_interval

PLACES = {"centre": ("C0", "at the centre"), "visited": ("C2", "at a visited place")}


@experiment("sec-6.4-placement", "where a new unit starts", "section 6.4")
class Placement(GrowthComparison):
    """Where a new unit starts: at the centre of the box, or at a random place among those that the particle visited
    recently. Units are added by the clock, in the layouts R3 and R1: the reward, and the initial and final places of
    units.
    """

    ways: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "centre": {"growth.placement": "none"},
        "visited": {"growth.placement": "visited"},
    }

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for name, run in self.runs(work):
            found["decision"], reward = run.curve()
            found[f"{name} reward"] = reward
            found[f"{name} after"] = after_units(found["decision"], reward, self.units)
            history = np.asarray(grown_policies(run, range(1, self.units + 1)).pool.centre)
            # a record at an addition contains the initial state of the new unit
            starts = [history[unit - 1][:, unit] for unit in range(1, self.units)]
            found[f"{name} starts"] = np.stack(starts, axis=1)
            found[f"{name} ends"] = at_own_interval(history)[:, 1:]
        return found

    def figure(self, values: Values) -> Figure:
        figure, axes = subplots(10, 6.4, len(self.layouts), 3, squeeze=False, width_ratios=[1.5, 1, 1])
        span = max(1, round(INTERVAL / values["decision"][0]))
        for row, layout in zip(axes, self.layouts, strict=True):
            for place, (colour, words) in PLACES.items():
                thousands = values["decision"] / 1e3
                reward = values[f"{layout} {place} reward"]
                draw_band(row[0], thousands, reward, colour, words, records=span)
            row[0].set(ylabel=f"{layout}: reward, last {INTERVAL:,} decisions")
            for panel, (place, (colour, words)) in zip(row[1:], PLACES.items(), strict=True):
                self._moves(panel, layout, values, place, colour)
                panel.set_title(words, fontsize=9.5)
        axes[0, 0].legend(loc="lower right", fontsize=8.5)
        axes[-1, 0].set_xlabel("thousand decisions")
        return figure

    def _moves(self, axes: Axes, layout: Any, values: Values, place: str, colour: str) -> None:
        """Initial places of all seeds' units, and their places when the next unit is added."""
        draw_regions(axes, FallingParticle(layout=layout).places)
        starts, ends = (values[f"{layout} {place} {when}"].reshape(-1, 2) for when in ("starts", "ends"))
        axes.plot(*starts.T, "+", color="black", markersize=5, alpha=0.7)
        axes.plot(*ends.T, ".", color=colour, markersize=3.5, alpha=0.7)

    def claims(self, values: Values) -> Iterator[Claim]:
        for layout in self.layouts:
            ends = {place: values[f"{layout} {place} after"][:, -1] for place in PLACES}
            lives = {place: values[f"{layout} {place} reward"].mean(1) for place in PLACES}
            ways = {
                place: np.linalg.norm(
                    values[f"{layout} {place} ends"] - values[f"{layout} {place} starts"], axis=-1
                ).mean(1)
                for place in PLACES
            }
            for found, words in ((ends, "in the last learning phase"), (lives, "over all decisions")):
                yield positive(
                    f"Units that start where the particle goes lead to more reward ({layout}, {words}).",
                    mean_of(found["visited"] - found["centre"]),
                    "reward minus that with units that start at the centre",
                    "reward per decision",
                    note=f"{found['visited'].mean():.3f}, for the centre {found['centre'].mean():.3f}.",
                    kind="extension",
                    source="section 6.5.4: local units only have an effect near the dynamics; our own",
                )
            yield negative(
                f"They move less far to their places ({layout}).",
                mean_of(ways["visited"] - ways["centre"]),
                "distance moved until the next addition minus that from the centre",
                "of the box",
                note=f"{ways['visited'].mean():.3f}, for the centre {ways['centre'].mean():.3f}.",
                kind="extension",
            )
