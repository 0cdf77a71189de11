"""Figure 5.7: the fixed controller of a leg as a state machine, and a walk under it."""

from collections.abc import Iterator
from typing import Any, ClassVar

from motorgrad.bodies import Hexapod, LegState, TripodController, walk
from motorgrad.schema import count, number
from motorgrad.statistics import mean_of
from motorgrad_thesis._claims import Claim, in_every, within
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, Point, draw_arrow, new_figure
from motorgrad_thesis.chapter_5.hexapod._drawing import STATE_COLOURS, draw_angles, draw_contacts, draw_states
from motorgrad_thesis.chapter_5.hexapod._gait_study import INDEPENDENT, JITTER, jittered_hexapods

# s
START = 2.0
SHOWN = 2.0
ALMOST = (
    f"Over walks whose servos' gains differ by up to {100 * JITTER:g} %: walks are chaotic, and this is their "
    "spread. The bound was chosen after measuring one walk."
)
WIDE = 2.5
HIGH = 1.15
PLACES: dict[LegState, Point] = {
    LegState.STANCE: (0.0, 0.0),
    LegState.WAIT: (0.0, 3.6),
    LegState.SWING: (5.0, 3.6),
    LegState.DROP: (5.0, 0.0),
}
FIXED = "#A0307A"


@experiment("fig-5.7", "the fixed controller", "figure 5.7")
class StateMachine(Experiment):
    """The fixed controller: a state machine for each leg, drawn from its own numbers, with our addition in another
    colour; and two seconds of a walk under it on level ground. Legs that wait count as being in the thesis's "stance
    phase", as legs in stance do.
    """

    reading: ClassVar[str] = (
        '"More than one leg in the stance phase" counts all legs that support the body, those in the states stance and '
        "wait: section 5.3 knows two phases, support and swing."
    )

    seconds: float = number(
        20.0, SHOWN, 3600, unit="simulated s", help="length of each walk, after two seconds that do not count"
    )
    seeds: int = count(20, 2, 1000, help="number of walks of nearly identical bodies")

    quick = smoke(seconds=3.0, seeds=2)

    def run(self, work: Workspace) -> Values:
        return work.part("walks", lambda: self._walk(work.threads))

    def _walk(self, threads: int) -> dict[str, Any]:
        found = walk(jittered_hexapods(self.seeds), TripodController(), self.seconds + START, threads=threads)
        shown = (found.time > START) & (found.time <= START + SHOWN + found.period / 2)
        return {
            **found.gait(since=START)._asdict(),
            "time": found.time[shown] - START,
            "states": found.states[shown, 0],
            "lateral": found.reading.lateral[shown, 0],
            "contact": found.reading.contact[shown, 0],
        }

    def figure(self, values: Values) -> Figure:
        controller = TripodController()
        figure = new_figure(10.4, 4.8)
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

    def claims(self, values: Values) -> Iterator[Claim]:
        yield in_every(
            "The controller results in a tripod gait.",
            values["kind"] == "tripod",
            "share of these walks, on level ground,",
            note=ALMOST,
            source="section 5.3.3",
        )
        yield within(
            0.45,
            0.55,
            "The tripods are half a cycle apart.",
            mean_of(values["phase"]),
            unit="cycles",
            note=ALMOST,
            kind="reference model",
            source=INDEPENDENT,
        )
        yield within(
            0.39,
            0.49,
            "A foot is on the ground 0.44 of the time.",
            mean_of(values["duty"]),
            unit="of the time",
            note=ALMOST,
            kind="reference model",
            source=INDEPENDENT,
        )
        yield within(
            0.612,
            0.748,
            "It walks at 0.68 body lengths per second.",
            mean_of(values["speed"] / Hexapod().length),
            unit="body lengths/s",
            note=f"{mean_of(values['speed']).value:.3f} m/s. {ALMOST}",
            kind="reference model",
            source=INDEPENDENT,
        )
        yield within(
            1.8,
            2.2,
            "It makes two strides per second.",
            mean_of(values["frequency"]),
            unit="Hz",
            note=ALMOST,
            kind="reference model",
            source=INDEPENDENT,
        )


def draw_machine(axes: Axes, controller: TripodController) -> None:
    """Boxes are states with the velocities that they set, arrows the conditions of transitions."""
    arrow: dict[str, Any] = {"colour": "0.25", "size": 15, "width": 1.4, "gap": 2}
    for state, place in PLACES.items():
        _state(axes, place, state, controller)
    draw_arrow(axes, (0.0, HIGH / 2), (0.0, 3.6 - HIGH / 2), **arrow)
    draw_arrow(axes, (WIDE / 2, 3.6), (5.0 - WIDE / 2, 3.6), **arrow)
    draw_arrow(axes, (5.0, 3.6 - HIGH / 2), (5.0, HIGH / 2), **arrow)
    draw_arrow(axes, (5.0 - WIDE / 2, 0.0), (WIDE / 2, 0.0), **arrow)
    style: dict[str, Any] = {"fontsize": 8.5, "zorder": 5}
    axes.text(0.15, 1.8, f"the leg is back\nbeyond {_degrees(controller.back)}", ha="left", va="center", **style)
    axes.text(4.85, 1.8, f"the leg is forward\nbeyond {_degrees(controller.forward)}", ha="right", va="center", **style)
    axes.text(
        2.5, 3.6 + HIGH / 2 + 0.1, "more than one leg of the opposing\ntripod is in stance or waits",
        ha="center", va="bottom", **style,
    )  # fmt: skip
    axes.text(
        2.5, -HIGH / 2 - 0.1, f"the foot touches the ground\nwith more than {controller.contact:g} N",
        ha="center", va="top", **style,
    )  # fmt: skip
    if controller.mended:
        lowest = f"or: it is within {_degrees(controller.margin)}\nof its lower limit"
        axes.text(2.5, 0.2, lowest, ha="center", va="bottom", color=FIXED, **style)
        axes.text(-WIDE / 2, -1.5, "● our addition", ha="left", va="center", color=FIXED, **style)
    axes.set(xlim=(-WIDE / 2 - 0.1, 5.0 + WIDE / 2 + 0.1), ylim=(-1.7, 5.0), aspect="equal")
    axes.set_axis_off()


def _state(axes: Axes, place: Point, state: LegState, controller: TripodController) -> None:
    from matplotlib.patches import FancyBboxPatch

    turning = controller.turning[state]
    colour = STATE_COLOURS[state]
    corner = (place[0] - WIDE / 2, place[1] - HIGH / 2)
    style: dict[str, Any] = {"boxstyle": "round,pad=0,rounding_size=0.15", "edgecolor": colour, "linewidth": 2}
    axes.add_patch(FancyBboxPatch(corner, WIDE, HIGH, facecolor="white", zorder=3, **style))
    x, y = place
    axes.text(x, y + 0.31, state.name.lower(), ha="center", va="center", fontsize=11, weight="bold", zorder=4)
    words = f"lateral {_rate(turning.lateral)}\nvertical {_rate(turning.vertical)}"
    axes.text(x, y - 0.17, words, ha="center", va="center", fontsize=8.5, zorder=4)


def _rate(value: float) -> str:
    return f"{value:+g} rad/s".replace("-", "−") if value else "0"


def _degrees(value: float) -> str:
    return f"{value:g}°".replace("-", "−")
