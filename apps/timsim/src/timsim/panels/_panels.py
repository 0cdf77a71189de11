"""The tabs of a page: all panels that apply to its session."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import viser

from timsim.live import Event, Session, Snapshot
from timsim.panels._capture import CapturePanel
from timsim.panels._gait import GaitPanel
from timsim.panels._joints import JointsPanel
from timsim.panels._learn import LearnPanel
from timsim.panels._learning import LearningPanel
from timsim.panels._motion import MotionPanel
from timsim.panels._muscles import MusclesPanel
from timsim.panels._network import NetworkPanel
from timsim.panels._panel import NotificationColour, Panel, notify
from timsim.panels._parts import PartsPanel
from timsim.panels._policy import PolicyPanel
from timsim.panels._run import RunPanel
from timsim.panels._watcher import Annotating, no_annotations
from timsim.scene import Pose, own

PANELS: tuple[type[Panel], ...] = (
    RunPanel,
    LearningPanel,
    LearnPanel,
    MotionPanel,
    PartsPanel,
    JointsPanel,
    MusclesPanel,
    PolicyPanel,
    NetworkPanel,
    GaitPanel,
    CapturePanel,
)
"""All panels, in the order of their tabs."""
NOTIFIED: dict[str, tuple[str, NotificationColour]] = {
    "saved": ("Saved", "green"),
    "loaded": ("Loaded", "green"),
    "error": ("Refused", "red"),
    "ended": ("Ended", "red"),
    "lost": ("Stopped", "orange"),
}


FIELD = "Tab in front"
"""The label of the hidden field by which a browser's page tells its tab."""


class TabsInFront:
    """Which tab each browser shows, as its page tells in a hidden field; a client that does not tell may show any."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._titles = dict[int, str]()
        server.on_client_connect(self._ask)
        server.on_client_disconnect(self._forget)

    def shows(self, title: str) -> bool:
        """Whether a browser may show this tab."""
        return any(self._titles.get(client, title) == title for client in self._server.get_clients())

    def _ask(self, client: viser.ClientHandle) -> None:
        field = own(client.gui.add_text(FIELD, "", order=2e6))
        field.on_update(lambda event: self._titles.__setitem__(client.client_id, event.target.value))

    def _forget(self, client: viser.ClientHandle) -> None:
        self._titles.pop(client.client_id, None)


class Panels:
    """The tabs of a page: those of `PANELS` that apply to its session.

    It reads the session's events, which nothing else may do: every browser is notified of refusals, saved and loaded
    files, and the log of changes keeps the rest.

    **Arguments:** `annotations`, which films show, as of `FilmRecorder`.

    **Attributes:** `tabs`, viser's tab group, to which others may add; `panels`, by title.
    """

    def __init__(self, annotations: Annotating = no_annotations) -> None:
        self._annotations = annotations
        self.panels: dict[str, Panel] = {}
        self.tabs: Any = None

    def build(self, server: viser.ViserServer, session: Session) -> None:
        """Add the tabs to the open container."""
        self._server, self._session = server, session
        self._fronts = TabsInFront(server)
        self.tabs = server.gui.add_tab_group()
        for kind in PANELS:
            if kind.applies(session):
                panel = kind()
                if isinstance(panel, CapturePanel):
                    panel.annotations = self._annotations
                with self.tabs.add_tab(kind.title):
                    panel.build(server, session)
                self.panels[kind.title] = panel

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        """Show the present moment; each panel limits its own rate."""
        self._tell(self._session.events())
        for title, panel in self.panels.items():
            panel.hidden = not self._fronts.shows(title)
            panel.update(snapshot, pose)

    def close(self) -> None:
        """End recordings, so that their files are complete."""
        capture = self.panels.get(CapturePanel.title)
        if isinstance(capture, CapturePanel):
            capture.close()

    def _tell(self, events: Sequence[Event]) -> None:
        if not events:
            return
        for panel in self.panels.values():
            panel.tell(list(events))
            panel.renew()
        for event in events:
            if event.kind in NOTIFIED:
                title, colour = NOTIFIED[event.kind]
                notify(self._server, event.text, title, colour)
