"""Forms for the terms of a composed task. Each field comes from the term's dataclass, with its meaning and unit."""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import viser

from motorgrad.schema import declared_by, default_of, descriptions, fields_of, hints_of, options_of
from motorgrad.tasks import terms

LEFT_OUT: dict[str, tuple[str, ...]] = {
    "targets": ("time", "values"),
    "observe": ("weight", "above", "below", "name", "at_end"),
    "reward": ("above", "below", "name", "at_end"),
    "terminate": ("weight", "name", "at_end"),
    "metrics": ("weight", "above", "below"),
}
"""Settings of terms that mean nothing, or cannot be typed, in a place."""
PLACES: dict[str, tuple[str, tuple[type, ...]]] = {
    "targets": ("Targets", (terms.Target,)),
    "observe": ("What is observed", (terms.Observation, terms.Quantity)),
    "reward": ("What is rewarded", (terms.Quantity,)),
    "terminate": ("What ends an episode", (terms.Quantity,)),
    "reset": ("How an episode starts", (terms.Reset,)),
    "metrics": ("What is recorded", (terms.Quantity,)),
}
"""The lists of a composed task: their headings, and the terms that they take."""
ADD = "add …"


def kinds_for(place: str) -> dict[str, type]:
    """The terms that a list accepts, by name."""
    return {name: kind for base in PLACES[place][1] for name, kind in base.kinds().items()}  # type: ignore[attr-defined]


class TermForm:
    """One term: a folder with a field for each setting, and a button that removes it.

    **Arguments:** `gui`: viser's, within the list; `place`: the list, such as `"reward"`; `table` of the term, with its
    `kind`; `removed`: called with the form.
    """

    def __init__(
        self, gui: viser.GuiApi, place: str, table: Mapping[str, Any], removed: Callable[[TermForm], None]
    ) -> None:
        self.kind = str(table["kind"])
        self._class = kinds_for(place)[table["kind"]]
        self._fields: dict[str, tuple[Any, Any]] = {}
        words = descriptions(self._class)
        self._folder = gui.add_folder(self.kind, expand_by_default=False)
        with self._folder:
            for name, field in fields_of(self._class).items():
                if name in LEFT_OUT.get(place, ()):
                    continue
                default = default_of(field)
                hint = hints_of(self._class)[name]
                value = table.get(name, None if default is dataclasses.MISSING else default)
                unit = declared_by(field).unit
                label = f"{name} ({unit})" if unit else name
                label = label.replace("_", " ")
                self._fields[name] = default, _field(gui, label, hint, value, words.get(name, ""))
            gui.add_button("Remove", icon=viser.Icon.TRASH, color="gray").on_click(lambda _: removed(self))

    def table(self) -> dict[str, Any]:
        """The term as a table: its kind, and the settings that differ from the defaults. **Raises** `ValueError`."""
        found: dict[str, Any] = {"kind": self.kind}
        for name, (default, handle) in self._fields.items():
            value = _value(f"{self.kind}: {name}", hints_of(self._class)[name], handle.value)
            if value is not None and value != _listed(default):
                found[name] = value
        return found

    def remove(self) -> None:
        """Remove the form from the page."""
        self._folder.remove()


class TermList:
    """One list of a composed task, to which terms can be added.

    **Arguments:** `gui`; `place`: the list.
    """

    def __init__(self, gui: viser.GuiApi, place: str) -> None:
        self._gui = gui
        self.place = place
        self._forms = list[TermForm]()
        self._folder = gui.add_folder(PLACES[place][0])
        with self._folder:
            known = (ADD, *sorted(kinds_for(place)))
            self._more = gui.add_dropdown(f"Add to {place}", known, initial_value=ADD, order=1e6)
        self._more.on_update(self._add)

    def fill(self, tables: Sequence[Any]) -> None:
        """Show other terms instead: names, or tables."""
        for form in self._forms:
            form.remove()
        self._forms = []
        for each in tables:
            self._append({"kind": each} if isinstance(each, str) else each)

    def tables(self) -> list[dict[str, Any]]:
        """The terms as tables. **Raises** `ValueError`."""
        return [form.table() for form in self._forms]

    def _append(self, table: Mapping[str, Any]) -> None:
        with self._folder:
            self._forms.append(TermForm(self._gui, self.place, table, self._removed))

    def _add(self, event: viser.GuiEvent) -> None:
        kind = event.target.value
        if event.client is not None and kind != ADD:
            self._append({"kind": kind})
            self._more.value = ADD

    def _removed(self, form: TermForm) -> None:
        self._forms.remove(form)
        form.remove()


def _field(gui: viser.GuiApi, label: str, hint: object, value: object, words: str) -> Any:
    """The form field for a setting of this type."""
    if hint is bool:
        return gui.add_checkbox(label, bool(value), hint=words)
    if typing.get_origin(hint) is typing.Literal:
        return gui.add_dropdown(label, typing.get_args(hint), initial_value=value, hint=words)
    return gui.add_text(label, _text(value), hint=words)


def _text(value: object) -> str:
    if value is None or value == "none":
        return ""
    if isinstance(value, tuple | list):
        return ", ".join(map(_text, value))
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _value(where: str, hint: object, given: object) -> Any:
    """The setting in a field; None for an empty text. **Raises** `ValueError`."""
    if not isinstance(given, str) or typing.get_origin(hint) is typing.Literal:
        return given
    words = [word.strip() for word in given.split(",") if word.strip()]
    options = options_of(hint)
    numbers = any(typing.get_args(option)[:1] == (float,) for option in options)
    if not words:
        return None
    if float in options or int in options or numbers:
        try:
            found = [float(word.replace("−", "-")) for word in words]
        except ValueError:
            raise ValueError(f"{where} = {given!r}: must be {'numbers' if numbers else 'a number'}") from None
        if numbers:
            return found
        if len(found) > 1:
            raise ValueError(f"{where} = {given!r}: must be one number")
        return int(found[0]) if int in options and found[0].is_integer() else found[0]
    return words if len(words) > 1 else words[0]


def _listed(value: object) -> Any:
    return list(value) if isinstance(value, tuple) else value
