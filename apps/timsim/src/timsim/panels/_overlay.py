"""The overlay on the scene: the state of the run in words and a small curve, and what programs add to it."""

from __future__ import annotations

import html
import inspect
import itertools
import re
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import viser

from motorgrad._errors import check
from motorgrad._labels import with_unit
from motorgrad.schema import description_of
from motorgrad.tasks import Task
from timsim.film import FIRING, SILENT, Annotations, Arrow, Curve
from timsim.live import Session, Snapshot
from timsim.panels import _charts
from timsim.panels._panel import brief
from timsim.panels._run import weight_of
from timsim.scene import BODY_COLOURS, Pose, main_metric, unit_of, weight_arrow

Moment = Snapshot
Text = str | Callable[[Moment], str]
Plotted = Callable[[Moment], float] | tuple[Sequence[float], Sequence[float]]
Pointing = Callable[[Moment], Any] | tuple[Sequence[float], Sequence[float]]

RATE = 5.0  # Hz
WIDE = 250.0
HIGH = 118.0
"""Size of a plot in its own units, which are pixels where there is room."""
POINTS = 160  # of a plot, at most
SECONDS = 10.0  # of simulated time that the plot of a function shows
SHAFT = 0.012  # of an arrow, as a share of the body's size


class Item:
    """One entry of the overlay: a text, a plot and an arrow, each optional."""

    def __init__(self, text: Text | None, plot: Plotted | None, arrow: Pointing | None, unit: str, colour: str) -> None:
        self.text, self.plot, self.arrow, self.unit, self.colour = text, plot, arrow, unit, colour
        self.seen: deque[tuple[float, float]] = deque(maxlen=2_000)
        self.failed = ""

    def follow(self, moment: Moment) -> None:
        """Record the number that a plot shows."""
        if not callable(self.plot) or (self.seen and self.seen[-1][0] == moment.seconds):
            return
        if self.seen and moment.seconds < self.seen[-1][0]:
            self.seen.clear()
        self.seen.append((moment.seconds, float(self.plot(moment))))
        while self.seen[0][0] < moment.seconds - SECONDS:
            self.seen.popleft()

    def _until(self, moment: Moment) -> np.ndarray:
        """The numbers of a plot's function up to a moment, which the page may not have shown: times and values."""
        assert callable(self.plot)
        before = [point for point in [*self.seen] if point[0] < moment.seconds]
        return np.array([*before, (moment.seconds, float(self.plot(moment)))]).T

    def html(self, name: str, moment: Moment) -> str:
        """The entry as HTML; empty for an arrow alone."""
        if self.failed:
            return _card(f"{html.escape(name)}: {html.escape(self.failed)}")
        parts = []
        if self.text is not None:
            parts.append(html.escape(self.text(moment) if callable(self.text) else self.text))
        if self.plot is not None:
            x, y = np.array(self.seen).reshape(-1, 2).T if callable(self.plot) else map(np.asarray, self.plot)
            parts.append(small_plot([(x, y, self.colour)], with_unit(name, self.unit)))
        return _card("".join(parts)) if parts else ""

    def cards(self, name: str, moment: Moment) -> list[str | Curve]:
        """The entry as films show it; empty for an arrow alone."""
        found: list[str | Curve] = []
        if self.text is not None:
            found.append(self.text(moment) if callable(self.text) else self.text)
        if self.plot is not None:
            x, y = self._until(moment) if callable(self.plot) else map(np.asarray, self.plot)
            step = max(1, -(-len(x) // POINTS))
            title = f"{name} ({self.unit})" if self.unit else name
            found.append(Curve(title, x[::-1][::step][::-1], y[::-1][::step][::-1], self.colour))
        return found


class Overlay:
    """The overlay on the scene: the task and its goal, the state of the run, a small learning curve, a legend of
    colours and forces; and texts, plots and arrows that a program adds by calling it.

    Browsers show it over the picture, at any size; films show what programs add. A switch in the tab "View" hides it.

    ```py
    page.overlay("height", text=lambda moment: f"the load is at {moment.position[0, 0]:.2f} m")
    page.overlay("height of the load", plot=lambda moment: moment.position[0, 0], unit="m")
    page.overlay("speed", arrow=lambda moment: ((0, 0, 1.2), (0, 0, 0.2 * moment.velocity[0, 0])))
    page.overlay("height")                          # removed again
    ```

    **Attributes:** `shown`: whether it is switched on.
    """

    def __init__(self) -> None:
        self._items: dict[str, Item] = {}
        self._arrows: dict[str, tuple[Any, Any]] = {}
        self._lock = threading.RLock()  # a user's function may add entries
        self._shown = True
        self._due = 0.0
        self._content = ""
        self._size = 1.0  # m, of the body

    def __call__(
        self,
        name: str,
        *,
        text: Text | None = None,
        plot: Plotted | None = None,
        arrow: Pointing | None = None,
        unit: str = "",
        colour: str = _charts.STRONG,
    ) -> None:
        """Show an entry on the scene, and replace any other of this name; a name alone removes it.

        Functions are called with the present `Snapshot` five times a second, those of plots and arrows thirty times,
        and all of them for each picture of a film. They run in the page's process, one at a time: they may read
        anything but must be quick. One that fails is shown with its error and not called again.

        **Arguments:**

        - `name`: of the entry; a plot and an arrow show it.
        - `text`: a line, or a function that returns one.
        - `plot`: a function that returns a number, which is drawn over the last ten simulated seconds; or x and y, of
          equal lengths.
        - `arrow`: from where, and how far: two triples in m, in world coordinates; or a function that returns them.
        - `unit`: of the plotted number, such as "m/s".
        - `colour`: of plot and arrow, as `"#d9730d"`.

        **Raises** `ValueError` for anything else.
        """
        check(isinstance(name, str) and bool(name), "name", name, "a text that is not empty")
        check(text is None or callable(text) or isinstance(text, str), "text", text, "a text or a function")
        valid = isinstance(colour, str) and re.fullmatch("#[0-9a-fA-F]{6}", colour)
        check(valid, "colour", colour, 'six hexadecimal digits, as in "#d9730d"')
        if plot is not None and not callable(plot):
            sizes = [np.shape(part) for part in plot]
            check(len(sizes) == 2 and sizes[0] == sizes[1] and len(sizes[0]) == 1, "plot", sizes, "x and y, alike long")
        if arrow is not None and not callable(arrow):
            _ends(arrow)
        with self._lock:
            if text is None and plot is None and arrow is None:
                self._items.pop(name, None)
            else:
                self._items[name] = Item(text, plot, arrow, unit, colour)
            self._due = 0.0

    def build(self, server: viser.ViserServer, session: Session) -> None:
        """Add the element that browsers copy onto the scene."""
        self._server, self._session = server, session
        self._arrows = {}
        self._content = ""
        self._due = 0.0
        self._handle = server.gui.add_html("", order=1e6)

    def add_switch(self) -> None:
        """Add the switch to the open container."""
        box = self._server.gui.add_checkbox("Text on the scene", self._shown, hint="Task, state, curve and legend.")
        box.on_update(lambda event: setattr(self, "shown", event.target.value))

    @property
    def shown(self) -> bool:
        """Whether it is switched on."""
        return self._shown

    @shown.setter
    def shown(self, value: bool) -> None:
        self._shown = value
        self._due = 0.0

    def annotations(self, snapshot: Snapshot) -> Annotations:
        """What films show of a moment: the entries that a program added, while the overlay is switched on."""
        cards: list[str | Curve] = []
        with self._lock:
            items = self._items if self._shown else {}
            arrows = [
                Arrow(name, ends, colour, SHAFT * self._size)
                for name, (ends, colour) in _arrows(items, snapshot).items()
            ]
            for name, item in items.items():
                known = _tried(item, item.cards, name, snapshot)
                cards += [f"{name}: {item.failed}"] if known is None else known
        return Annotations(cards, arrows)

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        """Show the present moment."""
        with self._lock:
            self._update(snapshot, pose)

    def _update(self, snapshot: Snapshot, pose: Pose) -> None:
        items = dict(self._items)
        self._size = pose.size
        for item in items.values():
            _tried(item, item.follow, snapshot)
        self._draw_arrows(items if self._shown else {}, snapshot, pose)
        now = time.monotonic()
        if now < self._due or not self._server.get_clients():
            return
        self._due = now + 1 / RATE
        content = self._html(items, snapshot, pose) if self._shown else ""
        if content != self._content:
            self._content = content
            self._handle.content = f'<div class="motorgrad-overlay-source">{content}</div>'

    def _html(self, items: dict[str, Item], snapshot: Snapshot, pose: Pose) -> str:
        added = "".join(_tried(item, item.html, name, snapshot) or "" for name, item in items.items())
        corners = {
            "top-left": _card(self._state(snapshot)) + self._curve(snapshot),
            "top-right": added,
            "bottom-left": self._legend(pose),
        }
        return "".join(f'<div class="{place}">{parts}</div>' for place, parts in corners.items() if parts)

    def _state(self, snapshot: Snapshot) -> str:
        session = self._session
        lines = [f"<b>{html.escape(session.name)}</b>"]
        if session.task is not None:
            lines.append(f"<span>{html.escape(goal_of(session.task))}</span>")
        learns = session.agent is not None
        doing = "acts, learning frozen" if snapshot.frozen else "learns" if learns else "moves"
        pace = f"{brief(snapshot.speed)}×" if snapshot.playing else "paused"
        lines.append(f'<span class="pale value">{doing} · {snapshot.seconds:,.1f} s · {pace}</span>')
        if learns and np.isfinite(snapshot.reward[0]):
            lines.append(f'<span class="value">reward {brief(float(snapshot.reward[0]))}</span>')
        return "<br>".join(lines)

    def _curve(self, snapshot: Snapshot) -> str:
        if self._session.agent is None:
            return ""
        name = main_metric(self._session.metrics)
        lines = []
        for row in range(len(snapshot.labels)):
            curve = self._session.curve(row).until(snapshot.decision)
            known = np.isfinite(curve.values[name])
            if np.count_nonzero(known) >= 3:
                colour = BODY_COLOURS[row % len(BODY_COLOURS)] if row else "var(--line)"
                lines.append((curve.seconds[known], _charts.smoothed(curve.values[name][known]), colour))
        if not lines:
            return ""
        words = "reward of a decision" if name == "reward" else with_unit(name, unit_of(name, self._session.task))
        return _card(small_plot(lines, words) + _bodies(snapshot.labels))

    def _legend(self, pose: Pose) -> str:
        model = self._session.model
        if model is None or not self._session.muscles:
            return ""
        ends = (f"rgb({', '.join(f'{255 * part:.0f}' for part in shade)})" for shade in (SILENT, FIRING))
        colours = f"linear-gradient(90deg, {', '.join(ends)})"
        bar = f'<span style="display:inline-block;width:44px;height:8px;border-radius:4px;background:{colours}"></span>'
        words = [f"activation 0 {bar} 1"]
        if model.ngeom:
            long = brief(weight_arrow(pose.size), 2)
            words.append(f"arrow of {long} m: contact force of the body's weight, {brief(weight_of(model))} N")
        return f'<div class="card wide">{"<br>".join(words)}</div>'

    def _draw_arrows(self, items: dict[str, Item], snapshot: Snapshot, pose: Pose) -> None:
        """Draw new and moved arrows, and remove the others."""
        wanted = _arrows(items, snapshot)
        for name in [*self._arrows]:
            if name not in wanted:
                self._arrows.pop(name)[1][0].remove()  # and its label, which is a part of it
        for name, (ends, colour) in wanted.items():
            known = self._arrows.get(name)
            if known is not None and known[0][1] == colour:
                if not np.array_equal(known[0][0], ends):
                    known[1][0].points = ends[None]
                    known[1][1].position = ends[1]
                    self._arrows[name] = ((ends, colour), known[1])
                continue
            if known is not None:
                known[1][0].remove()
            thick = SHAFT * pose.size
            rgb = _linear(colour)
            node = f"/overlay/{next(_numbers)}"  # a name of the user's may have slashes
            shape: Any = {"shaft_radius": thick, "head_radius": 2.5 * thick, "head_length": 6 * thick}
            arrow = self._server.scene.add_arrows(node, ends[None].astype(np.float32), rgb, **shape)
            label = self._server.scene.add_label(f"{node}/label", name, position=ends[1])
            self._arrows[name] = ((ends, colour), (arrow, label))


_numbers = itertools.count()


def goal_of(task: Task) -> str:
    """What a task is about: the first sentence of its documentation, without remarks in brackets."""
    if hasattr(task, "env_id"):
        return "Gather the reward of a Gymnasium environment"
    first = " ".join(description_of(type(task)).split("\n\n")[0].split()) or inspect.getdoc(type(task)) or ""
    end = min((place for mark in (" (", ". ", " as in ", ":") if (place := first.find(mark)) > 0), default=len(first))
    return first[:end].rstrip(".")


def small_plot(lines: Sequence[tuple[np.ndarray, np.ndarray, str]], label: str) -> str:
    """Small lines as SVG for the scene: each has x, the simulated time in s, y and a colour."""
    thin = []
    for x, y, colour in lines:
        step = max(1, -(-len(x) // POINTS))
        thin.append((*(np.asarray(part, float)[::-1][::step][::-1] for part in (x, y)), colour))
    times, values = (np.concatenate([np.ravel(line[axis]) for line in thin]) for axis in (0, 1))
    good = values[np.isfinite(values)]
    if not len(good):
        return html.escape(label)
    room = 0.08 * (float(np.ptp(good)) or abs(float(good[0])) or 1.0)
    box = (44.0, 18.0, WIDE - 8, HIGH - 18)
    limits = float(times.min()), float(times.max())
    chart = _charts.Chart(limits, (float(good.min()) - room, float(good.max()) + room), box=box)
    for x, y, colour in thin:
        chart.line(x, y, colour, 2.0)
    title = [_charts.text(4, 8, label), _charts.text(WIDE - 8, 8, "time (s)", "end", 'opacity=".7"')]
    return (
        f'<svg role="img" aria-label="{html.escape(label)}" viewBox="0 0 {WIDE:g} {HIGH:g}" '
        f'font-size="{_charts.SIZE}" fill="currentColor">{"".join([*title, *chart.elements()])}</svg>'
    )


def _bodies(labels: Sequence[str]) -> str:
    """A legend of the bodies in view, in their colours, if there are several."""
    colours = ["var(--line)", *BODY_COLOURS[1:]]
    marks = [
        f'<span style="white-space:nowrap"><b style="color:{colour}">—</b> {html.escape(label)}</span>'
        for label, colour in zip(labels, colours, strict=False)
    ]
    return f'<div style="line-height:1.25;max-width:250px">{" &ensp;".join(marks)}</div>' if len(labels) > 1 else ""


def _card(words: str) -> str:
    return f'<div class="card">{words}</div>'


def _tried(item: Item, act: Callable[..., Any], *arguments: object) -> Any:
    """The result of an entry's function; None once it has failed."""
    if item.failed:
        return act(*arguments) if act == item.html else None
    try:
        return act(*arguments)
    except Exception as error:  # a user's function may raise anything
        item.failed = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        return None


def _arrows(items: dict[str, Item], snapshot: Snapshot) -> dict[str, tuple[np.ndarray, str]]:
    """Start and end, `(2, 3)` m, and colour of the present arrows, by name."""
    found = {}
    for name, item in items.items():
        if item.arrow is not None and not item.failed:
            given = _tried(item, item.arrow, snapshot) if callable(item.arrow) else item.arrow
            ends = None if given is None else _tried(item, _ends, given)
            if ends is not None:
                found[name] = (ends, item.colour)
    return found


def _ends(arrow: Sequence[Sequence[float]]) -> np.ndarray:
    """Start and end of an arrow, `(2, 3)` m."""
    check(len(arrow) == 2, "arrow", arrow, "two triples: from where, and how far")
    start, way = (np.asarray(part, float) for part in arrow)
    fine = start.shape == way.shape == (3,) and np.isfinite(start).all() and np.isfinite(way).all()
    check(fine, "arrow", arrow, "two triples of finite numbers in m: from where, and how far")
    return np.stack([start, start + way])


def _linear(colour: str) -> np.ndarray:
    """A colour in linear light, which viser expects of arrows, as RGB from 0 to 255."""
    return np.round(255 * (np.array([*bytes.fromhex(colour[1:])]) / 255) ** 2.2).astype(np.uint8)
