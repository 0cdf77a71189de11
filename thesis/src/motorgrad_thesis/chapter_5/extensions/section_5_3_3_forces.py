"""Section 5.3.3: hexapods that learn to walk with stronger or weaker muscles."""

import dataclasses
from collections.abc import Iterator

import numpy as np

from motorgrad._errors import check
from motorgrad.bodies import TOUCH, BodyState, LateralPair, Section, VerticalPair, read_hexapod
from motorgrad.bodies import Hexapod as HexapodBody
from motorgrad.schema import Range, count, number, static
from motorgrad.statistics import mean_of
from motorgrad.tasks import HexapodSynergy
from motorgrad.training import Run, agent_for, evaluate
from motorgrad_thesis._claims import Claim, positive
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_intervals, subplots
from motorgrad_thesis.chapter_5.section_5_2_2 import behind_best

SETTLING = 2.0  # seconds at the start of a walk that are not measured
WAYS = ("all", "lateral")
"""Which muscles are scaled: all, or only the lateral ones."""

ROWS = (
    ("speed", "speed along the heading (m/s)"),
    ("duty", "fraction of the time with\na foot on the ground"),
    ("airborne", "fraction of the time\nin the air"),
    ("belly", "fraction of the time with\nthe belly on the ground"),
)
TITLES = {"all": "all muscles", "lateral": "the lateral muscles alone"}


@experiment("sec-5.3.3-forces", "how strong the muscles are", "section 5.3.3")
class Forces(Experiment):
    """Hexapods learn to walk on four synergies with muscles of several strengths: scaling all muscles, or only the
    lateral ones, which changes the ratio of lateral to vertical force. Speed of the frozen policies, and the fraction
    of the time that their feet are on the ground.
    """

    levels: tuple[float, ...] = static(
        (0.25, 0.5, 1.0, 2.0, 4.0),
        allowed=Range(0, open_low=True),
        help="factors of the standard maximum forces, at least three, rising, 1 among them but not at an end",
    )
    seconds: float = number(200.0, 1, 10**6, unit="simulated s", help="length of every hexapod's practice")
    seeds: int = count(12, 2, 10_000, help="number of hexapods that practise at each level")
    watched: float = number(
        22.0,
        SETTLING + 1,
        10**6,
        unit="simulated s",
        help="length of the walks of the frozen policies, with sampled actions",
    )

    def validate(self) -> None:
        super().validate()
        self.check_rising("levels", 3)
        check(1.0 in self.levels[1:-1], "levels", self.levels, "some with 1 between the ends")

    quick = smoke(levels=(0.5, 1.0, 2.0), seconds=3.0, seeds=2, watched=4.0)

    def task(self, lateral: float, vertical: float) -> HexapodSynergy:
        """The task with scaled muscle forces."""
        pairs = {
            "lateral_muscles": LateralPair(LateralPair.protractor * lateral, LateralPair.retractor * lateral),
            "vertical_muscles": VerticalPair(VerticalPair.levator * vertical, VerticalPair.depressor * vertical),
        }

        def strengthened(section: Section) -> Section:
            return dataclasses.replace(section, leg=dataclasses.replace(section.leg, **pairs))

        return HexapodSynergy(body=HexapodBody().map_sections(strengthened))

    def run(self, work: Workspace) -> Values:
        found: Values = {"levels": np.array(self.levels)}
        for way in WAYS:
            each = []
            for level in self.levels:
                task = self.task(level, level if way == "all" else 1.0)
                run = work.train(task, agent_for(task), round(self.seconds / task.period), self.seeds)
                each.append(work.part(f"{way} x {level:g}", lambda run=run: self._watch(work, run)))
            found |= {f"{way} {name}": np.stack([one[name] for one in each]) for name in each[0]}
        return found

    def _watch(self, work: Workspace, run: Run) -> Values:
        """Walks of the frozen policies of all seeds, (seeds,) each."""
        outcome = evaluate(run, round(self.watched / run.task.period), threads=work.threads)
        reading = read_hexapod(BodyState(outcome.position, None, outcome.sensors or {}))
        late = outcome.time > SETTLING
        feet = (reading.contact[:, late] > TOUCH).any(axis=-1)
        belly = reading.belly[:, late] > TOUCH
        place = reading.position[:, late, :2]
        seconds = run.task.period * (place.shape[1] - 1)
        return {
            "speed": reading.speed[:, late].mean(axis=1),
            "net": np.linalg.norm(place[:, -1] - place[:, 0], axis=-1) / seconds,
            "duty": outcome.motion_metrics["duty"],
            "airborne": (~feet & ~belly).mean(axis=1),
            "belly": belly.mean(axis=1),
            "falls": outcome.metrics["falls"] * self.watched,
            "gait": outcome.motion_metrics["gait"],
            "diverged": run.curve("diverged")[1].sum(axis=1),
        }

    def figure(self, values: Values) -> Figure:
        """Speed and contact against force: of all muscles (left), of the lateral ones alone (right); `usual` is the
        standard value of each."""
        usual = {"all": LateralPair().retractor, "lateral": LateralPair().retractor / VerticalPair().depressor}
        figure, axes = subplots(9, 9.8, len(ROWS), 2, sharex="col", sharey="row")
        levels = values["levels"]
        for column, (way, title) in enumerate(TITLES.items()):
            for row, (name, words) in enumerate(ROWS):
                _against(axes[row, column], levels, values[f"{way} {name}"])
                if not column:
                    axes[row, 0].set_ylabel(words)
            axes[0, column].set_title(title)
        lateral = usual["all"] * levels
        ratio = usual["lateral"] * levels
        vertical = usual["all"] / usual["lateral"] * levels
        axes[-1, 0].set_xticks(levels, [f"{a:.0f}\n{b:.0f}" for a, b in zip(lateral, vertical, strict=True)])
        axes[-1, 0].set_xlabel("maximum force of lateral (above)\nand vertical muscles (below), N")
        axes[-1, 1].set_xticks(levels, [f"{one:.2g}" for one in ratio])
        axes[-1, 1].set_xlabel("lateral over vertical force")
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        usual = values["levels"].tolist().index(1.0)
        most = f"{values['levels'][-1]:g}"
        levels = values["levels"]
        every = values["all speed"]
        lateral = values["lateral speed"]
        net, falls = ([values[f"{way} {name}"][-1].mean() for way in WAYS] for name in ("net", "falls"))
        medians = {way: _medians(values, way) for way in WAYS}
        yield positive(
            "Beyond a point, more force of all muscles slows the hexapod down.",
            mean_of(behind_best(every, -1)),
            f"deficit at {most} times the force relative to the best inner level",
            "m/s slower",
            note=f"The best level for each seed is that of the other seeds. Medians: {medians['all']}.",
        )
        yield positive(
            "More force of the lateral muscles without more of the vertical ones slows it down.",
            mean_of(lateral[usual] - lateral[-1]),
            f"deficit at {most} times the lateral force relative to the standard force",
            "m/s slower",
            note=f"Medians: {medians['lateral']}.",
        )
        yield positive(
            "The reason is that the vertical muscles do not match.",
            mean_of(every[-1] - lateral[-1]),
            f"at {most} times the lateral force, gain with {most} times the vertical force",
            "m/s faster",
            note=f"Net displacement {net[0]:.2f} m/s with it, {net[1]:.2f} m/s without; overturned {falls[0]:.2g} and "
            f"{falls[1]:.2g} times, after which a body restarts.",
        )
        best = 1 + int(np.argmax(every[1:-1].mean(axis=1)))
        for way, words, level in (("all", "of all muscles", best), ("lateral", "of the lateral muscles alone", usual)):
            air, belly = (values[f"{way} {name}"].mean(axis=1) for name in ("airborne", "belly"))
            yield positive(
                f"With more force {words}, feet spend less time on the ground.",
                mean_of(values[f"{way} duty"][level] - values[f"{way} duty"][-1]),
                f"reduction from {levels[level]:g} to {most} times the force",
                "of the time",
                note=f"In the air {air[-1]:.0%} of the time instead of {air[level]:.0%}, on the belly {belly[-1]:.0%} "
                f"instead of {belly[level]:.0%}.",
                of="With more force, feet spend less time on the ground.",
            )


def _medians(values: Values, way: str) -> str:
    """Median speeds at all levels, in words."""
    pairs = zip(values["levels"], np.median(values[f"{way} speed"], axis=1), strict=True)
    return ", ".join(f"{speed:.2f} m/s at {level:g}" for level, speed in pairs)


def _against(axes: Axes, levels: np.ndarray, found: np.ndarray) -> None:
    """All seeds, and the mean with its interval, against the level."""
    spread = np.exp(np.linspace(-0.12, 0.12, found.shape[1]))
    axes.plot(levels[:, None] * spread, found, "o", color="0.7", markersize=3.5, markeredgewidth=0)
    draw_intervals(axes, levels, [mean_of(each) for each in found], fmt="o-", color="C0", capsize=3, markersize=5)
    axes.axvline(1.0, color="0.85", linewidth=1, zorder=0)
    axes.set_xscale("log")
    axes.xaxis.minorticks_off()
    axes.set_ylim(bottom=min(0.0, float(found.min())))
