"""Framing: what a following camera looks at, and how far away it must stand, for a motion that is still going on."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from timsim.scene._pose import Pose

STILL = 3.0  # a range up to this many body sizes is framed as a whole, as in films; beyond, the body is followed
MAX_FRAMED_DISTANCE = 4.0  # in body sizes, from the followed point; what goes farther is let go
FILL = 0.72  # the share of half the picture that the range fills; the rest is a margin, and for the lag of the camera
MEMORY = 300  # moments from which a new frame starts: ten seconds of a page
HEADROOM = 0.7  # body sizes above the bodies for their labels, while two are compared


class Moment(NamedTuple):
    """Where bodies are: their `centre` `(3,)` of mass and the `box` `(2, 3)` around them, in m; how many `bodies`."""

    centre: np.ndarray
    box: np.ndarray
    bodies: int


def moment_of(pose: Pose) -> Moment | None:
    """The present moment; None where there is nothing to frame, or its place is not known."""
    if not pose.bodies:
        return None
    centres, boxes = pose.centres, pose.boxes
    apart = centres - pose.offset - (centres[0] - pose.offset[0])  # of two that part, the first is followed
    near = np.linalg.norm(apart, axis=1) <= MAX_FRAMED_DISTANCE * pose.size
    low = boxes[near, 0].min(0)
    high = boxes[near, 1].max(0)
    if len(centres) > 1:
        high[2] += HEADROOM * pose.size
    found = Moment(centres[near].mean(0), np.stack([low, high]), len(centres))
    return found if np.isfinite(found.centre).all() and np.isfinite(found.box).all() else None


class History:
    """The last moments of a motion, from which every new camera starts.

    **Attributes:** `now`, the present moment; None where it is not known.
    """

    def __init__(self) -> None:
        self.now: Moment | None = None
        self._moments: deque[Moment] = deque(maxlen=MEMORY)
        self._last: tuple[int, int, int] | None = None

    def __iter__(self) -> Iterator[Moment]:
        return iter(list(self._moments))

    def add(self, pose: Pose) -> None:
        """Remember the present moment, unless it is known already."""
        assert pose.snapshot is not None
        here = pose.snapshot.decision, pose.snapshot.reset_count, len(pose.bodies)
        if here == self._last:
            return
        self._last = here
        self.now = moment_of(pose)
        if (now := self.now) is None:
            return
        if self._moments and self._moments[-1].bodies != now.bodies:
            self._moments.clear()
        self._moments.append(now)


CORNERS = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
"""The corners of a box, `(8, 3)`, as signs."""


UPWARDS = np.array([0.0, 0.0, 1.0])


class Framing:
    """The frame of a motion so far.

    Along each axis it is the whole range of the motion while that is short. A body that goes farther, or `travels`, is
    followed, and its frame is what it needs around its centre of mass.

    **Arguments:** `size` of one body, in m; `travels`: whether the body is free to go away; `up` `(3,)`: the direction
    that is up in the picture.

    **Attributes:** `target` `(3,)`, the middle of the frame; `half` `(3,)`, half its sides, in m.
    """

    def __init__(self, size: float, travels: bool, up: np.ndarray = UPWARDS) -> None:
        self._size = size
        self._travels = travels
        self._up = up
        self._count = 0
        self.target = np.zeros(3)
        self.half = np.full(3, size / 2)
        self._asked: tuple[Any, ...] = ()
        self._needed = 0.0

    def see(self, moment: Moment) -> None:
        """Widen the frame for a moment; another number of bodies begins a new frame."""
        centre, (low, high) = moment.centre, moment.box
        around = np.minimum(
            np.maximum(high - centre, centre - low), MAX_FRAMED_DISTANCE * self._size * max(1, moment.bodies / 2)
        )
        if moment.bodies != self._count:
            self._count, self._low, self._high, self._around = moment.bodies, low, high, around
        self._low = np.minimum(self._low, low)
        self._high = np.maximum(self._high, high)
        self._around = np.maximum(self._around, around)
        room = STILL * max(self._size, float(np.linalg.norm(high - low)))
        still = (self._high - self._low <= room) & (not self._travels)
        self.target = np.where(still, (self._low + self._high) / 2, centre)
        self.half = np.where(still, (self._high - self._low) / 2, self._around)

    def distance(self, towards: np.ndarray, fov: float, aspect: float) -> float:
        """How far from the target a camera must be so that the frame is in its picture, in m.

        **Arguments:** `towards` `(3,)`: the direction from the target to the camera, which stands upright; `fov`: from
        the lower to the upper edge of the picture, in rad; `aspect`: width over height.
        """
        asked = (towards.tobytes(), self.half.tobytes(), fov, aspect)
        if asked != self._asked:  # in most frames neither the range nor the view changes
            near = towards / np.linalg.norm(towards)
            right = np.cross(self._up, near)
            right = right / np.linalg.norm(right) if np.linalg.norm(right) > 1e-6 else np.array([1.0, 0.0, 0.0])
            across, up, depth = (CORNERS * self.half @ np.stack([right, np.cross(near, right), near]).T).T
            slope = FILL * np.tan(fov / 2)
            self._needed = float(np.max(depth + np.maximum(np.abs(up), np.abs(across) / aspect) / slope))
            self._asked = asked
        return self._needed


def framing_of(history: History, pose: Pose, travels: bool, up: np.ndarray = UPWARDS) -> Framing:
    """The frame of a motion so far."""
    framing = Framing(pose.size, travels, up)
    framing.target = pose.centre
    for moment in history:
        framing.see(moment)
    return framing
