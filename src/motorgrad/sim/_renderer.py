"""Which renderer makes a picture, and what may be asked of it."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from motorgrad._errors import check, unknown
from motorgrad.sim import _framing, _gl

if TYPE_CHECKING:
    import mujoco

RENDERERS = ("auto", "drawn", "gl")

Camera = str | float | None
Renderer = Literal["auto", "gl", "drawn"]


def choose(renderer: str) -> tuple[str, str]:
    """The renderer to use, and the note on why it is the drawn one."""
    if renderer not in RENDERERS:
        raise unknown("renderer", renderer, RENDERERS)
    if renderer == "drawn":
        return "drawn", "Drawn with matplotlib, as asked for."
    problem = _gl.gl_problem()
    if not problem:
        return "gl", ""
    if renderer == "gl":
        raise RuntimeError(f"renderer = 'gl' does not work here: {problem}. {_gl.ADVICE}")
    return "drawn", f"Drawn with matplotlib, without OpenGL: {problem}. {_gl.ADVICE}"


def brush_of(kind: str) -> Any:
    """The class that makes the pictures: `Rendered` for "gl", `Drawn` for "drawn"."""
    if kind == "gl":
        from motorgrad.sim._rendered import Rendered as Brush
    else:
        from motorgrad.sim._drawn import Drawn as Brush
    return Brush


def check_picture(models: Sequence[mujoco.MjModel], width: int, height: int, camera: Camera) -> None:
    """Refuse a size or a camera that cannot be."""
    for name, value in (("width", width), ("height", height)):
        whole = isinstance(value, int | np.integer) and value >= 64 and value % 2 == 0
        check(whole, name, value, "an even whole number of pixels, at least 64")
    if isinstance(camera, str):
        for model in models:
            _framing.find_camera(model, camera)
    elif camera is not None:
        number = isinstance(camera, int | float | np.number) and np.isfinite(camera)
        check(number, "camera", camera, "the name of a camera of the model, an azimuth in degrees, or None")
