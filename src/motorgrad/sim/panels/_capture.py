"""Capture: films of a run as it goes on, snapshots, and the scene as an HTML page of its own."""

from __future__ import annotations

import copy
import io
import math
import os
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np
import viser
from PIL import Image

from motorgrad._errors import check
from motorgrad._files import check_writable
from motorgrad.sim.film import GAP, Painter, caption, check_picture, output_path, write_mp4
from motorgrad.sim.live import Session, Snapshot
from motorgrad.sim.panels._panel import Panel, brief, notify, send, table
from motorgrad.sim.panels._replay_recorder import ReplayRecorder
from motorgrad.sim.plane import PlanePicture, has_local_units
from motorgrad.sim.scene import Pose

FPS, WIDTH, HEIGHT = 30.0, 640, 480


class FilmRecorder:
    """Films a session from now on, in wall time, until it is stopped.

    MuJoCo's renderer paints the present moment `fps` times a second, with muscles as in all films of this library but
    without multisampling. A moment that takes too long to paint is shown for longer, so that a film lasts as long as
    what it shows. The video is H.264 (x264), preset "veryfast", constant rate factor 20, 4:2:0. If an untrained body is
    shown at the start, both bodies are filmed. The plane of a particle can be filmed too.

    **Arguments:** `session`; `path`, ending in ".mp4"; `fps`: frames per second; `width` and `height` of each body's
    picture.

    **Attributes:** `path`; `frames` of the film; `painted`: how many of them were painted; `busy`: seconds spent
    painting.

    **Raises** `ValueError` for a session that cannot be filmed, or a file that cannot be written; `stop` raises any
    later error.

    ```py
    film = FilmRecorder(session, "run.mp4")
    film.stop()
    ```
    """

    def __init__(
        self,
        session: Session,
        path: str | os.PathLike[str],
        *,
        fps: float = FPS,
        width: int = WIDTH,
        height: int = HEIGHT,
    ) -> None:
        self.path = output_path(path, ".mp4")
        check_writable("path", self.path)
        check(math.isfinite(fps) and 0 < fps <= 120, "fps", fps, "above 0, at most 120")
        check_picture([], width, height, None)
        self._session, self._fps, self._size = session, fps, (width, height)
        painting = painting_of(session)
        if painting is None:
            raise ValueError(f"{session.name}: has neither a body nor local units, so there is nothing to film")
        self._painting = painting
        self.frames = self.painted = 0
        self.busy = 0.0
        self._stop = threading.Event()
        self._failed: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="motorgrad sim film", daemon=True)
        self._thread.start()

    @property
    def running(self) -> bool:
        """Whether it is filming."""
        return self._thread.is_alive()

    def stop(self) -> None:
        """End the film and wait until its file is complete. A second call does nothing."""
        self._stop.set()
        self._thread.join()
        failed, self._failed = self._failed, None
        if failed is not None:
            raise failed

    def _run(self) -> None:
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            painting = self._painting(self._session, *self._size, self._session.snapshot())
            try:
                first = painting.paint(self._session.snapshot())
                size = (first.shape[1], first.shape[0])
                write_mp4(self.path, self._pictures(painting), size, self._fps)
            finally:
                painting.close()
        except Exception as error:  # raised by `stop`, in the caller's thread
            self._failed = error

    def _pictures(self, painting: Painting) -> Iterator[np.ndarray]:
        begin = time.monotonic()
        while not self._stop.is_set():
            since = time.monotonic()
            try:
                picture = painting.paint(self._session.snapshot())
            except RuntimeError:
                if self._session.ended:  # the film ends with the run
                    return
                raise
            self.busy += time.monotonic() - since
            self.painted += 1
            due = max(self.frames + 1, math.floor((time.monotonic() - begin) * self._fps))
            for _ in range(due - self.frames):
                yield picture
            self.frames = due
            self._stop.wait(max(0.0, begin + self.frames / self._fps - time.monotonic()))


class Painting(Protocol):
    """Paints pictures of a session's moments. Use it from one thread only."""

    def __init__(self, session: Session, width: int, height: int, snapshot: Snapshot) -> None: ...

    def paint(self, snapshot: Snapshot) -> np.ndarray:
        """The picture `(height, width, 3)`, uint8."""
        ...

    def close(self) -> None:
        """Free the resources of the graphics driver."""


class _Bodies(Painting):
    """Pictures of the bodies side by side."""

    def __init__(self, session: Session, width: int, height: int, snapshot: Snapshot) -> None:
        self._pose = Pose(session.model)
        count = len(snapshot.position)
        model: Any = copy.copy(session.model)
        model.vis.quality.offsamples = 0  # multisampling would more than double the time of a software renderer
        self._painters = [Painter(model, width=width, height=height) for _ in range(count)]
        self._labels = snapshot.labels if count > 1 else (session.name,)
        self._canvas = np.full((height, count * (width + GAP) - GAP, 3), 255, np.uint8)
        self._width = width

    def paint(self, snapshot: Snapshot) -> np.ndarray:
        self._pose.place(snapshot)
        marks = snapshot.marks.reshape(len(snapshot.marks), -1, 4)
        shown = zip(self._painters, self._pose.bodies, self._pose.activation, self._labels, marks, strict=False)
        for index, (painter, data, activation, label, marked) in enumerate(shown):
            clock = f"{snapshot.seconds:.2f} s"
            left = index * (self._width + GAP)
            picture = painter.paint(data.qpos, activation, label, clock, marked)
            self._canvas[:, left : left + self._width] = picture
        return self._canvas.copy()

    def close(self) -> None:
        for painter in self._painters:
            painter.close()


class _Plane(Painting):
    """Pictures of a particle's plane with the units of its policy."""

    def __init__(self, session: Session, width: int, height: int, snapshot: Snapshot) -> None:
        self._session = session
        side = min(width, height)
        self._picture = PlanePicture(session.task, session.policy(snapshot.parameters[0]), side)
        self._canvas = np.full((height, width, 3), 255, np.uint8)
        self._corner = (height - side) // 2, (width - side) // 2

    def paint(self, snapshot: Snapshot) -> np.ndarray:
        policy = self._session.policy(snapshot.parameters[0])
        if policy is not None:
            drawn = self._picture.paint(policy, self._session.trail().position[:, :2])
            top, left = self._corner
            self._canvas[top : top + len(drawn), left : left + len(drawn)] = drawn
        return caption(self._canvas, self._session.name, f"{snapshot.decision:,}")


def painting_of(session: Session) -> type[Painting] | None:
    """What paints a session: its bodies, or the plane of a particle with local units; None for any other."""
    if session.model is not None:
        return _Bodies
    policy = session.policy(session.snapshot().parameters[0])
    return _Plane if has_local_units(session.task, policy) else None


LONGEST = 120.0  # s after which a recording, which is kept in memory, ends by itself


class BodyRecording:
    """Records a session's body from now on, as a replay: see `ReplayRecorder`.

    Unlike viser's recordings it takes the plots along, and goes back to its beginning without an empty picture.
    """

    def __init__(self, session: Session) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="motorgrad-")
        self._recorder = ReplayRecorder(session, Path(self._folder.name) / "replay.html")

    @property
    def seconds(self) -> float:
        """The simulated duration so far."""
        return self._recorder.seconds

    def tick(self) -> None:
        """Nothing: it keeps the time itself."""

    def html(self) -> bytes:
        """End the recording. **Returns** a page that needs neither server nor network."""
        with self._folder:
            self._recorder.stop()
            return self._recorder.path.read_bytes()

    def close(self) -> None:
        """Give up; the recorder ends with its session."""
        self._folder.cleanup()


class SceneRecording:
    """Records the scene of a page without a body from now on, as one HTML file: viser's recording in viser's client.
    Call `tick` once a frame.
    """

    def __init__(self, server: viser.ViserServer) -> None:
        self._serializer = server.get_scene_serializer()
        self._begin = self._last = time.monotonic()

    @property
    def seconds(self) -> float:
        """The duration so far."""
        return self._last - self._begin

    def tick(self) -> None:
        """Advance the recording's time to the present."""
        now = time.monotonic()
        self._serializer.insert_sleep(now - self._last)
        self._last = now

    def html(self) -> bytes:
        """End the recording. **Returns** a page that needs neither server nor network."""
        return self._serializer.as_html().encode()


SIZES = ("640 × 480", "960 × 720", "1280 × 720")
PATIENCE = 60.0  # s in which a browser must send its picture
FILM, PAGE = ("Record film (MP4)", "Stop film"), ("Record scene (HTML)", "Stop scene")


class CapturePanel(Panel):
    """Film (MP4), snapshot (PNG) and scene recording (HTML); the browser that asked for it saves the file."""

    title: ClassVar[str] = "Capture"
    rate: ClassVar[float] = 2.0

    def fill(self, gui: Any) -> None:
        self._film: FilmRecorder | None = None
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._scene: BodyRecording | SceneRecording | None = None
        self._summary = gui.add_html("")
        if painting_of(self.session) is not None:
            self._size = gui.add_dropdown("Film size", SIZES, initial_value=SIZES[0], hint=f"{FPS:g} frames a second.")
            self._film_button = gui.add_button(FILM[0], icon="video")
            self._film_button.on_click(self.guarded(self._toggle_film))
        picture = gui.add_button("Snapshot (PNG)", icon="photo", hint="The scene as this browser shows it.")
        picture.on_click(self.guarded(self._picture))
        self._scene_button = gui.add_button(
            PAGE[0], icon="world", hint=f"One file that opens in any browser; at most {LONGEST:g} s."
        )
        self._scene_button.on_click(self.guarded(self._toggle_scene))
        self._say()

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        if self._scene is not None:
            self._scene.tick()
            if self._scene.seconds >= LONGEST:
                self._end_scene(None)
        if self._film is not None or self._scene is not None:
            self.renew_at_rate()
        super().update(snapshot, pose)

    def show(self, snapshot: Snapshot, pose: Pose) -> None:
        del snapshot, pose
        self._say()

    def renew_at_rate(self) -> None:
        """Keep updating while something is recorded, even if the run is paused."""
        self._seen = ()

    def close(self) -> None:
        """End recordings without sending them."""
        film, self._film = self._film, None
        if film is not None:
            film.stop()
        if self._folder is not None:
            self._folder.cleanup()
        if isinstance(self._scene, BodyRecording):
            self._scene.close()

    def _say(self) -> None:
        film, scene = self._film, self._scene
        rows = [
            ("film", "–" if film is None else f"{film.frames / FPS:.1f} s"),
            ("scene", "–" if scene is None else f"{scene.seconds:.1f} s"),
        ]
        if film is not None and film.painted:
            rows.append(("time per frame", f"{brief(1e3 * film.busy / film.painted)} ms"))
        self._summary.content = table(rows)

    def _toggle_film(self, event: Any) -> None:
        if self._film is None:
            width, height = (int(side) for side in self._size.value.split(" × "))
            self._folder = tempfile.TemporaryDirectory(prefix="motorgrad-")
            path = Path(self._folder.name) / self._name("mp4")
            self._film = FilmRecorder(self.session, path, width=width, height=height)
            self._film_button.label = FILM[1]
            return
        film, self._film = self._film, None
        self._film_button.label = FILM[0]
        assert self._folder is not None
        try:
            film.stop()
            send(self.server, event.client, film.path.name, film.path.read_bytes())
        finally:
            self._folder.cleanup()
        notify(self.server, f"{film.path.name}: {film.frames / FPS:.1f} s", "Film", "green", event.client)

    def _picture(self, event: Any) -> None:
        camera = event.client.camera
        height, width = camera.image_height or HEIGHT, camera.image_width or WIDTH
        pixels = camera.get_render(height, width, transport_format="jpeg", timeout=PATIENCE)
        content = io.BytesIO()
        Image.fromarray(pixels).save(content, "PNG")
        send(self.server, event.client, self._name("png"), content.getvalue())

    def _toggle_scene(self, event: Any) -> None:
        if self._scene is None:
            recorded = self.session.model is not None
            self._scene = BodyRecording(self.session) if recorded else SceneRecording(self.server)
            self._scene_button.label = PAGE[1]
        else:
            self._end_scene(event.client)

    def _end_scene(self, client: Any) -> None:
        scene, self._scene = self._scene, None
        self._scene_button.label = PAGE[0]
        assert scene is not None
        content = scene.html()
        name = self._name("html")
        send(self.server, client, name, content)
        notify(self.server, f"{name}: {scene.seconds:.1f} s, {len(content) / 1e6:.1f} MB", "Scene", "green", client)

    def _name(self, ending: str) -> str:
        plain = "".join(letter if letter.isalnum() or letter in "-_" else "-" for letter in self.session.name)
        return f"{plain}-{time.strftime('%Y%m%d-%H%M%S')}.{ending}"
