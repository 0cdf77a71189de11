"""Section 5.3.3: the fixed controller over varying terrain."""

from collections.abc import Iterator, Sequence
from typing import Any, ClassVar

import numpy as np

from motorgrad._errors import check
from motorgrad.bodies import Hexapod, OnTerrain, Terrain, TripodController, walk
from motorgrad.schema import Range, count, number, static
from motorgrad.statistics import mean_of, share_of
from motorgrad_thesis._claims import Claim, Kind, above, at_least, positive
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_intervals, subplots
from motorgrad_thesis.chapter_5.hexapod._gait_study import INDEPENDENT, jittered_hexapods

TERRAIN_KINDS = ("bumps", "slopes", "steps", "waves")
START = 2.0
LAST = 5.0
"""Seconds at the start of a walk that do not count towards its gait, and those at its end that decide whether it still
advances."""

STILL = 0.03
"""Mean speed (m/s) below which a body counts as standing still: the bound of the class stalled."""

WORDINGS = {"worded": False, "mended": True}
WORDING_STYLES = {
    "worded": ("#CC79A7", "s--", "as worded in the thesis"),
    "mended": ("#0072B2", "o-", "a leg at its lower limit counts as touching the ground"),
}
MENDED = " if a leg at its lower limit counts as touching the ground"
"""Our addition, at the end of a statement about it."""
CONSISTENT = 0.75
ROBUST = 0.9
"""Bound of the interval of a share of grounds that counts as consistent (with 20 grounds, at most one exception); and
the least fraction of the speed on level ground that counts as robust."""


@experiment("sec-5.3.3-terrain", "the fixed controller on uneven ground", "section 5.3.3")
class RoughGround(Experiment):
    """The fixed controller on bumps, slopes, steps and waves of increasing difficulty, each seed on its own ground:
    speed, phase between the tripods, gait, and whether it still walks at the end. Once as the thesis words it, legs
    that wait counting as being in the "stance phase"; and once with our addition, by which a leg at its lower limit
    counts as touching the ground.
    """

    reading: ClassVar[str] = (
        '"More than one leg in the stance phase" counts all legs that support the body, those in the states stance and '
        "wait: section 5.3 knows two phases, support and swing."
    )

    heights: tuple[float, ...] = static(
        (0.05, 0.1, 0.16, 0.2, 0.25),
        allowed=Range(0, open_low=True),
        unit="m",
        help="heights of the ground, at least two, rising; the greatest is difficulty 1",
    )
    seconds: float = number(
        20.0, LAST, 20, unit="simulated s", help="length of each walk, after two seconds that do not count"
    )
    seeds: int = count(20, 2, 1000, help="number of grounds of each kind and height")
    clearance: float = number(
        0.16,
        0,
        open_low=True,
        unit="m",
        help="the height up to which the ground counts as passable, one of `heights`; by default about the "
        "clearance under the belly",
    )

    def validate(self) -> None:
        super().validate()
        self.check_rising("heights", 2)
        check(self.clearance in self.heights, "clearance", self.clearance, f"one of heights = {self.heights}")

    quick = smoke(heights=(0.16, 0.25), seconds=5.0, seeds=2)

    def run(self, work: Workspace) -> Values:
        found: Values = {"height": np.array([0.0, *self.heights])}
        for wording, mended in WORDINGS.items():
            level = work.part(
                f"level {wording}", lambda m=mended: self._walk(jittered_hexapods(self.seeds), m, work.threads)
            )
            for kind in TERRAIN_KINDS:
                rows = [level]
                for height in self.heights:
                    part = f"{kind} {100 * height:g} cm {wording}"
                    grounds = self.grounds(kind, height)
                    rows.append(work.part(part, lambda g=grounds, m=mended: self._walk(g, m, work.threads)))
                for quantity in level:
                    found[f"{kind} {wording} {quantity}"] = np.stack([row[quantity] for row in rows])
        return found

    def grounds(self, kind: Any, height: float) -> list[OnTerrain]:
        """Bodies on ground of this kind and height, for all seeds."""
        steepest = self.heights[-1]
        return [
            OnTerrain(Hexapod(drive="servos"), Terrain(kind, height=steepest, difficulty=height / steepest, seed=seed))
            for seed in range(self.seeds)
        ]

    def _walk(self, bodies: Sequence[Any], mended: bool, threads: int) -> dict[str, Any]:
        """For each seed, (seeds,): gait, speed, net displacement, phase, whether it stands still at the end, whether it
        overturned."""
        found = walk(bodies, TripodController(mended=mended), self.seconds + START, threads=threads)
        gait = found.gait(since=START)
        late = found.time > found.time[-1] - LAST
        return {
            "gait": gait.kind,
            "speed": gait.speed,
            "net": gait.net,
            "phase": gait.phase,
            "still": found.reading.speed[late].mean(0) < STILL,
            "overturned": (found.reading.upright < 0).any(0),
        }

    def figure(self, values: Values) -> Figure:
        """Speed, phase, and the shares of grounds with a tripod gait and of those on which it stands still, over the
        height of each kind of ground; means and shares with their intervals."""
        figure, panels = subplots(9.8, 8.6, 4, len(TERRAIN_KINDS), sharex=True, sharey="row")
        for column, kind in zip(panels.T, TERRAIN_KINDS, strict=True):
            for wording, (colour, line, words) in WORDING_STYLES.items():
                gait = values[f"{kind} {wording} gait"]
                phases = zip(values[f"{kind} {wording} phase"], gait != "stalled", strict=True)
                measured = [
                    [mean_of(row) for row in values[f"{kind} {wording} net"]],
                    [mean_of(row[walks]) if walks.sum() > 1 else None for row, walks in phases],
                    [share_of(row) for row in gait == "tripod"],
                    [share_of(row) for row in values[f"{kind} {wording} still"]],
                ]
                for axes, each in zip(column, measured, strict=True):
                    shift = 0.2 if wording == "worded" else -0.2  # so that intervals do not overlap
                    _points(axes, 100 * values["height"] + shift, each, colour, line, words)
            for axes in column:
                axes.axvline(100 * self.clearance, color="0.75", linewidth=0.9, linestyle=":", zorder=0)
            column[0].set_title(kind)
            column[-1].set_xlabel("height (cm)")
        labels = ("net displacement\n/ time (m/s)", "phase of walking\nbodies (cycles)", "share with\na tripod gait")
        for axes, words in zip(panels[:, 0], (*labels, "share that stands\nstill at the end"), strict=True):
            axes.set_ylabel(words)
        panels[0, 0].set_ylim(0, None)
        panels[1, 0].set_ylim(0, 0.52)
        for row in (2, 3):
            panels[row, 0].set_ylim(-0.04, 1.04)
        handles, words = panels[0, 0].get_legend_handles_labels()
        figure.legend(handles, words, loc="outside upper center", ncols=2)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        for kind in TERRAIN_KINDS:
            yield from kind_claims(values, kind, self.clearance)
        yield from controller_claims(values, TERRAIN_KINDS, self.clearance)


def _points(axes: Axes, x: np.ndarray, measured: Sequence[Any], colour: str, line: str, words: str) -> None:
    known = [number for number, each in enumerate(measured) if each is not None]
    style = {"fmt": line, "color": colour, "markersize": 3.5, "linewidth": 1.2, "elinewidth": 0.9, "label": words}
    draw_intervals(axes, x[known], [measured[number] for number in known], **style)


def kind_claims(values: Values, kind: str, clearance: float) -> Iterator[Claim]:
    """Claims about one kind of ground: the thesis's about the controller as it is worded, ours about the mended one."""
    for wording in WORDINGS:
        yield from _wording_claims(values, kind, clearance, wording)


def _wording_claims(values: Values, kind: str, clearance: float, wording: str) -> Iterator[Claim]:
    rows = _rows(values, clearance)
    top = f"{100 * clearance:g} cm"
    gaits = values[f"{kind} {wording} gait"]
    net = values[f"{kind} {wording} net"]
    most = f"{100 * values['height'][-1]:g} cm"
    whose: Kind = "thesis" if wording == "worded" else "extension"
    added = "" if wording == "worded" else MENDED
    phases = ", ".join(f"{phase:.2f}" for phase in values[f"{kind} {wording} phase"][rows].mean(1))
    yield above(
        CONSISTENT,
        f"The controller consistently generates a tripod gait on {kind} up to {top}{added}.",
        share_of((gaits[rows] == "tripod").all(0)),
        f"at every height up to {top}: share of the grounds",
        note=f"Mean phase between the tripods by height: {phases} cycles.",
        kind=whose,
        of="The controller consistently generates a tripod gait over varying terrain.",
    )
    yield above(
        CONSISTENT,
        f"It also does so on {kind} of {most}{added}.",
        share_of(gaits[-1] == "tripod"),
        "share of the grounds",
        note=f"Net speed there {net[-1].mean():.2f} m/s; on level ground {net[0].mean():.2f}.",
        kind="extension",
    )
    modelled = whose == "extension" and kind == "bumps"
    yield at_least(
        ROBUST,
        f"It is robust: {kind} of {top} hardly slow it{added}.",
        mean_of(net[rows][-1] / net[0].mean()),
        "net displacement relative to that on level ground",
        "of the speed on level ground",
        kind="reference model" if modelled else whose,
        source=INDEPENDENT if modelled else "",
        of="The controller is robust: varying terrain hardly slows it.",
    )


def controller_claims(values: Values, kinds: Sequence[str], clearance: float) -> Iterator[Claim]:
    """Claims about the thesis's wording and our addition, over all kinds of ground up to the clearance."""
    rows = _rows(values, clearance)
    top = f"{100 * clearance:g} cm"
    still = {
        wording: np.concatenate([values[f"{kind} {wording} still"][rows].any(0) for kind in kinds])
        for wording in WORDINGS
    }
    stands = {wording: share_of(each) for wording, each in still.items()}
    by_kind = ", ".join(f"{kind} {np.count_nonzero(values[f'{kind} worded still'][rows].any(0))}" for kind in kinds)
    seeds = len(still["mended"]) // len(kinds)
    yield above(
        CONSISTENT,
        f"The controller is robust up to {top}: it does not come to a standstill.",
        share_of(~still["worded"]),
        f"walks at every height up to {top}: share of the grounds",
        note=f"Grounds, of {seeds} each, on which it stands still at the end of any walk: {by_kind}.",
    )
    yield above(
        CONSISTENT,
        f"It does not come to a standstill up to {top}{MENDED}.",
        share_of(~still["mended"]),
        f"walks at every height up to {top}: share of the grounds",
        kind="extension",
    )
    yield positive(
        "That a leg at its lower limit counts as touching the ground keeps the controller walking.",
        mean_of(still["worded"] * 1.0 - still["mended"]),
        "share of grounds on which it stands still, as worded minus with that addition,",
        note=f"{stands['worded'].value:.2f} and {stands['mended'].value:.2f} of the grounds.",
        kind="extension",
    )
    yield above(
        CONSISTENT,
        "It never overturns, at any height.",
        share_of(~np.concatenate([values[f"{kind} {each} overturned"].any(0) for kind in kinds for each in WORDINGS])),
        "share of the grounds",
        kind="extension",
    )


def _rows(values: Values, clearance: float) -> np.ndarray:
    """Indices of the heights above level ground and up to the clearance."""
    height = values["height"]
    return np.flatnonzero((height > 0) & (height <= clearance + 1e-9))
