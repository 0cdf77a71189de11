"""Draw every diagram of TimLab's gallery, `python -m tools.lab_pictures [NAME …]`, as the editor draws it for download.

It needs the editor's pages (`make editor`), playwright and chromium.
"""

import sys
import tempfile
from pathlib import Path

from playwright.sync_api import sync_playwright

from motorgrad.lab import GALLERY
from motorgrad.lab.editor import Server, Session

CHROMIUM = "/usr/bin/chromium"
IMAGES = Path(__file__).parents[1] / "docs" / "images"


def main(names: list[str]) -> None:
    """Write `lab-NAME.svg` for each name, by default for every diagram."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        for name in names or GALLERY:
            with tempfile.TemporaryDirectory() as folder:
                session = Session(GALLERY[name](), folder=Path(folder), states=Path(folder))
                server = Server(session)
                server.start()
                page = browser.new_page()
                page.goto(server.url)
                page.get_by_role("button", name="Add gain", exact=True).wait_for(state="attached")
                page.keyboard.press("Control+k")
                page.get_by_role("dialog").get_by_role("combobox").fill("Download as SVG")
                with page.expect_download() as download:
                    page.keyboard.press("Enter")
                download.value.save_as(IMAGES / f"lab-{name}.svg")
                page.close()
                server.stop()
                session.close()
            print(f"lab-{name}.svg", flush=True)
        browser.close()


if __name__ == "__main__":
    main(sys.argv[1:])
