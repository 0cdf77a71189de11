"""The folder in the tab "Capture" that sets up, starts and ends a film."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import viser

from timsim.film import Viewpoint
from timsim.panels._film_painting import CHOICES
from timsim.panels._film_recorder import HEIGHT, WIDTH, FilmRecorder, SlowFilmRecorder
from timsim.panels._panel import Panel, brief, notify, send
from timsim.panels._watcher import Annotating, no_annotations
from timsim.scene import viewpoint_of

FORMATS = {"MP4": 30.0, "GIF": 20.0, "WebP": 20.0}
"""Kinds of files, with their frames per second."""
PACES = {"as it runs": None, "1×": 1.0, "½×": 0.5, "¼×": 0.25, "⅒×": 0.1}
AS_I_SEE = "as I see it"
FRAMED = "framed"
BUTTON = ("Record film", "Stop film")
MAX_FILM_SIZE = (3840, 2160)


class FilmFolder:
    """Elements to film a run: camera, speed, size, ground and plots.

    **Arguments:** `panel` that it stands in; `name`: a function from an ending to the name of a file; `annotations`: as
    of `FilmRecorder`.
    """

    def __init__(self, panel: Panel, name: Callable[[str], str], annotations: Annotating = no_annotations) -> None:
        self._panel, self._name, self._annotations = panel, name, annotations
        self._film: FilmRecorder | SlowFilmRecorder | None = None
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    def fill(self, gui: viser.GuiApi) -> None:
        """Add the elements."""
        session = self._panel.session
        bodies = session.model is not None
        with gui.add_folder("Film"):
            self._format = gui.add_dropdown("Format", tuple(FORMATS), initial_value="MP4")
            self._width = gui.add_number("Width (pixels)", WIDTH, min=64, max=MAX_FILM_SIZE[0], step=2)
            self._height = gui.add_number("Height (pixels)", HEIGHT, min=64, max=MAX_FILM_SIZE[1], step=2)
            self._camera = self._pace = self._ground = None
            if bodies:
                hint = "The camera of who presses the button, wherever it goes; or one that frames the motion."
                self._camera = gui.add_dropdown("Camera", (AS_I_SEE, FRAMED), initial_value=AS_I_SEE, hint=hint)
                hint = "As it runs, or every decision at a speed of the film's own; the film is made at the end."
                self._pace = gui.add_dropdown("Speed", tuple(PACES), initial_value="as it runs", hint=hint)
                self._ground = gui.add_dropdown("Ground", ("marked", "plain"), initial_value="marked")
            self._titles = gui.add_checkbox("Name and time", True)
            self._plots = [gui.add_checkbox(f"Plot: {name}", False) for name in CHOICES] if bodies else []
            self._button = gui.add_button(BUTTON[0], icon=viser.Icon.VIDEO)
            self._button.on_click(self._panel.guarded(self._toggle))

    @property
    def at_work(self) -> bool:
        """Whether a film is being made."""
        return self._film is not None

    def rows(self) -> list[tuple[str, str]]:
        """The state of the film, in words."""
        film = self._film
        rows = [("film", "–" if film is None else f"{film.seconds:.1f} s")]
        if isinstance(film, FilmRecorder) and film.painted:
            rows.append(("time per frame", f"{brief(1e3 * film.busy / film.painted)} ms"))
        if isinstance(film, SlowFilmRecorder) and film.done:
            rows.append(("being made", f"{100 * film.done:.0f}%"))
        return rows

    def close(self) -> None:
        """End a film without sending it."""
        film = self._film
        self._film = None
        if isinstance(film, FilmRecorder):
            film.stop()
        if self._folder is not None:
            self._folder.cleanup()

    def _toggle(self, event: viser.GuiEvent) -> None:
        if self._film is None:
            assert event.client is not None  # a button is pressed in a browser
            self._begin(event.client)
            return
        film = self._film
        self._button.label = BUTTON[0]
        assert self._folder is not None
        try:
            film.stop()
            send(self._panel.server, event.client, film.path.name, film.path.read_bytes())
            notify(self._panel.server, film.path.name, "Film", "green", event.client)
        finally:
            self._film = None
            self._folder.cleanup()

    def _begin(self, client: viser.ClientHandle) -> None:
        kind = self._format.value
        (width, height) = (int(each.value) for each in (self._width, self._height))

        def seen(_: float) -> Viewpoint:
            return viewpoint_of(client.camera, width / height)

        settings: Any = {"fps": FORMATS[kind], "width": width, "height": height, "annotations": self._annotations}
        settings["plots"] = [name for name, box in zip(CHOICES, self._plots, strict=False) if box.value]
        if self._camera is not None and self._ground is not None:
            settings |= {"camera": seen if self._camera.value == AS_I_SEE else None, "ground": self._ground.value}
        pace = None if self._pace is None else PACES[self._pace.value]
        folder = tempfile.TemporaryDirectory(prefix="motorgrad-")
        path = Path(folder.name) / self._name(kind.lower())
        try:
            if pace is None:
                film = FilmRecorder(self._panel.session, path, titles=self._titles.value, **settings)
            else:
                film = SlowFilmRecorder(self._panel.session, path, speed=pace, **settings)
        except BaseException:
            folder.cleanup()
            raise
        self._film = film
        self._folder = folder
        self._button.label = BUTTON[1]
