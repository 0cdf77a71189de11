"""Pictures of a body drawn with matplotlib's Agg canvas: one figure, whose artists are moved from frame to frame."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.sim import _framing
from motorgrad.sim._drawing import Drawing
from motorgrad.sim._scenery import SKY

if TYPE_CHECKING:
    import mujoco

DOTS_PER_INCH = 100


class Drawn:
    """Draws one body; the same arguments and methods as `_rendered.Rendered`."""

    def __init__(self, model: mujoco.MjModel, view: _framing.View, which: int, width: int, height: int) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        # a body is drawn level or from straight above: an orthographic ground seen aslant is no line
        above = view.elevation < -60
        axes = _framing.axes(view.azimuth, -90.0 if above else 0.0)
        figure = Figure((width / DOTS_PER_INCH, height / DOTS_PER_INCH), dpi=DOTS_PER_INCH, facecolor=tuple(SKY))
        self._canvas = FigureCanvasAgg(figure)
        self._axes: Any = figure.add_axes((0, 0, 1, 1))
        self._axes.set_axis_off()
        self._screen = axes[:2]
        self._which, self._aspect = which, width / height
        self.look(view)
        line = height / 480 * 2.4
        self._drawing = Drawing(self._axes, model, self._screen, line, 1.0, True)

    def look(self, view: _framing.View) -> None:
        """Take another view, from the same side."""
        self._centres = view.centres[self._which]
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
        self._half = np.abs(signs * view.half @ self._screen.T).max(0)
        # metres from the middle to the sides; the picture's lower and upper halves share what the margins leave
        tall = 2 * self._half[1] / (_framing.DOWNWARDS + _framing.UPWARDS)
        self._reach = max(self._half[0] / _framing.SIDEWAYS, tall * self._aspect)
        self._tall = self._reach / self._aspect
        self._lift = self._tall * (_framing.DOWNWARDS - _framing.UPWARDS) / 2
        self._size = 2 * float(self._half.max())

    def paint(self, frame: int, position: np.ndarray, activation: np.ndarray) -> np.ndarray:
        """The picture `(height, width, 3)`, uint8, of one posture; overwritten by the next."""
        centre = self._centres[frame]
        right, up = self._screen @ centre
        self._axes.set_xlim(right - self._reach, right + self._reach)
        self._axes.set_ylim(up + self._lift - self._tall, up + self._lift + self._tall)
        self._drawing.update(position, activation)
        self._drawing.update_ground(centre, 1.1 * self._reach, self._size)
        self._canvas.draw()
        return np.asarray(self._canvas.buffer_rgba())[..., :3]

    def close(self) -> None:
        """Nothing is held outside Python; here so that both painters are used alike."""
