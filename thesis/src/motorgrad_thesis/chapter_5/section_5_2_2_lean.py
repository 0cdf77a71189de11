"""Section 5.2.2: what the flexors do to the foot of a hopper that leans."""

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

import numpy as np

from motorgrad._errors import check
from motorgrad.schema import Range, number, static
from motorgrad.statistics import exact, mean_of
from motorgrad.tasks import Hopper
from motorgrad.training import Evaluation, Run
from motorgrad_thesis._claims import Claim, Kind, below, more_than_half, positive
from motorgrad_thesis._experiment import Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_intervals, new_figure
from motorgrad_thesis.chapter_5._hopper_variants import HopperVariants
from motorgrad_thesis.chapter_5._pushed_hops import FALLS, LAST, RULES, leaning_falls, pushed_hops

CALM = "calm"
GUSTS = "gusts"
WORDS = {
    "flight off": "silent in flight",
    "falling off": "silent in the fall",
    "learned": "as learned",
    "falling on": "active in the fall",
}
"""What the flexors do, from least to most."""
COLOURS = {"flight off": "#D55E00", "falling off": "#E69F00", "learned": "#000000", "falling on": "#0072B2"}
PRACTICE = {CALM: ("0.55", "s"), GUSTS: ("black", "o")}
PLACES = {CALM: "in calm air", GUSTS: "with gusts"}
DROP = 0.5  # m
LEAN = 5.0  # degrees
STATEMENT = "The activation of the flexors ensures that the foot makes contact with the ground at an appropriate angle"


@experiment("sec-5.2.2-lean", "flexors and the foot of a hopper that leans", "section 5.2.2")
class Lean(HopperVariants):
    """Hoppers that lean against a spring learn with and without gusts that push the foot to the side in flight. Their
    frozen policies then meet the same gusts with flexors as learned, silent in flight, silent in the fall, and active
    in the fall: the angle of the foot at landings, also for other stiffnesses of the spring, and heights of hops; and
    the foot's angle in the fall of a body that leans.
    """

    reading: ClassVar[str] = (
        'The thesis says neither how its hopper could move sideways nor what made it do so. "Appropriate" is, for us, '
        "flat on the ground. Our body leans against a spring about three times as stiff as keeps the extended legs "
        "upright under the load (30 N m/rad), damped in the proportion of the body's default; a gust is a force on the "
        "foot of up to 10 N, about a third of the body's weight, drawn anew for every flight. Nothing that the policy "
        "observes tells it of lean or gust."
    )

    seconds: float = number(1000.0, 0, open_low=True, unit="simulated s", help="length of every hopper's practice")
    stiffness: float = number(
        30.0, 0, open_low=True, unit="N m/rad", help="stiffness of the lateral spring in practice"
    )
    gust: float = number(
        10.0, 0, open_low=True, unit="N", help="greatest force of a gust; in evaluations in proportion to the stiffness"
    )
    stiffnesses: tuple[float, ...] = static(
        (10.0, 30.0, 100.0, 300.0),
        allowed=Range(0, open_low=True),
        unit="N m/rad",
        help="stiffnesses of the spring in evaluations, rising, with that of practice among them",
    )

    def validate(self) -> None:
        super().validate()
        self.check_rising("stiffnesses", 2)
        check(
            self.stiffness in self.stiffnesses, "stiffnesses", self.stiffnesses, f"with {self.stiffness:g} among them"
        )

    quick = smoke(seconds=6.0, seeds=2, watched=2.0, stiffnesses=(10.0, 30.0))

    def leaning(self, stiffness: float) -> Hopper:
        """The task with gusts on a body that leans against such a spring."""
        own = self.task.body
        share = stiffness / own.lateral_stiffness
        body = dataclasses.replace(
            own,
            lateral="spring",
            lateral_stiffness=stiffness,
            lateral_damping=own.lateral_damping * np.sqrt(share).item(),
        )
        return dataclasses.replace(self.task, body=body, gust=self.gust * stiffness / self.stiffness)

    @property
    def variants(self) -> Mapping[str, Hopper]:
        windy = self.leaning(self.stiffness)
        return {CALM: dataclasses.replace(windy, gust=0.0), GUSTS: windy}

    def run(self, work: Workspace) -> Values:
        found = super().run(work)
        for stiffness in self.stiffnesses:
            task = self.leaning(stiffness)
            fall = work.part(f"fall {stiffness:g}", lambda task=task: leaning_falls(task.body, DROP, LEAN, task.gust))
            found |= {f"{stiffness:g} {quantity}": values for quantity, values in fall.items()}
        return found

    def measured(self, task: Hopper, run: Run, outcome: Evaluation) -> Values:
        """Also what `pushed_hops` returns, by rule: with gusts, whatever the practice; and of those that practised with
        gusts, in calm air, and for the other stiffnesses."""
        found = super().measured(task, run, outcome)
        windy = self.leaning(self.stiffness)
        cases: dict[str, dict[str, Any]] = {rule: {"rule": rule} for rule in RULES}
        if task.gust:
            cases |= {f"{CALM} {rule}": {"rule": rule, "calm": True} for rule in RULES}
            for stiffness in set(self.stiffnesses) - {self.stiffness}:
                other = self.leaning(stiffness)
                cases |= {f"{stiffness:g} {rule}": {"rule": rule, "task": other} for rule in RULES}
        for name, case in cases.items():
            seen = pushed_hops(**{"task": windy, "run": run, "seconds": self.watched, **case})
            found |= {f"{name} {quantity}": values for quantity, values in seen.items()}
        return found

    def at(self, stiffness: float, rule: str) -> str:
        """The name of what hoppers that practised with gusts do, without the quantity."""
        return f"{GUSTS} {rule}" if stiffness == self.stiffness else f"{GUSTS} {stiffness:g} {rule}"

    def figure(self, values: Values) -> Figure:
        """The fall of a body that leans; angles at landings and heights of hops by what the flexors do; angles against
        the stiffness."""
        figure = new_figure(9.8, 7.2)
        panels: Any = figure.subplot_mosaic([["fall", "angle"], ["stiffness", "height"]])
        self._falls(panels["fall"], values)
        places = np.arange(len(WORDS))
        angles = panels["angle"]
        heights = panels["height"]
        for shift, (practice, (colour, mark)) in zip((-0.1, 0.1), PRACTICE.items(), strict=True):
            _by_rule(angles, places + shift, values, practice, "angle", mark, colour, f"practised {PLACES[practice]}")
        _by_rule(heights, places - 0.1, values, f"{GUSTS} {CALM}", "height", "s", "0.55", PLACES[CALM])
        _by_rule(heights, places + 0.1, values, GUSTS, "height", "o", "black", PLACES[GUSTS])
        angles.set(ylabel="angle of the foot at landings, rms (°)", ylim=(0, None))
        heights.set(ylabel="height of hops (m)", ylim=(0, None))
        heights.legend(title="frozen, practised with gusts", fontsize=8.5, title_fontsize=8.5)
        angles.legend(fontsize=8.5)
        for axes in (angles, heights):
            axes.set_xticks(places, [words.replace(" in ", "\nin ") for words in WORDS.values()], fontsize=8.5)
            axes.set_xlabel("flexors")
        axes = panels["stiffness"]
        for rule, words in WORDS.items():
            found = [mean_of(values[f"{self.at(each, rule)} angle"]) for each in self.stiffnesses]
            draw_intervals(axes, self.stiffnesses, found, fmt="o-", color=COLOURS[rule], markersize=4, label=words)
        axes.set(xscale="log", xlabel="stiffness of the spring (N m/rad), gusts in proportion")
        axes.set(ylabel="angle of the foot at landings, rms (°)", ylim=(0, None))
        axes.set_xticks(self.stiffnesses, [f"{each:g}" for each in self.stiffnesses])
        axes.xaxis.minorticks_off()
        axes.legend(loc="lower left", ncols=2, fontsize=8.5)
        return figure

    def _falls(self, axes: Axes, values: Values) -> None:
        time, fall = (values[f"{self.stiffness:g} {name}"] for name in ("time", "fall"))
        labels = (f"leans by {LEAN:g}° at the start", f"gust of {self.gust:g} N")
        for traces, style, label in zip(fall, ("-", "--"), labels, strict=True):
            for trace, rule, words in zip(traces, ("flight off", "falling on"), ("silent", "active"), strict=True):
                axes.plot(time, trace, style, color=COLOURS[rule], label=f"{label}, flexors {words}")
        axes.axhline(0.0, color="0.8", linewidth=1, zorder=0)
        axes.set(xlabel=f"time since the drop from {DROP:g} m (s)", ylabel="angle of the foot in the fall (°)")
        axes.legend(fontsize=8)

    def claims(self, values: Values) -> Iterator[Claim]:
        def seen(name: str, quantity: str) -> np.ndarray:
            return values[f"{name} {quantity}"]

        learned = f"{GUSTS} learned"
        own = seen(learned, "angle")
        silenced: Mapping[str, tuple[str, Kind]] = {
            "flight off": ("silent in flight", "thesis"),
            "falling off": ("silent only in the fall", "extension"),
        }
        for rule, (words, kind) in silenced.items():
            angle = seen(f"{GUSTS} {rule}", "angle")
            yield positive(
                f"{STATEMENT}: with flexors {words}, it lands at a greater one.",
                mean_of(angle - own),
                "rms of the angle at landings, difference",
                "°",
                note=f"Means: {angle.mean():.1f}° with flexors {words}, {own.mean():.1f}° as learned.",
                kind=kind,
            )
        for stiffness in self.stiffnesses:
            if stiffness != self.stiffness:
                names = (self.at(stiffness, rule) for rule in ("flight off", "learned"))
                silent, active = (seen(name, "angle") for name in names)
                yield positive(
                    f"So it is with a spring of {stiffness:g} N m/rad: with flexors silent in flight, the foot lands "
                    "at a greater angle.",
                    mean_of(silent - active),
                    "rms of the angle at landings, difference",
                    "°",
                    note=f"Means: {silent.mean():.1f}° with silent flexors, {active.mean():.1f}° as learned.",
                    kind="extension",
                )
        shares = {k: seen(f"{k:g}", "landing")[:, 1] / seen(f"{k:g}", "landing")[:, 0] for k in self.stiffnesses}
        told = "; ".join(
            ", ".join(f"{share[row]:.2g} at {k:g} N m/rad" for k, share in shares.items()) + f" ({what})"
            for row, what in enumerate(FALLS)
        )
        yield below(
            1,
            f"In a fall from {DROP:g} m, active flexors alone bring the foot closer to level, whether the body leans "
            "at its start or a gust pushes it.",
            exact(max(share.max() for share in shares.values())),
            f"rms of the angle in the last {LAST:g} s, with active flexors relative to silent ones, greatest of all",
            note=f"Relative angles: {told}.",
            kind="extension",
        )
        held = seen(f"{GUSTS} falling on", "angle")
        yield positive(
            "Learned policies do not level the foot as far as flexors can: with flexors active throughout the fall, it "
            "lands at a smaller angle.",
            mean_of(own - held),
            "rms of the angle at landings, difference",
            "°",
            note=f"Means: {own.mean():.1f}° as learned, {held.mean():.1f}° with active flexors.",
            kind="extension",
        )
        yield positive(
            "A landing at an angle costs height: the more the foot tilts, the lower the next hop.",
            mean_of(100 * seen(learned, "loss")),
            "by how much a hop is lower for every degree at the landing before it",
            "cm",
            kind="extension",
        )
        heights = {name: seen(f"{GUSTS} {name}", "height") for name in (f"{CALM} learned", "learned")}
        calm, windy = heights.values()
        yield positive(
            "Gusts make hops lower.",
            mean_of(calm - windy),
            "height of hops in calm air, less that with gusts",
            "m",
            note=f"Means: {calm.mean():.2f} m and {windy.mean():.2f} m.",
            kind="extension",
        )
        flexes, without = (seen(f"{practice} learned", "flexes") for practice in (GUSTS, CALM))
        yield more_than_half(
            "Learned flexors are active for most of the fall.",
            mean_of(flexes),
            "share of the decisions in the fall at which the flexors are active",
            kind="extension",
        )
        yield positive(
            "Hoppers that practise with gusts learn to flex more in the fall than those that practise in calm air.",
            mean_of(flexes - without),
            "share of the decisions in the fall, difference",
            note=f"Means: {flexes.mean():.2f} and {without.mean():.2f}.",
            kind="extension",
        )


def _by_rule(
    axes: Axes, places: np.ndarray, values: Values, group: str, quantity: str, mark: str, colour: str, label: str
) -> None:
    """One quantity of each seed, and its mean, by what the flexors do."""
    found = np.stack([values[f"{group} {rule} {quantity}"] for rule in WORDS])
    spread = np.linspace(-0.06, 0.06, found.shape[1])
    axes.plot(places[:, None] + spread, found, mark, color="0.8", markersize=2.5, markeredgewidth=0)
    measured = [mean_of(each) for each in found]
    draw_intervals(axes, places, measured, fmt=mark, color=colour, markersize=5, capsize=3, label=label)
