"""A window on the screen that shows pictures in real time."""

import os
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

LEAST_RATE = 20.0  # pictures a second of wall time that are drawn even where drawing cannot keep up
_SILENT = ("agg", "cairo", "pdf", "pgf", "ps", "svg", "template")


def screen_problem() -> str:
    """Why no window can be opened here, as far as can be told without trying; empty if one may."""
    backend = os.environ.get("MPLBACKEND", "").lower()
    if backend:
        return f"matplotlib's backend {backend!r} shows nothing" if _shows_nothing(backend) else ""
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return "there is no display (neither DISPLAY nor WAYLAND_DISPLAY is set)"
    return ""


def _shows_nothing(backend: str) -> bool:
    return backend in _SILENT or backend.endswith("backend_inline") or backend == "inline"


class Screen:
    """A matplotlib window of a picture's size.

    **Raises:** `RuntimeError` where no window can be opened, with the reason.
    """

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
        """Show what `paint` makes when `moment` (s, simulated; 0 begins anew) has come on the clock of the wall.

        Where drawing is slower than that, pictures are left out. After the window was closed, nothing happens.
        """
        import matplotlib.pyplot as plt

        now = time.perf_counter()
        if moment == 0:
            self._begun = now
        late = now > self._begun + moment
        if not plt.fignum_exists(self._figure.number) or (late and moment and now - self._drawn < 1 / LEAST_RATE):
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
