"""Figure 5.7: the fixed controller of a leg as a state machine, and a walk under it."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from motorgrad._errors import check
from motorgrad.bodies import Hexapod, TripodController, walk
from motorgrad.experiments._claim import Claim, mean_of, share_of
from motorgrad.experiments._experiment import Experiment, Values
from motorgrad.experiments._workspace import Workspace
from motorgrad.experiments.chapter_5.hexapod._sources import INDEPENDENT
from motorgrad.experiments.chapter_5.hexapod._state_diagram import draw_machine
from motorgrad.experiments.chapter_5.hexapod._walk_record import draw_angles, draw_contacts, draw_states
from motorgrad.experiments.chapter_5.hexapod._walkers import JITTER, alike

if TYPE_CHECKING:
    from matplotlib.figure import Figure

START, SHOWN = 2.0, 2.0  # s
ALMOST = (
    f"Over walks whose servos' gains differ by up to {100 * JITTER:g} %: a walk is chaotic, and this is its "
    "spread. The bound was chosen after one walk had been measured."
)


@dataclasses.dataclass(frozen=True)
class StateMachine(Experiment):
    """The fixed controller: a state machine for each leg, drawn from its own numbers, with what ends its two deadlocks
    in another colour; and two seconds of a walk under it on level ground.

    **Arguments:**

    - `seconds` (simulated s): length of each walk, from two seconds after its start on.
    - `seeds`: walks, of bodies that differ by next to nothing.
    """

    name: ClassVar[str] = "fig-5.7"
    title: ClassVar[str] = "the fixed controller"
    source: ClassVar[str] = "figure 5.7"

    seconds: float = 20.0
    seeds: int = 20

    def __post_init__(self) -> None:
        check(SHOWN <= self.seconds <= 3600, "seconds", self.seconds, f"in {SHOWN:g} … 3600 simulated s")
        check(2 <= self.seeds <= 1000, "seeds", self.seeds, "in 2 … 1000")

    @classmethod
    def quick(cls) -> Self:
        return cls(seconds=3.0, seeds=2)

    def run(self, work: Workspace) -> Values:
        return work.part("walks", lambda: self._walk(work.threads))

    def _walk(self, threads: int) -> dict[str, Any]:
        found = walk(alike(self.seeds), TripodController(), self.seconds + START, threads=threads)
        shown = (found.time > START) & (found.time <= START + SHOWN + found.period / 2)
        return {
            **found.gait(since=START)._asdict(),
            "time": found.time[shown] - START,
            "states": found.states[shown, 0],
            "lateral": found.reading.lateral[shown, 0],
            "contact": found.reading.contact[shown, 0],
        }

    def figure(self, values: Values) -> "Figure":
        from matplotlib.figure import Figure

        controller, figure = TripodController(), Figure(figsize=(10.4, 4.8), layout="constrained")
        sides: Any = figure.subfigures(1, 2, width_ratios=[1, 1.05])
        draw_machine(sides[0].subplots(), controller)
        states, angles, contacts = sides[1].subplots(3, 1, sharex=True, height_ratios=[1.2, 1, 0.9])
        time = values["time"]
        draw_states(states, time, values["states"])
        draw_angles(angles, time, values["lateral"])
        for limit in (controller.back, controller.forward):
            angles.axhline(limit, color="0.6", linewidth=0.8, linestyle=":")
        draw_contacts(contacts, time, values["contact"])
        contacts.set(xlabel="time (s)", xlim=(0, SHOWN))
        contacts.set_title(f"feet on the ground, with more than {controller.contact:g} N", fontsize=9)
        for axes in (states, angles, contacts):
            axes.tick_params(labelsize=8)
        return figure

    def claims(self, values: Values) -> Sequence[Claim]:
        tripod, phase, duty = share_of(values["kind"] == "tripod"), mean_of(values["phase"]), mean_of(values["duty"])
        speed, strides = mean_of(values["speed"] / Hexapod().length), mean_of(values["frequency"])
        return (
            Claim(
                "The controller results in a tripod gait.",
                "section 5.3.3",
                "on level ground: in every walk",
                tripod,
                tripod.value == 1,
                note=ALMOST,
            ),
            Claim(
                "The tripods are half a cycle apart.",
                INDEPENDENT,
                "0.5: within 0.05",
                phase,
                _within(phase, 0.5, 0.05),
                "cycles",
                ALMOST,
            ),
            Claim(
                "A foot is on the ground for 0.44 of the time.",
                INDEPENDENT,
                "0.44: within 0.05",
                duty,
                _within(duty, 0.44, 0.05),
                "of the time",
                ALMOST,
            ),
            Claim(
                "It walks at 0.68 body lengths a second.",
                INDEPENDENT,
                "0.68: within a tenth of it",
                speed,
                _within(speed, 0.68, 0.068),
                "body lengths/s",
                f"{mean_of(values['speed']).value:.3f} m/s. {ALMOST}",
            ),
            Claim(
                "It makes two strides a second.",
                INDEPENDENT,
                "2: within a tenth of it",
                strides,
                _within(strides, 2.0, 0.2),
                "Hz",
                ALMOST,
            ),
        )


def _within(measured: Any, expected: float, tolerance: float) -> bool:
    """Whether the whole interval is so near."""
    return bool(np.all(np.abs(np.array([measured.low, measured.high]) - expected) <= tolerance))
