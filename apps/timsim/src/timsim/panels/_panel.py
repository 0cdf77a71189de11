"""The base of all panels, and numbers as text: CSV tables for programs, rounded values and tables for people."""

from __future__ import annotations

import csv
import html
import io
import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, Literal

import numpy as np
import viser

from timsim.live import Event, Order, Session, Snapshot
from timsim.scene import Pose

NOTHING = 1e-12  # smaller numbers are rounding errors of zero
HELD = 1.0  # s for which a slider that a user moved is left alone
SINGLE = 1e38  # the largest number of single precision is 3.4e38


def csv_of(columns: Mapping[str, np.ndarray]) -> bytes:
    """Columns of equal length as a CSV table with a header; NaN leaves a cell empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in zip(*(np.asarray(column).tolist() for column in columns.values()), strict=True):
        writer.writerow([_cell(value) if isinstance(value, float) else value for value in row])
    return text.getvalue().encode()


def _cell(value: float) -> str:
    """The shortest text of a single-precision number; twelve digits for any other."""
    if math.isnan(value):
        return ""
    single = np.float32(value) if abs(value) < SINGLE else None
    return str(single) if single == value else f"{value:.12g}"


def columns_of(name: str, names: Sequence[str], rows: np.ndarray) -> dict[str, np.ndarray]:
    """The columns of an array `(n, names)`, by `name` and the name of each."""
    return {f"{name} {each}": column for each, column in zip(names, np.asarray(rows).T, strict=True)}


def brief(value: float, digits: int = 3) -> str:
    """A number with so many significant digits and thousands separators, or a dash where it is NaN."""
    if not math.isfinite(value):
        return "–" if math.isnan(value) else "∞" if value > 0 else "−∞"
    if abs(value) < NOTHING:
        return "0"
    size = math.floor(math.log10(abs(value)))
    if -4 <= size < 6:
        return f"{value:,.{max(0, digits - 1 - size)}f}".replace("-", "−")
    return f"{value:.{digits - 1}e}".replace("-", "−")


def table(rows: Sequence[tuple[str, str]]) -> str:
    """Names and values as an HTML table with aligned values."""
    cells = "".join(
        f'<tr><td style="opacity:.7;padding:1px 10px 1px 0">{html.escape(name)}</td>'
        f'<td style="font-variant-numeric:tabular-nums">{html.escape(value)}</td></tr>'
        for name, value in rows
    )
    return f'<table style="font-size:12px;margin:0 10px 6px;line-height:1.35;border-spacing:0">{cells}</table>'


Numbers = Mapping[str, np.ndarray]
TABLE: Any = "table-export"
REFUSED = (ValueError, TypeError, RuntimeError, OSError)
"""Errors that the user is told in one line; any other is a bug."""
NotificationColour = Literal["red", "green", "blue", "orange"]


class Panel:
    """A tab of the page. A subclass adds its elements in `fill`, updates them in `show`, and may return the numbers
    behind them from `numbers`.

    **Attributes:** `title` of the tab; `rate` of updates in Hz; `hidden`: whether no browser shows the tab. Nothing is
    drawn without a browser, without a change, or while it is hidden.
    """

    title: ClassVar[str]
    rate: ClassVar[float] = 4.0

    server: viser.ViserServer
    session: Session

    def __init__(self) -> None:
        self._due = 0.0
        self._seen = ()
        self.hidden = False
        self.spent = 0.0
        """Seconds spent drawing in all."""

    @property
    def model(self) -> Any:
        """The `mujoco.MjModel` in view, or None; typed as Any, as MuJoCo's bindings carry no types."""
        return self.session.model

    @classmethod
    def applies(cls, session: Session) -> bool:
        """Whether the panel applies to a session."""
        del session
        return True

    def build(self, server: viser.ViserServer, session: Session) -> None:
        """Add the elements to the open container."""
        self.server, self.session = server, session
        self.fill(server.gui)
        if type(self).numbers is not Panel.numbers:
            button = server.gui.add_button("Download numbers (CSV)", icon=TABLE, color="gray")
            button.on_click(self.guarded(self._download))

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        """Update what is shown, if it is due and anything has changed."""
        now = time.monotonic()
        seen = (snapshot.decision, snapshot.reset_count, snapshot.playing, snapshot.frozen, len(snapshot.position))
        if self.hidden or now < self._due or seen == self._seen or not self.server.get_clients():
            return
        self._due = now + 1 / self.rate
        self._seen = seen
        self.show(snapshot, pose)
        self.spent += time.monotonic() - now

    def renew(self, _: object = None) -> None:
        """Update at the next frame, even if the run has not advanced."""
        self._due = 0.0
        self._seen = ()

    def fill(self, gui: viser.GuiApi) -> None:
        """Add the elements."""
        raise NotImplementedError

    def show(self, snapshot: Snapshot, pose: Pose) -> None:
        """Update what is shown."""
        raise NotImplementedError

    def tell(self, events: list[Event]) -> None:
        """Handle events."""

    def numbers(self) -> Numbers:
        """The numbers behind the panel: columns of equal length, by name."""
        raise NotImplementedError

    def order(self, order: Order) -> None:
        """Send an order, and update at once."""
        self.session.order(order)
        self.renew()

    def guarded(self, action: Callable[[Any], object]) -> Callable[[Any], None]:
        """Wrap a callback so that errors of the user are shown in one line."""

        def run(event: viser.GuiEvent) -> None:
            try:
                action(event)
            except REFUSED as error:
                notify(self.server, " ".join(str(error).split()), client=event.client)

        return run

    def _download(self, event: viser.GuiEvent) -> None:
        name = f"{self.session.name}-{self.title.lower()}.csv".replace("/", "-").replace(" ", "-")
        send(self.server, event.client, name, csv_of(self.numbers()))


class Following:
    """A slider that shows a number of the session, until a user moves it.

    viser sets a slider's value some time before it calls back. So a value that is not the one that was set here last is
    a user's, of whom the panel is about to be told, and is left alone.
    """

    def __init__(self, slider: Any) -> None:
        self._slider = slider
        self._last = slider.value
        self._moved = -math.inf

    def show(self, value: float | tuple[float, ...]) -> None:
        """Set the slider, unless a user has just moved it."""
        if not self.is_moved:
            self._last = value
            self._slider.value = value

    @property
    def is_moved(self) -> bool:
        """Whether a user has just moved it."""
        return self._slider.value != self._last or time.monotonic() - self._moved < HELD

    def moved(self) -> None:
        """A user has moved it."""
        self._moved = time.monotonic()
        self._last = self._slider.value


def notify(
    server: viser.ViserServer,
    text: str,
    title: str = "Refused",
    color: NotificationColour = "red",
    client: viser.ClientHandle | None = None,
) -> None:
    """Show one line to one browser, or to all, for ten seconds."""
    for each in [client] if client is not None else list(server.get_clients().values()):
        each.add_notification(title, text, auto_close_seconds=10.0, color=color)


def send(server: viser.ViserServer, client: viser.ClientHandle | None, name: str, content: bytes) -> None:
    """Let one browser, or all of them, save a file."""
    (client if client is not None else server).send_file_download(name, content, save_immediately=True)


def command(gui: viser.GuiApi, label: str, key: Any, action: Callable[[viser.CommandEvent], None]) -> None:
    """Add an entry with a key to the page's command palette."""
    gui.add_command(label, hotkey=key).on_trigger(action)
