"""Guided tours: a card over the scene that moves one browser's camera and tab, and waits until something happens."""

from __future__ import annotations

import html
import itertools
import time
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import viser

from timsim.live import Session, Snapshot
from timsim.panels._clicks import ClickSelect
from timsim.panels._panel import brief
from timsim.panels._panels import Panels
from timsim.panels._tours import TourStep, check_tour, read_tour, tour_of
from timsim.scene import Cameras, Guard, Pose, camera_named, own

RATE = 4.0  # Hz, at which is looked whether a step is over
KEY = "T"
BEGIN = "begin"
UNTIL = {
    "next": "",
    "play": "Continues when the run plays.",
    "pause": "Continues when the run is paused.",
    "push": "Continues after a push.",
    "edit": "Continues after a change.",
}


class Waiting:
    """The condition that a step waits for, measured from the step's start.

    **Arguments:** `step`; `session`; `snapshot` at which the step begins.

    **Attributes:** `open`: whether the button alone goes on, as nothing is waited for or it was so at the beginning.
    """

    def __init__(self, step: TourStep, session: Session, snapshot: Snapshot) -> None:
        self._step, self._session, self._first = step, session, snapshot
        self._begun = time.time()
        self.open = step.wait == "next" or self.over(snapshot)

    def over(self, snapshot: Snapshot) -> bool:
        """Whether the condition is met."""
        wait, amount = self._step.wait, self._step.amount
        if wait in ("play", "pause"):
            return snapshot.playing == (wait == "play")
        if wait == "push":
            return any(text.startswith("push ") for text in self._changes())
        if wait == "edit":
            return any(not text.startswith("push ") for text in self._changes()) or self._driven(snapshot)
        value = self._value(snapshot)
        return amount is not None and value is not None and value >= amount

    def words(self, snapshot: Snapshot) -> str:
        """The condition and its progress, for the card."""
        step = self._step
        if self.open or step.amount is None:
            return "" if self.open else UNTIL[step.wait]
        value = self._value(snapshot)
        now = "–" if value is None else brief(value)
        if step.wait == "metric":
            return f"Continues when {step.metric} reaches {step.amount:g}; now {now}."
        unit = "s" if step.wait == "seconds" else "decisions"
        paused = "" if snapshot.playing else " The run is paused."
        return f"Continues after {step.amount:g} {unit}; now {now}.{paused}"

    def _value(self, snapshot: Snapshot) -> float | None:
        """The quantity that a step with an amount measures; None for a metric that is not known yet."""
        if self._step.wait == "decisions":
            return float(snapshot.decision - self._first.decision)
        if self._step.wait == "seconds":
            return snapshot.seconds - self._first.seconds
        if self._step.metric is None:
            return None
        curve = self._session.curve().until(snapshot.decision).values[self._step.metric]
        known = curve[np.isfinite(curve)]
        return float(known[-1]) if len(known) else None

    def _changes(self) -> list[str]:
        """What was changed since the step began."""
        changes = []
        for event in reversed([*self._session.log]):
            if event.wall < self._begun:
                break
            if event.kind in ("change", "loaded"):
                changes.append(event.text)
        return changes

    def _driven(self, snapshot: Snapshot) -> bool:
        """Whether the drive of a body without a learner has changed, which no event reports."""
        alone = self._session.task is None and self._session.setup.motion is None
        return alone and not np.array_equal(snapshot.control, self._first.control)


class Guide:
    """One browser's tour: its card and its current step.

    **Arguments:** `client`, the browser's handle; `field`, by which its page answers.
    """

    def __init__(self, client: viser.ClientHandle, field: viser.GuiTextHandle) -> None:
        self.client, self.field = client, field
        self.steps: tuple[TourStep, ...] = ()
        self.at = 0
        self.heard = ""
        self.waiting: Waiting | None = None
        self._element: Any = None
        self._shown = ""
        self._number = 0

    def show(self, snapshot: Snapshot) -> None:
        """Show the card of the current step, or none."""
        words = "" if self.waiting is None else self._card(self.waiting.words(snapshot))
        if words == self._shown:
            return
        self._shown = words
        if self._element is None:
            self._element = self.client.gui.add_html("")
        self._element.content = words

    def begin(self, session: Session, snapshot: Snapshot) -> None:
        """Begin to wait at the current step."""
        self.waiting = Waiting(self.steps[self.at], session, snapshot)
        self._number = next(_counts)

    def _card(self, hint: str) -> str:
        last = self.at == len(self.steps) - 1
        back = '<button data-word="back"' + (" disabled>" if self.at == 0 else ">") + "Back</button>"
        end = "" if last else '<button data-word="end">End</button>'
        return (
            f'<div class="motorgrad-tour-source" data-go="{self.field._impl.uuid}" data-step="{self._number}">'
            f"<p>{html.escape(self.steps[self.at].text)}</p>"
            f'<p class="hint">{html.escape(hint)}</p>'
            f"<footer><span>{self.at + 1} of {len(self.steps)}</span>{back}{end}"
            f'<button data-word="next">{"Done" if last else "Next"}</button></footer></div>'
        )


class Tours:
    """The guided tour of a page. Every browser takes it independently, even one that may only watch.

    The button "Tour", or the key T, starts it for the browser that pressed it. Each step is a card over the
    scene and moves that browser's camera and tab. It goes on when what it waits for happens, or with Next.
    Keys: Page Down, Page Up, Escape.

    Call it with steps to give the page a tour of its own, in place of the library's:

    ```py
    from timsim.panels import TourStep

    page.tour([
        TourStep("A hopper. Press Play.", camera="side", tab="Run", wait="play"),
        TourStep("Now push it.", wait="push"),
        TourStep("It learns for a minute.", tab="Learning", wait="seconds", amount=60.0),
    ])
    ```

    **Arguments:** `cameras`, `panels` and `clicks` of the page; `tabs`: titles of further tabs.

    **Attributes:** `steps`.
    """

    def __init__(self, cameras: Cameras, panels: Panels, clicks: ClickSelect, tabs: Sequence[str] = ()) -> None:
        self._cameras, self._panels, self._clicks, self._more = cameras, panels, clicks, tabs
        self._guides: dict[int, Guide] = {}
        self._guard = Guard("the tour of a browser")
        self._asked: deque[tuple[int, str]] = deque()
        self._due = 0.0

    def __call__(self, steps: Iterable[TourStep | Mapping[str, Any]]) -> None:
        """Set the page's steps, or tables of their arguments; tours that have begun keep theirs.

        **Raises** `ValueError` that names the step, for an unknown camera, tab, metric or event.
        """
        found = read_tour(list(steps))
        check_tour(found, self._session, self._cameras.names, self._tabs)
        self.steps = found

    @property
    def _tabs(self) -> list[str]:
        return [*self._panels.panels, *self._more]

    def build(self, server: viser.ViserServer, session: Session) -> None:
        """Use the library's tour of the session's body."""
        self._server, self._session = server, session
        self.steps: tuple[TourStep, ...] = ()

    def add_buttons(self) -> None:
        """Add the button of each browser to the open container, once all tabs are there."""
        self.steps = tour_of(self._session, self._cameras.names, self._tabs)
        folder = self._server.gui.add_folder("Guided tour")

        @self._server.on_client_connect
        async def _(client: viser.ClientHandle) -> None:
            with folder:
                button = own(
                    client.gui.add_button("Tour", icon=viser.Icon.MAP_2, hint=f"What there is to see here. Key: {KEY}.")
                )
            field = own(client.gui.add_text("Tour", "", visible=False))
            number = client.client_id
            self._guides[number] = Guide(client, field)
            button.on_click(lambda _: self._asked.append((number, BEGIN)))
            field.on_update(lambda event: self._asked.append((number, event.target.value)))
            key = own(client.gui.add_command("Guided tour", hotkey=KEY, icon=viser.Icon.MAP_2))
            key.on_trigger(lambda _: self._asked.append((number, BEGIN)))

        @self._server.on_client_disconnect
        async def _(client: viser.ClientHandle) -> None:
            self._guides.pop(client.client_id, None)

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        """Handle what browsers asked for, and go to the next step once a condition is met."""
        del pose
        while self._asked:
            number, word = self._asked.popleft()
            guide = self._guides.get(number)
            # a number before the word tells repetitions apart; of quick answers viser may report the last one twice
            if guide is not None and (word == BEGIN or word != guide.heard):
                guide.heard = word
                self._guard(str(number), self._obey, guide, word.rpartition(":")[2], snapshot)
        now = time.monotonic()
        if now < self._due:
            return
        self._due = now + 1 / RATE
        for number, guide in [*self._guides.items()]:
            self._guard(str(number), self._proceed, guide, snapshot)

    def _proceed(self, guide: Guide, snapshot: Snapshot) -> None:
        waiting = guide.waiting
        if waiting is None:
            return
        if not waiting.open and waiting.over(snapshot):
            self._go(guide, guide.at + 1, snapshot)
        guide.show(snapshot)

    def _obey(self, guide: Guide, word: str, snapshot: Snapshot) -> None:
        if word == BEGIN and self.steps:
            guide.steps = self.steps
            self._go(guide, 0, snapshot)
        elif guide.waiting is not None and word in ("next", "back", "end"):
            places = {"next": guide.at + 1, "back": max(0, guide.at - 1), "end": len(guide.steps)}
            self._go(guide, places[word], snapshot)
        guide.show(snapshot)

    def _go(self, guide: Guide, place: int, snapshot: Snapshot) -> None:
        """Take a browser to a step; after the last one the tour ends."""
        if place >= len(guide.steps):
            guide.waiting = None
            return
        guide.at = place
        step = guide.steps[place]
        if step.camera is not None:
            self._cameras.select(guide.client.client_id, camera_named(step.camera, self._cameras.names))
        if step.tab is not None:
            self._clicks.bring_forward(guide.client, step.tab)
        guide.begin(self._session, snapshot)


_counts = itertools.count(1)
"""Numbers of steps shown, all different, by which the page's script tells a new step from news of the present one."""
