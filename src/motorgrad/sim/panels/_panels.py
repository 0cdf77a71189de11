"""The tabs of a page: all panels that apply to its session."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import viser

from motorgrad.sim.live import Event, Session, Snapshot
from motorgrad.sim.panels._capture import CapturePanel
from motorgrad.sim.panels._gait import GaitPanel
from motorgrad.sim.panels._joints import JointsPanel
from motorgrad.sim.panels._learning import LearningPanel
from motorgrad.sim.panels._muscles import MusclesPanel
from motorgrad.sim.panels._network import NetworkPanel
from motorgrad.sim.panels._panel import Panel, notify
from motorgrad.sim.panels._parts import PartsPanel
from motorgrad.sim.panels._policy import PolicyPanel
from motorgrad.sim.panels._run import RunPanel
from motorgrad.sim.scene import Pose

PANELS: tuple[type[Panel], ...] = (
    RunPanel,
    LearningPanel,
    PartsPanel,
    JointsPanel,
    MusclesPanel,
    PolicyPanel,
    NetworkPanel,
    GaitPanel,
    CapturePanel,
)
"""All panels, in the order of their tabs."""
NOTIFIED = {
    "saved": ("Saved", "green"),
    "loaded": ("Loaded", "green"),
    "error": ("Refused", "red"),
    "ended": ("Ended", "red"),
    "lost": ("Stopped", "orange"),
}


class Panels:
    """The tabs of a page: those of `PANELS` that apply to its session.

    It reads the session's events, which nothing else may do: every browser is notified of refusals, saved and loaded
    files, and the log of changes keeps the rest.

    **Attributes:** `tabs`, viser's tab group, to which others may add; `panels`, by title.
    """

    def __init__(self) -> None:
        self.panels: dict[str, Panel] = {}
        self.tabs: Any = None

    def build(self, server: viser.ViserServer, session: Session) -> None:
        """Add the tabs to the open container."""
        self._server, self._session = server, session
        self.tabs = server.gui.add_tab_group()
        for kind in PANELS:
            if kind.applies(session):
                panel = kind()
                with self.tabs.add_tab(kind.title):
                    panel.build(server, session)
                self.panels[kind.title] = panel

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        """Show the present moment; each panel limits its own rate."""
        self._tell(self._session.events())
        for panel in self.panels.values():
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
