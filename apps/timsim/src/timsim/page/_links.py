"""Links to a moment and a view, in the fragment (#…) of the page's address, and who may follow them."""

from __future__ import annotations

import dataclasses
import html
import time
from typing import Any
from urllib.parse import parse_qsl, quote, urlencode

import viser

from motorgrad._errors import check
from timsim.live import Scrub, Session, Snapshot
from timsim.panels import notify
from timsim.scene import Cameras, Guard, Pose, camera_named, own, own_elements, watches

RATE = 4.0  # Hz, at which changes are looked for
LATEST = 2**53  # decisions, or seconds, that a link may name
WATCHED = "Whoever opens it sees the run, turns the camera and switches tabs, and can change nothing."
REFUSED = (ValueError, RuntimeError)


@dataclasses.dataclass(frozen=True)
class Place:
    """A moment and a view; None leaves a part as it is.

    **Arguments:** `decision`, or `time` in simulated seconds, of which only one; `camera`, by its name in the list of
    cameras, those of the model also without "Fixed: "; `tab`, by its title.

    **Raises** `ValueError` for a moment that cannot be.
    """

    decision: int | None = None
    time: float | None = None
    camera: str | None = None
    tab: str | None = None

    def __post_init__(self) -> None:
        whole = self.decision is None or (isinstance(self.decision, int) and 0 <= self.decision < LATEST)
        check(whole, "decision", self.decision, "an integer from 0")
        fine = self.time is None or 0 <= self.time < LATEST
        check(fine, "time", self.time, "simulated seconds from 0")
        check(self.decision is None or self.time is None, "time", self.time, "left out where there is a decision")

    @property
    def fragment(self) -> str:
        """The place as an address's fragment, with its "#"; empty for no place."""
        given = {name: value for name, value in dataclasses.asdict(self).items() if value is not None}
        return f"#{urlencode(given, quote_via=quote)}" if given else ""

    def moment(self, period: float) -> int | None:
        """The decision of the place, for decisions of `period` seconds."""
        return round(self.time / period) if self.time is not None else self.decision


def read_place(fragment: str) -> Place:
    """The place in an address's fragment. Unknown names are ignored. **Raises** `ValueError` for an unreadable
    value."""
    kinds: dict[str, Any] = {"decision": int, "time": float, "camera": str, "tab": str}
    found = {}
    for name, text in parse_qsl(fragment.lstrip("#")):
        try:
            if name in kinds:
                found[name] = kinds[name](text)
        except ValueError:
            check(False, name, text[:40], "a number")
    return Place(**found)


def link_element(address: str, words: str, hint: str) -> str:
    """An address to copy, as HTML; the page's script copies it, with the present view, on a click."""
    address, words, hint = map(html.escape, (address, words, hint))
    return (
        f'<button class="motorgrad-copy" title="{hint}" data-address="{address}">{words}</button>'
        f'<span class="motorgrad-copied" role="status"></span>'
    )


class Links:
    """Takes every browser to the moment and view in the fragment of its address, and keeps the address up to date.

    A browser that may only watch gets the view alone. The page's script says through a field of the browser's own what
    its address has, and reads from an element that is not shown what the address should have.

    **Arguments:** `cameras` of the page.
    """

    def __init__(self, cameras: Cameras) -> None:
        self._cameras = cameras
        self._fields: dict[int, Any] = {}
        self._sent: dict[int, tuple[Any, str]] = {}
        self._waiting: int | None = None
        self._guard = Guard("the address of a browser")
        self._due = 0.0
        self._moment = ""

    def build(self, server: viser.ViserServer, session: Session) -> None:
        """Give each browser its field, and forget those that have gone."""
        self._server, self._session = server, session
        self._element = server.gui.add_html("")
        server.on_client_connect(self._connect)

        @server.on_client_disconnect
        async def _(client: viser.ClientHandle) -> None:
            for known in (self._fields, self._sent):
                known.pop(client.client_id, None)

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        """Send each browser its address."""
        del pose
        now = time.monotonic()
        if now < self._due:
            return
        self._due = now + 1 / RATE
        if self._waiting is not None and snapshot.newest >= self._waiting:
            self._session.order(Scrub(self._waiting))
            self._waiting = None
        moment = "" if snapshot.playing else str(snapshot.decision)
        if moment != self._moment:
            self._moment = moment
            self._element.content = f'<div class="motorgrad-moment" data-decision="{moment}"></div>'
        for number, client in self._server.get_clients().items():
            field = self._fields.get(number)
            if field is not None:
                self._guard(str(number), self._tell, number, client, field)

    def go(self, client: viser.ClientHandle, text: str) -> None:
        """Take a browser to the place in its address. **Raises** `ValueError` for an unknown one."""
        place = read_place(text)
        if place.camera is not None and self._cameras.names:
            self._cameras.select(client.client_id, camera_named(place.camera, self._cameras.names))
        decision = place.moment(self._session.period)
        if decision is None or watches(self._server, client.client_id):
            return
        now = self._session.snapshot()
        if decision > now.newest:
            self._waiting = decision
            words = f"the run is at decision {now.newest:,}, and pauses when it gets to {decision:,}"
            notify(self._server, words, "Link", "blue", client)
        elif (decision, False) != (now.decision, now.playing):
            self._session.order(Scrub(decision))

    def _connect(self, client: viser.ClientHandle) -> None:
        field = own(client.gui.add_text("Link", "", visible=False))

        def heard(event: viser.GuiEvent) -> None:
            try:
                self.go(client, event.target.value.partition(":")[2])  # a number before it tells repetitions apart
            except REFUSED as error:
                notify(self._server, str(error), client=client)

        field.on_update(heard)
        self._fields[client.client_id] = field

    def _tell(self, number: int, client: viser.ClientHandle, field: viser.GuiTextHandle) -> None:
        shown = [uuid for uuid, handle in own_elements(client).items() if getattr(handle, "visible", True)]
        camera = self._cameras.chosen(number).removeprefix("Fixed: ").lower()
        if self._cameras.names and not camera:  # it has just come
            return
        words = f'data-own="{" ".join(shown)}" data-go="{field._impl.uuid}" data-camera="{html.escape(camera)}"'
        element, sent = self._sent.get(number, (None, ""))
        if words != sent:
            element = client.gui.add_html("") if element is None else element
            self._sent[number] = element, words
            element.content = f'<div class="motorgrad-own" {words}></div>'
