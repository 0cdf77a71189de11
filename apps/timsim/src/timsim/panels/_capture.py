"""Capture: films of a run, snapshots, the pose as SVG, and the scene as a separate HTML page."""

from __future__ import annotations

import io
import tempfile
import time
from pathlib import Path
from typing import ClassVar

import numpy as np
import viser
from PIL import Image

from timsim.film import Motion, still
from timsim.live import Session, Snapshot
from timsim.panels._film_folder import FilmFolder
from timsim.panels._film_painting import painting_of
from timsim.panels._motion_recorder import MAX_RECORDING_SECONDS
from timsim.panels._panel import Panel, notify, send, table
from timsim.panels._replay_recorder import ReplayRecorder
from timsim.panels._watcher import Annotating, no_annotations
from timsim.scene import Pose, viewpoint_of

LICENCES = Path(__file__).with_name("viser-licences.txt")  # made by tools/viser_licences.py


class BodyRecording:
    """Records a session's body from now on, as a replay: see `ReplayRecorder`.

    Unlike viser's recordings it takes the plots along, and goes back to its beginning without an empty picture.
    """

    def __init__(self, session: Session, annotations: Annotating = no_annotations) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="motorgrad-")
        path = Path(self._folder.name) / "replay.html"
        self._recorder = ReplayRecorder(session, path, annotations=annotations, longest=MAX_RECORDING_SECONDS)

    @property
    def seconds(self) -> float:
        """The recorded simulated time so far."""
        return self._recorder.seconds

    @property
    def full(self) -> bool:
        """Whether it has ended by itself."""
        return self._recorder.full

    def tick(self) -> None:
        """Do nothing: the recorder keeps the time itself."""

    def html(self) -> bytes:
        """End the recording. **Returns** a page that needs neither server nor network."""
        with self._folder:
            self._recorder.stop()
            return self._recorder.path.read_bytes()

    def close(self) -> None:
        """Discard the recording; the recorder ends with its session."""
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

    @property
    def full(self) -> bool:
        """Whether it is to end, as it is kept in memory."""
        return self.seconds >= MAX_RECORDING_SECONDS

    def tick(self) -> None:
        """Advance the recording's time to the present."""
        now = time.monotonic()
        self._serializer.insert_sleep(now - self._last)
        self._last = now

    def html(self) -> bytes:
        """End the recording. **Returns** a page that needs neither server nor network, with the licences of what is in
        it."""
        first, rest = self._serializer.as_html().split("\n", 1)
        licences = LICENCES.read_text(encoding="utf-8")
        return f"{first}\n<!-- Licences of what is built in:\n\n{licences}-->\n{rest}".encode()


PATIENCE = 60.0  # s in which a browser must send its picture
PAGE = ("Record scene (HTML)", "Stop scene")


class CapturePanel(Panel):
    """Films, snapshots (PNG), the pose as vector graphics (SVG) and recordings of the scene (HTML). The browser that
    asked for a file saves it.

    **Attributes:** `annotations`, which films and recordings show, as of `FilmRecorder`; to be set before `build`.
    """

    title: ClassVar[str] = "Capture"
    rate: ClassVar[float] = 2.0

    annotations: Annotating = staticmethod(no_annotations)

    def fill(self, gui: viser.GuiApi) -> None:
        self._film: FilmFolder | None = None
        self._scene: BodyRecording | SceneRecording | None = None
        self._summary = gui.add_html("")
        if painting_of(self.session) is not None:
            self._film = FilmFolder(self, self._name, self.annotations)
            self._film.fill(gui)
        picture = gui.add_button("Snapshot (PNG)", icon=viser.Icon.PHOTO, hint="The scene as this browser shows it.")
        picture.on_click(self.guarded(self._picture))
        if self.model is not None:
            words = "Parts as outlines, muscles by activation, as this browser sees them."
            pose = gui.add_button("Pose (SVG)", icon=viser.Icon.VECTOR, hint=words)
            pose.on_click(self.guarded(self._pose_as_svg))
        self._scene_button = gui.add_button(
            PAGE[0],
            icon=viser.Icon.WORLD,
            hint=f"One file that opens in any browser; at most {MAX_RECORDING_SECONDS:g} s.",
        )
        self._scene_button.on_click(self.guarded(self._toggle_scene))
        self._say()

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        if self._scene is not None:
            self._scene.tick()
            if self._scene.full:
                self._end_scene(self._asked)
        if (self._film is not None and self._film.at_work) or self._scene is not None:
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
        if self._film is not None:
            self._film.close()
        if isinstance(self._scene, BodyRecording):
            self._scene.close()

    def _say(self) -> None:
        film = [] if self._film is None else self._film.rows()
        scene = "–" if self._scene is None else f"{self._scene.seconds:.1f} s"
        self._summary.content = table([*film, ("scene", scene)])

    def _pose_as_svg(self, event: viser.GuiEvent) -> None:
        snapshot = self.session.snapshot()
        assert event.client is not None  # a button is pressed in a browser
        camera = event.client.camera
        pose = Pose(self.session.model)
        pose.place(snapshot)
        marks = snapshot.marks[:1].reshape(1, -1, 4)
        motion = Motion(self.session.model, np.zeros(1), snapshot.position[:1], pose.activation[:1], "", marks)
        width, height = (max(64, 2 * (side // 2)) for side in (camera.image_width or 640, camera.image_height or 480))
        with tempfile.TemporaryDirectory(prefix="motorgrad-") as folder:
            path = Path(folder) / self._name("svg")
            still(motion, 0, path, width=width, height=height, camera=viewpoint_of(camera))
            send(self.server, event.client, path.name, path.read_bytes())

    def _picture(self, event: viser.GuiEvent) -> None:
        assert event.client is not None  # a button is pressed in a browser
        camera = event.client.camera
        height = camera.image_height or 480
        width = camera.image_width or 640
        pixels = camera.get_render(height, width, transport_format="jpeg", timeout=PATIENCE)
        content = io.BytesIO()
        Image.fromarray(pixels).save(content, "PNG")
        send(self.server, event.client, self._name("png"), content.getvalue())

    def _toggle_scene(self, event: viser.GuiEvent) -> None:
        if self._scene is None:
            recorded = self.session.model is not None
            self._scene = BodyRecording(self.session, self.annotations) if recorded else SceneRecording(self.server)
            self._asked = event.client
            self._scene_button.label = PAGE[1]
        else:
            self._end_scene(event.client)

    def _end_scene(self, client: viser.ClientHandle | None) -> None:
        scene = self._scene
        self._scene = None
        self._scene_button.label = PAGE[0]
        assert scene is not None
        content = scene.html()
        name = self._name("html")
        send(self.server, client, name, content)
        notify(self.server, f"{name}: {scene.seconds:.1f} s, {len(content) / 1e6:.1f} MB", "Scene", "green", client)

    def _name(self, ending: str) -> str:
        plain = "".join(letter if letter.isalnum() or letter in "-_" else "-" for letter in self.session.name)
        return f"{plain}-{time.strftime('%Y%m%d-%H%M%S')}.{ending}"
