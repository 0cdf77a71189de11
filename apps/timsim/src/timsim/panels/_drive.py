"""Find muscles among many on the page, and drive one or all of those found, by a pattern or a recording."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

from __future__ import annotations

import html
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from motorgrad._errors import check
from timsim.film import read_activations
from timsim.live import PATTERNS, Control, Drive, DriveRecorded, confined, control_limits
from timsim.panels._muscle_groups import ALL, ORDERS, chosen_rows, groups_of
from timsim.panels._panel import Panel

MANY = 8
"""Muscles from which on they can be searched, grouped and sorted."""
AGAIN = 1.0  # s between two sorts by what changes
CHOSEN = "the chosen muscle"
FOUND = "all in the list"


class MuscleFinder:
    """A search, groups and an order of muscles.

    **Arguments:** `panel`: that it belongs to; `levels`: returns the forces of all actuators, or with False their
    activations.
    """

    def __init__(self, panel: Panel, levels: Callable[[bool], np.ndarray]) -> None:
        self._panel, self._levels = panel, levels
        self._search: Any = None
        self._rows: list[int] = list(range(len(panel.session.muscles)))
        self._seen: tuple[str, ...] = ()
        self._due = 0.0

    def fill(self, gui: viser.GuiApi) -> None:
        """Add the elements if the body has many muscles."""
        names = self._panel.session.muscles
        if len(names) < MANY:
            return
        self._groups = groups_of(self._panel.model, names)
        labels = {f"{name} ({len(rows)})": name for name, rows in self._groups.items()}
        self._labels = labels
        self._search = gui.add_text("Search", "", hint="Parts of names, or patterns such as gas*_l; with spaces.")
        self._group = gui.add_dropdown("Group", tuple(labels), initial_value=next(iter(labels)))
        self._order = gui.add_dropdown("Order", ORDERS, initial_value=ORDERS[0], hint="The greatest first.")
        for each in (self._search, self._group, self._order):
            each.on_update(self._panel.renew)

    @property
    def narrowed(self) -> bool:
        """Whether the search selects only some of the muscles."""
        return self._search is not None and bool(self._search.value.strip() or self._labels[self._group.value] != ALL)

    def rows(self) -> list[int]:
        """The numbers of the muscles found, in order; of all muscles if none is found."""
        if self._search is None:
            return self._rows
        wanted = (self._search.value, self._group.value, self._order.value)
        now = time.monotonic()
        if wanted != self._seen or (self._order.value in ORDERS[2:] and now > self._due):
            self._seen = wanted
            self._due = now + AGAIN
            group = self._groups[self._labels[self._group.value]]
            levels = (lambda: self._levels(True)), (lambda: self._levels(False))
            self._rows = chosen_rows(self._panel.session.muscles, group, wanted[0], wanted[2], *levels)
        return self._rows

    def note(self, shown: int) -> str:
        """A note on the muscles that are not shown, as HTML."""
        count = len(self._rows)
        every = len(self._panel.session.muscles)
        if count == every == shown:
            return ""
        words = f"{count} of {every} muscles found" + (f", the first {shown} shown" if shown < count else "")
        words = words if count else f"no muscle of {every} is called so"
        return f'<div style="font-size:12px;opacity:.75;margin:0 10px 6px">{html.escape(words)}</div>'


class DriveFolder:
    """Drives muscles of a body without a learner.

    **Arguments:** `panel`; `finder`: which muscles are found; `chosen`: returns the number of the chosen one.
    """

    def __init__(self, panel: Panel, finder: MuscleFinder, chosen: Callable[[], int]) -> None:
        self._panel, self._finder, self._chosen = panel, finder, chosen
        self._slider: Any = None

    def fill(self, gui: viser.GuiApi) -> None:
        """Add the elements."""
        panel = self._panel
        self._limits = control_limits(panel.model)
        low, high = self._limits[self._chosen()].tolist()
        with gui.add_folder("Drive"):
            self._slider = gui.add_slider("By hand", low, high, step=(high - low) / 200, initial_value=low)
            self._slider.on_update(panel.guarded(self._control))
            self._which = gui.add_dropdown("What", (CHOSEN, FOUND), initial_value=FOUND)
            self._pattern = gui.add_dropdown("Pattern", PATTERNS, initial_value="sine")
            self._amplitude = gui.add_slider("Amplitude", 0.0, 1.0, 0.01, 0.5, hint="As a share of the range.")
            self._pace = gui.add_number("Frequency (Hz)", 1.0, min=0.01, max=100.0, step=0.1)
            buttons = gui.add_button_group(" ", ("Start", "Stop"))
            buttons.on_click(panel.guarded(lambda event: self._drive(event.target.value)))
            hint = "In the working folder: .csv, .mot, .sto, .npz or .npy, with the names of muscles."
            self._path = gui.add_text("Recorded", "", hint=hint)
            gui.add_button("Play the recorded activations", icon=viser.Icon.PLAYER_PLAY).on_click(
                panel.guarded(self._recorded)
            )

    def follow(self) -> None:
        """Show the drive of another muscle."""
        if self._slider is None:
            return
        row = self._chosen()
        low, high = self._limits[row].tolist()
        now = float(self._panel.session.snapshot().control[0, row])
        self._slider.min = low
        self._slider.max = high
        self._slider.step = (high - low) / 200
        self._slider.value = float(np.clip(now, low, high))

    def _control(self, event: viser.GuiEvent) -> None:
        if event.client is not None:
            self._panel.order(Control(self._chosen(), float(self._slider.value)))

    def _drive(self, button: str) -> None:
        rows = (self._chosen(),) if self._which.value == CHOSEN else tuple(self._finder.rows())
        check(rows, "Search", "no muscle", "one that finds some")
        if button == "Stop":
            self._panel.order(Drive(rows, "constant", 0.0))
        else:
            self._panel.order(Drive(rows, self._pattern.value, self._amplitude.value, self._pace.value))

    def _recorded(self, _: viser.GuiEvent) -> None:
        path = confined(self._path.value.strip(), self._panel.session.folders)
        seconds, rows, values = read_activations(path, self._panel.model)
        self._panel.order(DriveRecorded(tuple(rows), seconds, values))
