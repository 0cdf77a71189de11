"""Layers of the scene that can be switched off, and the pools of meshes that they draw with."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import viser
from viser._messages import SetOrientationMessage, SetPositionMessage

from timsim.live import Session
from timsim.scene._geometry import Shape, identity_quaternions, quaternions_from_z
from timsim.scene._pose import Pose

STILL = 1e-6  # m, and of a quaternion's number: less is no movement
AWAY = 1e-6  # the size of an unused copy: invisible, but with an invertible matrix


class MeshPool:
    """A batched mesh with room for `room` copies; unused ones are shrunk to nothing.

    The mesh is sent once; after that only changes of positions, rotations, sizes and colours are. When more copies are
    needed than there is room for, the pool is added again with twice the room.

    Opacities stay as they are: viser's client makes the material of a batched mesh, and with it the whole mesh, again
    whenever one changes, and until that is done the mesh is missing from the picture.

    **Arguments:** `scene`: viser's; `name` of the node; `shape`: the mesh; `room`; `shadow`: whether it casts shadows;
    `opacity`: in [0, 1] of all copies, or `(n,)` of each copy, repeated when there are more; None where nothing is seen
    through.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        name: str,
        shape: Shape,
        room: int,
        *,
        shadow: bool = True,
        opacity: float | np.ndarray | None = None,
    ) -> None:
        self._scene, self._name, self._shape, self._opacity = scene, name, shape, opacity
        self._shadow = shadow
        self._visible = True
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
        """viser's handle; None before the first `show`."""
        return self._handle

    def show(self, position: np.ndarray, turn: np.ndarray | None, size: np.ndarray, colour: np.ndarray) -> None:
        """Show as many copies as there are rows.

        **Arguments:** `position` `(n, 3)`; quaternions `turn` `(n, 4)`, or None where copies are never turned; `size`
        `(n, 3)`; and `colour` `(n, 3)` as RGB in [0, 1], or as the bytes of `sent_colour`.
        """
        count = len(position)
        if count > self._room or self._handle is None:
            while self._room < count:
                self._room *= 2
            self._handle = self._add()
        room = self._room
        self._send("positions", _filled(position, (room, 3), 0.0))
        if turn is not None:
            self._send("wxyzs", _filled(turn, (room, 4), (1.0, 0.0, 0.0, 0.0)))
        if self._is_new("scales", size):
            self._send("scales", _filled(size, (room, 3), AWAY))
        if self._is_new("colors", colour):
            colours = np.zeros((room, 3), np.uint8)
            colours[:count] = colour if colour.dtype == np.uint8 else sent_colour(colour)
            self._send("colors", colours)

    def _is_new(self, name: str, values: np.ndarray) -> bool:
        """Whether an array may differ from the one before: the same array, if it is `unchanging`, does not."""
        known = values is self._given.get(name)
        self._given[name] = None if values.flags.writeable else values
        return not known

    def _send(self, name: str, values: np.ndarray) -> None:
        """Send what has changed. viser's own assignment converts and compares each array again, which takes longer than
        all else here; so the array, which nobody changes any more, is given to what that calls in the end.
        """
        if name not in self._sent or not np.array_equal(values, self._sent[name]):
            self._sent[name] = values
            if not self._handle._impl.removed:
                setattr(self._handle._impl.props, f"batched_{name}", values)
                self._handle._queue_update(f"batched_{name}", values)

    def show_balls(self, position: np.ndarray, radius: npt.ArrayLike, colour: npt.ArrayLike) -> None:
        """Show copies of a unit sphere; `radius` `(n,)` and `colour` `(n, 3)` may be the same for all."""
        count = len(position)
        size = np.broadcast_to(np.reshape(radius, (-1, 1)), (count, 3))
        self.show(position, None, size, np.broadcast_to(colour, (count, 3)))

    def show_rods(self, start: np.ndarray, end: np.ndarray, radius: npt.ArrayLike, colour: np.ndarray) -> None:
        """Show copies of a unit rod from `start` `(n, 3)` to `end` `(n, 3)`, of `radius` `(n,)` or one for all."""
        along = end - start
        radius = np.broadcast_to(radius, len(along))
        size = np.stack([radius, radius, np.linalg.norm(along, axis=1)], axis=1)
        self.show((start + end) / 2, quaternions_from_z(along), size, colour)

    def _add(self) -> Any:
        room, shape = self._room, self._shape
        self._sent: dict[str, np.ndarray] = {}
        self._given: dict[str, np.ndarray | None] = {}
        return self._scene.add_batched_meshes_simple(
            self._name,
            shape.vertices,
            shape.faces,
            identity_quaternions(room),
            np.zeros((room, 3), np.float32),
            batched_scales=np.full((room, 3), AWAY, np.float32),
            batched_colors=np.zeros((room, 3), np.uint8),
            batched_opacities=None if self._opacity is None else np.resize(self._opacity, room).astype(np.float32),
            lod="off",
            cast_shadow=self._shadow,
            visible=self._visible,
        )


def unchanging(values: np.ndarray) -> np.ndarray:
    """A read-only array, which a pool need not compare twice."""
    values = np.array(values)
    values.flags.writeable = False
    return values


def sent_colour(colour: np.ndarray) -> np.ndarray:
    """Colours as the bytes that are sent: RGB in linear light, which viser expects for batched copies only."""
    return np.round(255 * _linear(np.nan_to_num(colour))).astype(np.uint8)


def place_nodes(handles: list[Any], position: np.ndarray, turn: np.ndarray, before: np.ndarray | None) -> np.ndarray:
    """Move nodes that have moved, with one comparison for all of them.

    **Arguments:** `handles`, viser's; `position` `(n, 3)`, quaternions `turn` `(n, 4)`; `before`: what this returned
    for them last.

    **Returns** the places, to be given the next time.
    """
    now = np.concatenate([position, turn], axis=1)
    moved = np.arange(len(now)) if before is None else np.flatnonzero(np.any(np.abs(now - before) > STILL, axis=1))
    now = now if before is None else np.where(np.isin(np.arange(len(now)), moved)[:, None], now, before)
    for row in moved:
        impl = handles[row]._impl
        values = now[row].tolist()
        impl.position[:] = values[:3]
        impl.wxyz[:] = values[3:]
        impl.api._queue_scene_message(SetPositionMessage(impl.name, tuple(values[:3])))
        impl.api._queue_scene_message(SetOrientationMessage(impl.name, tuple(values[3:])))
    return now


def _linear(colour: np.ndarray) -> np.ndarray:
    """sRGB colours in linear light, which viser expects for batched copies only."""
    colour = np.clip(colour, 0, 1)
    return np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)


def _filled(rows: np.ndarray, shape: tuple[int, ...], rest: npt.ArrayLike) -> np.ndarray:
    """The rows, then `rest` up to the shape, as float32; values that are not finite become 0."""
    filled = np.empty(shape, np.float32)
    filled[: len(rows)] = rows
    filled[len(rows) :] = rest
    bad = ~np.isfinite(filled)
    if bad.any():
        filled[bad] = 0.0
    return filled


class Layer:
    """Draws one aspect of the bodies in view; switched off, it costs nothing.

    A subclass sets `applies` and makes its `pools` in `build`, and updates them in `draw`.

    **Attributes:** `name`: of its switch, empty where it always shows; `initially_shown`; `applies`: whether there is
    anything to draw; `pools`.
    """

    name: ClassVar[str] = ""
    initially_shown: ClassVar[bool] = True

    def __init__(self) -> None:
        self._shown = self.initially_shown
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
        """viser's handles of what can be dragged, and the geom of each of their copies."""
        return []

    def renew(self, pose: Pose) -> int:
        """A number that changes if the layer must be redrawn at the same moment; called every frame."""
        del pose
        return 0

    def draw(self, pose: Pose) -> None:
        """Show the present moment; called only where the layer applies and is shown."""
