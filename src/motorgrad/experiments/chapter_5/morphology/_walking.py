"""How fast bodies walk under the fixed controller."""

from collections.abc import Mapping, Sequence

import numpy as np

from motorgrad.bodies import Hexapod, HexapodReading, walk
from motorgrad.experiments._experiment import Values
from motorgrad.experiments.chapter_5.morphology._body_space import body_of

SETTLING = 1.0  # s of a walk that are not measured
MEASURES = ("speed", "duty", "tilt")


def walked(candidates: Sequence[Mapping[str, float]], seconds: float, threads: int = 0) -> Values:
    """How bodies with these numbers walk, in so many seconds but for the first.

    **Returns** for each body, NaN for one that cannot be or that diverges: `speed`, the net displacement over the time
    in m/s; `duty`, the part of the time that a foot is on the ground; `tilt`, of the middle section against the ground,
    the root mean square in degrees.
    """
    bodies = [body_of(each) for each in candidates]
    found = {name: np.full(len(bodies), np.nan) for name in MEASURES}
    rows = [row for row, body in enumerate(bodies) if body is not None]
    possible: list[Hexapod] = [body for body in bodies if body is not None]
    if not possible:
        return found
    done = walk(possible, seconds=seconds, threads=threads)
    gait, late = done.gait(since=SETTLING), HexapodReading(*(part[done.time > SETTLING] for part in done.reading))
    tilt = np.rad2deg(np.sqrt((np.arccos(np.clip(late.upright, -1.0, 1.0)) ** 2).mean(axis=0)))
    for name, values in zip(MEASURES, (gait.net, gait.duty, tilt), strict=True):
        found[name][rows] = np.where(done.diverged > 0, np.nan, values)
    return found


def walked_in_turn(candidates: Sequence[Mapping[str, float]], seconds: float, threads: int = 0) -> Values:
    """The same for many bodies, some at a time, so that no memory is needed for all of their walks."""
    parts = [walked(candidates[at : at + 24], seconds, threads) for at in range(0, len(candidates), 24)]
    return {name: np.concatenate([part[name] for part in parts]) for name in MEASURES}
