"""Which body is which, where several stand side by side."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from motorgrad.sim.scene._layer import Layer

if TYPE_CHECKING:
    import viser

    from motorgrad.sim.live import Session
    from motorgrad.sim.scene._pose import Pose

SAID = ("learning", "untrained")


class Labels(Layer):
    """A word above each body, as long as there are two."""

    def build(self, server: viser.ViserServer, session: Session) -> None:
        self.applies, self._scene = session.model is not None, server.scene
        self._words: list[Any] = []

    def draw(self, pose: Pose) -> None:
        wanted = SAID[: len(pose.bodies)] if len(pose.bodies) > 1 else ()
        while len(self._words) > len(wanted):
            self._words.pop().remove()
        for said in wanted[len(self._words) :]:
            self._words.append(self._scene.add_label(f"/labels/{said}", said, anchor="bottom-center"))
        for word, data, offset in zip(self._words, pose.bodies, pose.offset, strict=False):
            word.position = data.subtree_com[0] + offset + (0.0, 0.0, 0.55 * pose.size)
