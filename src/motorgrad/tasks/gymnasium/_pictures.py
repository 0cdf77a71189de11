"""What a Gymnasium environment looks like: the body that MuJoCo moves in it, or its own picture."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

if TYPE_CHECKING:
    import gymnasium

RENDERED = "rgb_array"


def physics_of(environment: gymnasium.Env) -> tuple[Any, Any] | None:
    """MuJoCo's model and data of an environment that has them, typed as Any, as MuJoCo's bindings carry no types."""
    bare: Any = environment.unwrapped
    model = getattr(bare, "model", None)
    data = getattr(bare, "data", None)
    return (model, data) if isinstance(model, mujoco.MjModel) and isinstance(data, mujoco.MjData) else None


def renders(environment: gymnasium.Env) -> bool:
    """Whether an environment says that it can be shown as a picture."""
    return RENDERED in (environment.unwrapped.metadata or {}).get("render_modes", ())


class EnvironmentPictures:
    """Pictures of environments that were made without any: each is as it was before, and goes on as it would have.

    ```py
    pixels = EnvironmentPictures().of(environment)
    ```
    """

    def __init__(self) -> None:
        self._kept: dict[str, Any] = {}
        """What rendering has added to the environment, such as a canvas, to be used again."""

    def of(self, environment: gymnasium.Env) -> np.ndarray:
        """The picture `(height, width, 3)`, uint8, that the environment's `render` makes of its present state.

        **Raises** whatever `render` raises, and `ValueError` where it returns no picture.
        """
        bare: Any = environment.unwrapped
        attributes = vars(bare)
        before = dict(attributes)
        try:
            attributes.update(self._kept)
            bare.render_mode = RENDERED
            picture = np.asarray(bare.render())
            self._kept = {name: x for name, x in attributes.items() if name not in before or before[name] is not x}
        finally:  # a canvas could not be saved with the environment
            attributes.clear()
            attributes.update(before)
        if picture.ndim != 3 or picture.shape[2] < 3 or 0 in picture.shape:
            raise ValueError(f"render returned an array of shape {picture.shape}, but must return (height, width, 3)")
        return np.ascontiguousarray(picture[..., :3], np.uint8)
