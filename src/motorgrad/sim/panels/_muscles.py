"""Muscles: when they fire, and where one of them is on its curves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from motorgrad.sim.panels._law import Law
from motorgrad.sim.panels._numbers import brief, columns_of, table
from motorgrad.sim.panels._operating import LEAST, Range, draw_operating
from motorgrad.sim.panels._panel import Numbers, Panel
from motorgrad.sim.panels._raster import draw_raster
from motorgrad.sim.panels._settings_form import SettingsForm

if TYPE_CHECKING:
    from motorgrad.sim.live import Event, Session, Snapshot
    from motorgrad.sim.scene import Pose

ARMS = 3  # joints of which the moment arm is told


class MusclesPanel(Panel):
    """A raster of activations; the chosen muscle's length, velocity, force, moment arms, operating point, settings."""

    title: ClassVar[str] = "Muscles"
    icon: ClassVar[str] = "wave-sine"
    rate: ClassVar[float] = 5.0

    @classmethod
    def applies(cls, session: Session) -> bool:
        return session.model is not None and bool(session.muscles)

    def fill(self, gui: Any) -> None:
        session = self.session
        self._raster = gui.add_html("")
        self._which = gui.add_dropdown("Muscle", tuple(session.muscles), initial_value=session.muscles[0])
        self._said = gui.add_html("")
        self._curve = gui.add_html("")
        self._range = _fresh()
        self._form = SettingsForm(self, "Numbers of this muscle")
        self._editable = any(self._settings_of(name) for name in session.muscles)
        if self._editable:
            first = max(session.muscles, key=lambda name: len(self._settings_of(name)))
            self._form.fill(gui, self._settings_of(first))
            self._form.point_at(self._settings_of(self._which.value))
        self._drive: Any = None
        if session.task is None:
            low, high = self._limits()
            self._drive = gui.add_slider("Drive", low, high, step=(high - low) / 200, initial_value=low)
            self._drive.on_update(self.guarded(self._control))
        self._which.on_update(self._choose)
        self._pose: Pose | None = None

    def show(self, snapshot: Snapshot, pose: Pose) -> None:
        self._pose = pose
        trail, row = self.session.trail(), self._chosen
        names = self.session.muscles
        self._raster.content = draw_raster(
            trail.seconds, self._share(trail.activation), names, self.session.period, row
        )
        if not pose.bodies:
            return
        data, law = pose.bodies[0], Law(self.model, row)
        length, velocity = float(data.actuator_length[row]), float(data.actuator_velocity[row])
        activation = float(pose.activation[0, row])
        arms = [(f"moment arm, {arm.joint}", f"{brief(1e3 * arm.metres)} mm") for arm in law.moment_arms(data)[:ARMS]]
        unit = "m" if law.pulls else ""
        self._said.content = table(
            [
                ("activation", f"{activation:.0%}"),
                ("length", f"{brief(length)} {unit}"),
                ("velocity", f"{brief(velocity)} {unit}/s"),
                ("force", f"{brief(law.force_now(data))} N"),
                *arms,
            ]
        )
        self._range = self._range.holding(length, velocity, law.rest_length)
        self._curve.content = draw_operating(law, activation, length, velocity, self._range)
        if self._editable:
            self._form.follow()

    def tell(self, events: list[Event]) -> None:
        if self._editable and any(event.kind == "error" for event in events):
            self._form.refused()

    def numbers(self) -> Numbers:
        trail = self.session.trail()
        actions = columns_of("chosen", self.session.actions, trail.action)
        levels = columns_of("activation", self.session.muscles, trail.activation)
        return {"decision": trail.decision, "seconds": trail.seconds, **levels, **actions}

    @property
    def _chosen(self) -> int:
        return self.session.muscles.index(self._which.value)

    def _share(self, activation: np.ndarray) -> np.ndarray:
        """Activations as shares of the most that each can be."""
        model = self.model
        most = np.abs(model.actuator_ctrlrange).max(axis=1)
        return np.abs(activation) / np.where((model.actuator_ctrllimited > 0) & (most > 0), most, 1.0)

    def _settings_of(self, muscle: str) -> list[str]:
        return [name for name in self.session.settings if name.startswith(f"body.{muscle}.")]

    def _choose(self, _: Any) -> None:
        self._range = _fresh()
        if self._editable:
            self._form.point_at(self._settings_of(self._which.value))
        if self._drive is not None:
            low, high = self._limits()
            now = float(self.session.snapshot().control[0, self._chosen])
            self._drive.min, self._drive.max, self._drive.step = low, high, (high - low) / 200
            self._drive.value = float(np.clip(now, low, high))
        self.renew()

    def _limits(self) -> tuple[float, float]:
        model, row = self.model, self._chosen
        low, high = model.actuator_ctrlrange[row].tolist()
        return (low, high) if model.actuator_ctrllimited[row] and high > low else (-1.0, 1.0)

    def _control(self, event: Any) -> None:
        from motorgrad.sim.live import Control

        if event.client is not None:
            self.order(Control(self._chosen, float(self._drive.value)))


def _fresh() -> Range:
    return Range((np.inf, -np.inf), LEAST)
