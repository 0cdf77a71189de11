"""Clicks on the scene choose a part or a muscle, and bring its tab to the front."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

from __future__ import annotations

import html
import itertools
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import viser

from timsim.live import Session, Snapshot
from timsim.panels._muscles import MusclesPanel
from timsim.panels._panels import Panels
from timsim.panels._parts import PartsPanel
from timsim.scene import Pose, Scene


class ClickSelect:
    """Chooses the clicked part or muscle: its panel shows it, and comes to the front for the user who clicked.

    It is a part of the page, updated after the scene.

    **Arguments:** `scene` and `panels`, of the page.
    """

    def __init__(self, scene: Scene, panels: Panels) -> None:
        self._scene, self._panels = scene, panels
        self._known: dict[int, Any] = {}
        self._fronts: dict[int, Any] = {}

    def build(self, server: viser.ViserServer, session: Session) -> None:
        """Remember the session, and forget closed browsers."""
        self._session = session
        self._tendons = {}
        model: Any = session.model
        if model is not None:
            pulls = np.flatnonzero(model.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON)
            self._tendons = {int(model.actuator_trnid[row, 0]): session.muscles[row] for row in pulls}

        @server.on_client_disconnect
        async def _(client: viser.ClientHandle) -> None:
            self._fronts.pop(client.client_id, None)

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        """Listen to new meshes, and tint the chosen part."""
        del snapshot, pose
        parts = self._panels.panels.get(PartsPanel.title)
        muscles = self._panels.panels.get(MusclesPanel.title)
        if isinstance(parts, PartsPanel):
            for handle, geoms in self._scene.draggable():
                self._listen(handle, self._choose_part(parts, geoms))
            self._scene.choose(parts.chosen)
        if isinstance(muscles, MusclesPanel):
            for handle, _ in self._scene.clickable_muscles():
                self._listen(handle, self._choose_muscle(muscles))

    def _listen(self, handle: viser.SceneNodeHandle, act: Callable[[Any], None]) -> None:
        if id(handle) not in self._known:
            self._known[id(handle)] = handle
            handle.on_click(act)

    def _choose_part(self, panel: PartsPanel, geoms: np.ndarray) -> Callable[[Any], None]:
        model: Any = self._session.model

        def act(event: viser.SceneNodePointerEvent) -> None:
            copy = (event.instance_index or 0) % len(geoms)  # beyond: of the body beside, which has the same parts
            panel.choose(int(model.geom_bodyid[geoms[copy]]))
            self.bring_forward(event.client, PartsPanel.title)

        return act

    def _choose_muscle(self, panel: MusclesPanel) -> Callable[[Any], None]:
        def act(event: viser.SceneNodePointerEvent) -> None:
            ((_, tendons),) = self._scene.clickable_muscles()
            copy = event.instance_index or 0
            name = self._tendons.get(int(tendons[copy])) if 0 <= copy < len(tendons) else None
            if name is not None:
                panel.choose(name)
                self.bring_forward(event.client, MusclesPanel.title)

        return act

    def bring_forward(self, client: viser.ClientHandle, title: str) -> None:
        """Bring a tab to the front in one browser; the page's script reads which from this element."""
        element = self._fronts.get(client.client_id)
        if element is None:
            element = self._fronts[client.client_id] = client.gui.add_html("")
        element.content = f'<div class="motorgrad-front" data-count="{next(_counts)}">{html.escape(title)}</div>'


_counts = itertools.count(1)
"""Numbers for calls, all different, by which browsers tell a new one from one that they have followed."""
