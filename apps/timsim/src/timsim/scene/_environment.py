"""The rendered picture of a Gymnasium environment on a board, updated while somebody looks."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import viser

from timsim.live import Look, Session
from timsim.scene._layer import Layer
from timsim.scene._plane import FLOOR
from timsim.scene._pose import Pose
from timsim.scene._surroundings import floor_glb

RATE = 5.0  # Hz; the learner waits while its environment is drawn, some milliseconds
UPRIGHT = np.array([np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0])
"""The rotation of a picture, whose x goes to the right and y down, for a viewer who looks along the world's y."""
# m: of the board's lower edge, and its longer side
LIFT = 0.06
SIDE = 1.1
TOOK = 0.04  # share of the time that drawing may take of the learner's


class EnvironmentPicture(Layer):
    """Shows the picture that an environment's `render` makes, a few times a second, while a browser is there.

    The worker is asked for it: nobody looks, nothing is drawn. Pictures that take long come less often.
    """

    def build(self, server: viser.ViserServer, session: Session) -> None:
        self.applies = session.rendered
        if not self.applies:
            return
        self._server, self._session = server, session
        self._handle: Any = None
        self._word: Any = None
        self._asked: tuple[int, int] | None = None
        self._due = self._sent = 0.0
        self._last = 0
        server.scene.add_glb("/environment/floor", floor_glb(np.full(2, 60.0), 1.0, FLOOR), cast_shadow=False)

    def renew(self, pose: Pose) -> int:
        session = self._session
        snapshot = pose.snapshot
        now = time.monotonic()
        assert snapshot is not None
        moment = snapshot.decision, snapshot.reset_count
        if moment != self._asked and now >= self._due and self._server.get_clients():
            self._asked, self._sent = moment, now
            self._due = now + 1.0  # or until the answer is here
            session.order(Look())
        return session.pictures

    def draw(self, pose: Pose) -> None:
        del pose
        session = self._session
        now = time.monotonic()
        if session.picture is None or session.pictures == self._last:
            return
        pixels, problem, took = session.picture
        self._last = session.pictures
        self._due = max(self._sent + 1 / RATE, now + took / TOOK)
        if pixels is None:
            text = f"{session.name} has no picture here: {problem}"
            if self._word is None:
                self._word = self._server.scene.add_label("/environment/word", text, position=(0.0, 0.0, 0.55))
            return
        if self._handle is None or self._handle.image.shape != pixels.shape:
            high, wide = SIDE * np.array(pixels.shape[:2]) / max(pixels.shape[:2])
            where: Any = {"wxyz": UPRIGHT, "position": (0.0, 0.0, LIFT + high / 2)}
            self._handle = self._server.scene.add_image("/environment/picture", pixels, wide, high, **where)
        else:
            self._handle.image = pixels
