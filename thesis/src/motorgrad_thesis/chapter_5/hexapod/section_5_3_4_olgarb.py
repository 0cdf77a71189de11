"""Section 5.3.4: the thesis's own learner on 24 independent muscles."""

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np

from motorgrad.learning import Learner
from motorgrad.schema import count, number
from motorgrad.statistics import median_of, share_of
from motorgrad.tasks import HexapodSynergy
from motorgrad.training import Run, agent_for, evaluate
from motorgrad_thesis._claims import Claim, at_most, below
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_band, new_figure
from motorgrad_thesis.chapter_5.hexapod._gait_study import MODES, controller_speeds, gait_readings

SMOOTH = 12.0
"""Simulated seconds over which the speed during practice is averaged."""

STILL = 0.1
"""Net displacement (m/s) up to which a hexapod counts as not walking, as for the learner that does walk."""

ACTIONS = {"sample": "sampled actions", "mode": "most probable actions"}


@experiment("sec-5.3.4-olgarb", "the thesis's learner on 24 muscles", "section 5.3.4")
class MusclesByOlgarb(Experiment):
    """Hexapods learn by OLGARB with a hyperplane for each of their 24 muscles, all else as with four synergies: their
    speed during practice compared with the fixed controller, and speed and net displacement of the frozen policies.
    """

    reading: ClassVar[str] = (
        "The thesis does not say with which step size and decay its 24 muscles failed to learn. Ours are the best of "
        "eight pairs, by the mean speed of four other seeds after 300 s."
    )

    seconds: float = number(300.0, 0, open_low=True, unit="simulated s", help="length of every hexapod's practice")
    seeds: int = count(20, 2, 10_000, help="number of independent hexapods")
    decay: float = number(0.97, 0, 1, help="decay of the eligibility trace, per decision")
    rate: float = number(3e-3, 0, help="the step size of all parameters")
    watched: float = number(20.0, 20, 3600, unit="simulated s", help="length of the evaluation of the frozen policies")

    def validate(self) -> None:
        super().validate()
        self.check_least(seconds=50 * self.task.period)

    quick = smoke(seconds=6.0, seeds=2)

    @property
    def task(self) -> HexapodSynergy:
        """The thesis's task with a unit for each muscle."""
        return HexapodSynergy(synergies=HexapodSynergy().body.groups)

    @property
    def learner(self) -> Learner:
        """OLGARB on 24 hyperplanes."""
        return agent_for(self.task, decay=self.decay, learning_rate=self.rate)

    def run(self, work: Workspace) -> Values:
        found: Values = {f"controller {name}": value for name, value in controller_speeds(work, self.watched).items()}
        run = work.train(self.task, self.learner, round(self.seconds / self.task.period), self.seeds)
        found["time"], found["practice"] = run.curve("speed", x="simulated", smooth=SMOOTH)
        for mode in MODES:
            seen = work.part(mode, lambda mode=mode: self._watch(work, run, mode))
            found |= {f"{mode} {name}": values for name, values in seen.items()}
        return found

    def _watch(self, work: Workspace, run: Run, mode: Literal["sample", "mode"]) -> Values:
        return gait_readings(evaluate(run, round(self.watched / run.task.period), mode=mode, threads=work.threads))

    def figure(self, values: Values) -> Figure:
        """Speed during practice, and net displacement against speed of every frozen policy."""
        figure = new_figure(9.6, 3.9)
        practice, frozen = figure.subplots(1, 2, width_ratios=[1.3, 1])
        draw_band(practice, values["time"], values["practice"], "#0072B2", "24 muscles, median and quartiles")
        practice.plot(
            values["time"], values["practice"].max(0), color="#0072B2", linewidth=0.8, label="greatest of the seeds"
        )
        level = float(values["controller speed"][0])
        practice.axhline(level, color="0.3", linewidth=0.9, linestyle=(0, (5, 3)), label="fixed controller")
        practice.set(
            xlabel="simulated time of practice (s)",
            ylabel="speed along the heading (m/s)",
            xlim=(0, values["time"][-1]),
            ylim=(None, 1.5 * level),  # room for the legend
        )
        practice.legend(fontsize=8.5)
        _frozen(frozen, values)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        net = {mode: median_of(values[f"{mode} net"]) for mode in MODES}
        speed = {mode: median_of(values[f"{mode} speed"]) for mode in MODES}
        stalled = "; ".join(
            f"{ACTIONS[mode]}: {np.count_nonzero(values[f'{mode} gait'] == 'stalled')} of {self.seeds} of the class "
            f"stalled, greatest net displacement {values[f'{mode} net'].max():.2f} m/s"
            for mode in MODES
        )
        for mode in MODES:
            yield at_most(
                STILL,
                f"Learning the activation of each of the 24 muscles is unsuccessful ({ACTIONS[mode]}).",
                net[mode],
                f"frozen, after {self.seconds:g} s of practice: median net displacement over 20 s",
                "m/s",
                note=f"Speed along the heading: {speed[mode].words('m/s')}. {stalled[0].upper()}{stalled[1:]}.",
                of="Learning the activation of each of the 24 muscles is unsuccessful.",
            )
        level = float(values["controller speed"][0])
        yield below(
            0.25,
            "Hardly any seed becomes as fast as the fixed controller.",
            share_of(values["practice"][:, -1] > level),
            f"share of seeds above {level:.2f} m/s in the last {SMOOTH:g} s of practice",
            note=f"Median speed there: {median_of(values['practice'][:, -1]).words('m/s')}.",
            kind="extension",
        )


def _frozen(axes: Axes, values: Values) -> None:
    for mode, marker, face in (("sample", "o", "none"), ("mode", "o", "#0072B2")):
        speed, net = (values[f"{mode} {name}"] for name in ("speed", "net"))
        axes.plot(
            speed, net, marker, color="#0072B2", markerfacecolor=face, markersize=4.5, linestyle="", label=ACTIONS[mode]
        )
    axes.plot(
        values["controller speed"], values["controller net"], "P", color="black", markersize=7, label="fixed controller"
    )
    axes.axhline(STILL, color="0.8", linewidth=0.8, zorder=0)
    axes.set(xlabel="speed along the heading (m/s)", ylabel="net displacement in 20 s / 20 s (m/s)")
    axes.set_ylim(-0.02, None)
    axes.legend(fontsize=8.5)
