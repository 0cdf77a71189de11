"""Beyond section 5.3.4: the hexapod learns to walk on 24 independent muscles."""

from collections.abc import Iterator
from typing import Any, Literal, get_args

import numpy as np

from motorgrad._errors import check
from motorgrad.schema import count, static
from motorgrad.statistics import mean_of, median_of
from motorgrad_thesis._claims import Claim, at_least, at_most, in_every, negative, positive
from motorgrad_thesis._experiment import Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_band, new_figure
from motorgrad_thesis.chapter_5.extensions._muscle_study import ACTION_LABELS, FULL, SMOOTH, MuscleStudy

COLOURS = ("#000000", "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")
SPEED = 1.8
NET = 1.6
"""Targets for the most probable actions: median speed along the heading and net displacement, m/s."""

THESIS = "section 5.3.4"
CHANGES = {
    "mirror tie": "A learner whose left and right sides share parameters gets farther.",
    "Euclidean": "The plain gradient, with steps of the same divergence, gets less far than the natural one.",
    "no critic": "Without a critic, learning gets less far.",
    "no lag": "Without a lag of the observations, learning gets less far.",
    "seven inputs": "With only six lateral angles and a bias as inputs, learning gets less far than with all senses.",
}
Changed = Literal["mirror tie", "Euclidean", "no critic", "no lag", "seven inputs"]
HELPS = ("mirror tie",)
"""Changes that should help; the others remove something."""


@experiment("beyond-5.3.4-muscles", "twenty-four independent muscles", "beyond section 5.3.4")
class Muscles(MuscleStudy):
    """Hexapods learn to walk on 24 muscles that fire independently, without prior knowledge: their speed during
    learning, and the walks of the frozen policies from a fresh start. For comparison, learners with one change each.
    """

    compared: int = count(
        5, 2, 1000, help="number of seeds of each changed learner; they are compared with as many of the unchanged one"
    )
    variants: tuple[Changed, ...] = static(get_args(Changed), help="the changed learners, by name")

    def validate(self) -> None:
        super().validate()
        check(self.compared <= self.seeds, "compared", self.compared, f"at most seeds, {self.seeds}")

    quick = smoke(updates=4, seeds=2, watched=20.0, compared=2, variants=("mirror tie", "no critic"))

    def run(self, work: Workspace) -> Values:
        found: Values = {"variants": np.array(self.variants), "compared": np.array(self.compared)}
        for variant in (FULL, *self.variants):
            run = self.trained(work, variant, None if variant == FULL else self.compared)
            found[f"{variant} time"], found[f"{variant} practice"] = run.curve("speed", x="simulated", smooth=SMOOTH)
            found |= self.judged(work, run, variant)
        return found

    def figure(self, values: Values) -> Figure:
        """Speed during learning; and speed and net displacement of every frozen policy."""
        figure = new_figure(9.8, 7.2)
        panels: Any = figure.subplot_mosaic([["practice", "practice"], ["mode", "sample"]], height_ratios=[1, 1.15])
        names = [FULL, *(str(name) for name in values["variants"])]
        _practice(panels["practice"], values, names)
        for mode in ACTION_LABELS:
            _frozen(panels[mode], values, names, mode)
        panels["mode"].set_ylabel("m/s")
        top = 1.15 * max(panels[mode].get_ylim()[1] for mode in ACTION_LABELS)  # room for the legends
        for mode in ACTION_LABELS:
            panels[mode].set_ylim(-0.05, top)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        yield from muscle_claims(values)
        yield from ablation_claims(values)


def _practice(axes: Axes, values: Values, names: list[str]) -> None:
    for name, colour in zip(names, COLOURS, strict=False):
        curves = values[f"{name} practice"]
        if name == FULL:
            draw_band(axes, values[f"{name} time"], curves, colour, f"{name}, {len(curves)} seeds")
        else:
            axes.plot(values[f"{name} time"], np.median(curves, 0), color=colour, linewidth=1.2, label=name)
    changed = f"; changed learners, {int(values['compared'])} seeds each" if len(names) > 1 else ""
    axes.set(
        xlabel="simulated time of practice (s)",
        ylabel="speed along the heading (m/s)",
        ylim=(0, None),
        xlim=(0, values[f"{FULL} time"][-1]),
    )
    axes.legend(loc="upper left", ncols=2, title=f"medians{changed}", title_fontsize=8.5)


def _frozen(axes: Axes, values: Values, names: list[str], mode: str) -> None:
    """For each learner two columns of marks, one mark per seed, with medians as bars."""
    for place, (name, colour) in enumerate(zip(names, COLOURS, strict=False)):
        for shift, quantity, filled in ((-0.17, "speed", False), (0.17, "net", True)):
            found = values[f"{name} {mode} {quantity}"]
            across = place + shift + 0.12 * np.linspace(-1, 1, len(found))
            face = colour if filled else "none"
            axes.plot(across, found, "o", markersize=3.8, color=colour, markerfacecolor=face, alpha=0.75)
            axes.plot([place + shift - 0.15, place + shift + 0.15], [np.median(found)] * 2, color=colour, linewidth=2)
    axes.set_xticks(range(len(names)), [name.replace(" ", "\n") for name in names], fontsize=8)
    axes.plot([], [], "o", color="0.4", markersize=3.8, markerfacecolor="none", label="speed along the heading")
    axes.plot([], [], "o", color="0.4", markersize=3.8, label="net displacement over 20 s")
    axes.set_title(ACTION_LABELS[mode])
    axes.legend(loc="upper right", fontsize=8, handletextpad=0.2)


def muscle_claims(values: Values) -> Iterator[Claim]:
    """Claims about the learner itself."""
    mode, sample = (_quantities(values, kind) for kind in ("mode", "sample"))
    net = median_of(mode["net"])
    counts = zip(*np.unique(mode["gait"], return_counts=True), strict=True)
    gaits = f"Gaits with the most probable actions: {', '.join(f'{kind} {count}' for kind, count in counts)}."
    seeds = len(mode["speed"])
    yield at_most(
        0.1,
        "Learning the activation of each of 24 muscles is intractable without prior knowledge.",
        net,
        "median net displacement with the most probable actions",
        "m/s",
        note="No synergies and no symmetry are given, and all weights start at 0. The thesis did not have this "
        "learner.",
        source=THESIS,
    )
    yield at_least(
        SPEED,
        "Twenty-four independent muscles learn to walk fast.",
        median_of(mode["speed"]),
        "most probable actions: median speed along the heading",
        "m/s",
        note=gaits,
        kind="extension",
    )
    yield at_least(
        NET,
        "The learned walks lead somewhere.",
        net,
        "most probable actions: median net displacement over 20 s",
        "m/s",
        note=f"With sampled actions: speed {median_of(sample['speed']).words('m/s')}, net displacement "
        f"{median_of(sample['net']).words('m/s')}.",
        kind="extension",
    )
    yield in_every(
        "No hexapod stalls with its most probable actions.",
        mode["stalls"] <= 0,
        "share of these seeds without a second below 0.3 m/s",
        note=f"Fraction of all seconds; {np.count_nonzero(mode['stalls'] > 0)} of {seeds} seeds have such a second. "
        f"Falls: {np.count_nonzero(mode['falls'] > 0)} seeds.",
        kind="extension",
    )


def ablation_claims(values: Values) -> Iterator[Claim]:
    """Claims about the changed learners, compared with the unchanged one on the same seeds."""
    count = int(values["compared"])
    for variant in values["variants"]:
        ours, theirs = (values[f"{name} mode net"][:count] for name in (FULL, variant))
        yield (positive if variant in HELPS else negative)(
            CHANGES[str(variant)],
            mean_of(theirs - ours),
            "most probable actions, net displacement over 20 s: difference from the unchanged learner",
            "m/s",
            kind="extension",
            note=f"Medians: {np.median(theirs):.2f} against {np.median(ours):.2f} m/s; speed along the heading "
            f"{np.median(values[f'{variant} mode speed']):.2f} against "
            f"{np.median(values[f'{FULL} mode speed'][:count]):.2f}.",
        )


def _quantities(values: Values, mode: str) -> dict[str, np.ndarray]:
    return {name: values[f"{FULL} {mode} {name}"] for name in ("speed", "net", "stalls", "falls", "gait")}
