"""Beyond section 5.3.4: the hexapod learns to walk on 24 muscles with all senses of joints and trunk."""

import dataclasses
from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np

from motorgrad.schema import count
from motorgrad.statistics import median_of
from motorgrad.tasks import Hexapod, HexapodProprioception
from motorgrad_thesis._claims import Claim, at_least, in_every
from motorgrad_thesis._experiment import Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_band, new_figure
from motorgrad_thesis.chapter_5.extensions._muscle_study import ACTION_LABELS, FULL, SMOOTH, MuscleStudy

TARGETS = {"speed": 3.0, "net": 2.5}
"""Medians with sampled actions, m/s."""
LINES = {"speed": ("speed along the heading", "#0072B2"), "net": ("net displacement over 20 s", "#D55E00")}


@experiment("beyond-5.3.4-proprioception", "24 muscles with all senses", "beyond section 5.3.4")
class Proprioception(MuscleStudy):
    """Hexapods learn to walk on 24 muscles that fire independently, and sense angles and velocities of their joints and
    the motion of their trunk: their speed during learning, and the walks of the frozen policies from a fresh start.
    """

    kind: ClassVar[type[Hexapod]] = HexapodProprioception
    first_seed: ClassVar[int] = 50
    """Seeds 0 to 49 were judged with earlier settings, which trained without episodes."""

    updates: int = 1250
    seeds: int = count(50, 2, 1000, help="number of independent hexapods, with seeds from 50 on")

    quick = smoke(updates=4, seeds=2, watched=20.0)

    def run(self, work: Workspace) -> Values:
        run = self.trained(work)
        time, practice = run.curve("speed", x="simulated", smooth=SMOOTH)
        walk = dataclasses.replace(self.task(), time_limit=None)  # training is cut into episodes
        return {"time": time, "practice": practice, **self.judged(work, run.with_task(walk))}

    def figure(self, values: Values) -> Figure:
        """Speed during learning; and speed and net displacement of every frozen policy."""
        figure = new_figure(9.8, 3.9)
        practice, frozen = figure.subplots(1, 2, width_ratios=[1.25, 1], sharey=True)
        draw_band(practice, values["time"], values["practice"], "k", f"median, {len(values['practice'])} seeds")
        practice.set(
            xlabel="simulated time of practice (s)", ylabel="m/s", xlim=(0, values["time"][-1]), title="while learning"
        )
        practice.plot(values["time"], values["practice"].T, color="0.5", linewidth=0.4, alpha=0.6, zorder=0)
        practice.legend(loc="upper left")
        for place, mode in enumerate(reversed(ACTION_LABELS)):
            for shift, (name, (words, colour)) in zip((-0.2, 0.2), LINES.items(), strict=True):
                found = np.sort(values[f"{FULL} {mode} {name}"])
                across = place + shift + 0.15 * np.linspace(-1, 1, len(found))
                label = words if place == 0 else None
                frozen.plot(across, found, "o", markersize=3, color=colour, alpha=0.6, label=label)
                ends = [place + shift - 0.17, place + shift + 0.17]
                frozen.plot(ends, [np.median(found)] * 2, color="k", linewidth=2)
        for name, aim in TARGETS.items():
            frozen.axhline(aim, color=LINES[name][1], linewidth=1, linestyle=":", zorder=0)
        frozen.set_xticks(range(len(ACTION_LABELS)), [*reversed(ACTION_LABELS.values())])
        frozen.set(title="frozen, from a fresh start", ylim=(-0.08, None))
        frozen.legend(loc="lower left", bbox_to_anchor=(0, 0.08))  # above walkers that stall
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        found: dict[str, Any] = {name: values[f"{FULL} sample {name}"] for name in (*TARGETS, "stalls", "falls")}
        probable = {name: median_of(values[f"{FULL} mode {name}"]).words("m/s") for name in TARGETS}
        for name, statement in (("speed", "24 muscles learn to walk fast."), ("net", "Their walks lead somewhere.")):
            yield at_least(
                TARGETS[name],
                statement,
                median_of(found[name]),
                f"sampled actions: median {LINES[name][0]}",
                "m/s",
                note=f"With the most probable actions: {probable[name]}. No synergies and no gait are given, and all "
                "weights start at 0; left and right share their parameters.",
                kind="extension",
            )
        yield in_every(
            "No hexapod stalls with sampled actions.",
            found["stalls"] <= 0,
            "share of these seeds without a second below 0.3 m/s",
            note=f"Falls: {np.count_nonzero(found['falls'] > 0)} seeds. With the most probable actions, "
            f"{np.count_nonzero(values[f'{FULL} mode stalls'] > 0)} seeds have such a second.",
            kind="extension",
        )
