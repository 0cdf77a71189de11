"""The cameras of every browser that looks: each has its own, chosen in its own list or by its own keys."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad._errors import check
from motorgrad.sim import _framing
from motorgrad.sim._ground import ground_height
from motorgrad.sim.scene._eyes import Eye, Fixed, Follow, Footing, Orbit, Walk, look

if TYPE_CHECKING:
    import viser

    from motorgrad.sim.live import Session, Snapshot
    from motorgrad.sim.scene._pose import Pose

ORBIT, WALK, FOLLOW = "Orbit", "Walk", "Follow"
KEYS = {ORBIT: "O", WALK: "G", FOLLOW: "F"}
"""W, A, S, D, Q, E and the arrows are viser's own."""
FIELD_OF_VIEW = 45.0  # degrees
LEAST_SLOPE = -12.0  # degrees; lower down the ground is seen too flat
LOWEST, TALLEST = 0.05, 3.0  # m, of a walker's eyes


class Seat:
    """One browser's camera: which kind, and what it needs to move."""

    def __init__(self, client: Any, wanted: str, height: float) -> None:
        self.client, self.height = client, height
        self.eye, self.name = Eye(), ""
        self.wanted: str | None = wanted
        self.choice: Any = None


class Cameras:
    """Orbit, walk, follow and the model's fixed cameras, for every browser by itself.

    A body that can go away is followed at first; of one that cannot the camera stands still.

    Build it in the container in which the choice is to stand.

    **Arguments:** `footing`, where a walker's feet are, other than on the model's own ground.

    **Attributes:** `names`, of the cameras there are, in the order of the list.
    """

    def __init__(self, footing: Footing | None = None) -> None:
        self._footing = footing or self._on_model
        self._seats: dict[int, Seat] = {}
        self._lock = threading.Lock()
        self._pose: Pose | None = None
        self.names: list[str] = []

    def build(self, server: viser.ViserServer, session: Session) -> None:
        """Add the list of cameras, and take every browser's camera over as it comes."""
        import mujoco

        from motorgrad.sim.scene._pose import Pose

        self._server, model = server, session.model
        self._fixed = [] if model is None else [model.camera(index).name or str(index) for index in range(model.ncam)]
        self.names = [ORBIT, WALK, FOLLOW, *(f"Fixed: {name}" for name in self._fixed)]
        goes = model is not None and bool(np.any(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE))
        self._first = FOLLOW if goes else ORBIT
        start = Pose(model)
        self._tall = float(np.clip(0.75 * start.size, 0.25, 1.7))
        self._start(server, start)
        self._folder = server.gui.add_folder("Camera")
        server.on_client_connect(self._connect)
        server.on_client_disconnect(self._leave)

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        """Move the cameras that move by themselves."""
        del snapshot
        self._pose = pose
        here = self._server.get_clients()
        with self._lock:
            seats = [seat for client, seat in self._seats.items() if client in here]
        for seat in seats:
            if seat.wanted is not None:
                self._switch(seat, pose)
            if isinstance(seat.eye, Walk):
                seat.eye.height = seat.height
            with seat.client.atomic():
                seat.eye.move(seat.client.camera, pose)

    def choose(self, client_id: int, name: str) -> None:
        """Give a browser another camera, at the next moment. **Raises** `ValueError` for a name that is not known."""
        check(name in self.names, "camera", name, f"one of {', '.join(self.names)}")
        seat = self._seats[client_id]
        seat.wanted = name
        if seat.choice.value != name:
            seat.choice.value = name

    def chosen(self, client_id: int) -> str:
        """The name of a browser's camera; empty before it has one."""
        return self._seats[client_id].name

    def _switch(self, seat: Seat, pose: Pose) -> None:
        name, seat.wanted = seat.wanted, None
        if name is None or name == seat.name:
            return
        camera = seat.client.camera
        if not seat.name:  # it has just come, and the body may have gone far
            look(camera, pose.centre + self._away, pose.centre)
        seat.eye.end(camera)
        seat.name, seat.eye = name, self._make(name, seat.height)
        seat.eye.begin(camera, pose)

    def _make(self, name: str, height: float) -> Eye:
        if name == WALK:
            return Walk(self._footing, height)
        if name in (ORBIT, FOLLOW):
            return Orbit() if name == ORBIT else Follow()
        return Fixed(self.names.index(name) - 3)

    def _start(self, server: viser.ViserServer, pose: Pose) -> None:
        """Where a browser looks from at first: aslant from the side, the body in the middle of the picture."""
        azimuth, elevation = (95.0, -4.0) if pose.model is None else _framing.natural_angles(pose.model)
        towards = _framing.axes(azimuth - 20, min(elevation, LEAST_SLOPE))[2]
        self._away = 1.9 * pose.size * towards
        first = server.initial_camera
        first.look_at, first.position = pose.middle, pose.middle + self._away
        first.up, first.fov = np.array([0.0, 0.0, 1.0]), np.radians(FIELD_OF_VIEW)

    def _connect(self, client: Any) -> None:
        """Give a browser its list, its slider and its keys."""
        seat = Seat(client, self._first, self._tall)
        with self._lock, self._folder:  # one at a time: several browsers may come at once
            seat.choice = client.gui.add_dropdown("View", self.names, initial_value=self._first, hint=HINT)
            eyes = client.gui.add_slider("Eye height (m)", LOWEST, TALLEST, 0.05, round(self._tall, 1))
        seat.choice.on_update(lambda event: self._want(seat, event.target.value))
        eyes.on_update(lambda event: setattr(seat, "height", float(event.target.value)))
        for number, name in enumerate(self.names):
            key = KEYS.get(name, str(number - 2) if number < 12 else None)
            command = client.gui.add_command(f"Camera: {name.lower()}", hotkey=key, icon="camera")
            command.on_trigger(lambda _, name=name: self.choose(client.client_id, name))
        with self._lock:
            self._seats[client.client_id] = seat

    @staticmethod
    def _want(seat: Seat, name: str) -> None:
        seat.wanted = name

    def _leave(self, client: Any) -> None:
        with self._lock:
            self._seats.pop(client.client_id, None)

    def _on_model(self, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The highest plane or height field of the model under a place; level with the origin where it has none."""
        pose, height = self._pose, None
        if pose is not None and pose.model is not None and pose.bodies:
            height = ground_height(pose.model, pose.bodies[0], place[None])
        level = 0.0 if height is None else float(height[0])
        return np.array([place[0], place[1], level]), np.array([0.0, 0.0, 1.0])


HINT = "Keys: O orbit, G walk on the ground, F follow the body, 1, 2, … the model's own; ? lists all."
