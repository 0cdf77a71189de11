"""Pictures of a body as it moves, from a renderer that stays open."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad._errors import check
from motorgrad.sim import _framing
from motorgrad.sim._caption import caption
from motorgrad.sim._renderer import Camera, Renderer, brush_of, check_picture, choose

if TYPE_CHECKING:
    import mujoco

ROOM = 1.3  # a view holds so much more than what made it, so that a growing motion seldom asks for another


class Painter:
    """Pictures of one body as it moves, from a renderer that stays open: for a motion that is not over yet.

    A film knows the whole motion and frames that. A painter frames what it has seen, and widens its view when the body
    leaves it; a body that goes far is followed in leaps.

    **Arguments:** `model`, of which a copy is painted; `width`, `height`, `camera` and `renderer` as of `film`.

    **Attributes:** `renderer` and `note`, as of a `Film`.

    **Raises:** as `film` does. `paint` raises `RuntimeError` after `close`. Use it from one thread.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        *,
        width: int = 640,
        height: int = 480,
        camera: Camera = None,
        renderer: Renderer = "auto",
    ) -> None:
        self.renderer, self.note = choose(renderer)
        check_picture([model], width, height, camera)
        self._model, self._camera, self._size = model, camera, (width, height)
        self._seen: list[np.ndarray] = []
        self._view: _framing.View | None = None
        self._brush: Any = None
        self._closed = False

    def paint(self, position: np.ndarray, activation: np.ndarray, left: str = "", right: str = "") -> np.ndarray:
        """One picture.

        **Arguments:** `position` `(nq,)`; `activation` `(nu,)` in [0, 1]; what to write `left` and `right` above it.

        **Returns:** `(height, width, 3)`, uint8; yours to keep.
        """
        if self._closed:
            raise RuntimeError("this painter is closed: make another one")
        nq, nu = self._model.nq, self._model.nu
        position, activation = np.asarray(position, float), np.asarray(activation, float)
        check(position.shape == (nq,), "position.shape", position.shape, f"({nq},): (nq of the model,)")
        check(activation.shape == (nu,), "activation.shape", activation.shape, f"({nu},): (actuators,)")
        self._hold(position)
        picture = self._brush.paint(0, position, activation)
        return caption(picture, left, right) if left or right else picture.copy()

    def close(self) -> None:
        """Free what the graphics driver holds; a second time does nothing."""
        if self._brush is not None:
            self._brush.close()
        self._brush, self._closed = None, True

    def _hold(self, position: np.ndarray) -> None:
        """Take a view that holds the posture, if the present one does not."""
        low, high = _framing.box(self._model, position)
        view = self._view
        if view is not None and np.all(np.abs(np.stack([low, high]) - view.centres[0][0]) <= view.half):
            return
        self._seen.append(position.copy())
        view = self._frame()
        if np.ptp(view.centres[0], axis=0).any():  # a long path: begin again from here
            self._seen = [position.copy()]
            view = self._frame()
        self._view = dataclasses.replace(view, half=view.half * ROOM)
        if self._brush is None:
            self._brush = brush_of(self.renderer)(self._model, self._view, 0, *self._size)
        else:
            self._brush.look(self._view)

    def _frame(self) -> _framing.View:
        return _framing.frame([self._model], [np.stack(self._seen)], self._camera, self._size[0] / self._size[1])
