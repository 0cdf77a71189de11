"""What every layer of the scene has: a name to switch it by, pools to draw with."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser

from motorgrad.sim.live import Session
from motorgrad.sim.scene._geometry import Shape, identity_quaternions
from motorgrad.sim.scene._pose import Pose

AWAY = 1e-6  # the size of a copy that is not needed: nothing to see, and no matrix that cannot be inverted


class MeshPool:
    """A batched mesh with room for `room` copies; those beyond what is shown are shrunk to nothing.

    A mesh is sent once; after that only what changed of positions, turns, sizes, colours and opacities is. Asked for
    more copies than there is room for, the pool is added again with twice the room.

    **Arguments:** the viser scene; the node's `name`; the mesh; `room`; whether it throws shadows; whether each copy
    has an opacity of its own.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        name: str,
        shape: Shape,
        room: int,
        *,
        shadow: bool = True,
        faded: bool = False,
    ) -> None:
        self._scene, self._name, self._shape, self._faded = scene, name, shape, faded
        self._shadow, self._visible = shadow, True
        self._room = max(room, 1)
        self._handle: Any = None

    @property
    def visible(self) -> bool:
        """Whether it is shown."""
        return self._visible

    @visible.setter
    def visible(self, value: bool) -> None:
        self._visible = value
        if self._handle is not None:
            self._handle.visible = value

    @property
    def handle(self) -> Any:
        """viser's handle; None before something was shown."""
        return self._handle

    def show(
        self,
        position: np.ndarray,
        turn: np.ndarray,
        size: np.ndarray,
        colour: np.ndarray,
        opacity: np.ndarray | None = None,
    ) -> None:
        """Show as many copies as there are rows: place `(n, 3)`, quaternion `(n, 4)`, size `(n, 3)`, RGB `(n, 3)` in
        [0, 1], and opacity `(n,)` where copies have their own."""
        count = len(position)
        if count > self._room or self._handle is None:
            while self._room < count:
                self._room *= 2
            self._handle = self._add()
        room, handle = self._room, self._handle
        handle.batched_positions = _filled(position, (room, 3), 0.0)
        handle.batched_wxyzs = _filled(turn, (room, 4), (1.0, 0.0, 0.0, 0.0))
        handle.batched_scales = _filled(size, (room, 3), AWAY)
        handle.batched_colors = np.round(255 * _linear(_filled(colour, (room, 3), 0.0))).astype(np.uint8)
        if self._faded:
            handle.batched_opacities = _filled(np.ones(count) if opacity is None else opacity, (room,), 0.0)

    def _add(self) -> Any:
        room, shape = self._room, self._shape
        return self._scene.add_batched_meshes_simple(
            self._name,
            shape.vertices,
            shape.faces,
            identity_quaternions(room),
            np.zeros((room, 3), np.float32),
            batched_scales=np.full((room, 3), AWAY, np.float32),
            batched_colors=np.zeros((room, 3), np.uint8),
            batched_opacities=np.ones(room, np.float32) if self._faded else None,
            lod="off",
            cast_shadow=self._shadow,
            visible=self._visible,
        )


def _linear(colour: np.ndarray) -> np.ndarray:
    """Colours as amounts of light: viser takes those of copies so, and all other colours as sRGB."""
    colour = np.clip(colour, 0, 1)
    return np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)


def _filled(rows: np.ndarray, shape: tuple[int, ...], rest: Any) -> np.ndarray:
    """The rows, then `rest` up to the shape; float32, and nothing that is not finite."""
    filled = np.empty(shape, np.float32)
    filled[: len(rows)] = rows
    filled[len(rows) :] = rest
    bad = ~np.isfinite(filled)
    if bad.any():
        filled[bad] = 0.0
    return filled


class Layer:
    """Draws something about the bodies in view, and can be switched off; switched off, it costs nothing.

    A subclass says in `build` whether it `applies` and makes its `pools`; `draw` assigns to them.

    **Attributes:** `name`, of its switch, empty where it always shows; `applies`, whether there is anything to draw;
    `pools`.
    """

    name = ""

    def __init__(self, shown: bool = True) -> None:
        self._shown = shown
        self.applies = False
        self.pools: list[MeshPool] = []

    @property
    def shown(self) -> bool:
        """Whether it is switched on."""
        return self._shown

    @shown.setter
    def shown(self, value: bool) -> None:
        self._shown = value
        self.switch(value)

    def switch(self, shown: bool) -> None:
        """Show or hide what was drawn."""
        for pool in self.pools:
            pool.visible = shown

    def build(self, server: viser.ViserServer, session: Session) -> None:
        """Add the nodes, once."""
        raise NotImplementedError

    def draggable(self) -> list[tuple[Any, np.ndarray]]:
        """What can be taken hold of: viser's handles, and of which geom each copy is."""
        return []

    def draw(self, pose: Pose) -> None:
        """Show the present moment; called only where the layer applies and is shown."""
