"""What every panel is: a tab that shows some of a run, and costs little."""

from __future__ import annotations

import csv
import html
import io
import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
import viser

from motorgrad.sim.live import Event, Order, Session, Snapshot
from motorgrad.sim.scene import Pose

NOTHING = 1e-12
"""A number smaller than this is what rounding left of none."""


def csv_of(columns: Mapping[str, np.ndarray]) -> bytes:
    """Columns of one length as a CSV table with a header; a number that is not known leaves its place empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in zip(*(np.asarray(column).tolist() for column in columns.values()), strict=True):
        writer.writerow(["" if isinstance(value, float) and math.isnan(value) else value for value in row])
    return text.getvalue().encode()


def columns_of(name: str, names: Sequence[str], rows: np.ndarray) -> dict[str, np.ndarray]:
    """The columns of an array `(n, names)`, each called after what it is and whose."""
    return {f"{name} {each}": column for each, column in zip(names, np.asarray(rows).T, strict=True)}


def brief(value: float, digits: int = 3) -> str:
    """A number for people: so many significant digits, thousands set apart, a dash where it is not known."""
    if not math.isfinite(value):
        return "–" if math.isnan(value) else "∞" if value > 0 else "−∞"
    if abs(value) < NOTHING:
        return "0"
    size = math.floor(math.log10(abs(value)))
    if -4 <= size < 6:
        return f"{value:,.{max(0, digits - 1 - size)}f}".replace("-", "−")
    return f"{value:.{digits - 1}e}".replace("-", "−")


def table(rows: Sequence[tuple[str, str]]) -> str:
    """Names and values as HTML, the values in line."""
    cells = "".join(
        f'<tr><td style="opacity:.7;padding:1px 10px 1px 0">{html.escape(name)}</td>'
        f'<td style="font-variant-numeric:tabular-nums">{html.escape(value)}</td></tr>'
        for name, value in rows
    )
    return f'<table style="font-size:12px;margin:0 10px 6px;line-height:1.35;border-spacing:0">{cells}</table>'


Numbers = Mapping[str, np.ndarray]
TABLE: Any = "table-export"
REFUSED = (ValueError, TypeError, RuntimeError, OSError)
"""What the user is told in one line; anything else is a fault of ours."""


class Panel:
    """A tab of the page. A subclass adds its elements in `fill`, renews them in `show`, and says in `numbers` what lies
    behind them.

    **Attributes:** `title`, of the tab; `icon`, one of viser's; `rate`, how often it is renewed, in Hz. Nothing is
    drawn for nobody: neither without a browser nor where nothing has changed.
    """

    title: ClassVar[str]
    icon: ClassVar[str]
    rate: ClassVar[float] = 4.0

    server: viser.ViserServer
    session: Session

    def __init__(self) -> None:
        self._due, self._seen = 0.0, ()
        self.spent = 0.0
        """Seconds that drawing has taken in all."""

    @property
    def model(self) -> Any:
        """The `mujoco.MjModel` in view, or None; its bindings carry no types."""
        return self.session.model

    @classmethod
    def applies(cls, session: Session) -> bool:
        """Whether a run has what the panel shows."""
        del session
        return True

    def build(self, server: viser.ViserServer, session: Session) -> None:
        """Add the elements, in the container that is open."""
        self.server, self.session = server, session
        self.fill(server.gui)
        if type(self).numbers is not Panel.numbers:
            button = server.gui.add_button("Download numbers (CSV)", icon=TABLE, color="gray")
            button.on_click(self.guarded(self._download))

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        """Renew what is shown, if it is time to and anything has changed."""
        now = time.monotonic()
        seen = (snapshot.decision, snapshot.reset_count, snapshot.playing, snapshot.frozen, len(snapshot.position))
        if now < self._due or seen == self._seen or not self.server.get_clients():
            return
        self._due, self._seen = now + 1 / self.rate, seen
        self.show(snapshot, pose)
        self.spent += time.monotonic() - now

    def renew(self, _: Any = None) -> None:
        """Show it anew at the next moment, whether or not the run has gone on."""
        self._due, self._seen = 0.0, ()

    def fill(self, gui: Any) -> None:
        """Add the elements."""
        raise NotImplementedError

    def show(self, snapshot: Snapshot, pose: Pose) -> None:
        """Renew what is shown."""
        raise NotImplementedError

    def tell(self, events: list[Event]) -> None:
        """Take note of what happened."""

    def numbers(self) -> Numbers:
        """Columns by name, of one length: what is behind the panel."""
        raise NotImplementedError

    def order(self, order: Order) -> None:
        """Send an order, of which the user sees the effect at once."""
        self.session.order(order)
        self.renew()

    def guarded(self, action: Callable[[Any], object]) -> Callable[[Any], None]:
        """A callback that tells the user in one line why something was not done."""

        def run(event: Any) -> None:
            try:
                action(event)
            except REFUSED as error:
                notify(self.server, " ".join(str(error).split()), client=event.client)

        return run

    def _download(self, event: Any) -> None:
        name = f"{self.session.name}-{self.title.lower()}.csv".replace("/", "-").replace(" ", "-")
        send(self.server, event.client, name, csv_of(self.numbers()))


def notify(
    server: viser.ViserServer, text: str, title: str = "Not done", color: Any = "red", client: Any = None
) -> None:
    """Tell one line to one browser, or to all; it stays for ten seconds."""
    for each in [client] if client is not None else list(server.get_clients().values()):
        each.add_notification(title, text, auto_close_seconds=10.0, color=color)


def send(server: viser.ViserServer, client: Any, name: str, content: bytes) -> None:
    """Let a browser, or all of them, save a file."""
    (client if client is not None else server).send_file_download(name, content, save_immediately=True)


def command(gui: Any, label: str, key: str, action: Any) -> None:
    """An entry of the page's palette of commands, with a key."""
    gui.add_command(label, hotkey=key).on_trigger(action)
