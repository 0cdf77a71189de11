"""Settings as text fields, so that 5e-4 can be typed. Enter submits all changes together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import viser

from motorgrad.schema import sentence
from timsim.live import declared_setting, field_of, geom_of

if TYPE_CHECKING:
    from motorgrad.learning import Learner
    from motorgrad.tasks import Task
    from timsim.panels._panel import Panel

SETTING_LABELS = {
    "exploration": ("exploration", "A factor on the temperature of the units, or on their noise."),
    "strength": ("strength (N)", "The greatest force."),
    "rest_length": ("rest length (m)", "Where the force is greatest."),
    "max_isometric_force": ("isometric force (N)", "The greatest, of the fiber at its optimal length."),
    "optimal_fiber_length": ("optimal fiber (m)", "The length at which the fiber is strongest."),
    "tendon_slack_length": ("slack tendon (m)", "The length beyond which the tendon pulls."),
    "damping": ("damping (N·s/m)", "Of the muscle's whole path."),
    "mass": ("mass (kg)", "The moments of inertia change with it, in proportion."),
    "friction": ("friction", "Of sliding. Of two that touch, the greater coefficient counts."),
    "radius": ("radius (m)", "Mass and moments of inertia stay as they are."),
    "half_length": ("half length (m)", "Without round ends. Mass and moments of inertia stay as they are."),
    "half_width_x": ("half width x (m)", "Mass and moments of inertia stay as they are."),
    "half_width_y": ("half width y (m)", "Mass and moments of inertia stay as they are."),
    "half_width_z": ("half width z (m)", "Mass and moments of inertia stay as they are."),
    "gravity_x": ("gravity x (m/s²)", "World coordinates."),
    "gravity_y": ("gravity y (m/s²)", "World coordinates."),
    "gravity_z": ("gravity z (m/s²)", "World coordinates; −9.81 on earth, −1.62 on the moon."),
    "timestep": ("time step (s)", "Of the physics: a decision divided by a whole number."),
    "terrain_height": ("terrain height (m)", "Of its highest possible point."),
}

OUTER = ("estimator", "optimizer")
"""Parts of a learner whose names are left out of the labels of their numbers."""


class SettingsForm:
    """Some of a session's settings as a form. Submitting it sends the changed ones.

    **Arguments:** the panel that it stands in; `label`, of the form; `button`, what submits it.

    A setting that the run refuses, or that is no number, is put back to what it is, and the user is told why.
    """

    def __init__(self, panel: Panel, label: str = "Settings", button: str = "Apply") -> None:
        self._panel, self._label, self._button = panel, label, button
        self._fields: list[Any] = []
        self._names: list[str] = []
        self._shown: dict[str, float] = {}

    def fill(self, gui: viser.GuiApi, names: Sequence[str]) -> None:
        """Add the form, with a field for each setting."""
        self._names = list(names)
        with gui.add_form(self._label) as form:
            for name in names:
                label, hint = self._words(name)
                self._fields.append(gui.add_text(label, self._text(name), hint=f"{hint} {name}".strip()))
            button = gui.add_button(self._button, icon=viser.Icon.CHECK)
        button.on_click(lambda _: form.submit())
        form.on_submit(self._panel.guarded(self._submit))

    def point_at(self, names: Sequence[str]) -> None:
        """Show other settings in the same fields, and hide unused fields."""
        self._names = list(names)
        for field, name in zip(self._fields, names, strict=False):
            field.value = self._text(name)
            field.label = self._words(name)[0]
        for row, field in enumerate(self._fields):
            field.visible = row < len(names)

    def refresh(self) -> None:
        """Show changes made elsewhere: by another browser, or by going back in time."""
        for field, name in zip(self._fields, self._names, strict=False):
            if self._shown.get(name) != self._panel.session.settings[name]:
                field.value = self._text(name)

    def _words(self, name: str) -> tuple[str, str]:
        return words_of(name, self._panel.session.task, self._panel.session.agent)

    def _text(self, name: str) -> str:
        value = self._panel.session.settings[name]
        self._shown[name] = value
        return f"{value:.6g}"

    def _submit(self, _: viser.GuiEvent) -> None:
        from timsim.live import Edit

        try:
            changes = []
            for field, name in zip(self._fields, self._names, strict=False):
                if field.value.strip() != f"{self._shown[name]:.6g}":
                    changes.append(Edit(name, number_of(self._words(name)[0], field.value)))
            try:
                for change in changes:
                    self._panel.order(change)
            except ValueError:
                self.refused()
                raise
        finally:
            for field, name in zip(self._fields, self._names, strict=False):
                if not _is_number(field.value):
                    field.value = self._text(name)

    def refused(self) -> None:
        """Reset every field to the run's value."""
        self._shown.clear()
        self.refresh()


def words_of(name: str, task: Task | None = None, agent: Learner | None = None) -> tuple[str, str]:
    """A setting's label, with its unit, and what it means; of a task and a learner, what their fields declare."""
    if name.startswith("body."):
        label, hint = SETTING_LABELS[field_of(name)]
        geom = geom_of(name)
        return (f"{geom}: {label}" if geom else label), hint
    if name in SETTING_LABELS:
        return SETTING_LABELS[name]
    declared = declared_setting(name, task, agent)
    words = [each for each in name.split(".")[1:] if each not in OUTER]
    label = " ".join(words).replace("_", " ")
    return f"{label} ({declared.unit})" if declared.unit else label, sentence(declared) if declared.help else ""


def number_of(name: str, text: str) -> float:
    """The number in a text. **Raises** `ValueError` that names the field."""
    if not _is_number(text):
        raise ValueError(f"{name} = {text!r}: must be a number, such as 0.5 or 5e-4")
    return float(text)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
