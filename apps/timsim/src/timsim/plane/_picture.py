"""Pictures of the plane of a particle, as array after array: the still parts are drawn once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import UInt8

from motorgrad.plane import draw_paths, draw_reward, draw_units

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from motorgrad.policies import Policy
    from motorgrad.tasks import ParticleTask

Pixels = UInt8[np.ndarray, "height width 3"]
# pixels, and pixels per inch
SIDE = 480
DPI = 120
RECENT = 60  # decisions of the path that are shown


class Animation:
    """A figure in which only some artists change. It draws them over a stored picture of the rest.

    That is about ten times as fast as drawing everything.

    **Arguments:** `figure`, drawn but for the `moving` artists.
    """

    def __init__(self, figure: Figure, moving: Sequence[Any]) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        self._canvas = FigureCanvasAgg(figure)
        self._figure = figure
        self._moving = moving
        for artist in moving:
            artist.set_animated(True)
        self._canvas.draw()
        self._background = self._canvas.copy_from_bbox(figure.bbox)

    @property
    def pixels(self) -> Pixels:
        """The last picture, as a new array; the first time without the moving artists."""
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()

    def draw(self) -> Pixels:
        """Draw the moving artists as they are now."""
        self._canvas.restore_region(self._background)
        for artist in self._moving:
            (artist.axes or self._figure).draw_artist(artist)
        return self.pixels


class PlanePicture:
    """A square picture of a particle's plane: reward, local units, recent path and position.

    **Arguments:** `task`; `policy`, with as many units as every policy that will be shown; `side` in pixels.
    """

    def __init__(self, task: ParticleTask, policy: Policy, side: int = SIDE) -> None:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(side / DPI, side / DPI), dpi=DPI)
        axes = figure.add_axes((0.02, 0.02, 0.96, 0.96))
        draw_reward(axes, task)
        self._paths = draw_paths(axes, [])
        self._units = draw_units(axes, policy, task.dynamics.forces)
        (self._here,) = axes.plot([], [], "o", color="#d0021b", markersize=7, markeredgecolor="white", zorder=6)
        self._animation = Animation(figure, [*self._paths.artists, *self._units.artists, self._here])
        self.blank = self._animation.pixels
        """The plane with its reward alone."""

    def paint(self, policy: Policy, positions: np.ndarray) -> Pixels:
        """The units of a policy and the last of a particle's positions `(n, 2)`."""
        recent = positions[-RECENT:]
        self._paths.update([recent])
        self._here.set_data(recent[-1:, 0], recent[-1:, 1])
        self._units.update(policy)
        return self._animation.draw()
