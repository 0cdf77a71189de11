"""A camera at any place: its position, its target and its field of view."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from motorgrad._errors import check
from motorgrad.schema import Settings, number, static

Triple = tuple[float, float, float]


@dataclasses.dataclass(frozen=True)
class Viewpoint(Settings):
    """A camera at any place, such as that of a browser showing a live page.

    **Raises:** `ValueError` for numbers that are not finite, a target at the position, or `up` along the line of sight.

    ```py
    Viewpoint(position=(2.0, -2.0, 1.0), target=(0.0, 0.0, 0.5))
    ```
    """

    position: Triple = static(unit="m", help="where it stands, in world coordinates")
    target: Triple = static(unit="m", help="what it looks at, in world coordinates")
    field_of_view: float = number(45.0, 1, 170, unit="degrees", help="from the lower to the upper edge of the picture")
    up: Triple = static(
        (0.0, 0.0, 1.0), help="the direction that is up in the picture; only its part across the line of sight counts"
    )

    def validate(self) -> None:
        check(self.distance > 0, "target", self.target, "a point other than the position")
        across = np.linalg.norm(np.cross(self.up, np.subtract(self.position, self.target)))
        check(across > 1e-9, "up", self.up, "a direction other than the line of sight")

    @property
    def distance(self) -> float:
        """From the position to the target, in m."""
        return math.dist(self.position, self.target)

    @property
    def axes(self) -> np.ndarray:
        """Rows: the picture's right, its up, and towards the viewer; `(3, 3)`."""
        towards = np.subtract(self.position, self.target) / self.distance
        right = np.cross(self.up, towards)
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(towards, right), towards])

    @property
    def azimuth(self) -> float:
        """The heading in degrees, as of MuJoCo's free camera: at 90 it looks along +y."""
        right = self.axes[0]
        return math.degrees(math.atan2(right[0], -right[1]))

    @property
    def elevation(self) -> float:
        """The elevation of the line of sight above the horizon, in degrees; negative downwards."""
        return math.degrees(-math.asin(min(1.0, max(-1.0, self.axes[2][2]))))

    def for_aspect(self, seen: float, aspect: float) -> Viewpoint:
        """The same camera for a picture of another aspect ratio. It shows at least the same scene.

        **Arguments:** `seen` and `aspect`: width over height of the picture that was seen, and of the new one.
        """
        wider = max(1.0, seen / aspect) * math.tan(math.radians(self.field_of_view) / 2)
        return dataclasses.replace(self, field_of_view=min(170.0, 2 * math.degrees(math.atan(wider))))


Moving = Callable[[float], Viewpoint]
"""A camera that moves: a function of the time on a motion's clock, in s."""
Camera = str | float | Viewpoint | Moving | None
"""A camera of the model by name, an azimuth in degrees, a viewpoint that stays or moves, or one that is to be found."""


def viewpoint_at(camera: Camera, time: float) -> Viewpoint | None:
    """The viewpoint of a camera at a time; None for a camera of the model or one that is to be found."""
    found = camera(time) if callable(camera) else camera
    return found if isinstance(found, Viewpoint) else None
