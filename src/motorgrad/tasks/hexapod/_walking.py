"""What all walking tasks share: the muscle-driven hexapod, its mirror image, and the synergies of its tripods."""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar, Literal

import numpy as np
from jaxtyping import Array, Bool, Float

from motorgrad._errors import check
from motorgrad.bodies import LEGS, TRIPODS, HexapodReading
from motorgrad.bodies import Hexapod as HexapodBody
from motorgrad.schema import inner
from motorgrad.tasks._host_task import BodyTask
from motorgrad.tasks._task import Metric, Mirror


def _other_side(name: str) -> str:
    sides = {"left": "right", "right": "left"}
    return "_".join(sides.get(word, word) for word in name.split("_"))


# Angles of legs are positive forward and up on both sides, so they keep their signs.
_SWAPPED = tuple(LEGS.index(_other_side(leg)) for leg in LEGS)
_LEGS = (_SWAPPED, (1,) * len(LEGS))
_TURN = ((0,), (-1,))
_MIRRORED: dict[str, tuple[tuple[int, ...], tuple[int, ...]]] = {
    "lateral": _LEGS,
    "current": _LEGS,
    "contact": _LEGS,
    "yaw": _TURN,
    "course": _TURN,
    "vertical": _LEGS,
    "velocity": ((*_SWAPPED, *(len(LEGS) + image for image in _SWAPPED)), 2 * _LEGS[1]),
    "trunk": (tuple(range(8)), (1, -1, 1, -1, 1, -1, 1, -1)),
}
TRIPOD_SYNERGIES = tuple(
    " ".join(f"{muscle}_{leg}" for muscle in muscles for leg in tripod)
    for tripod in TRIPODS
    for muscles in (("protractor", "levator"), ("retractor", "depressor"))
)
"""Swing (lift and protract) and stance (depress and retract) of the first tripod, then of the second."""


@dataclasses.dataclass(frozen=True)
class WalkingTask(BodyTask):
    """A task on a muscle-driven hexapod: rewarded for distance, ended when the trunk overturns."""

    episodic: ClassVar[bool] = True
    metric_units: ClassVar[Mapping[str, str]] = {"speed": "m/s", "falls": "1/s"}

    body: HexapodBody = inner(factory=HexapodBody, help="the hexapod (`motorgrad.bodies.Hexapod`), driven by muscles")

    def validate(self) -> None:
        super().validate()
        check(self.body.drive == "muscles", "body.drive", self.body.drive, "'muscles'")

    def check_limits(self, shortest: float, longest: float, **usual: float) -> None:
        """Refuse a greatest duration below the least, and `usual` durations that do not lie between them, in s."""
        check(shortest <= longest, "longest", longest, f"at least {shortest!r} s")
        for name, value in usual.items():
            check(shortest <= value <= longest, name, value, f"from {shortest!r} to {longest!r} s")

    def joint_range(self, freedom: Literal["lateral", "vertical"], scale: float) -> list[tuple[float, float]]:
        """The least and greatest angle of a joint of each leg, divided by `scale` (degrees)."""
        joints = [getattr(self.body.sections[leg.partition("_")[2]].leg, freedom).range for leg in LEGS]
        return [(low / scale, high / scale) for low, high in joints]

    def walking_metrics(self, reading: HexapodReading) -> dict[str, Metric]:
        """`speed`: along the heading, m/s. `falls`: how often the trunk overturns per second."""
        return {"speed": (reading.speed, True), "falls": (overturned(reading) / self.period, True)}


def overturned(reading: HexapodReading) -> Bool[Array, "..."]:
    """Whether the trunk lies on its back or side."""
    return reading.upright < 0.0


def hexapod_mirror(
    senses: Iterable[str], groups: Sequence[str], drives: Float[np.ndarray, "units groups"] | None
) -> Mirror | None:
    """The mirror of a hexapod's task; `None` if a unit has no counterpart for the mirror image of its muscles.

    **Arguments:** the senses in the order of observation; the names of the groups of muscles; which groups each unit
    drives, `None` for one each.
    """
    inputs: list[int] = []
    signs: list[int] = []
    for sense in senses:
        images, own = _MIRRORED[sense]
        inputs += [len(inputs) + image for image in images]
        signs += own
    matrix = np.eye(len(groups)) if drives is None else drives
    mirrored = matrix[:, [groups.index(_other_side(group)) for group in groups]]
    # a row with the number of equal ones before it, so that equal rows are matched in order
    own, image = (
        [(row, rows[:n].count(row)) for n, row in enumerate(rows)] for rows in (matrix.tolist(), mirrored.tolist())
    )
    if any(each not in own for each in image):
        return None
    return Mirror(tuple(inputs), tuple(signs), tuple(own.index(each) for each in image))
