"""The hexapod in the mirror: left legs become right ones, and turns to the left turns to the right."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from motorgrad.bodies import LEGS
from motorgrad.tasks._mirror import Mirror


def _other_side(name: str) -> str:
    sides = {"left": "right", "right": "left"}
    return "_".join(sides.get(word, word) for word in name.split("_"))


_SWAPPED = tuple(LEGS.index(_other_side(leg)) for leg in LEGS)
# Angles of legs are positive forward and up on either side, so they keep their signs.
_IMAGES: dict[str, tuple[tuple[int, ...], int]] = {
    "lateral": (_SWAPPED, 1),
    "current": (_SWAPPED, 1),
    "contact": (_SWAPPED, 1),
    "yaw": ((0,), -1),
    "course": ((0,), -1),
}


def hexapod_mirror(
    senses: Iterable[str], groups: Sequence[str], drives: Float[np.ndarray, "units groups"] | None
) -> Mirror | None:
    """The mirror of a hexapod's task; `None` where a unit's muscles have no unit of their mirror image's.

    **Arguments:** the senses in the order in which they are observed; the names of the groups of muscles; which groups
    each unit drives, `None` for one each.
    """
    inputs: list[int] = []
    signs: list[int] = []
    for sense in senses:
        images, sign = _IMAGES[sense]
        inputs += [len(inputs) + image for image in images]
        signs += [sign] * len(images)
    matrix = np.eye(len(groups)) if drives is None else drives
    outputs = _images(matrix, matrix[:, [groups.index(_other_side(group)) for group in groups]])
    return None if outputs is None else Mirror(tuple(inputs), tuple(signs), outputs)


def _images(matrix: Any, mirrored: Any) -> tuple[int, ...] | None:
    """For each row the place of the one that is its mirror image; of equal rows the first is the first's."""
    own, image = (_counted([tuple(row) for row in rows.tolist()]) for rows in (matrix, mirrored))
    return tuple(own.index(each) for each in image) if set(own) == set(image) else None


def _counted(rows: list[tuple[float, ...]]) -> list[tuple[tuple[float, ...], int]]:
    return [(row, rows[:n].count(row)) for n, row in enumerate(rows)]
