"""The whole scene with its layers, and the tab "View" with cameras, switches and help."""

from __future__ import annotations

import html
import threading
from typing import Any, ClassVar

import numpy as np
import viser

from timsim.live import Session, Snapshot
from timsim.scene._abstract import LiftedArm, MotoneuronPool, States
from timsim.scene._annotations import Ghost, ScaleBar, Trail
from timsim.scene._beside import Labels
from timsim.scene._bodies import Bodies, JointAxes, Meshes, Sites, Targets
from timsim.scene._cameras import Cameras, GroundAt
from timsim.scene._contacts import Balance, Contacts
from timsim.scene._environment import EnvironmentPicture
from timsim.scene._layer import Layer
from timsim.scene._muscles import Muscles
from timsim.scene._own import own
from timsim.scene._plane import Plane, PlaneUnits
from timsim.scene._pose import Pose
from timsim.scene._surroundings import Ground, Sky


class Scene:
    """Everything that is drawn of a run: bodies, muscles, their surroundings, and annotations.

    Build it once on a server, then update it every frame. Nodes are created once; afterwards only changes are sent: for
    a hexapod with 24 muscles about 14 kB a frame with every layer on, which does not grow.

    **Arguments:** `layers` instead of the usual ones, in the order in which they are built.

    **Attributes:** `layers`; each has a `name` and a switch `shown`.
    """

    def __init__(self, layers: list[Layer] | None = None) -> None:
        usual = [Sky(), Ground(), Bodies(), Meshes(), Muscles(), Contacts(), Balance(), Sites(), JointAxes(), Labels()]
        usual += [
            Targets(),
            Plane(),
            PlaneUnits(),
            States(),
            MotoneuronPool(),
            LiftedArm(),
            EnvironmentPicture(),
            Trail(),
            Ghost(),
            ScaleBar(),
        ]
        self.layers = usual if layers is None else layers
        self._drawn: tuple[object, ...] = ()

    def build(self, server: viser.ViserServer, session: Session) -> None:
        """Add the nodes of all layers, once."""
        self._server = server
        for layer in self.layers:
            layer.build(server, session)
        if not self.draws:
            text = f"{session.name} has no picture: its panels show what it does"
            server.scene.add_label("/no-picture", text, position=(0.0, 0.0, 0.55))

    @property
    def draws(self) -> bool:
        """Whether there is anything to see but the surroundings, after `build`."""
        return any(layer.applies for layer in self.layers if not isinstance(layer, Sky))

    def draggable(self) -> list[tuple[Any, np.ndarray]]:
        """viser's handles of what can be dragged in all layers, and the geoms of their copies."""
        return [grip for layer in self.layers for grip in layer.draggable()]

    def clickable_muscles(self) -> list[tuple[Any, np.ndarray]]:
        """viser's handles of muscles, and the tendons of their copies at present."""
        return [grip for layer in self.layers if isinstance(layer, Muscles) for grip in layer.clickable()]

    def choose(self, body: int) -> None:
        """Tint the geoms of a body, by its number; −1 for none."""
        for layer in self.layers:
            if isinstance(layer, Bodies | Meshes) and layer.chosen != body:
                layer.chosen = body
                self._drawn = ()

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        """Show the present moment atomically; nothing is sent where nothing has changed."""
        active = [layer for layer in self.layers if layer.applies and layer.shown]
        renewed = [layer.renew(pose) for layer in active]
        moment = (snapshot.decision, snapshot.reset_count, len(snapshot.position), pose.edits, *renewed)
        moment = (*moment, *map(id, active))
        if moment == self._drawn:
            return
        self._drawn = moment
        with self._server.atomic():
            for layer in active:
                layer.draw(pose)


KEYS = {
    "space": "play or pause",
    "N": "one decision",
    "P": "push the body",
    "U": "undo the last push or edit",
    "drag": "turn the camera; when walking, look around",
    "right drag": "move the camera sideways",
    "wheel": "zoom",
    "W A S D": "move forwards, left, backwards, right",
    "Q E": "move down, up",
    "← → ↑ ↓": "turn the camera",
    "O": "camera: orbit",
    "G": "camera: walk on the ground, at eye height",
    "F": "camera: follow the body; again: frame its motion anew",
    "1 2 …": "camera: those of the model",
    "Ctrl K": "search all commands",
    "?": "this list",
}


def add_help(client: viser.ClientHandle) -> None:
    """Show a browser the list of keys on `?`, and by a button in the open container."""
    rows = "\n".join(f"| `{key}` | {meaning} |" for key, meaning in KEYS.items())
    shown: list[Any] = []

    # coroutines, as viser's threads are for all browsers, and one that asks again and again must not fill them
    async def close(_: object) -> None:
        while shown:
            shown.pop().close()

    async def show(event: object) -> None:
        await close(event)  # viser does not hear that a browser has closed a list, and would keep them all
        with client.gui.add_modal("Keys and mouse") as modal:
            shown.append(modal)
            client.gui.add_markdown(f"| key | what it does |\n|---|---|\n{rows}")
            own(client.gui.add_button("Close")).on_click(close)

    # missing in viser's type, but its client knows it: the character typed, which takes shift on most keyboards
    hotkey: Any = "?"
    own(client.gui.add_command("Keys", hotkey=hotkey, modifier="shift", icon=viser.Icon.KEYBOARD)).on_trigger(show)
    own(client.gui.add_button("Keys (?)", icon=viser.Icon.KEYBOARD)).on_click(show)


class View:
    """The tab "View": cameras for each browser, and switches of the scene's layers for all.

    **Arguments:** `scene`, already built; `ground_at`, as of `Cameras`.

    **Attributes:** `cameras`; `title` of the tab.
    """

    title: ClassVar[str] = "View"

    def __init__(self, scene: Scene, ground_at: GroundAt | None = None) -> None:
        self._scene = scene
        self.cameras = Cameras(ground_at)

    def build(self, server: viser.ViserServer, session: Session) -> None:
        """Add the elements to the open container."""
        if self._scene.draws:
            self.cameras.build(server, session)
        else:
            words = f"{session.name} has no picture, and so no cameras: its panels show what it does."
            server.gui.add_html(f'<p style="margin:0 12px 6px">{html.escape(words)}</p>')
        with server.gui.add_folder("Show"):
            for layer in self._scene.layers:
                if layer.name and layer.applies:
                    box = server.gui.add_checkbox(layer.name, layer.shown)
                    box.on_update(lambda event, layer=layer: setattr(layer, "shown", event.target.value))
        one_at_a_time = threading.Lock()
        folder = server.gui.add_folder("Help")

        @server.on_client_connect
        def _(client: viser.ClientHandle) -> None:
            with one_at_a_time, folder:  # several browsers may connect at once
                add_help(client)

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        """Move the cameras."""
        if self._scene.draws:
            self.cameras.update(snapshot, pose)
