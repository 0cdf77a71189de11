"""The scene as one HTML file that anyone can open, turn round and play: viser's recording in viser's client."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import viser

LONGEST = 120.0
"""Seconds after which a recording ends by itself: it is kept in memory."""


class SceneRecording:
    """Records a page's scene from now on; `tick` is to be called once a frame."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._serializer = server.get_scene_serializer()
        self._begin = self._last = time.monotonic()

    @property
    def seconds(self) -> float:
        """How long it has recorded."""
        return self._last - self._begin

    def tick(self) -> None:
        """Let the recording's time pass as the clock's has."""
        now = time.monotonic()
        self._serializer.insert_sleep(now - self._last)
        self._last = now

    def html(self) -> bytes:
        """End it: a page that needs no server and no network."""
        return self._serializer.as_html().encode()
