"""Learning: the learning curve, the numbers behind it, the settings, and policies in files."""

from __future__ import annotations

import html
import time
from collections import deque
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import viser

from motorgrad._labels import with_unit
from timsim.panels._charts import CurvePlot, TracePlot
from timsim.panels._figures import Figures
from timsim.panels._panel import Numbers, Panel, brief, table
from timsim.panels._settings_form import SettingsForm
from timsim.scene import unit_of

if TYPE_CHECKING:
    from timsim.live import Event, Session, Snapshot
    from timsim.scene import Pose

KEPT = 400  # moments of reward, baseline and gradient
LOGGED = 12  # lines of the log that are shown
WHERE = "A file ending in .npz, or a run directory to load from. Relative to the working folder or the run's folder."


class LearningPanel(Panel):
    """Learning curve, reward, baseline and gradient norm; settings with a log of changes; policies."""

    title: ClassVar[str] = "Learning"
    rate: ClassVar[float] = 2.0

    @classmethod
    def applies(cls, session: Session) -> bool:
        return session.agent is not None

    def fill(self, gui: viser.GuiApi) -> None:
        self._log: deque[str] = deque(maxlen=200)
        self._moments: deque[tuple[float, ...]] = deque(maxlen=KEPT)
        self._said = gui.add_html("")
        names = ("reward", *self.session.metrics)
        first = "return" if "return" in names else "reward"
        self._which = gui.add_dropdown("Curve", names, initial_value=first, hint="Of a decision, mean; of the task.")
        self._which.on_update(self.renew)
        self._curve = CurvePlot(gui)
        self._several = gui.add_html("", visible=False)
        self._figures = Figures(self.session)
        self._traces = [TracePlot(gui, ("reward", "baseline")), TracePlot(gui, ("gradient norm",))]
        learn = gui.add_button_group("Learning", ("Freeze", "Thaw"), hint="Frozen, it acts and learns nothing.")
        learn.on_click(self.guarded(lambda event: self._freeze(event.target.value)))
        beside = gui.add_checkbox(
            "Before and after", False, hint='An untrained body beside. Branches: in the tab "Run".'
        )
        beside.on_update(self.guarded(lambda event: self._compare(event.target.value)))
        self._form = SettingsForm(self)
        self._form.fill(gui, [name for name in self.session.settings if not name.startswith("body.")])
        with gui.add_folder("Policy in a file"):
            self._path = gui.add_text("File", "policy.npz", hint=WHERE)
            files = gui.add_button_group(" ", ("Save", "Load"))
            files.on_click(self.guarded(lambda event: self._file(event.target.value)))
        with gui.add_folder("Log of changes"):
            self._lines = gui.add_html(_lines(()))

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        last = self._moments[-1][0] if self._moments else np.nan
        if snapshot.seconds != last:
            if snapshot.seconds < last:
                self._moments.clear()
            numbers = (snapshot.reward[0], snapshot.baseline[0], snapshot.gradient_norm[0])
            self._moments.append((snapshot.seconds, *map(float, numbers)))
        super().update(snapshot, pose)

    def show(self, snapshot: Snapshot, pose: Pose) -> None:
        del pose
        curve = self.session.curve().until(snapshot.decision)
        name = self._which.value
        self._curve.show(curve.seconds, curve.values[name], with_unit(name, unit_of(name, self.session.task)))
        several = len(snapshot.labels) > 1
        if self._several.visible != several:
            self._several.visible = several
        if several:
            drawn = self._figures.curves(self._which.value, snapshot.labels, snapshot.decision)
            self._several.content = f'<div style="padding:0 8px 6px">{drawn}</div>'
        moments = np.array(self._moments).reshape(-1, 4)
        self._traces[0].show(moments[:, 0], moments[:, 1:3])
        self._traces[1].show(moments[:, 0], moments[:, 3:])
        recent = curve.reward[-max(1, len(curve.reward) // 20) :]
        recent = recent[np.isfinite(recent)]
        self._said.content = table(
            [
                ("learning", "frozen" if snapshot.frozen else "yes"),
                ("reward, lately", brief(float(np.mean(recent))) if len(recent) else "–"),
                ("reward now", brief(float(snapshot.reward[0]))),
                ("baseline", brief(float(snapshot.baseline[0]))),
                ("gradient norm", brief(float(snapshot.gradient_norm[0]))),
                ("parameters", f"{snapshot.parameters.shape[1]:,}"),
            ]
        )
        self._form.refresh()

    def tell(self, events: list[Event]) -> None:
        for event in events:
            if event.kind == "error":
                self._form.refused()
            clock = time.strftime("%H:%M:%S", time.localtime(event.wall))
            self._log.append(f"{clock}  decision {event.decision:,}: {event.text}")
        if events:
            self._lines.content = _lines(list(self._log)[-LOGGED:])

    def numbers(self) -> Numbers:
        curve = self.session.curve()
        return {"decision": curve.decision, "seconds": curve.seconds, **curve.values, "frozen": curve.frozen}

    def _freeze(self, button: str) -> None:
        from timsim.live import Freeze, Thaw

        self.order(Freeze() if button == "Freeze" else Thaw())

    def _compare(self, on: bool) -> None:
        from timsim.live import Compare

        self.order(Compare(on))

    def _file(self, button: str) -> None:
        from timsim.live import Load, Save, confined

        path = str(confined(self._path.value.strip(), self.session.folders))
        self.order(Save(path) if button == "Save" else Load(path))


def _lines(lines: list[str] | tuple[str, ...]) -> str:
    """The newest line first."""
    said = "".join(f"<div>{html.escape(line)}</div>" for line in reversed(lines)) or "<div>nothing yet</div>"
    return f'<div style="font-size:11px;line-height:1.4;margin:0 10px 8px;overflow-wrap:anywhere">{said}</div>'
