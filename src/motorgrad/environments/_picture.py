"""Pictures of an environment, as arrays or in a window."""

import os
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from motorgrad._applications import PICTURES, offered
from motorgrad.bodies import actuator_levels, group_places
from motorgrad.environments._rows import Rows

MIN_PICTURE_RATE = 20.0  # pictures per second of wall time that are drawn even if drawing cannot keep up
_SILENT = ("agg", "cairo", "pdf", "pgf", "ps", "svg", "template")


def screen_problem() -> str:
    """Why no window can be opened here, as far as is known without trying; empty if one may."""
    backend = os.environ.get("MPLBACKEND", "").lower()
    if backend:
        return f"matplotlib's backend {backend!r} shows nothing" if _shows_nothing(backend) else ""
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return "there is no display (neither DISPLAY nor WAYLAND_DISPLAY is set)"
    return ""


class Screen:
    """A matplotlib window of a picture's size. **Raises** `RuntimeError` with the reason if no window can be opened."""

    def __init__(self, title: str, width: int, height: int):
        problem = screen_problem()
        try:
            import matplotlib.pyplot as plt

            backend = plt.get_backend().lower()
            if not problem and _shows_nothing(backend):
                problem = f"matplotlib's backend {backend!r} shows nothing"
            if not problem:
                size = (width / 100, height / 100)
                self._figure: Any = plt.figure(num=title, figsize=size, dpi=100, clear=True)
        except Exception as error:  # every toolkit has its own
            problem = f"{type(error).__name__}: {error}"
        if problem:
            raise RuntimeError(
                f"render_mode = 'human': no window can be opened, {problem}; render_mode='rgb_array' needs none"
            )
        axes = self._figure.add_axes((0, 0, 1, 1))
        axes.set_axis_off()
        self._image = axes.imshow(np.zeros((height, width, 3), np.uint8))
        self._begun = self._drawn = -np.inf

    def show(self, paint: Callable[[], np.ndarray], moment: float) -> None:
        """Show the result of `paint` when the wall clock reaches `moment` (s, simulated; 0 restarts the clock). Frames
        are dropped if drawing is too slow. After the window was closed, nothing happens."""
        import matplotlib.pyplot as plt

        now = time.perf_counter()
        if moment == 0:
            self._begun = now
        late = now > self._begun + moment
        if not plt.fignum_exists(self._figure.number) or (late and moment and now - self._drawn < 1 / MIN_PICTURE_RATE):
            return
        if np.isinf(self._drawn):
            self._figure.show()
        self._image.set_data(paint())
        self._figure.canvas.draw()
        self._figure.canvas.flush_events()
        self._drawn = time.perf_counter()
        time.sleep(max(0.0, self._begun + moment - self._drawn))

    def close(self) -> None:
        """Close the window."""
        import matplotlib.pyplot as plt

        plt.close(self._figure)


class Picture:
    """Pictures of rows: on demand (`"rgb_array"`), or of the first row on the screen (`"human"`). **Raises**
    `ValueError` for a task without a body or an invalid size, `RuntimeError` for `"human"` without a screen."""

    def __init__(self, rows: Rows, mode: str, width: int, height: int):
        if rows.body is None:
            raise ValueError(f"render_mode = {mode!r}: must be None, as task {rows.task.name!r} has no body to show")
        self._rows = rows
        body = rows.body.body
        self._group_of = group_places(body)
        self._painter = offered("painter", *PICTURES)(rows.body.model, width=width, height=height)
        self._action = np.zeros((rows.body.seeds, len(body.groups)))
        self._screen = Screen(f"motorgrad: {rows.task.name}", width, height) if mode == "human" else None

    def note(self) -> None:
        """Record the last input of the simulations; with a screen, show the picture."""
        self._action[...] = self._rows.activation[:, : self._action.shape[1]]
        if self._screen is not None:
            self._screen.show(lambda: self.paint(0), self._rows.decisions[0] * self._rows.period)

    def paint(self, row: int) -> np.ndarray:
        """The picture of a row, with its simulated time."""
        body = self._rows.body
        assert body is not None
        state = body.unpack(body.packed[row])
        time = self._rows.decisions[row] * self._rows.period
        level = actuator_levels(body.model, self._action[row][self._group_of], state.activation)
        return self._painter.paint(state.position, level, "", f"{time:.2f} s")

    def close(self) -> None:
        """Close the window and release graphics resources."""
        self._painter.close()
        if self._screen is not None:
            self._screen.close()


def _shows_nothing(backend: str) -> bool:
    return backend in _SILENT or backend.endswith("backend_inline") or backend == "inline"
