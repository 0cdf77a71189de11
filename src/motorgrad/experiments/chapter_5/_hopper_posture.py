"""The hopper standing at rest with its knees at a given angle."""

import numpy as np

from motorgrad.bodies import Hopper


def posture(body: Hopper, interior: float) -> np.ndarray:
    """The coordinates `(6,)` with both knees at `interior` (rad) and the sole on the floor."""
    knee = interior - np.pi / 2
    rise = 2 * body.link_length * (np.sin(interior / 2) - np.sin(np.pi / 4))
    return np.array([rise, -knee / 2, knee, -knee / 2, -knee / 2, knee])
