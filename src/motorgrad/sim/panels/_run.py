"""The run itself: go on, stop, one step, how fast, and back in time."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from motorgrad.sim.panels._numbers import brief, columns_of, table
from motorgrad.sim.panels._panel import Numbers, Panel, command
from motorgrad.sim.panels._push import PushFolder

if TYPE_CHECKING:
    from motorgrad.sim.live import Snapshot
    from motorgrad.sim.scene import Pose

MARKS = (0.05, 0.2, 1.0, 5.0, 20.0)
FASTEST = 60.0
"""From here to the right end, which is as fast as possible, the slider has no speed of its own."""
HELD = 1.0  # seconds for which a slider that the user moved is left alone


class RunPanel(Panel):
    """Play, pause, one step, reset, speed, scrubbing, and pushes."""

    title: ClassVar[str] = "Run"
    icon: ClassVar[str] = "player-play"
    rate: ClassVar[float] = 8.0

    def fill(self, gui: Any) -> None:
        from motorgrad.sim.live import Step

        self._said = gui.add_html("")
        buttons = gui.add_button_group(
            "Run", ("Play", "Pause", "Step"), hint="Keys: space plays and pauses, N makes one step."
        )
        buttons.on_click(self.guarded(lambda event: self._press(event.target.value)))
        self._speed = gui.add_multi_slider(
            "Speed",
            min=math.log10(MARKS[0]),
            max=math.log10(FASTEST),
            step=0.01,
            initial_value=(self._place(1.0),),
            marks=(*((math.log10(mark), f"{mark:g}×") for mark in MARKS), (math.log10(FASTEST), "max")),
            hint="Simulated seconds per second; at the right end as fast as possible.",
        )
        self._speed.on_update(self.guarded(self._hasten))
        with gui.add_folder("Back in time"):
            self._back = gui.add_slider(
                "To (s)", min=-1.0, max=0.0, step=self._step, initial_value=0.0, hint="Body and learner as they were."
            )
            self._back.on_update(self._scrub)
            go = gui.add_button("Continue from here", icon="player-play")
            go.on_click(self.guarded(lambda _: self._press("Play")))
        reset = gui.add_button("Reset", icon="rotate-2", color="gray", hint="Body and learner as at the start.")
        reset.on_click(self.guarded(lambda _: self._press("Reset")))
        self._touched, self._wanted, self._limits = -math.inf, None, (-1.0, 0.0)
        self._push = PushFolder(self) if self.model is not None else None
        if self._push is not None:
            self._push.fill(gui)
        for label, key, action in (
            ("Play or pause", "space", lambda _: self._press("Pause" if self.session.snapshot().playing else "Play")),
            ("One step", "N", lambda _: self.order(Step())),
        ):
            command(gui, label, key, self.guarded(action))

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        if self._wanted is not None:  # once a frame, however quickly the slider moves
            wanted, self._wanted = self._wanted, None
            self.guarded(lambda _: self._go_to(*wanted))(wanted[1])
        super().update(snapshot, pose)

    def show(self, snapshot: Snapshot, pose: Pose) -> None:
        del pose
        doing = "paused" if not snapshot.playing else "acting, frozen" if snapshot.frozen else "running"
        if snapshot.playing and not snapshot.frozen and self.session.agent is not None:
            doing = "learning"
        rows = [
            ("state", doing),
            ("simulated time", f"{snapshot.seconds:,.2f} s"),
            ("decisions", f"{snapshot.decision:,}"),
            ("speed", f"{brief(snapshot.speed)}×" if snapshot.playing else "–"),
        ]
        self._said.content = table(rows)
        if time.monotonic() - self._touched > HELD:
            low = min(-self._step, (snapshot.oldest - snapshot.newest) * self.session.period)
            if not math.isclose(low, self._limits[0]):
                self._limits = (low, 0.0)
                self._back.min = low
            self._back.value = float(np.clip((snapshot.decision - snapshot.newest) * self.session.period, low, 0))

    def numbers(self) -> Numbers:
        trail = self.session.trail()
        return {
            "decision": trail.decision,
            "seconds": trail.seconds,
            **columns_of("position", [str(i) for i in range(trail.position.shape[1])], trail.position),
            **columns_of("velocity", [str(i) for i in range(trail.velocity.shape[1])], trail.velocity),
        }

    @property
    def _step(self) -> float:
        return max(self.session.period, 1e-3)

    @staticmethod
    def _place(speed: float) -> float:
        return math.log10(min(speed, FASTEST))

    def _press(self, button: str) -> None:
        from motorgrad.sim.live import Pause, Play, Reset, Step

        self.order({"Play": Play, "Pause": Pause, "Step": Step, "Reset": Reset}[button]())

    def _hasten(self, event: Any) -> None:
        from motorgrad.sim.live import Speed

        factor = 10 ** event.target.value[0]
        self.order(Speed(math.inf if factor > FASTEST * 0.97 else max(factor, MARKS[0])))

    def _scrub(self, event: Any) -> None:
        if event.client is not None:  # and not by this panel itself
            self._touched = time.monotonic()
            self._wanted = (float(event.target.value), event)

    def _go_to(self, seconds: float, event: Any) -> None:
        from motorgrad.sim.live import Scrub

        del event
        now = self.session.snapshot()
        decision = now.newest + round(seconds / self.session.period)
        self.order(Scrub(int(np.clip(decision, now.oldest, now.newest))))
