"""The page in the browser: a session, its scene and its panels, at an address."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

import contextlib
import html
import io
import logging
import os
import socket
import sys
import threading
import time
import warnings
from pathlib import Path
from typing import Any, Self

import mujoco

from motorgrad._arguments import check_arguments
from motorgrad._errors import check
from motorgrad.pages import LOCAL, Gate, open_in_browser
from timsim.film import Viewpoint
from timsim.live import Session
from timsim.page._links import WATCHED, Links, Place, link_element
from timsim.page._plots import PlotPages
from timsim.page._server import clear, gated_server
from timsim.panels import (
    ClickSelect,
    DragPush,
    Figures,
    FilmRecorder,
    Overlay,
    Panels,
    ReplayRecorder,
    SlowFilmRecorder,
    Tours,
)
from timsim.scene import Guard, Pose, Scene, View, camera_named, viewpoint_of, watches

HERE = "127.0.0.1"
EVERYWHERE = ("0.0.0.0", "::")
NUMERIC = {"0.0.0.0": HERE, "::": "::1"}
"""Where this machine reaches a host. Browsers may take the name localhost for the other of its two addresses, where
another user may listen for the token."""
PORT = 8080


class ExposedWarning(UserWarning):
    """The page can be reached from other machines."""


def warn_of(host: str) -> None:
    """Warn if other machines can reach the host."""
    if host not in LOCAL:
        text = f"host = {host!r}: other machines can reach the page. Its address is a password, and is sent unencrypted"
        warnings.warn(text, ExposedWarning, stacklevel=3)


def check_port(host: str, port: int | None) -> None:
    """Refuse a host and a port on which no page can listen; with None, any port. **Raises** `ValueError`."""
    check(isinstance(host, str) and bool(host.strip()), "host", host, "an address or a name of this machine")
    whole = isinstance(port, int) and not isinstance(port, bool)
    check(port is None or (whole and 1 <= port <= 65535), "port", port, "from 1 to 65535")
    named = HERE if host.lower() == "localhost" else host
    if port is None and named == HERE:
        return
    try:  # viser would wait for ever for a server that cannot listen
        family, kind, _, _, address = socket.getaddrinfo(named, port or 0, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except (OSError, UnicodeError) as error:
        why = getattr(error, "strerror", None) or str(error)
        given = f"host = {host!r}: cannot listen there" if port is None else f"port = {port}: cannot listen on {host}"
        raise ValueError(f"{given}: {why.lower()}") from None


FRAME = 1 / 30  # s
PANEL = 384.0  # pixels, the width of the panel, as of the theme's large controls
LAST = 0.3  # s for browsers to receive why there is nothing to see
log = logging.getLogger(__name__)


class Page:
    """Shows a session in any number of browsers, or none.

    The page opens at once. Until a session that was made with `wait=False` is ready, it says what the session does.

    **Arguments:** `session`; `host` and `port` to listen on; port None is 8080, or the next free one; `wait`: whether
    to return only when the body is in the picture. Without, `ready` waits for that.

    **Attributes:** `url`, whose path is a secret: whoever has it can drive the run; `read_only_url`, by which others,
    such as a class, may watch and change nothing; `plots_url`, of the page of plots; `server`, viser's; `session`;
    `scene` and `panels`; `overlay`: what stands on the scene, to which programs add texts, plots and arrows (see
    `timsim.panels.Overlay`); `tour`: its guided tour, which takes steps of your own (see
    `timsim.panels.Tours`).

    **Raises** `ValueError` for a host or a port on which it cannot listen.
    """

    def __init__(self, session: Session, host: str = HERE, port: int | None = None, wait: bool = True):
        check_arguments(Page, locals())
        check_port(host, port)
        host = HERE if host.lower() == "localhost" else host
        self.session, self.host = session, host
        self._recordings: list[FilmRecorder | SlowFilmRecorder | ReplayRecorder] = []
        self._gate = Gate(host, "`motorgrad sim`, or `page.url`,", watched=True)
        self._plots = PlotPages()
        self.server = gated_server(self._gate, host, PORT if port is None else port, session.name, self._plots)
        # a browser may disconnect between two messages
        warnings.filterwarnings("ignore", "Queued a .* on a closed connection", UserWarning)
        self.overlay = Overlay()
        self._dock()
        self._progress = self.server.gui.add_html("")
        self._stop = threading.Event()
        self._built = threading.Event()
        self._error = None
        self._thread = threading.Thread(target=self._begin, name="motorgrad sim page", daemon=True)
        self._thread.start()
        if wait:
            try:
                self.ready()
            except BaseException:
                self.server.stop()
                raise

    def ready(self) -> None:
        """Wait until the body is shown. **Raises** the error that kept the session from starting."""
        while not self._built.wait(0.2):
            pass
        if self._error is not None:
            raise self._error

    def _begin(self) -> None:
        """Start the session, show its progress, then build the page and keep it up to date."""
        try:
            self.session.wait_until_ready(self._tell)
            self._tell("drawing")
            self._build()
            self._progress.remove()
        except Exception as error:
            self._error = error
            self._tell(f"could not start: {' '.join(str(error).split())}")
            return
        finally:
            self._built.set()
        self._run()

    def _dock(self) -> None:
        """Give the panels their place."""
        self.server.gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        self.server.gui.main_panel.dock_right()
        # a browser may dock the panel before it hears of the theme, with a width that has no room for all tabs
        self.server.gui.main_panel.set_width(PANEL)

    def _succeed(self, session: Session) -> None:
        """Show another session in place of the current one, which ends, with its recordings."""
        old, self.session = self.session, session
        for recording in self._recordings:
            recording.stop()
        self.panels.close()
        clear(self.server)
        self._dock()
        self._build()
        old.close()
        for number, client in self.server.get_clients().items():
            tab = "Run" if session.task is None else "Learning"
            self._guard(f"the tab of browser {number}", self._clicks.bring_forward, client, tab)

    def _tell(self, words: str) -> None:
        """Show progress on the page's cover; the page's script reads it from this element."""
        self._progress.content = f'<div class="motorgrad-progress">{html.escape(words)}</div>'

    def _build(self) -> None:
        if mujoco.get_mju_user_warning() is None:  # by default MuJoCo writes a file into the user's folder
            mujoco.set_mju_user_warning(log.debug)
        session = self.session
        self.scene = Scene()
        self.panels = Panels(self.overlay.annotations)
        self._guard = Guard(session.name)
        self._pose = Pose(session.model)
        self._pose.place(session.snapshot())
        planet = None
        ground_at = None
        if getattr(getattr(session.task, "dynamics", None), "planet", None) is not None:
            from timsim.planet import PlanetScene, ground_finder  # not met by who does not ask for a planet

            planet = PlanetScene()
            ground_at = ground_finder(session.task, session.model, self._pose)
        self.view = View(self.scene, ground_at=ground_at)
        self.links = Links(self.view.cameras)
        self._clicks = ClickSelect(self.scene, self.panels)
        self.tour = Tours(self.view.cameras, self.panels, self._clicks, (View.title,))
        hands = DragPush(self.scene.draggable), self._clicks, self.links, self.tour
        drawn = [self.scene, *([] if planet is None else [planet])]
        for part in (*drawn, self.panels, self.overlay, *hands):
            part.build(self.server, session)
        with self.panels.tabs.add_tab(View.title):
            self.view.build(self.server, session)
            self.overlay.add_switch()
            self.tour.add_buttons()
            with self.server.gui.add_folder("Links"):
                self.server.gui.add_html(link_element("", "Copy link", "This page as it is, to open in this browser."))
                self.server.gui.add_html(link_element(self.read_only_url, "Copy link to watch only", WATCHED))
        self._plots.figures = Figures(session)
        self.parts: list[Any] = [*drawn, self.view, self.panels, self.overlay, *hands]

    @property
    def failures(self) -> int:
        """How many frames a part could not draw."""
        return self._guard.failures

    @property
    def url(self) -> str:
        """The whole address of the page, with the secret that opens it."""
        return f"{self._public_url}/{self._gate.token}/"

    @property
    def plots_url(self) -> str:
        """The address of the page of plots, for a separate window of a browser that has opened `url`."""
        return f"{self._public_url}/{self._gate.place}/plots"

    @property
    def read_only_url(self) -> str:
        """The whole address for those who may watch: they turn their camera and switch tabs, and change nothing.

        With a `host` that listens everywhere it names this machine, as others must.
        """
        door = self._gate.watching
        assert door is not None
        name = socket.gethostname().lower() if self.host in EVERYWHERE else None
        return f"{self._address(name)}/{door.token}/"

    @property
    def _public_url(self) -> str:
        return self._address()

    def _address(self, name: str | None = None) -> str:
        shown = name or NUMERIC.get(self.host, self.host)
        return f"http://{f'[{shown}]' if ':' in shown else shown}:{self.server.get_port()}"

    @property
    def last_words(self) -> str:
        """Why the run ended, as far as is known."""
        known = [event.text for event in self.session.log if event.kind in ("error", "ended")]
        return " ".join(dict.fromkeys(known[-2:])) or f"{self.session.name}: the simulation has ended"

    def link(
        self,
        *,
        decision: int | None = None,
        time: float | None = None,
        camera: str | None = None,
        tab: str | None = None,
        read_only: bool = False,
    ) -> str:
        """The address of a moment and a view of this page.

        **Arguments:** `decision`, or `time` in simulated seconds, at which the run pauses; `camera` and `tab`, by
        their names on the page; `read_only`: the address for watching, by which nobody moves the run.

        **Raises** `ValueError` for a moment that cannot be, an unknown camera or tab.

        ```py
        page.link(decision=1200, camera="side", tab="Muscles")
        ```
        """
        place = Place(decision, time, camera, tab)
        if camera is not None:
            camera_named(camera, self.view.cameras.names)
        if tab is not None:
            titles = [*self.panels.panels, View.title]
            check(tab.lower() in map(str.lower, titles), "tab", tab, f"one of {', '.join(titles)}")
        return f"{self.read_only_url if read_only else self.url}{place.fragment}"

    def open(self) -> None:
        """Open the page in the user's browser, where there is a screen."""
        if sys.platform in ("darwin", "win32") or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
            open_in_browser(self._gate, self._public_url)

    def viewpoint(self, time: float | None = None) -> Viewpoint:
        """The camera of the newest browser that may drive, for films of what it shows.

        **Arguments:** `time`, which films give to a camera that moves, does not matter.

        **Raises** `RuntimeError` where no such browser is there.

        ```py
        film = page.record("hop.mp4", camera=page.viewpoint)
        ```
        """
        del time
        clients = self.server.get_clients()
        driving = [number for number in clients if not watches(self.server, number)]
        if not driving:
            raise RuntimeError("viewpoint: no browser shows this page")
        return viewpoint_of(clients[max(driving)].camera)

    def record(self, path: Path | str, **settings: Any) -> FilmRecorder | SlowFilmRecorder | ReplayRecorder:
        """Record the run from now on, until `stop` is called on the returned recorder, or until `close`.

        A path that ends in ".html" becomes a replay (`timsim.panels.ReplayRecorder`), one in ".mp4", ".gif" or
        ".webp" a film (`timsim.panels.FilmRecorder`, which has the `settings`: size, camera, plots, ground).
        With `speed`, the film shows every decision at that speed, and is made when it ends
        (`timsim.panels.SlowFilmRecorder`). All show what was added by `overlay`.
        """
        kind: Any = SlowFilmRecorder if "speed" in settings else FilmRecorder
        if Path(path).suffix.lower() == ".html":
            kind = ReplayRecorder
        settings.setdefault("annotations", self.overlay.annotations)
        recording = kind(self.session, path, **settings)
        self._recordings.append(recording)
        return recording

    def wait(self) -> None:
        """Wait until the page or its run is closed, or for Ctrl-C."""
        while not self._stop.wait(0.2) and not self.session.ended:
            pass

    def close(self) -> None:
        """Close the page and end its run. A second call does nothing."""
        if self._stop.is_set():
            return
        self._stop.set()
        self._gate.end_tickets()
        if not self._built.is_set():
            self.session.close()
        self._thread.join(10.0)
        try:
            for recording in self._recordings:
                recording.stop()
        finally:
            if self._error is None:
                self.panels.close()
            else:
                time.sleep(LAST)
            with contextlib.redirect_stdout(io.StringIO()):  # viser prints that it stopped
                self.server.stop()
            for session in filter(None, (self.session, self.session.successor)):
                session.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Page({self.session.name}, {self._public_url})"

    def _repr_html_(self) -> str:
        """Show the page in a notebook."""
        return f'<iframe src="{self.url}" width="100%" height="600" style="border: 0"></iframe>'

    def _run(self) -> None:
        """Draw the newest snapshot thirty times a second; the run does not wait for it."""
        due = time.perf_counter()
        while not self._stop.is_set():
            if self.session.successor is not None:
                self._guard("another run", self._succeed, self.session.successor)
            try:
                snapshot = self.session.snapshot()
            except RuntimeError:  # the session is closed, or its worker died in the middle of a write
                return
            self._guard("pose", self._pose.place, snapshot)
            for part in self.parts:
                self._guard(type(part).__name__, part.update, snapshot, self._pose)
            now = time.perf_counter()
            due = max(due + FRAME, now)
            self._stop.wait(due - now)
