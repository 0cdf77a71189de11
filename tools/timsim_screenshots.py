"""Take the pictures of TimSim's page again: `python -m tools.timsim_screenshots [NAME ...] [--width 390] [--dark]`.

Needs Playwright and a Chromium, whose path the variable `CHROMIUM` sets. Learners learn first, so all pictures
together take some minutes. With a width, a colour scheme or a folder of your own, it shows how the page looks
elsewhere.
"""

import argparse
import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from playwright.sync_api import Browser, sync_playwright
from playwright.sync_api import Page as Tab

import timsim
from timsim import live
from timsim.page import Page

ROOT = Path(__file__).parents[1]
IMAGES = ROOT / "docs" / "images"
SOFTWARE = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--no-sandbox"]
WAIT = 240_000  # ms: WebGL in software leaves a page little time for anything else
TRAIL = 400  # decisions that are watched at the end, so that traces have no gaps
WATCHED = 10.0  # s that a run takes, unless it cannot be that fast
SETTLE = 15_000  # ms until the scene is drawn in full detail
# pictures in full detail, although a frame then takes seconds without a graphics card
DETAILED = """const place = new URL(location.href);
place.searchParams.set("fixedDpr", "2");
history.replaceState(history.state, "", place);"""


class Shot(NamedTuple):
    """A picture of the page.

    - `subject`: what `timsim.view` shows; `options`: its other arguments.
    - `seconds`: how long it has run, or learned, before, in simulated time.
    - `camera`, `tab`: in the picture, by their names.
    - `act`: what is done on the page last.
    """

    subject: Any
    options: dict[str, Any]
    seconds: float
    camera: str | None
    tab: str | None
    act: Callable[[Tab], None] | None = None


def _plots(tab: Tab) -> None:
    tab.get_by_role("button", name="Plots").click()


def _tour(tab: Tab) -> None:
    tab.keyboard.press("t")
    tab.locator(".motorgrad-tour").wait_for()


SHOTS = {
    "timsim-page-hopper": Shot("hopper", {}, 600, None, "Learning"),
    "timsim-page-hexapod": Shot("hexapod", {}, 3_840, None, "Muscles"),
    "timsim-particle": Shot("particle", {}, 400, None, "Policy"),
    "timsim-beside": Shot("hopper", {"beside": {"untrained": "untrained"}}, 600, None, "Run"),
    "timsim-plots": Shot("hopper", {}, 600, None, "Run", _plots),
    "timsim-task": Shot("arm6", {}, 0, None, "Task"),
    "timsim-tour": Shot("hopper", {}, 600, None, "Run", _tour),
}


def until(true: Callable[[], object], what: str, seconds: float = 600.0) -> None:
    """Wait for something. **Raises** `TimeoutError`."""
    end = time.monotonic() + seconds
    while not true():
        if time.monotonic() > end:
            raise TimeoutError(f"{what}: not within {seconds:.0f} s")
        time.sleep(0.05)


def arrive(page: Page, seconds: float) -> None:
    """Let the run get that far, at a speed at which its curves have enough points, and pause it."""
    session = page.session
    if not seconds:
        return
    session.order(live.Speed(max(1.0, seconds / WATCHED)))
    session.order(live.Play())
    until(lambda: session.snapshot().seconds >= seconds, f"{session.name}: {seconds} s")
    session.order(live.Pause())
    session.order(live.Speed(1.0))
    before = session.snapshot().decision
    session.order(live.Step(TRAIL))
    until(lambda: session.snapshot().decision >= before + TRAIL, "the last decisions")


def take(browser: Browser, page: Page, shot: Shot, size: tuple[int, int], scheme: Any, path: Path) -> None:
    """Open the page at its camera and tab, wait until the scene is drawn, and save a picture."""
    context = browser.new_context(viewport={"width": size[0], "height": size[1]}, color_scheme=scheme)
    context.add_init_script(DETAILED)
    tab = context.new_page()
    tab.set_default_timeout(WAIT)
    tab.goto(page.link(camera=shot.camera, tab=shot.tab))
    tab.locator("#motorgrad-cover").wait_for(state="detached")
    if shot.act is not None:
        shot.act(tab)
    tab.wait_for_timeout(SETTLE)
    tab.screenshot(path=path, type="jpeg", quality=88)
    context.close()


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        prog="python -m tools.timsim_screenshots", description=(__doc__ or "").split(":")[0]
    )
    parser.add_argument("names", nargs="*", help=f"which pictures: {', '.join(SHOTS)}; by default all")
    parser.add_argument("--width", type=int, default=1280, help="of the page, in pixels")
    parser.add_argument("--height", type=int, default=720, help="of the page, in pixels")
    parser.add_argument("--dark", action="store_true", help="in dark colours")
    parser.add_argument("--out", type=Path, default=IMAGES, help="a folder for the pictures")
    options = parser.parse_args(arguments)
    if unknown := set(options.names) - set(SHOTS):
        parser.error(f"unknown picture {min(unknown)!r}: must be one of {', '.join(SHOTS)}")
    options.out.mkdir(parents=True, exist_ok=True)
    size = (options.width, options.height)
    scheme = "dark" if options.dark else "light"
    with sync_playwright() as playwright:
        executable = os.environ.get("CHROMIUM", "/usr/bin/chromium")
        browser = playwright.chromium.launch(executable_path=executable, args=SOFTWARE)
        for name in options.names or SHOTS:
            shot = SHOTS[name]
            path = options.out / f"{name}.jpg"
            with timsim.view(shot.subject, playing=False, **shot.options) as page:
                arrive(page, shot.seconds)
                take(browser, page, shot, size, scheme, path)
            print(path, flush=True)
        browser.close()


if __name__ == "__main__":
    main()
