"""Capture: films, pictures, and the scene as a page of its own."""

from __future__ import annotations

import io
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from motorgrad.sim.panels._film import FPS, HEIGHT, WIDTH, FilmRecorder, can_be_filmed
from motorgrad.sim.panels._numbers import brief, table
from motorgrad.sim.panels._panel import Panel, notify, send
from motorgrad.sim.panels._recording import LONGEST, SceneRecording

if TYPE_CHECKING:
    from motorgrad.sim.live import Snapshot
    from motorgrad.sim.scene import Pose

SIZES = ("640 × 480", "960 × 720", "1280 × 720")
PATIENCE = 60.0  # seconds in which a browser must send its picture
FILM, PAGE = ("Record film (MP4)", "Stop film"), ("Record scene (HTML)", "Stop scene")


class CapturePanel(Panel):
    """Film (MP4), snapshot (PNG), scene recording (HTML); each is saved by the browser that asked for it."""

    title: ClassVar[str] = "Capture"
    icon: ClassVar[str] = "camera"
    rate: ClassVar[float] = 2.0

    def fill(self, gui: Any) -> None:
        self._film: FilmRecorder | None = None
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._scene: SceneRecording | None = None
        self._said = gui.add_html("")
        if can_be_filmed(self.session):
            self._size = gui.add_dropdown("Film size", SIZES, initial_value=SIZES[0], hint=f"{FPS:g} frames a second.")
            self._film_button = gui.add_button(FILM[0], icon="video")
            self._film_button.on_click(self.guarded(self._toggle_film))
        picture = gui.add_button("Snapshot (PNG)", icon="photo", hint="The scene as this browser shows it.")
        picture.on_click(self.guarded(self._picture))
        self._scene_button = gui.add_button(
            PAGE[0], icon="world", hint=f"One file, to be opened anywhere; at most {LONGEST:g} s."
        )
        self._scene_button.on_click(self.guarded(self._toggle_scene))
        self._say()

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        if self._scene is not None:
            self._scene.tick()
            if self._scene.seconds > LONGEST:
                self._end_scene(None)
        if self._film is not None or self._scene is not None:
            self.renew_at_rate()
        super().update(snapshot, pose)

    def show(self, snapshot: Snapshot, pose: Pose) -> None:
        del snapshot, pose
        self._say()

    def renew_at_rate(self) -> None:
        """Time goes on while something is recorded, though the run may stand still."""
        self._seen = ()

    def close(self) -> None:
        """End what is under way; nothing is sent."""
        film, self._film = self._film, None
        if film is not None:
            film.stop()
        if self._folder is not None:
            self._folder.cleanup()

    def _say(self) -> None:
        film, scene = self._film, self._scene
        rows = [
            ("film", "–" if film is None else f"{film.frames / FPS:.1f} s"),
            ("scene", "–" if scene is None else f"{scene.seconds:.1f} s"),
        ]
        if film is not None and film.painted:
            rows.append(("a frame takes", f"{brief(1e3 * film.busy / film.painted)} ms"))
        self._said.content = table(rows)

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
        from PIL import Image

        camera = event.client.camera
        height, width = camera.image_height or HEIGHT, camera.image_width or WIDTH
        pixels = camera.get_render(height, width, transport_format="jpeg", timeout=PATIENCE)
        content = io.BytesIO()
        Image.fromarray(pixels).save(content, "PNG")
        send(self.server, event.client, self._name("png"), content.getvalue())

    def _toggle_scene(self, event: Any) -> None:
        if self._scene is None:
            self._scene = SceneRecording(self.server)
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
