"""Paint a moving body, and choose the renderer."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from motorgrad._arguments import check_arguments
from motorgrad._errors import check, unknown
from timsim.film._annotations import Arrow, caption
from timsim.film._appearance import check_posture
from timsim.film._drawing import MatplotlibRenderer
from timsim.film._framing import View, bounding_box, find_camera, frame_motions
from timsim.film._gl import ADVICE, GlRenderer, Ground, gl_problem
from timsim.film._motion import NO_MARKS
from timsim.film._viewpoint import Camera, Viewpoint

if TYPE_CHECKING:
    import mujoco


RENDERERS = ("auto", "drawn", "gl")
GROUNDS = ("marked", "plain")
Renderer = Literal["auto", "gl", "drawn"]


def choose_renderer(renderer: str) -> tuple[str, str]:
    """The renderer to use, and why it is the drawn one."""
    if renderer not in RENDERERS:
        raise unknown("renderer", renderer, RENDERERS)
    if renderer == "drawn":
        return "drawn", "Drawn with matplotlib, as requested."
    problem = gl_problem()
    if not problem:
        return "gl", ""
    if renderer == "gl":
        raise RuntimeError(f"renderer = 'gl' does not work here: {problem}. {ADVICE}")
    return "drawn", f"Drawn with matplotlib, without OpenGL: {problem}. {ADVICE}"


def renderer_class(kind: str) -> Any:
    """The class of the renderer "gl" or "drawn"."""
    return {"gl": GlRenderer, "drawn": MatplotlibRenderer}[kind]


def check_picture(
    models: Sequence[mujoco.MjModel], width: int, height: int, camera: Camera, ground: str = "marked"
) -> None:
    """Refuse impossible picture sizes, cameras and grounds. **Raises** `ValueError`."""
    if ground not in GROUNDS:
        raise unknown("ground", ground, GROUNDS)
    for name, value in (("width", width), ("height", height)):
        whole = isinstance(value, int | np.integer) and value >= 64 and value % 2 == 0
        check(whole, name, value, "an even number of pixels, at least 64")
    if isinstance(camera, str):
        for model in models:
            find_camera(model, camera)
    elif camera is not None and not isinstance(camera, Viewpoint) and not callable(camera):
        number = isinstance(camera, int | float | np.number) and np.isfinite(camera)
        check(number, "camera", camera, ALLOWED)


ALLOWED = (
    "the name of a camera of the model, an azimuth in degrees, a Viewpoint or a function that returns one, or None"
)
ROOM = 1.3  # a view is larger than needed by this factor, so that a growing motion seldom needs another


class Painter:
    """Paints pictures of one body while it moves.

    A film knows the whole motion and frames it. A painter frames what it has seen so far and widens its view when the
    body leaves it; a body that goes far is followed in leaps.

    **Arguments:** `model`, of which a copy is painted; `width`, `height`, `camera`, `renderer` and `ground` as of
    `write_film`; a camera that moves is given to `paint`.

    **Attributes:** `renderer` and `note`, as of a `Film`.

    **Raises:** as `write_film` does. `paint` raises `RuntimeError` after `close`. Use it from one thread only.

    ```py
    painter = Painter(model, width=320, height=240)
    picture = painter.paint(data.qpos, activation, left="hopper", right="0.50 s")
    painter.close()
    ```
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        *,
        width: int = 640,
        height: int = 480,
        camera: Camera = None,
        renderer: Renderer = "auto",
        ground: Ground = "marked",
    ) -> None:
        check_arguments(Painter, locals())
        self.renderer, self.note = choose_renderer(renderer)
        check_picture([model], width, height, camera, ground)
        self._viewpoint = camera if isinstance(camera, Viewpoint) else None
        self._ground: Ground = ground
        self._model = model
        self._size = (width, height)
        self._camera = camera if isinstance(camera, str | float | int) else None
        self._seen: list[tuple[np.ndarray, np.ndarray]] = []
        self._view: View | None = None
        self._backend: Any = None
        self._closed = False

    def paint(
        self,
        position: np.ndarray,
        activation: np.ndarray,
        left: str = "",
        right: str = "",
        marks: np.ndarray = NO_MARKS[0],
        viewpoint: Viewpoint | None = None,
        beside: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]] = (),
        arrows: Sequence[Arrow] = (),
    ) -> np.ndarray:
        """Paint one picture.

        **Arguments:** `position` `(nq,)`; `activation` `(nu,)` in [0, 1]; `left` and `right`: text above the body;
        `marks` `(marks, 4)` as of a `Motion`; `viewpoint`, for this picture; `beside`: further bodies of the same
        model, each a position, an activation, and how far it is moved, `(3,)` m, which drawn pictures leave out;
        `arrows` in the scene.

        **Returns:** `(height, width, 3)`, uint8, a new array.
        """
        if self._closed:
            raise RuntimeError("this painter is closed: make another one")
        position, activation = check_posture(self._model, position, activation)
        self._hold(position, marks)
        self._backend.look(viewpoint or self._viewpoint)
        picture = self._backend.paint(0, position, activation, marks, beside, arrows)
        return caption(picture, left, right) if left or right else picture.copy()

    def close(self) -> None:
        """Free the resources of the graphics driver. A second call does nothing."""
        if self._backend is not None:
            self._backend.close()
        self._backend = None
        self._closed = True

    def _hold(self, position: np.ndarray, marks: np.ndarray) -> None:
        """Change the view if the posture leaves the picture."""
        low, high = bounding_box(self._model, position, marks)
        view = self._view
        if view is not None and np.all(np.abs(np.stack([low, high]) - view.centres[0][0]) <= view.half):
            return
        self._seen.append((position.copy(), marks.copy()))
        view = self._frame()
        if np.ptp(view.centres[0], axis=0).any():  # a long path: start again from here
            self._seen = self._seen[-1:]
            view = self._frame()
        self._view = dataclasses.replace(view, half=view.half * ROOM)
        if self._backend is None:
            self._backend = renderer_class(self.renderer)(self._model, self._view, 0, *self._size, self._ground)
        else:
            self._backend.set_view(self._view)

    def _frame(self) -> View:
        positions, marks = map(np.stack, zip(*self._seen, strict=True))
        return frame_motions([self._model], [positions], [marks], self._camera, self._size[0] / self._size[1])
