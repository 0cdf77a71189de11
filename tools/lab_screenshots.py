"""Take the pictures of TimLab's editor again: `python -m tools.lab_screenshots [--width 390] [--out FOLDER]`.

Needs the editor's built pages (`make editor`), Playwright and a Chromium, whose path `CHROMIUM` tells. With a width or
a folder of your own, it shows how the editor looks elsewhere. With `--journeys`, it runs the tests of the editor in the
browser and keeps a picture of every state that they look at, at 1440 and 390 pixels, light and dark, side by side.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

from PIL import Image
from playwright.sync_api import Browser, sync_playwright

from timlab import GALLERY
from timlab.editor import Server, Session

ROOT = Path(__file__).parents[1]
IMAGES = ROOT / "docs" / "images"
WAIT = 120_000  # milliseconds: the first tick is compiled meanwhile


class Shot(NamedTuple):
    """A diagram of the gallery, in light or dark; the block that is selected; and the tick until which it plays."""

    diagram: str
    scheme: Any
    selected: str
    until: int


SHOTS = {
    "timlab-editor": Shot("pid", "light", "PID tracked", 4_000),
    "timlab-gallery": Shot("orbit", "dark", "policy", 100_000),
}


def take(browser: Browser, shot: Shot, width: int, path: Path) -> None:
    """Play a diagram, select a block, and save the page as a picture."""
    with tempfile.TemporaryDirectory() as folder:
        session = Session(GALLERY[shot.diagram](), folder=Path(folder), states=Path(folder) / "states")
        server = Server(session)
        server.start()
        try:
            page = browser.new_page(viewport={"width": width, "height": 760}, color_scheme=shot.scheme)
            page.goto(server.url)
            page.get_by_role("button", name="Add gain", exact=True).wait_for(state="attached", timeout=WAIT)
            page.get_by_label("speed", exact=True).select_option("null", timeout=WAIT)
            page.get_by_role("button", name="Play", exact=True).click(timeout=WAIT)
            clock = page.get_by_label("time", exact=True)
            while int(re.sub(r"\D", "", clock.inner_text(timeout=WAIT).rpartition("tick")[2])) < shot.until:
                page.wait_for_timeout(200)
            page.get_by_role("button", name="Pause", exact=True).click()
            page.get_by_label(f"block {shot.selected}", exact=True).click(position={"x": 8, "y": 8})
            page.get_by_label("all time").check()
            page.keyboard.press("f")
            page.wait_for_timeout(1000)
            page.screenshot(path=path)
            page.close()
        finally:
            server.stop()
            session.close()


def journeys(folder: Path) -> int:
    """Keep pictures of all that the tests in the browser look at, a sheet per state; answer pytest's exit status."""
    with tempfile.TemporaryDirectory() as single:
        tests = sorted(map(str, (ROOT / "apps" / "timlab" / "tests" / "editor").glob("test_editor_browser*.py")))
        environment = os.environ | {"TIMLAB_PICTURES": single}
        command = [sys.executable, "-m", "pytest", "-q", *tests]
        status = subprocess.run(command, cwd=ROOT, env=environment).returncode
        states: dict[str, list[Path]] = {}
        for path in sorted(Path(single).glob("*.png")):  # STATE.WIDTH.SCHEME.png
            states.setdefault(path.name.rsplit(".", 3)[0], []).append(path)
        for state, paths in states.items():
            pictures = [Image.open(path) for path in paths]
            height = max(picture.height for picture in pictures)
            sheet = Image.new("RGB", (sum(picture.width + 8 for picture in pictures) - 8, height), "gray")
            left = 0
            for picture in pictures:
                sheet.paste(picture, (left, 0))
                left += picture.width + 8
            sheet.save(folder / f"{state}.png")
            print(folder / f"{state}.png", flush=True)
    return status


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tools.lab_screenshots", description=(__doc__ or "").split(":")[0])
    parser.add_argument("--width", type=int, default=1280, help="of the page, in pixels")
    parser.add_argument("--out", type=Path, help="a folder for the pictures: docs/images, or build/journeys")
    parser.add_argument("--journeys", action="store_true", help="pictures of all that the tests in a browser look at")
    options = parser.parse_args()
    out: Path = options.out or (ROOT / "build" / "journeys" if options.journeys else IMAGES)
    out.mkdir(parents=True, exist_ok=True)
    if options.journeys:
        sys.exit(journeys(out))
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=os.environ.get("CHROMIUM", "/usr/bin/chromium"))
        for name, shot in SHOTS.items():
            take(browser, shot, options.width, out / f"{name}.png")
            print(f"{name}.png", flush=True)
        browser.close()


if __name__ == "__main__":
    main()
