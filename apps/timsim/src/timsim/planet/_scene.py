"""A planet in the page: tiles that follow the cameras of all browsers, and the ground for walkers."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from timsim.planet._body import PLANET, OnPlanet, has_planet
from timsim.planet._detail import Camera, Cover, select_tiles
from timsim.planet._geometry import Ellipsoid, Frame, quaternion
from timsim.planet._planet import FIELD, Planet
from timsim.planet._tiles import CELLS, TRIANGLES, Key, make_tile, mesh_errors, tile_glb

if TYPE_CHECKING:
    import mujoco
    import viser

    from motorgrad.tasks import Task
    from timsim.live import Session, Snapshot
    from timsim.scene import Pose

GroundAt = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def ground_finder(task: Task | None, model: mujoco.MjModel | None, pose: Pose) -> GroundAt | None:
    """For a task on a planet, a function from a place `(3,)` to the point of the ground under it and the upward
    direction there, in the coordinates of the scene; None for others.
    """
    body = getattr(task, "dynamics", None)
    if model is None or not isinstance(body, OnPlanet):
        return None
    surface = body.planet.surface
    first = int(model.joint(PLANET).qposadr[0])

    def ground_at(place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        frame = Frame.of_pose(pose.bodies[0].qpos[first : first + 7])
        offset = pose.offset[0]
        way = surface.ellipsoid.foot(frame.to_planet(np.asarray(place) - offset))
        ground = frame.to_local(surface.points(way)) + offset
        return ground, frame.rotation @ surface.ellipsoid.normals(way)

    return ground_at


SETTLE = 1.0  # s after which a sent tile is assumed to have arrived
_SAFE = 1.5  # errors are sampled; elsewhere they may be somewhat larger
_READ = 0.5  # s between two updates of the numbers shown
_SHADOW = 0.35


class PlanetScene:
    """Draws the planet under a body, as a part of the page; it draws nothing unless the task's body is `OnPlanet`.

    The planet is placed as the body's posture tells, so that all other parts keep local coordinates. Each update finds
    the tiles that all cameras need, sends some of the missing ones, and shows the best of those that have arrived.

    **Attributes:** `triangles` shown now; `milliseconds` of the last update; `tiles` that browsers have.
    """

    def __init__(self) -> None:
        self._planet: Planet | None = None
        self.triangles = 0
        self.milliseconds = 0.0
        self.tiles = 0

    @property
    def applies(self) -> bool:
        """Whether there is a planet, after `build`."""
        return self._planet is not None

    def build(self, server: viser.ViserServer, session: Session) -> None:
        """Add the planet's node, and a folder "Planet" that shows its cost."""
        body = getattr(session.task, "dynamics", None)
        if session.model is None or not isinstance(body, OnPlanet) or not has_planet(session.model):
            return
        planet = body.planet
        self._planet, self._server, self._detail = planet, server, planet.detail
        self._errors = _SAFE * mesh_errors(planet.surface, deepest(planet))
        self._cover = Cover(planet.detail.cache, SETTLE)
        self._handles: dict[Key, Any] = {}
        self._frame: Frame | None = None
        self._cameras: list[Camera] = []
        self._node = server.scene.add_frame("/planet", show_axes=False)
        with server.gui.add_folder("Planet"):
            self._cost = server.gui.add_text("Triangles", "", disabled=True)
            self._time = server.gui.add_text("Update", "", disabled=True)
        self._read = 0.0

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        """Place the planet under the body and send what the cameras need, within the budget."""
        if self._planet is None or not pose.bodies:
            return
        begin = time.perf_counter()
        model = pose.model
        assert model is not None
        data = pose.bodies[0]
        address = int(model.joint(PLANET).qposadr[0])
        frame = Frame.of_pose(data.qpos[address : address + 7])
        if self._frame is None or any(np.any(a != b) for a, b in zip(frame, self._frame, strict=True)):
            self._frame = frame
            self._middle = self._planet.ground.write(model, frame)
            with self._server.atomic():
                self._node.position = frame.shift + pose.offset[0]
                self._node.wxyz = quaternion(frame.rotation)
        # so that contacts that the page computes are with the ground under the body
        data.mocap_pos[model.body(FIELD).mocapid[0]] = self._middle
        self._draw(frame, pose.offset[0], begin)
        self.milliseconds = 1e3 * (time.perf_counter() - begin)
        self._tell()

    def _draw(self, frame: Frame, offset: np.ndarray, begin: float) -> None:
        planet, detail = self._planet, self._detail
        assert planet is not None
        clients = list(self._server.get_clients().values())
        cameras = [each for client in clients if (each := _camera(client, frame, offset, planet.ellipsoid)) is not None]
        self._cameras = cameras or self._cameras or [_overview(planet)]
        most = detail.triangles // TRIANGLES
        wanted = select_tiles(planet.surface, self._errors, self._cameras, detail.tolerance, most)
        plan = self._cover.plan(wanted, time.monotonic())
        sent = []
        for key in plan.send[: detail.changes]:
            if sent and 1e3 * (time.perf_counter() - begin) > detail.milliseconds:
                break
            self._send(key)
            sent.append(key)
        with self._server.atomic():
            for key, handle in self._handles.items():
                if handle.visible != (key in plan.show):
                    handle.visible = key in plan.show
            for key in plan.drop:
                self._handles.pop(key).remove()
        self._cover.note(sent, plan.drop, time.monotonic())
        self.triangles = TRIANGLES * len(plan.show)
        self.tiles = len(self._handles)

    def _send(self, key: Key) -> None:
        """Send a tile, hidden until it has arrived; its skirts reach below the coarsest possible neighbour."""
        assert self._planet is not None
        coarsest, coarser, own = (float(self._errors[level]) for level in (0, max(0, key.level - 1), key.level))
        tile = make_tile(self._planet.surface, key, coarser + own, coarsest)
        name = f"/planet/{key.level}_{key.face}_{key.column}_{key.row}"
        place: Any = tuple(map(float, tile.centre))
        self._handles[key] = self._server.scene.add_glb(
            name, tile_glb(tile), position=place, visible=False, cast_shadow=False, receive_shadow=_SHADOW
        )

    def _tell(self) -> None:
        """Show the cost on the page, at a readable rate."""
        if time.monotonic() - self._read > _READ:
            self._read = time.monotonic()
            self._cost.value = f"{self.triangles:,} of {self._detail.triangles:,}"
            self._time.value = f"{self.milliseconds:.1f} ms, {self.tiles} tiles"


def deepest(planet: Planet) -> int:
    """The deepest level of tiles: its cells are at most half of those that the body feels."""
    longest = planet.ellipsoid.greatest * np.pi / 2.0 / CELLS
    return max(0, int(np.ceil(np.log2(2.0 * longest / planet.cell))))


def _camera(client: viser.ClientHandle, frame: Frame, offset: np.ndarray, ellipsoid: Ellipsoid) -> Camera | None:
    """A browser's camera in the planet's coordinates; None until it has reported its position."""
    import viser.transforms as vt

    try:
        camera = client.camera
        turn = vt.SO3(camera.wxyz).as_matrix()
        place = np.array(camera.position)
        seen = Camera(
            frame.to_planet(place - offset),
            frame.rotation.T @ turn,
            float(camera.fov),
            float(camera.aspect),
            int(camera.image_height),
        )
    except (AssertionError, ZeroDivisionError):
        return None
    if seen.pixels <= 0 or not (np.isfinite(seen.position).all() and seen.aspect > 0.0 and 0.0 < seen.fov < np.pi):
        return None
    # otherwise the page would clip the far parts of a large planet
    far = 1.1 * (float(np.linalg.norm(seen.position)) + ellipsoid.greatest)
    if far > camera.far:
        camera.far = 2.0 * far
    return seen


def _overview(planet: Planet) -> Camera:
    """A camera that shows the whole planet, for recordings without a browser."""
    up = planet.start.rotation[2]
    turn = np.stack([planet.start.rotation[1], planet.start.rotation[0], -up], axis=1)
    return Camera(3.0 * planet.ellipsoid.greatest * up, turn, np.pi / 3.0, 1.0, 720)
