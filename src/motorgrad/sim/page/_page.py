"""A page in the browser: a session, its scene and its panels."""

import contextlib
import io
import logging
import os
import sys
import threading
import time
import warnings
import webbrowser
from pathlib import Path
from typing import Any, Self

import viser

from motorgrad.sim.live import Session
from motorgrad.sim.page._address import HERE, PORT, check_port
from motorgrad.sim.page._footing import footing_on
from motorgrad.sim.panels import DragPush, FilmRecorder, Panels
from motorgrad.sim.planet import PlanetScene
from motorgrad.sim.scene import Pose, Scene, View

FRAME = 1 / 30
log = logging.getLogger(__name__)


class Page:
    """What is seen of a session in browsers, as many as like; none is needed.

    **Arguments:** `session`; the `host` and `port` to listen at; port None is 8080, or the next that is free.

    **Attributes:** `url`; `server`, viser's; `session`; `scene` and `panels`; `failures`, how many frames a part could
    not draw; `spent`, seconds that drawing has taken in all.

    **Raises** `ValueError` for a port that is in use.
    """

    def __init__(self, session: Session, host: str = HERE, port: int | None = None):
        check_port(host, port)
        self.session, self.host = session, host
        with contextlib.redirect_stdout(io.StringIO()):  # its banner; the address is told by who asked for the page
            self.server = viser.ViserServer(host, PORT if port is None else port, label=session.name, verbose=False)
        try:
            self._build()
        except BaseException:
            self.server.stop()
            raise
        self._thread = threading.Thread(target=self._run, name="motorgrad sim page", daemon=True)
        self._thread.start()

    def _build(self) -> None:
        # a browser may leave between two elements that it is told of
        warnings.filterwarnings("ignore", "Queued a .* on a closed connection", UserWarning)
        # to share a page would let anyone in the world drive the simulation
        self.server.gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        self.server.gui.main_panel.dock_right()
        session = self.session
        self.scene, self.panels = Scene(), Panels()
        self.planet = PlanetScene()
        self.failures, self.spent = 0, 0.0
        self._failed: set[str] = set()
        self._pose = Pose(session.model)
        self.view = View(self.scene, footing=footing_on(session.task, session.model, self._pose))
        self._stop = threading.Event()
        self._pose.place(session.snapshot())
        drag = DragPush(self.scene.grips)
        for part in (self.scene, self.planet, self.panels, drag):
            part.build(self.server, session)
        with self.panels.tabs.add_tab(View.title, View.icon):
            self.view.build(self.server, session)
        self.parts: list[Any] = [self.scene, self.planet, self.view, self.panels, drag]

    @property
    def url(self) -> str:
        """Where the page is."""
        shown = "localhost" if self.host in (HERE, "0.0.0.0", "::") else self.host
        return f"http://{shown}:{self.server.get_port()}"

    @property
    def last_words(self) -> str:
        """Why the run ended, as far as it is known."""
        known = [event.text for event in self.session.log if event.kind in ("error", "ended")]
        return " ".join(dict.fromkeys(known[-2:])) or f"{self.session.name}: the simulation has ended"

    def open(self) -> None:
        """Show the page in the user's browser, where there is a screen to see it on."""
        if sys.platform in ("darwin", "win32") or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
            webbrowser.open(self.url)

    def record(self, path: Path | str, **settings: Any) -> FilmRecorder:
        """Film the run from now on; see `motorgrad.sim.panels.FilmRecorder`."""
        return FilmRecorder(self.session, path, **settings)

    def wait(self) -> None:
        """Until the page or its run is closed, or Ctrl-C."""
        while not self._stop.wait(0.2) and not self.session.ended:
            pass

    def close(self) -> None:
        """Close the page and end its run. A second call does nothing."""
        if self._stop.is_set():
            return
        self._stop.set()
        self._thread.join(10.0)
        self.panels.close()
        with contextlib.redirect_stdout(io.StringIO()):
            self.server.stop()
        self.session.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Page({self.session.name}, {self.url})"

    def _repr_html_(self) -> str:
        """In a notebook the page shows itself."""
        return f'<iframe src="{self.url}" width="100%" height="600" style="border: 0"></iframe>'

    def _run(self) -> None:
        """Thirty times a second: the newest snapshot into every part. The run takes no notice."""
        due = time.perf_counter()
        while not self._stop.is_set():
            start = time.perf_counter()
            try:
                snapshot = self.session.snapshot()
            except RuntimeError:  # closed, or its worker died in the middle of a write
                return
            self._guard("pose", self._pose.place, snapshot)
            for part in self.parts:
                self._guard(type(part).__name__, part.update, snapshot, self._pose)
            now = time.perf_counter()
            self.spent += now - start
            due = max(due + FRAME, now)
            self._stop.wait(due - now)

    def _guard(self, name: str, act: Any, *arguments: Any) -> None:
        """A part that cannot draw a moment must not take the others with it; it is told once."""
        try:
            try:
                act(*arguments)
            except RuntimeError as error:
                # viser wakes its senders by asyncio's Event, which threads may not share: once in some 10,000 frames a
                # sender goes to sleep at that moment
                if "mutated during iteration" not in str(error):
                    raise
                act(*arguments)
        except Exception:
            self.failures += 1
            if name not in self._failed:
                self._failed.add(name)
                log.exception("%s: %s could not be drawn", self.session.name, name)
