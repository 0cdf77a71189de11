"""The tab "View": whose eyes to look through, and what to see."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

from motorgrad.sim.scene._cameras import Cameras
from motorgrad.sim.scene._eyes import Footing
from motorgrad.sim.scene._keys import add_help
from motorgrad.sim.scene._layer import Layer
from motorgrad.sim.scene._scene import Scene

if TYPE_CHECKING:
    import viser

    from motorgrad.sim.live import Session, Snapshot
    from motorgrad.sim.scene._pose import Pose


class View:
    """Cameras for every browser by itself, and switches of the scene's layers for all.

    **Arguments:** `scene`, built before; `keys`, of other parts of the page, with what they do, for the list on `?`;
    `footing`, as of `Cameras`.

    **Attributes:** `cameras`; `title` and `icon` of the tab.
    """

    title: ClassVar[str] = "View"
    icon: ClassVar[str] = "eye"

    def __init__(self, scene: Scene, keys: Mapping[str, str] | None = None, footing: Footing | None = None) -> None:
        self._scene, self._keys = scene, dict(keys or {})
        self.cameras = Cameras(footing)

    @classmethod
    def applies(cls, session: Session) -> bool:
        """There is always something to see."""
        del session
        return True

    def build(self, server: viser.ViserServer, session: Session) -> None:
        """Add the elements, in the container that is open."""
        self.cameras.build(server, session)
        with server.gui.add_folder("Show"):
            for layer in self._scene.layers:
                if layer.name and layer.applies:
                    box = server.gui.add_checkbox(layer.name, layer.shown)
                    box.on_update(lambda event, layer=layer: self._switch(layer, event.target.value))
        self._one = threading.Lock()
        self._foot = server.gui.add_folder("Help")

        @server.on_client_connect
        def _(client: Any) -> None:
            with self._one, self._foot:  # several browsers may come at once
                add_help(client, self._keys)

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        """Move the cameras."""
        self.cameras.update(snapshot, pose)

    @staticmethod
    def _switch(layer: Layer, shown: bool) -> None:
        layer.shown = shown
