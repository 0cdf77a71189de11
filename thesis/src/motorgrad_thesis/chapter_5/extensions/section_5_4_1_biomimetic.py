"""Section 5.4.1: gaits learned by the biomimetic hexapod."""

from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np

from motorgrad.bodies import BodyState, Hexapod, biomimetic_hexapod, read_hexapod
from motorgrad.schema import count, number
from motorgrad.statistics import difference_of, median_of
from motorgrad.tasks import HexapodSynergy
from motorgrad.training import Run, agent_for, evaluate
from motorgrad_thesis._claims import Claim, at_most, negative, positive
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_band, new_figure
from motorgrad_thesis.chapter_5.hexapod._gait_study import START, gait_readings
from motorgrad_thesis.chapter_5.hexapod.section_5_3_4_gaits import counted

SMOOTH = 12.0
"""Simulated seconds over which the speed during practice is averaged."""

STILL = 0.1
"""Net displacement (m/s) up to which a hexapod counts as not walking."""

BODIES = {"plain": Hexapod(), "biomimetic": biomimetic_hexapod()}
COLOURS = {"plain": "#000000", "biomimetic": "#D55E00"}
QUANTITIES = {
    "speed": "speed along\nthe heading (m/s)",
    "net": "net displacement\nin 20 s / 20 s (m/s)",
    "yaw": "yaw rate, root\nmean square (rad/s)",
}


@experiment("sec-5.4.1-biomimetic", "gaits of the biomimetic hexapod", "section 5.4.1")
class BiomimeticGaits(Experiment):
    """The biomimetic hexapod of figure 5.9 and the plain one learn to walk on four synergies, with the same learner:
    speed during practice; and speed, net displacement, yaw and gait of the frozen policies.
    """

    reading: ClassVar[str] = (
        "The thesis gives no numbers of the biomimetic body; ours were set by hand, as for figure 5.9. To yaw means "
        "the root mean square of the yaw rate."
    )

    seconds: float = number(150.0, 0, open_low=True, unit="simulated s", help="length of every hexapod's practice")
    seeds: int = count(12, 2, 10_000, help="number of independent hexapods with each body")
    watched: float = number(20.0, 20, 3600, unit="simulated s", help="length of the evaluation of the frozen policies")

    def validate(self) -> None:
        super().validate()
        self.check_least(seconds=50 * HexapodSynergy().period)

    quick = smoke(seconds=6.0, seeds=2)

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for name, body in BODIES.items():
            task = HexapodSynergy(body=body)
            run = work.train(task, agent_for(task), round(self.seconds / task.period), self.seeds)
            found["time"], found[f"{name} practice"] = run.curve("speed", x="simulated", smooth=SMOOTH)
            seen = work.part(name, lambda run=run: self._watch(work, run))
            found |= {f"{name} {quantity}": values for quantity, values in seen.items()}
        return found

    def _watch(self, work: Workspace, run: Run) -> Values:
        """Walks of frozen policies from a fresh start, with sampled actions: `gait_readings` and `yaw`, the root mean
        square of the yaw rate in rad/s."""
        outcome = evaluate(run, round(self.watched / run.task.period), threads=work.threads)
        late = outcome.time > START
        reading = read_hexapod(BodyState(outcome.position, None, outcome.sensors or {}))
        return {**gait_readings(outcome), "yaw": np.sqrt((reading.yaw_rate[:, late] ** 2).mean(axis=1))}

    def figure(self, values: Values) -> Figure:
        """Speed during practice; then one mark for each frozen policy, with medians."""
        figure = new_figure(9.8, 6.6)
        panels: Any = figure.subplot_mosaic([["practice"] * 3, list(QUANTITIES)], height_ratios=[1, 1])
        practice = panels["practice"]
        for name, colour in COLOURS.items():
            draw_band(practice, values["time"], values[f"{name} practice"], colour, name)
        practice.set(
            xlabel="simulated time of practice (s)",
            ylabel="speed along the heading (m/s)",
            xlim=(0, values["time"][-1]),
            ylim=(0, None),
        )
        practice.legend(loc="upper left", title=f"median and quartiles of {self.seeds} seeds", title_fontsize=8.5)
        for quantity, words in QUANTITIES.items():
            _marks(panels[quantity], values, quantity)
            panels[quantity].set_ylabel(words)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        both = {body: {name: values[f"{body} {name}"] for name in (*QUANTITIES, "gait")} for body in BODIES}
        ours = both["biomimetic"]
        plain = both["plain"]
        counts = "; ".join(f"{body} {counted(found['gait'])}" for body, found in both.items())
        medians = {
            name: " and ".join(f"{np.median(found[name]):.2f}" for found in (ours, plain)) for name in QUANTITIES
        }
        after = f"frozen, after {self.seconds:g} s of practice, with sampled actions:"
        yield at_most(
            STILL,
            "Without an outer loop over its numbers, the biomimetic body is not capable of walking.",
            median_of(ours["net"]),
            f"{after} median net displacement",
            "m/s",
            note=f"Gaits: {counts}. The thesis says that an outer loop is needed for a structure capable of the "
            "desired behaviour.",
        )
        yield positive(
            "Legs with different functions turn the body: learned gaits yaw more than those of the plain hexapod.",
            difference_of(ours["yaw"], plain["yaw"]),
            f"{after} difference of the root mean squares of the yaw rate",
            "rad/s",
            note=f"Medians: {medians['yaw']} rad/s.",
        )
        yield negative(
            "With the same practice, the biomimetic hexapod gets less far than the plain one.",
            difference_of(ours["net"], plain["net"]),
            f"{after} difference of the net displacements",
            "m/s",
            note=f"Medians: {medians['net']} m/s; speed along the heading {medians['speed']} m/s.",
            kind="extension",
        )


def _marks(axes: Axes, values: Values, quantity: str) -> None:
    """One mark per seed for each body, medians as bars."""
    for place, (name, colour) in enumerate(COLOURS.items()):
        found = values[f"{name} {quantity}"]
        across = place + 0.2 * np.linspace(-1, 1, len(found))
        axes.plot(across, found, "o", color=colour, markersize=4, alpha=0.75)
        axes.plot([place - 0.3, place + 0.3], [np.median(found)] * 2, color=colour, linewidth=2)
    axes.set_xticks(range(len(COLOURS)), COLOURS)
    axes.set(xlim=(-0.6, 1.6), ylim=(min(0.0, float(axes.get_ylim()[0])), None))
