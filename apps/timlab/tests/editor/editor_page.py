"""A page of the editor in a browser, and how its parts are found: by role and name, as people find them."""

import contextlib
import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

from timlab import Diagram, Gain, Scope, Sine
from timlab.editor import Server, Session

sync_api = pytest.importorskip("playwright.sync_api", reason="needs playwright")

STATIC = Path(__file__).parents[2] / "src" / "timlab" / "editor" / "static" / "index.html"
WAIT = 600_000  # milliseconds: the first tick is compiled meanwhile, and the machine may be busy
AXE = STATIC.parents[1] / "frontend" / "node_modules" / "axe-core" / "axe.min.js"
SIZES = {1440: 900, 390: 844}
"""Widths and heights, in pixels, in which every journey is looked at: a desk's and a telephone's."""
sync_api.expect.set_options(timeout=WAIT)
PICTURES = os.environ.get("TIMLAB_PICTURES")
"""A folder for pictures of what is looked at (`python -m tools.lab_screenshots --journeys`)."""


def needs_pages() -> None:
    """Skip, aloud, where the pages are not built."""
    if not STATIC.exists():
        pytest.skip("the editor's pages are not built: make editor")


@contextlib.contextmanager
def served(folder: Path, diagram: Diagram | None = None) -> Iterator[Server]:
    """A session in a folder, on a port of its own."""
    session = Session(diagram, folder=folder, states=folder / "states")
    server = Server(session)
    server.start()
    try:
        yield server
    finally:
        server.stop()
        session.close()


def wave() -> Diagram:
    """A sine, twice as large, on a scope."""
    diagram = Diagram(tick=0.01)
    diagram.add("sine", Sine())
    diagram.add("gain", Gain(2.0))
    diagram.add("scope", Scope())
    diagram.connect("sine", "gain")
    diagram.connect("gain", "scope")
    return diagram


class Editor:
    """The editor, as someone in front of it uses it."""

    def __init__(self, page: Any, server: Any = None):
        self.page, self.server = page, server
        self.faults: list[str] = []
        page.on("pageerror", lambda error: self.faults.append(str(error)))
        page.on("requestfailed", lambda request: self.faults.append(f"{request.url}: {request.failure}"))

    def open(self, url: str) -> "Editor":
        self.page.goto(url)
        sync_api.expect(self.page.get_by_role("button", name="Add gain", exact=True)).to_be_attached(timeout=WAIT)
        assert self.server is None or self.server.token not in self.page.url
        return self

    def button(self, name: str) -> Any:
        return self.page.get_by_role("button", name=name, exact=True)

    def block(self, name: str) -> Any:
        return self.page.get_by_label(f"block {name}", exact=True)

    def port(self, side: str, name: str, block: str) -> Any:
        return self.page.get_by_label(f"{side} {name} of {block}", exact=True)

    def wire(self, source: str, target: str) -> Any:
        return self.page.get_by_label(f"wire from {source} to {target}", exact=True)

    def field(self, name: str) -> Any:
        return self.page.get_by_role("textbox", name=name, exact=True)

    def scope(self, name: str) -> Any:
        return self.page.get_by_label(f"scope {name}", exact=True)

    @property
    def dialog(self) -> Any:
        return self.page.get_by_role("dialog")

    @property
    def tick(self) -> int:
        text = self.page.get_by_label("time", exact=True).inner_text()
        return int(re.search(r"tick (\d+)", text).group(1))  # type: ignore[union-attr]

    def press(self, *keys: str) -> None:
        for key in keys:
            self.page.keyboard.press(key)

    def told(self, text: str | re.Pattern[str]) -> None:
        """Wait until a message says so."""
        sync_api.expect(self.page.get_by_role("log", name="messages")).to_contain_text(text, timeout=WAIT)

    def drag(self, begin: Any, end: Any) -> None:
        """Pull from one element to another, as a hand does."""
        start, stop = begin.bounding_box(), end.bounding_box()
        mouse = self.page.mouse
        mouse.move(start["x"] + start["width"] / 2, start["y"] + start["height"] / 2)
        mouse.down()
        mouse.move(start["x"] + 30, start["y"] + 10, steps=3)
        mouse.move(stop["x"] + stop["width"] / 2, stop["y"] + stop["height"] / 2, steps=8)
        mouse.up()

    def drop(self, kind: str, x: float, y: float) -> None:
        """Drag a type of block from the palette to a place of the canvas."""
        canvas = self.page.get_by_role("region", name="canvas")
        item = self.page.get_by_role("button", name=f"Add {kind}", exact=True)
        item.scroll_into_view_if_needed()
        item.drag_to(canvas, target_position={"x": x, "y": y})
        sync_api.expect(self.block(kind)).to_be_visible()

    def play_until(self, tick: int) -> None:
        """Run to a tick, and pause."""
        self.button("Play").click()
        self.wait(lambda: self.tick >= tick)
        self.button("Pause").click()
        sync_api.expect(self.button("Play")).to_be_visible(timeout=WAIT)

    def look(self, state: str, panel: str = "", widths: Iterable[int] = SIZES, axe: bool = True) -> None:
        """Look at the page as it stands, wide and narrow, light and dark; note what axe finds and what is too wide.

        Where the page is narrow, panels are folded away, but for one that is named."""
        page, before = self.page, self.page.viewport_size
        if not AXE.exists():
            pytest.skip("axe-core is not installed: make editor")
        if not page.evaluate("() => 'axe' in window"):
            page.evaluate(AXE.read_text(encoding="utf-8"))
        for width in widths:
            page.set_viewport_size({"width": width, "height": SIZES[width]})
            page.wait_for_timeout(300)  # until the diagram fits again
            opens = panel and width < 900
            if opens:
                page.keyboard.press({"palette": "1", "inspector": "2"}[panel])
            for scheme in ("light", "dark"):
                page.emulate_media(color_scheme=scheme)
                page.wait_for_timeout(100)
                if PICTURES:
                    Path(PICTURES).mkdir(parents=True, exist_ok=True)
                    page.screenshot(path=Path(PICTURES) / f"{state.replace(' ', '-')}.{width}.{scheme}.png")
                if not axe:
                    continue
                options: dict[str, Any] = {"resultTypes": ["violations"]}  # describing what passes is slow
                if scheme == "dark":
                    options["runOnly"] = {"type": "rule", "values": ["color-contrast"]}
                run = "async options => (await axe.run(document, options)).violations"  # the rest is a megabyte
                found = page.evaluate(run, options)
                for each in found:
                    targets = [node["target"] for node in each["nodes"]][:4]
                    self.faults.append(f"{state}, {width} px, {scheme}: {each['id']} {targets}")
            if page.evaluate("() => document.documentElement.scrollWidth") > width:
                self.faults.append(f"{state}, {width} px: the page is wider than the window")
            if opens:
                page.keyboard.press({"palette": "1", "inspector": "2"}[panel])
        page.emulate_media(color_scheme="null")
        if before:
            page.set_viewport_size(before)
            page.wait_for_timeout(300)

    def wait(self, condition: Any, seconds: float = WAIT / 1000) -> None:
        for _ in range(int(seconds * 10)):
            if condition():
                return
            self.page.wait_for_timeout(100)
        raise AssertionError("did not come about in time")
