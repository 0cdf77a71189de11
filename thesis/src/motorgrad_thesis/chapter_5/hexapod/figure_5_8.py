"""Figure 5.8: the two gaits that hexapods learn, pronking and tripod."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from motorgrad.bodies import LEGS, TRIPODS, debounced
from motorgrad.schema import number
from motorgrad.statistics import share_of
from motorgrad.training import Evaluation
from motorgrad_thesis._claims import Claim, more_than_half
from motorgrad_thesis._experiment import Values, Workspace, experiment
from motorgrad_thesis._figures import Figure, subplots
from motorgrad_thesis.chapter_5.hexapod._drawing import TOUCH, TRIPOD_COLOURS, draw_angles, draw_contacts
from motorgrad_thesis.chapter_5.hexapod._gait_study import START, SynergyStudy

SHOWN = ("pronk", "tripod")
TOGETHER = 0.5
AIRBORNE = 0.05
"""Mean correlation between legs above which they move together; fraction of the time without ground contact above which
a gait jumps."""

MEMBERS = [np.array([LEGS.index(leg) for leg in tripod]) for tripod in TRIPODS]
GAIT_LABELS = {"pronk": "pronking", "tripod": "tripod"}


@experiment("fig-5.8", "two learned gaits", "figure 5.8")
class TwoGaits(SynergyStudy):
    """Lateral angles and ground contacts of two hexapods that have learned to walk on four synergies: the seed with the
    clearest pronk and the seed with the clearest tripod gait, by the correlation between the mean lateral angles of the
    two tripods; over all lags, with sampled actions. A gait that no seed learned is not shown.
    """

    shown: float = number(2.0, 0.1, 10, unit="simulated s", help="length of the record, from the middle of the walk on")

    def run(self, work: Workspace) -> Values:
        found = []
        for lag in self.lags:
            run = self.trained(work, lag)
            found.append(work.part(f"lag {lag}", lambda run=run: self._watched(self.watch(work, run, "sample"))))
        values: Values = {name: np.concatenate([each[name] for each in found]) for name in found[0] if name != "time"}
        values["lag"] = np.repeat(self.lags, self.seeds)
        values["seed"] = np.tile(np.arange(self.seeds), len(self.lags))
        kept: Values = {name: values[name] for name in values if name not in ("lateral", "contact")}
        kept["time"] = found[0]["time"]
        for kind in SHOWN:
            row = clearest(values["gait"], values["correlation"], kind)
            kept[f"{kind} row"] = np.array(row)
            for name in ("lateral", "contact"):
                kept[f"{kind} {name}"] = values[name][max(row, 0)]
        return kept

    def _watched(self, outcome: Evaluation) -> dict[str, Any]:
        """For each seed: its gait with its measures, and a record of its legs from the middle of the walk on."""
        sensors = outcome.sensors or {}
        lateral, contact = (np.stack([sensors[f"{kind}_{leg}"] for leg in LEGS], -1) for kind in ("lateral", "contact"))
        late = outcome.time > START
        middle = outcome.time[-1] / 2
        part = (outcome.time > middle) & (outcome.time <= middle + self.shown)
        period = float(outcome.time[1] - outcome.time[0])
        down = debounced(np.swapaxes(contact[:, late] > TOUCH, 0, 1), period)
        return {
            **{name: outcome.motion_metrics[name] for name in ("gait", "phase", "correlation")},
            "speed": outcome.metrics["speed"],
            "feet": outcome.motion_metrics["contact_correlation"],
            **movement(lateral[:, late], np.swapaxes(down, 0, 1)),
            "time": outcome.time[part] - middle,
            "lateral": lateral[:, part],
            "contact": contact[:, part],
        }

    def figure(self, values: Values) -> Figure:
        """Lateral angles and ground contacts of one seed for each gait, or a note if no seed learned the gait."""
        from matplotlib.patches import Patch

        figure, panels = subplots(8.6, 8.0, 2 * len(SHOWN), 1, height_ratios=[1.15, 1] * len(SHOWN), sharex=True)
        time = values["time"]
        seeds = len(values["gait"])
        for index, kind in enumerate(SHOWN):
            angles, feet = panels[2 * index : 2 * index + 2]
            row = int(values[f"{kind} row"])
            count = int(np.count_nonzero(values["gait"] == kind))
            if row < 0:
                for axes in (angles, feet):
                    axes.set_axis_off()
                words = f"None of {seeds} seeds learned the {GAIT_LABELS[kind]} gait."
                angles.text(0.5, 0.5, words, ha="center", va="center", transform=angles.transAxes, color="0.3")
                continue
            draw_angles(angles, time, values[f"{kind} lateral"])
            draw_contacts(feet, time, values[f"{kind} contact"])
            feet.tick_params(labelsize=8, axis="y")
            feet.set_title("feet on the ground", fontsize=9)
            angles.set_title(
                f"{GAIT_LABELS[kind]}: the clearest of {count} of {seeds} seeds; lag {values['lag'][row]}, seed "
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

    def claims(self, values: Values) -> Iterator[Claim]:
        jumps = values["airborne"] > AIRBORNE
        alternate = values["feet"] < 0
        rows = (
            ("pronk", "In the pronking gait all legs cycle together.", values["all six"] > TOGETHER,
             f"a mean correlation of the six lateral angles above {TOGETHER:g}"),
            ("pronk", "Pronking is a jumping movement: all feet are off the ground at once.", jumps,
             f"it so for more than {AIRBORNE:g} of the time"),
            ("tripod", "In the tripod gait the legs of a tripod move together.", values["within"] > TOGETHER,
             f"a mean correlation of their lateral angles above {TOGETHER:g}"),
            ("tripod", "The two tripods alternate on the ground.", alternate,
             "a correlation between their numbers of feet on the ground below 0"),
        )  # fmt: skip
        for kind, statement, happened, what in rows:
            own = happened[values["gait"] == kind]
            note = "" if len(own) else f"None of {len(happened)} seeds learned this gait."
            share = f"share of the seeds of this gait with {what}"
            yield more_than_half(statement, share_of(own), share, note=note, source="section 5.3.2")


def clearest(gaits: np.ndarray, correlation: np.ndarray, kind: str) -> int:
    """The row of the seed of this class with the correlation between tripods farthest from 0; −1 if there is none."""
    rows = np.flatnonzero(gaits == kind)
    return int(rows[np.argmax(np.abs(correlation[rows]))]) if len(rows) else -1


def movement(lateral: np.ndarray, down: np.ndarray) -> dict[str, np.ndarray]:
    """Coordination of each seed's legs.

    **Arguments:** lateral angles and whether the feet are on the ground, both (seeds, decisions, 6).

    **Returns** by name, (seeds,) each: mean correlation between the lateral angles of two legs, of `all six` and
    `within` a tripod, NaN where a leg never moves; `airborne`, the fraction of the time without contact.
    """
    legs = [_correlations(each.T) for each in lateral]
    within = [np.mean([_pairs(matrix[np.ix_(rows, rows)]) for rows in MEMBERS]) for matrix in legs]
    return {
        "all six": np.array([_pairs(matrix) for matrix in legs]),
        "within": np.array(within),
        "airborne": (~down.any(2)).mean(1),
    }


def _correlations(rows: np.ndarray) -> np.ndarray:
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.corrcoef(rows)


def _pairs(matrix: np.ndarray) -> float:
    """Mean of a matrix above its diagonal."""
    return float(matrix[np.triu_indices(len(matrix), 1)].mean())
