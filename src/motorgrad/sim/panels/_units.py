"""Local units in the plane of a particle, with its reward and its path: what stays is drawn once."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import UInt8

if TYPE_CHECKING:
    from motorgrad.policies import Policy

SIDE, DPI = 480, 120  # pixels, and how many of them an inch has
RECENT = 60  # decisions of the path


def is_local(task: Any, policy: Any) -> bool:
    """Whether a task is a particle's and its policy made of units that have a place in its plane."""
    from motorgrad.sim._plane_units import shapes_of
    from motorgrad.tasks import ParticleTask

    if not isinstance(task, ParticleTask) or policy is None:
        return False
    try:
        shapes_of(policy)
    except ValueError:
        return False
    return True


class UnitsPicture:
    """The plane of a particle as a picture that is painted again and again.

    **Arguments:** the task; a policy, of as many units as all that will be shown; the side in pixels.
    """

    def __init__(self, task: Any, policy: Any, side: int = SIDE) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        from motorgrad.sim._plane import draw_paths, draw_reward, draw_units

        self._figure = Figure(figsize=(side / DPI, side / DPI), dpi=DPI)
        self._canvas = FigureCanvasAgg(self._figure)
        axes = self._figure.add_axes((0.02, 0.02, 0.96, 0.96))
        draw_reward(axes, task)
        self._paths = draw_paths(axes, [])
        self._units = draw_units(axes, policy, task.dynamics.forces)
        (self._here,) = axes.plot([], [], "o", color="#d0021b", markersize=7, markeredgecolor="white", zorder=6)
        self._moving = [*self._paths.artists, *self._units.artists, self._here]
        for artist in self._moving:
            artist.set_animated(True)
        self._canvas.draw()
        self._still = self._canvas.copy_from_bbox(self._figure.bbox)

    @property
    def blank(self) -> UInt8[np.ndarray, "height width 3"]:
        """The plane without anything that moves."""
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()

    def paint(self, policy: Policy, places: np.ndarray) -> UInt8[np.ndarray, "height width 3"]:
        """The units of a policy, and the last of a particle's places `(n, 2)`."""
        recent = places[-RECENT:]
        self._paths.update([recent])
        self._here.set_data(recent[-1:, 0], recent[-1:, 1])
        self._units.update(policy)
        self._canvas.restore_region(self._still)
        for artist in self._moving:
            (artist.axes or self._figure).draw_artist(artist)
        return self.blank
