"""The page of plots in its own window, and the figures for it and for the strip below the scene.

Both are served behind the gate of the main page: `plots`, and `plots/figures/640x240/0,3,5`.
"""

import json
import re
from pathlib import Path
from typing import NamedTuple

from timsim.panels import Figures

PLACE = "/plots"
JSON = "application/json; charset=utf-8"


class Document(NamedTuple):
    """What is served: its status, type and text."""

    status: int
    kind: str
    text: str


def plots_script() -> str:
    """The script that lists, asks for and shows figures, on either page."""
    return Path(__file__).with_name("plots.js").read_text("utf-8")


def plots_style() -> str:
    """The style of what that script makes."""
    return Path(__file__).with_name("plots.css").read_text("utf-8")


class PlotPages:
    """Answers requests for the page of plots and for figures. It may be called in any thread.

    **Attributes:** `figures`; None until the run has started.
    """

    def __init__(self) -> None:
        self.figures: Figures | None = None

    def __contains__(self, path: str) -> bool:
        return path == PLACE or path.startswith(f"{PLACE}/")

    def answer(self, path: str) -> Document:
        """The answer to a request for a path."""
        if path == PLACE:
            page = Path(__file__).with_name("plots.html").read_text("utf-8")
            page = page.replace("/* style */", plots_style()).replace("/* script */", plots_script())
            return Document(200, "text/html; charset=utf-8", page)
        if self.figures is None:
            return Document(503, JSON, json.dumps({"error": "the run has not started yet"}))
        if path == f"{PLACE}/list":
            return Document(200, JSON, json.dumps(self.figures.about()))
        asked = re.fullmatch(rf"{PLACE}/figures/(\d{{1,5}})x(\d{{1,5}})/((?:\d{{1,4}},?){{0,40}})", path)
        if asked is None:
            return Document(404, JSON, json.dumps({"error": "there is no such page"}))
        chosen = [int(number) for number in asked[3].split(",") if number]
        try:
            return Document(200, JSON, json.dumps(self.figures.draw(chosen, int(asked[1]), int(asked[2]))))
        except (ValueError, RuntimeError) as error:  # refused, or the run has ended
            return Document(400, JSON, json.dumps({"error": " ".join(str(error).split())}))
