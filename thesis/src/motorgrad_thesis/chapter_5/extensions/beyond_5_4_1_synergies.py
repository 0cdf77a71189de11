"""Beyond section 5.4.1: synergies extracted from learned gaits, and learning on them with four units."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from motorgrad._errors import check
from motorgrad.bodies import TRIPODS
from motorgrad.schema import count, number
from motorgrad.statistics import mean_of, median_of
from motorgrad.tasks import TRIPOD_SYNERGIES, HexapodSynergy, find_synergies, synergy_matrix
from motorgrad.training import agent_for, evaluate
from motorgrad_thesis._claims import Claim, above, more_than_half, positive
from motorgrad_thesis._experiment import Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_band, new_figure
from motorgrad_thesis.chapter_5.extensions._muscle_study import MuscleStudy
from motorgrad_thesis.chapter_5.hexapod._gait_study import controller_speeds

UNITS = 4
SMOOTH = 12.0
"""Simulated seconds over which the speed during practice is averaged."""

COLOURS = {"found": "#0072B2", "by lot": "#D55E00", "by hand": "#4d4d4d"}
MUSCLES = ("protractor", "levator", "retractor", "depressor")


@experiment("beyond-5.4.1-synergies", "synergies found in learned gaits", "beyond section 5.4.1")
class FoundSynergies(MuscleStudy):
    """The activations of hexapods that learned to walk on 24 muscles are factorised into four synergies each. Other
    hexapods then learn to walk on those four, by OLGARB, from weights of 0. For comparison, some learn on synergies of
    the same sizes with randomly drawn muscles, and some on synergies made by hand.
    """

    gaits: int = count(5, 1, 1000, help="number of hexapods whose gait is factorised, those that get farthest")
    learners: int = count(4, 2, 1000, help="number of hexapods that learn on the synergies of each gait")
    seconds: float = number(600.0, 1, 10**6, unit="simulated s", help="length of the practice on synergies")
    lag: int = count(1, 0, 1_000, unit="decisions", help="delay of the observations in this practice")

    def validate(self) -> None:
        super().validate()
        check(self.gaits <= self.seeds, "gaits", self.gaits, f"at most seeds, {self.seeds}")

    quick = smoke(updates=4, seeds=2, watched=20.0, gaits=1, learners=2, seconds=4.0)

    def run(self, work: Workspace) -> Values:
        found = dict(work.part("synergies", lambda: self._find(work)))
        kinds = {kind: [tuple(words) for words in found[f"{kind} words"]] for kind in ("found", "by lot")}
        kinds["by hand"] = [TRIPOD_SYNERGIES]
        found["controller speed"] = controller_speeds(work, 20.0)["speed"]
        for kind, sets in kinds.items():
            seeds = self.learners * (self.gaits if kind == "by hand" else 1)
            parts = [self._learn(work, f"{kind} {index}", words, seeds) for index, words in enumerate(sets)]
            found["time"] = parts[0]["time"]
            for name in set(parts[0]) - {"time"}:
                found[f"{kind} {name}"] = np.concatenate([part[name] for part in parts])
        return found

    def figure(self, values: Values) -> Figure:
        """Synergies of the gait that gets farthest, synergies made by hand, and what is learned on them."""
        figure = new_figure(9.8, 7.6)
        panels: Any = figure.subplot_mosaic(
            [["found", "found"], ["hand", "hand"], ["practice", "frozen"]],
            height_ratios=[1, 1, 2.2],
            width_ratios=[1.7, 1],
        )
        part = f"{100 * float(values['explained'][0]):.0f} %"
        _matrix(
            panels["found"], values, values["weights"][0], f"found in the gait that gets farthest, {part} explained"
        )
        _matrix(panels["hand"], values, values["hand"], "made by hand: swing and stance of each tripod")
        _practice(panels["practice"], values)
        _frozen(panels["frozen"], values)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        level = float(values["controller speed"][0])
        counts = [len(values[f"{kind} sample net"]) // self.learners for kind in ("found", "by lot")]
        # learners on the synergies of one gait are not independent: they count by their mean
        each = [
            values[f"{kind} sample net"].reshape(count, -1).mean(1)
            for kind, count in zip(("found", "by lot"), counts, strict=True)
        ]
        mode, net = (median_of(values[f"found {kind} net"]) for kind in ("mode", "sample"))
        hand = median_of(values["by hand sample net"])
        yield more_than_half(
            "Four synergies account for most of the activity of 24 muscles in a learned gait.",
            mean_of(values["explained"]),
            "fraction of the activations' sum of squares",
            kind="extension",
        )
        yield above(
            level,
            "On synergies found in learned gaits, four units learn to walk.",
            median_of(values["found sample speed"]),
            "frozen, sampled actions: median speed, against the fixed controller's,",
            "m/s",
            note=f"Net displacement over 20 s: {net.words('m/s')}; with the most probable actions {mode}; on hand-made "
            "synergies "
            f"{hand}.",
            kind="extension",
        )
        yield positive(
            "The synergies themselves help: with randomly drawn muscles, learners get less far.",
            mean_of(each[0] - each[1]),
            "frozen, sampled actions, net displacement over 20 s: mean difference by gait",
            "m/s",
            kind="extension",
        )

    def _find(self, work: Workspace) -> dict[str, Any]:
        """Synergies of the gaits that get farthest, and random ones of the same sizes."""
        run = self.trained(work)
        outcome = evaluate(run, round(self.watched / run.task.period), mode="mode", threads=work.threads)
        assert outcome.control is not None
        best = np.argsort(-np.nan_to_num(outcome.metrics["net"]), kind="stable")[: self.gaits]
        groups = self.task().dynamics.groups
        random = np.random.default_rng(0)
        synergies = [find_synergies(outcome.control[row], UNITS) for row in best]
        words = [each.names(groups) for each in synergies]
        lots = [dict(zip(groups, random.permutation(groups), strict=True)) for _ in words]
        mixed = [
            [" ".join(str(lot[name]) for name in unit.split()) for unit in units]
            for lot, units in zip(lots, words, strict=True)
        ]
        return {
            "groups": np.array(groups),
            "weights": np.stack([each.weights for each in synergies]),
            "explained": np.array([each.explained for each in synergies]),
            "walked": outcome.metrics["net"][best],
            "hand": synergy_matrix(TRIPOD_SYNERGIES, groups),
            "found words": np.array(words),
            "by lot words": np.array(mixed),
        }

    def _learn(self, work: Workspace, name: str, words: Sequence[str], seeds: int) -> dict[str, np.ndarray]:
        """Hexapods that learn on four synergies: their speed during practice, and the walks of the frozen policies."""
        task = HexapodSynergy(synergies=tuple(str(unit) for unit in words), lag=self.lag)
        run = work.train(task, agent_for(task), round(self.seconds / task.period), seeds)
        time, speed = run.curve("speed", x="simulated", smooth=SMOOTH)
        judged = self.judged(work, run, name)
        kept = {key.removeprefix(f"{name} "): values for key, values in judged.items()}
        return {"time": time, "practice": speed, **kept}


def _matrix(axes: Axes, values: Values, weights: np.ndarray, title: str) -> None:
    """Weights by unit and muscle, grouped by tripod."""
    groups = [str(name) for name in values["groups"]]
    order = [groups.index(f"{muscle}_{leg}") for tripod in TRIPODS for muscle in MUSCLES for leg in tripod]
    axes.imshow(weights[:, order], cmap="Blues", vmin=0, vmax=1, aspect="auto")
    legs = len(TRIPODS[0])
    for start in range(0, len(order), legs):
        axes.axvline(start - 0.5, color="0.3" if start == len(order) // 2 else "0.85", linewidth=1.2)
    names = [muscle + "s" for _ in TRIPODS for muscle in MUSCLES]
    axes.set_xticks(np.arange(1, len(order), legs), names, fontsize=8)
    axes.set_yticks(range(len(weights)), [f"unit {index + 1}" for index in range(len(weights))], fontsize=8)
    axes.tick_params(length=0)
    axes.set_title(f"{title} (left: the first tripod's muscles, right: the second's)", fontsize=9)


def _practice(axes: Axes, values: Values) -> None:
    for kind, colour in COLOURS.items():
        curves = values[f"{kind} practice"]
        draw_band(axes, values["time"], curves, colour, f"synergies {kind}, {len(curves)} seeds")
    level = float(values["controller speed"][0])
    axes.axhline(level, color="0.3", linewidth=0.9, linestyle=(0, (5, 3)), label="fixed controller")
    axes.set(xlabel="simulated time of practice (s)", ylabel="speed along the heading (m/s)", ylim=(0, None))
    axes.set_xlim(0, values["time"][-1])
    axes.legend(loc="upper left", fontsize=8, title="medians and quartiles", title_fontsize=8)


def _frozen(axes: Axes, values: Values) -> None:
    rows = [(kind, mode) for kind in COLOURS for mode in ("sample", "mode")]
    for place, (kind, mode) in enumerate(rows):
        net = values[f"{kind} {mode} net"]
        across = place + 0.25 * np.linspace(-1, 1, len(net))
        face = COLOURS[kind] if mode == "sample" else "none"
        axes.plot(across, net, "o", color=COLOURS[kind], markerfacecolor=face, markersize=4, alpha=0.75)
        axes.plot([place - 0.32, place + 0.32], [np.median(net)] * 2, color=COLOURS[kind], linewidth=2)
    axes.set_xticks(
        range(len(rows)), [f"{kind},\n{'sampled' if mode == 'sample' else 'mode'}" for kind, mode in rows], fontsize=7.5
    )
    axes.set(ylabel="net displacement over 20 s, frozen (m/s)", ylim=(-0.05, None))
