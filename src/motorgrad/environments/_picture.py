"""Pictures of an environment as it goes."""

import numpy as np

from motorgrad.environments._rows import Rows
from motorgrad.environments._screen import Screen
from motorgrad.sim import Painter


class Picture:
    """The pictures of rows: made when asked for (`"rgb_array"`), or of the first put on the screen (`"human"`).

    **Raises:** `ValueError` for a task without a body, or for a size that cannot be; `RuntimeError` for `"human"` where
    there is no screen.
    """

    def __init__(self, rows: Rows, mode: str, width: int, height: int):
        if rows.body is None:
            raise ValueError(f"render_mode = {mode!r}: must be None, as task {rows.task.name!r} has no body to show")
        self._rows = rows
        body = rows.body.body
        self._group_of = [body.groups.index(muscle.group) for muscle in body.muscles]
        self._painter = Painter(rows.body.model, width=width, height=height)
        self._action = np.zeros((rows.body.seeds, len(body.groups)))
        self._screen = Screen(f"motorgrad: {rows.task.name}", width, height) if mode == "human" else None

    def note(self) -> None:
        """Note what the simulations were told last; on the screen, show it."""
        self._action[...] = self._rows.activation[:, : self._action.shape[1]]
        if self._screen is not None:
            self._screen.show(lambda: self.paint(0), self._rows.decisions[0] * self._rows.period)

    def paint(self, row: int) -> np.ndarray:
        """The picture of a row, with its simulated time."""
        body = self._rows.body
        assert body is not None
        position = body.unpack(body.packed[row]).position
        time = self._rows.decisions[row] * self._rows.period
        return self._painter.paint(position, self._action[row][self._group_of], "", f"{time:.2f} s")

    def close(self) -> None:
        """Close the window and free what the graphics driver holds."""
        self._painter.close()
        if self._screen is not None:
            self._screen.close()
