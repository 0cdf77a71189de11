"""Section 5.3.3: the fixed controller over varying terrain."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from motorgrad._errors import check
from motorgrad.bodies import Hexapod, OnTerrain, Terrain, TripodController, walk
from motorgrad.experiments._claim import Claim
from motorgrad.experiments._experiment import Experiment, Values
from motorgrad.experiments._workspace import Workspace
from motorgrad.experiments.chapter_5.hexapod._terrain_claims import controller_claims, kind_claims
from motorgrad.experiments.chapter_5.hexapod._terrain_figure import draw_terrain
from motorgrad.experiments.chapter_5.hexapod._walkers import alike

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KINDS = ("bumps", "slopes", "steps", "waves")
START, LAST = 2.0, 5.0
"""Seconds of a walk that are no part of its gait, and those at its end that say whether it still gets ahead."""
STILL = 0.03
"""The mean speed (m/s) below which a body stands still, the bound of the class stalled."""
WORDINGS = {"mended": True, "worded": False}


@dataclasses.dataclass(frozen=True)
class RoughGround(Experiment):
    """The fixed controller on bumps, slopes, steps and waves of rising difficulty, each seed on ground of its own:
    speed, phase between the tripods, gait, and whether it still walks at the end; with its deadlocks mended, and as
    the thesis words it.

    **Arguments:**

    - `heights` (m): of the ground, rising, at least two; the greatest is difficulty 1.
    - `seconds` (simulated s): length of each walk, from two seconds after its start on.
    - `seeds`: grounds of each kind and height.
    - `clearance` (m): the height up to which the ground counts as passable, one of `heights`; by default about the
      clearance under the belly.
    """

    name: ClassVar[str] = "sec-5.3.3-terrain"
    title: ClassVar[str] = "the fixed controller on uneven ground"
    source: ClassVar[str] = "section 5.3.3"

    heights: tuple[float, ...] = (0.05, 0.1, 0.16, 0.2, 0.25)
    seconds: float = 20.0
    seeds: int = 20
    clearance: float = 0.16

    def __post_init__(self) -> None:
        rising = len(self.heights) >= 2 and self.heights[0] > 0 and bool(np.all(np.diff(self.heights) > 0))
        check(rising, "heights", self.heights, "at least two, above 0 and rising")
        check(self.clearance in self.heights, "clearance", self.clearance, f"one of heights = {self.heights}")
        check(LAST <= self.seconds <= 20, "seconds", self.seconds, f"in {LAST:g} … 20 simulated s: the field ends")
        check(2 <= self.seeds <= 1000, "seeds", self.seeds, "in 2 … 1000")

    @classmethod
    def quick(cls) -> Self:
        return cls(heights=(0.16, 0.25), seconds=5.0, seeds=2)

    def run(self, work: Workspace) -> Values:
        found: Values = {"height": np.array([0.0, *self.heights])}
        for wording, mended in WORDINGS.items():
            level = work.part(f"level {wording}", lambda m=mended: self._walk(alike(self.seeds), m, work.threads))
            for kind in KINDS:
                rows = [level]
                for height in self.heights:
                    part = f"{kind} {100 * height:g} cm {wording}"
                    grounds = self.grounds(kind, height)
                    rows.append(work.part(part, lambda g=grounds, m=mended: self._walk(g, m, work.threads)))
                for quantity in level:
                    found[f"{kind} {wording} {quantity}"] = np.stack([row[quantity] for row in rows])
        return found

    def grounds(self, kind: Any, height: float) -> list[OnTerrain]:
        """The bodies on ground of a kind and a height, of all seeds."""
        steepest = self.heights[-1]
        return [
            OnTerrain(Hexapod(drive="servos"), Terrain(kind, height=steepest, difficulty=height / steepest, seed=seed))
            for seed in range(self.seeds)
        ]

    def _walk(self, bodies: Sequence[Any], mended: bool, threads: int) -> dict[str, Any]:
        """Of each seed (seeds,): gait, speed, net displacement, phase, whether it stands still at the end, whether it
        overturned."""
        found = walk(bodies, TripodController(mended=mended), self.seconds + START, threads=threads)
        gait, late = found.gait(since=START), found.time > found.time[-1] - LAST
        return {
            "gait": gait.kind,
            "speed": gait.speed,
            "net": gait.net,
            "phase": gait.phase,
            "still": found.reading.speed[late].mean(0) < STILL,
            "overturned": (found.reading.upright < 0).any(0),
        }

    def figure(self, values: Values) -> "Figure":
        return draw_terrain(values, KINDS, self.clearance)

    def claims(self, values: Values) -> Sequence[Claim]:
        made = [claim for kind in KINDS for claim in kind_claims(values, kind, self.clearance)]
        return [*made, *controller_claims(values, KINDS, self.clearance)]
