"""How a camera moves: one class for each kind."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import viser

    from motorgrad.sim.scene._pose import Pose

Footing = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Of a place `(3,)`, the point of the ground under it and the way up there."""

DAMPING = 0.25  # s in which a camera that follows makes up 63 % of what it lags
HANDS_OFF = 0.25  # s for which a camera that the user turns is left alone
NEAREST, FARTHEST = 0.01, 1e4  # viser's own limits of the distance to what an orbiting camera looks at


class Eye:
    """A kind of camera. `begin` takes a client's camera over, `move` is called at every moment, `end` gives it back.

    The browser moves the camera itself, by viser's mouse and keys, and reports where it is some 20 times a second.
    """

    def begin(self, camera: viser.CameraHandle, pose: Pose) -> None:
        """Put the camera where this kind begins."""

    def move(self, camera: viser.CameraHandle, pose: Pose) -> None:
        """Correct or move the camera."""

    def end(self, camera: viser.CameraHandle) -> None:
        """Undo what the next kind must not find."""


class Orbit(Eye):
    """Turns about what it looks at, all by the user's hand."""

    def begin(self, camera: viser.CameraHandle, pose: Pose) -> None:
        look(camera, camera.position, pose.centre)


class Follow(Eye):
    """Orbits the first body, whose centre of mass it follows with damping, so that it does not shake with the body."""

    def begin(self, camera: viser.CameraHandle, pose: Pose) -> None:
        self._target = pose.centre.copy()
        away = camera.position - self._target
        distance = np.clip(np.linalg.norm(away), 0.8 * pose.size, 3 * pose.size)
        away = away * distance / max(float(np.linalg.norm(away)), 1e-9)
        self._away, self._then, self._turned = away, time.monotonic(), 0.0
        look(camera, self._target + away, self._target)

    def move(self, camera: viser.CameraHandle, pose: Pose) -> None:
        now = time.monotonic()
        self._target += (pose.centre - self._target) * (1 - np.exp(-(now - self._then) / DAMPING))
        self._then = now
        away = camera.position - camera.look_at
        if np.linalg.norm(away - self._away) > 1e-3 * np.linalg.norm(self._away):
            self._away, self._turned = away, now
        # what is sent would undo what the hand does before it is reported
        if now - self._turned > HANDS_OFF:
            look(camera, self._target + self._away, self._target)


class Walk(Eye):
    """Stands on the ground: viser's keys W, A, S, D walk, the mouse and the arrows look around.

    It looks at a point just before it, about which the browser then turns it, and is put back at eye height where the
    ground rises or falls.

    **Arguments:** `footing`; `height` in m of the eyes.
    """

    REACH = 0.02  # of the height, to the point that it looks at
    LOOSE = 0.03  # of the height, by which the eyes may be too high or too low

    def __init__(self, footing: Footing, height: float) -> None:
        self.footing, self.height = footing, height
        self._last: tuple[float, np.ndarray] | None = None
        self._speed = np.zeros(3)

    def begin(self, camera: viser.CameraHandle, pose: Pose) -> None:
        ground, up = self.footing(camera.position)
        eye = ground + self.height * up
        ahead = pose.centre - eye
        ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-9)
        reach = max(self.REACH * self.height, 2 * NEAREST)
        camera.up_direction = up
        look(camera, eye, eye + reach * ahead)
        camera.min_orbit_distance, camera.max_orbit_distance = 0.99 * reach, 1.01 * reach

    def move(self, camera: viser.CameraHandle, pose: Pose) -> None:
        place, now = self._place_now(camera)
        ground, up = self.footing(place)
        error = self.height - (place - ground) @ up
        if abs(error) > self.LOOSE * self.height:
            ahead = camera.look_at - camera.position
            target = place + error * up
            look(camera, target, target + ahead)
            self._last = (now, target)

    def _place_now(self, camera: viser.CameraHandle) -> tuple[np.ndarray, float]:
        """Where the camera is by now: what it reported last, and how fast it went, on the level."""
        now, told = camera.update_timestamp, camera.position.copy()
        if self._last is not None and now > self._last[0]:
            self._speed = (told - self._last[1]) / max(now - self._last[0], 0.02)
            self._last = (now, told)
        elif self._last is None:
            self._last = (now, told)
        return told + self._speed * np.clip(time.time() - now, 0, 0.1), time.time()

    def end(self, camera: viser.CameraHandle) -> None:
        camera.max_orbit_distance, camera.min_orbit_distance = FARTHEST, NEAREST
        camera.up_direction = (0.0, 0.0, 1.0)


class Fixed(Eye):
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
        data, index = pose.bodies[0], self._index
        place, turn = data.cam_xpos[index] + pose.offset[0], data.cam_xmat[index].reshape(3, 3)
        ahead, up = -turn[:, 2], turn[:, 1]
        distance = max(float((pose.centre - place) @ ahead), 0.1 * pose.size)
        camera.fov = float(np.radians(pose.model.cam_fovy[index]))
        if abs(camera.up_direction @ up) < 0.999 * np.linalg.norm(camera.up_direction):
            camera.up_direction = up
        look(camera, place, place + distance * ahead)

    def end(self, camera: viser.CameraHandle) -> None:
        camera.fov = self._fov
        camera.up_direction = (0.0, 0.0, 1.0)


def look(camera: Any, place: np.ndarray, target: np.ndarray) -> None:
    """Put a camera somewhere and let it look at something; nothing is sent where nothing has changed."""
    if not (np.isfinite(place).all() and np.isfinite(target).all()) or np.linalg.norm(place - target) < 1e-6:
        return
    camera.position = place
    camera.look_at = target
