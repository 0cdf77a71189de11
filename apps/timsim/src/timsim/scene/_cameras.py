"""Cameras: orbit, walk, follow and the model's own. Each browser chooses independently."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import viser
from viser._messages import SetCameraLookAtMessage, SetCameraPositionMessage

from motorgrad._errors import check, unknown
from timsim.film import ABOVE, Viewpoint, camera_axes, ground_height, natural_angles
from timsim.live import Session, Snapshot
from timsim.scene._framing import UPWARDS, History, framing_of
from timsim.scene._guard import Guard
from timsim.scene._own import own
from timsim.scene._pose import Pose

GroundAt = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""A function from a place `(3,)` to the point of the ground under it and the upward direction there."""
DAMPING = 0.25  # s in which a following camera makes up 63 % of its lag
LAG = 0.15  # most that it lags, as a share of half the picture's height, however fast the body goes
HANDS_OFF = 0.25  # s for which a camera that the user turns is left alone
AFRESH = 1.0  # s between two changes of the view of the next browser
UNHEARD = 1800  # distances that wait for a browser's report, at most: a minute's
UNSEEN = 1e-5  # a movement that no picture shows, as a share of the distance
# viser's limits of an orbiting camera's distance to its target
MIN_ORBIT_DISTANCE = 0.01
MAX_ORBIT_DISTANCE = 1e4


class CameraMode:
    """One way to move a camera. `begin` takes over a client's camera, `move` is called every frame, `end` returns it.

    The browser itself moves the camera by viser's mouse and keys, and reports its position about 20 times a second.

    **Attributes:** `awaited`: whether a browser that has just connected has yet to report what it was sent.
    """

    awaited = False

    def begin(self, camera: viser.CameraHandle, pose: Pose) -> None:
        """Take the camera over."""

    def move(self, camera: viser.CameraHandle, pose: Pose) -> None:
        """Correct or move the camera."""

    def end(self, camera: viser.CameraHandle) -> None:
        """Undo anything that the next mode must not inherit."""


class Orbit(CameraMode):
    """Lets the user turn the camera about a fixed target.

    **Arguments:** `history` of the motion, in the middle of which the target is; `travels` and `up` as of `Follow`.
    """

    def __init__(self, history: History, travels: bool, up: np.ndarray = UPWARDS) -> None:
        self._history, self._travels, self._up = history, travels, up

    def begin(self, camera: viser.CameraHandle, pose: Pose) -> None:
        aim(camera, camera.position, framing_of(self._history, pose, self._travels, self._up).target)


class Follow(CameraMode):
    """Keeps the range of the bodies' motion in the picture, from where the user looks at it.

    A body that goes far is followed, with damping, so that the camera does not shake with it, but never by more than
    the margin of the picture. Where the motion grows, the camera moves away; what the user zooms, it keeps.

    **Arguments:** `history` of the motion so far; `travels`: whether the body is free to go away; `up` `(3,)`: the
    direction that is up in the picture.
    """

    def __init__(self, history: History, travels: bool, up: np.ndarray = UPWARDS) -> None:
        self._history, self._travels, self._up = history, travels, up

    def begin(self, camera: viser.CameraHandle, pose: Pose) -> None:
        self._framing = framing_of(self._history, pose, self._travels, self._up)
        self._target = self._framing.target.copy()
        away = camera.position - camera.look_at
        self._towards = away / max(float(np.linalg.norm(away)), 1e-9)
        self._zoom = 1.0
        self._distance = self._needed(camera)
        self._then = time.monotonic()
        self._turned = -np.inf
        self._sent = deque([float(np.linalg.norm(away))], maxlen=UNHEARD)
        """Distances sent since the last one that the browser has reported; a slow browser lags far behind."""
        self._aim(camera)

    def move(self, camera: viser.CameraHandle, pose: Pose) -> None:
        now = time.monotonic()
        if self._history.now is not None:
            self._framing.see(self._history.now)
        self._heed(camera, now)
        part = 1 - np.exp(-(now - self._then) / DAMPING)
        self._then = now
        wanted = self._zoom * self._needed(camera)
        self._distance = max(wanted, self._distance + part * (wanted - self._distance))
        goal = self._framing.target
        lag = (1 - part) * (goal - self._target)
        most = LAG * np.tan(camera.fov / 2) * self._distance
        lag *= min(1.0, most / max(float(np.linalg.norm(lag)), 1e-9))
        self._target = goal - lag
        # sending now would undo a movement that has not been reported yet, but must not lose the body
        lost = np.linalg.norm(camera.look_at - goal) > 2 * most
        if lost or now - self._turned > HANDS_OFF:
            self._aim(camera)

    def _needed(self, camera: viser.CameraHandle) -> float:
        return self._framing.distance(self._towards, camera.fov, camera.aspect)

    def _heed(self, camera: viser.CameraHandle, now: float) -> None:
        """Take over how the user has turned the camera and zoomed; reports of what was sent before do not count."""
        reported_at = camera.update_timestamp
        if reported_at == self._reported_at:  # no report since the last movement, which another thread may have torn
            return
        away = camera.position - camera.look_at
        distance = float(np.linalg.norm(away))
        if camera.update_timestamp != reported_at:
            return
        self._reported_at = reported_at
        if self.awaited and np.linalg.norm(away - distance * self._towards) > 1e-3 * distance:
            return  # from before the browser has heard where to look
        self.awaited = False
        reached = [place for place, sent in enumerate(self._sent) if abs(distance / sent - 1) < 1e-3]
        for _ in range(reached[-1] if reached else 0):  # reports come in order: what was sent before it has passed
            self._sent.popleft()
        zoomed = not 0.999 * min(self._sent) < distance < 1.001 * max(self._sent)
        if distance > 1e-9 and (zoomed or np.linalg.norm(away / distance - self._towards) > 1e-3):
            self._towards = away / distance
            self._turned = now
            if zoomed:
                self._zoom = distance / self._needed(camera)
                self._distance = distance
                self._sent.clear()
                self._sent.append(distance)

    def _aim(self, camera: viser.CameraHandle) -> None:
        if self._sent[-1] != self._distance:
            self._sent.append(self._distance)
        aim(camera, self._target + self._distance * self._towards, self._target)
        self._reported_at = camera.update_timestamp


class Walk(CameraMode):
    """Stands on the ground: viser's keys W, A, S, D walk, the mouse and the arrows look around.

    The camera's target is a point just before it, about which the browser turns it. It is put back at eye height where
    the ground rises or falls.

    **Arguments:** `ground_at`; `height` of the eyes in m.
    """

    START = 2.5  # least distance from the body at the beginning, in its sizes
    REACH = 0.02  # distance of the target, as a share of the height
    LOOSE = 0.03  # tolerance of the height, as a share of it

    def __init__(self, ground_at: GroundAt, height: float) -> None:
        self.ground_at, self.height = ground_at, height
        self._last: tuple[float, np.ndarray] | None = None
        self._speed = np.zeros(3)

    def begin(self, camera: viser.CameraHandle, pose: Pose) -> None:
        # at a distance from which the body is seen as a whole
        away = camera.position - pose.centre
        (_, upright) = self.ground_at(pose.centre)
        flat = away - (away @ upright) * upright
        length = float(np.linalg.norm(flat))
        flat = flat / length if length > 1e-9 else np.array([0.0, -1.0, 0.0])
        ground, up = self.ground_at(pose.centre + max(length, self.START * pose.size) * flat)
        eye = ground + self.height * up
        ahead = pose.centre - eye
        ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-9)
        reach = max(self.REACH * self.height, 2 * MIN_ORBIT_DISTANCE)
        aim(camera, eye, eye + reach * ahead)
        camera.up_direction = up
        camera.min_orbit_distance = 0.99 * reach
        camera.max_orbit_distance = 1.01 * reach

    def move(self, camera: viser.CameraHandle, pose: Pose) -> None:
        place, now = self._place_now(camera)
        ground, up = self.ground_at(place)
        error = self.height - (place - ground) @ up
        if abs(error) > self.LOOSE * self.height:
            ahead = camera.look_at - camera.position
            target = place + error * up
            aim(camera, target, target + ahead)
            self._last = (now, target)

    def _place_now(self, camera: viser.CameraHandle) -> tuple[np.ndarray, float]:
        """The camera's current position, extrapolated from its last report and speed, and the time."""
        now = camera.update_timestamp
        position = camera.position.copy()
        if self._last is not None and now > self._last[0]:
            self._speed = (position - self._last[1]) / max(now - self._last[0], 0.02)
            self._last = (now, position)
        elif self._last is None:
            self._last = (now, position)
        return position + self._speed * np.clip(time.time() - now, 0, 0.1), time.time()

    def end(self, camera: viser.CameraHandle) -> None:
        camera.max_orbit_distance, camera.min_orbit_distance = MAX_ORBIT_DISTANCE, MIN_ORBIT_DISTANCE


class Fixed(CameraMode):
    """A camera of the model, with its field of view; it moves as the model moves it.

    **Arguments:** `index`, of the camera in the model.
    """

    def __init__(self, index: int) -> None:
        self._index = index

    def begin(self, camera: viser.CameraHandle, pose: Pose) -> None:
        self._fov = camera.fov
        self.move(camera, pose)

    def move(self, camera: viser.CameraHandle, pose: Pose) -> None:
        if not pose.bodies or pose.model is None:
            return
        data = pose.bodies[0]
        index = self._index
        place = data.cam_xpos[index] + pose.offset[0]
        turn = data.cam_xmat[index].reshape(3, 3)
        ahead = -turn[:, 2]
        up = turn[:, 1]
        distance = max(float((pose.centre - place) @ ahead), 0.1 * pose.size)
        camera.fov = float(np.radians(pose.model.cam_fovy[index]))
        if abs(camera.up_direction @ up) < 0.999 * np.linalg.norm(camera.up_direction):
            camera.up_direction = up
        aim(camera, place, place + distance * ahead)

    def end(self, camera: viser.CameraHandle) -> None:
        camera.fov = self._fov


def aim(camera: viser.CameraHandle, place: np.ndarray, target: np.ndarray) -> None:
    """Place a camera and let it look at a target. Nothing is sent if the values are unusable or unchanged."""
    distance = float(np.linalg.norm(place - target))
    if not (np.isfinite(place).all() and np.isfinite(target).all()) or distance < 1e-6:
        return
    moved = max(np.abs(place - camera.position).max(), np.abs(target - camera.look_at).max())
    if moved <= UNSEEN * distance:  # each message interrupts a user who is turning the camera
        return
    if not isinstance(camera, viser.CameraHandle):
        camera.position, camera.look_at = place, target
        return
    # viser's own assignment compares again and computes the orientation twice, which takes longer than all else that a
    # camera does
    state: Any = camera._state
    state.position = np.array(place)
    state.look_at = np.array(target)
    state.update_timestamp = time.time()
    ahead = (target - place) / distance
    right = np.cross(ahead, state.up_direction)
    if (length := np.linalg.norm(right)) > 1e-9:
        right /= length
        turn = np.stack([right, np.cross(ahead, right), ahead], axis=1)
        mujoco.mju_mat2Quat(state.wxyz, turn.ravel())
    send = state.client._websock_connection.queue_message
    send(SetCameraPositionMessage(tuple(place.tolist())))
    send(SetCameraLookAtMessage(tuple(target.tolist())))


def has_picture(camera: viser.CameraHandle) -> bool:
    """Whether a browser shows anything; a hidden one reports a picture without size."""
    return min(camera.image_width, camera.image_height) > 0


def viewpoint_of(camera: viser.CameraHandle, aspect: float | None = None) -> Viewpoint:
    """The viewpoint of a browser's camera; for a picture with this `aspect` (width over height) wide enough to show
    what the browser shows.
    """
    place, target, up = (tuple(map(float, each)) for each in (camera.position, camera.look_at, camera.up_direction))
    found = Viewpoint(place, target, float(np.clip(np.degrees(camera.fov), 1, 170)), up)  # type: ignore[arg-type]
    return found if aspect is None or not has_picture(camera) else found.for_aspect(camera.aspect, aspect)


def camera_named(name: str, cameras: list[str]) -> str:
    """The name of a camera in the list. **Raises** `ValueError` for an unknown one."""
    for known in cameras:
        if name.lower() in (known.lower(), known.lower().removeprefix("fixed: ")):
            return known
    raise unknown("camera", name, [known.removeprefix("Fixed: ").lower() for known in cameras])


ORBIT = "Orbit"
WALK = "Walk"
FOLLOW = "Follow"
KEYS = {ORBIT: "O", WALK: "G", FOLLOW: "F"}
"""W, A, S, D, Q, E and the arrows are viser's."""
FIELD_OF_VIEW = 45.0  # degrees
MAX_ELEVATION = -12.0  # degrees, of the initial view; from any lower, the ground looks too flat
MIN_UPRIGHT_COSINE = 0.5  # of the angle between what was up and what is
# m, of a walker's height
LOWEST = 0.05
TALLEST = 3.0


class Viewer:
    """One browser's camera: its mode, and what it needs to change it."""

    def __init__(self, client: viser.ClientHandle, wanted: str, height: float) -> None:
        self.client, self.height = client, height
        self.mode = CameraMode()
        self.name = ""
        self.wanted: str | None = wanted
        self.choice: Any = None


class Cameras:
    """Orbit, walk, follow and the model's fixed cameras, independently for every browser.

    At first the camera follows the body. Build it inside the GUI container for its list.

    **Arguments:** `ground_at`: where the ground is, if it is not the model's own.

    **Attributes:** `names` of the cameras, in the order of the list.
    """

    def __init__(self, ground_at: GroundAt | None = None) -> None:
        self._ground_at = ground_at or self._model_ground
        self._viewers: dict[int, Viewer] = {}
        self._lock = threading.Lock()
        self._guard = Guard("cameras")
        self._pose: Pose | None = None
        self._history = History()
        self._kept = -np.inf
        self.names: list[str] = []

    def build(self, server: viser.ViserServer, session: Session) -> None:
        """Add the list of cameras, and take over every browser's camera as it connects."""
        self._server, model = server, session.model
        self._fixed = [] if model is None else [model.camera(index).name or str(index) for index in range(model.ncam)]
        self.names = [ORBIT, WALK, FOLLOW, *(f"Fixed: {name}" for name in self._fixed)]
        self._travels = model is not None and bool(np.any(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE))
        self._first = ORBIT if model is None else FOLLOW
        start = Pose(model)
        self._tall = float(np.clip(0.75 * start.size, 0.25, 1.7))
        self._start(server, start)
        self._folder = server.gui.add_folder("Camera")
        server.on_client_connect(self._connect)
        server.on_client_disconnect(self._leave)

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        """Move the cameras."""
        del snapshot
        self._pose = pose
        self._history.add(pose)
        self._keep_start(pose)
        here = self._server.get_clients()
        with self._lock:
            viewers = [(client, viewer) for client, viewer in self._viewers.items() if client in here]
        for client, viewer in viewers:
            self._guard(f"that of browser {client}", self._move, viewer, pose)

    def _move(self, viewer: Viewer, pose: Pose) -> None:
        camera = viewer.client.camera
        if not has_picture(camera):
            return
        if viewer.wanted is not None:
            self._switch(viewer, pose)
        if isinstance(viewer.mode, Walk):
            viewer.mode.height = viewer.height
        with viewer.client.atomic():
            viewer.mode.move(camera, pose)

    def select(self, client_id: int, name: str) -> None:
        """Give a browser another camera in the next frame. **Raises** `ValueError` for an unknown name."""
        check(name in self.names, "camera", name, f"one of {', '.join(self.names)}")
        viewer = self._viewers[client_id]
        viewer.wanted = name
        if viewer.choice.value != name:
            viewer.choice.value = name

    def chosen(self, client_id: int) -> str:
        """The name of a browser's camera; empty before it has one."""
        viewer = self._viewers.get(client_id)
        return "" if viewer is None else viewer.name

    def _switch(self, viewer: Viewer, pose: Pose) -> None:
        name = viewer.wanted
        viewer.wanted = None
        if name is None or (name == viewer.name and name != FOLLOW):
            return
        camera = viewer.client.camera
        if not viewer.name:  # it has just connected, and the body may have gone far
            aim(camera, pose.centre + self._away, pose.centre)
        viewer.mode.end(camera)
        if camera.up_direction @ self._up < MIN_UPRIGHT_COSINE:  # the picture would roll, or have no upright
            target = framing_of(self._history, pose, self._travels).target
            aim(camera, target + self._away, target)
        camera.up_direction = self._up
        fresh = not viewer.name
        viewer.name = name
        viewer.mode = self._make(name, viewer.height)
        viewer.mode.awaited = fresh
        viewer.mode.begin(camera, pose)

    def _make(self, name: str, height: float) -> CameraMode:
        if name == WALK:
            return Walk(self._ground_at, height)
        if name in (ORBIT, FOLLOW):
            return (Orbit if name == ORBIT else Follow)(self._history, self._travels, self._up)
        return Fixed(self.names.index(name) - 3)

    def _start(self, server: viser.ViserServer, pose: Pose) -> None:
        """Set the initial view: obliquely from the side with z up, or along z with y up, of a body in that plane."""
        azimuth, elevation = (95.0, -4.0) if pose.model is None else natural_angles(pose.model)
        towards = camera_axes(azimuth - 20, min(elevation, MAX_ELEVATION))[2]
        self._up = UPWARDS
        if elevation == ABOVE[1]:
            towards = UPWARDS
            self._up = camera_axes(*ABOVE)[1]
        self._away = 1.9 * pose.size * towards
        first = server.initial_camera
        first.look_at = pose.middle
        first.position = pose.middle + self._away
        first.up = self._up
        first.fov = np.radians(FIELD_OF_VIEW)

    def _keep_start(self, pose: Pose) -> None:
        """Let the view of the next browser, and viser's "Reset view", begin where the body is."""
        first = self._server.initial_camera
        now = time.monotonic()
        if now > self._kept + AFRESH and np.linalg.norm(pose.centre - first.look_at) > pose.size:
            self._kept = now
            first.look_at = pose.centre
            first.position = pose.centre + self._away

    def _connect(self, client: viser.ClientHandle) -> None:
        """Give a browser its list, its slider and its keys."""
        viewer = Viewer(client, self._first, self._tall)
        with self._lock, self._folder:  # one at a time: several browsers may connect at once
            choice = client.gui.add_dropdown("View", self.names, initial_value=self._first, hint=HINT)
            viewer.choice = own(choice)
            height = own(client.gui.add_slider("Eye height (m)", LOWEST, TALLEST, 0.05, round(self._tall, 1)))
        viewer.choice.on_update(lambda event: self._want(viewer, event.target.value))
        height.on_update(lambda event: setattr(viewer, "height", float(event.target.value)))
        for number, name in enumerate(self.names):
            key: Any = KEYS.get(name, str(number - 2) if number < 12 else None)
            command = own(client.gui.add_command(f"Camera: {name.lower()}", hotkey=key, icon=viser.Icon.CAMERA))
            command.on_trigger(lambda _, name=name: self.select(client.client_id, name))
        with self._lock:
            self._viewers[client.client_id] = viewer

    @staticmethod
    def _want(viewer: Viewer, name: str) -> None:
        viewer.wanted = name

    def _leave(self, client: viser.ClientHandle) -> None:
        with self._lock:
            self._viewers.pop(client.client_id, None)

    def _model_ground(self, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The highest plane or height field of the model under a place; at the origin's height where it has none."""
        pose = self._pose
        height = None
        if pose is not None and pose.model is not None and pose.bodies:
            height = ground_height(pose.model, pose.bodies[0], place[None])
        level = 0.0 if height is None else float(height[0])
        return np.array([place[0], place[1], level]), np.array([0.0, 0.0, 1.0])


HINT = "Keys: O orbit, G walk on the ground, F follow and frame again, 1, 2, … the model's cameras; ? lists all keys."
