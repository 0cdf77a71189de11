"""Stored motions: play one on the body in view, and go to any of its moments."""

from __future__ import annotations

import dataclasses
import html
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
import viser

from timsim.live import Scrub, Session, Setup, Snapshot, confined, setup_of, succeed, with_motion
from timsim.panels._panel import REFUSED, Following, Panel, brief, table
from timsim.scene import Pose

FILES = "In the working folder: .mot, .sto, .csv, .npz or .npy, with the names of joints."


class MotionPanel(Panel):
    """Plays a stored motion of a model without a learner, and goes to any of its moments."""

    title: ClassVar[str] = "Motion"
    rate: ClassVar[float] = 8.0

    @classmethod
    def applies(cls, session: Session) -> bool:
        return session.task is None and session.model is not None and session.model.nq > 0

    def fill(self, gui: viser.GuiApi) -> None:
        motion: Any = self.session.setup.motion
        self._summary = gui.add_html("")
        self._slider = None
        if motion is not None:
            period = self.session.period
            self._slider = gui.add_slider("Moment (s)", 0.0, max(motion.seconds, period), period, 0.0)
            self._slider.on_update(self._move)
            self._following = Following(self._slider)
        self._wanted: tuple[int, Any] | None = None
        with gui.add_folder("Motion in a file"):
            self._path = gui.add_text("File", "", hint=FILES)
            self._partial = gui.add_checkbox(
                "Some columns only",
                False,
                hint="Ignore columns without a joint; other joints keep their place.",
            )
            gui.add_button("Play this motion", icon=viser.Icon.PLAYER_PLAY).on_click(
                lambda _: self._start(self._of_file)
            )
            self._said = gui.add_html("")
            if motion is not None:
                back = gui.add_button("Back to the simulated body", icon=viser.Icon.ARROW_BACK_UP, color="gray")
                back.on_click(lambda _: self._start(self._bare))

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        if self._wanted is not None:  # at most once a frame, however fast the slider moves
            wanted = self._wanted
            self._wanted = None
            self.guarded(lambda _: self.order(Scrub(wanted[0])))(wanted[1])
        super().update(snapshot, pose)

    def show(self, snapshot: Snapshot, pose: Pose) -> None:
        del pose
        motion: Any = self.session.setup.motion
        if motion is None or self._slider is None:
            self._summary.content = table([("motion", "none: the body is simulated")])
            return
        at = snapshot.seconds % (motion.seconds + self.session.period)
        self._summary.content = table(
            [
                ("motion", motion.label or "given"),
                ("moment", f"{at:.2f} s of {brief(motion.seconds)} s"),
                ("frames in the file", f"{len(motion.time):,}"),
                ("muscles", "with activations" if motion.activation.any() else "no activations in the file"),
            ]
        )
        self._following.show(float(np.clip(at, 0, motion.seconds)))

    def _move(self, event: viser.GuiEvent) -> None:
        if event.client is not None:
            self._following.moved()
            self._wanted = round(float(event.target.value) / self.session.period), event

    def _of_file(self) -> Setup:
        path = confined(self._path.value.strip(), self.session.folders)
        return with_motion(self._bare(), path, self._partial.value)

    def _bare(self) -> Setup:
        setup = self.session.setup
        if setup.body is None:
            return dataclasses.replace(setup, motion=None)
        return dataclasses.replace(setup_of(setup.body, stage=setup.stage), name=setup.name, key=setup.key)

    def _start(self, make: Callable[[], Setup]) -> None:
        """Start another run in place of this one, and show an error here."""
        self._tell("reading …")
        try:
            succeed(self.session, make(), lambda words: self._tell(f"{words} …"))
        except REFUSED as error:
            self._tell(" ".join(str(error).split()), "#c92a2a")

    def _tell(self, words: str, colour: str = "inherit") -> None:
        style = f"color:{colour};font-size:12.5px;margin:2px 12px 6px;overflow-wrap:anywhere"
        self._said.content = f'<div role="status" style="{style}">{html.escape(words)}</div>'
