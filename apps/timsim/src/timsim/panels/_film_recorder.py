"""Films of a run: in real time as the page shows it, or of every decision, in slow motion."""

from __future__ import annotations

import math
import os
import threading
import time
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from motorgrad._errors import check, unknown
from motorgrad._files import check_writable
from timsim.film import (
    ENDINGS,
    GAP,
    Camera,
    Ground,
    annotate,
    check_picture,
    output_path,
    rate_of,
    write_film,
    write_frames,
)
from timsim.live import Session
from timsim.panels._film_painting import CHOICES, LiveStrip, Painting, PictureOptions, painting_of
from timsim.panels._motion_recorder import MotionRecorder
from timsim.panels._watcher import Annotating, Watcher, no_annotations

FPS = 30.0
WIDTH = 640
HEIGHT = 480
ROOM = 400_000_000  # bytes of the pictures of a GIF or WebP, which are kept until it ends


class FilmRecorder:
    """Films a session from now on, in wall time, until it is stopped.

    MuJoCo's renderer paints the present moment `fps` times a second, with muscles as in all films of this library but
    without multisampling. A moment that takes too long to paint is shown for longer, so that a film lasts as long as
    what it shows. The video is H.264 (x264), preset "veryfast", constant rate factor 20, 4:2:0. A GIF or WebP repeats
    for ever, and is kept in memory until it ends, by itself when it has 400 MB: after 14 s at 640 × 480. If an
    untrained body is shown at the start, both bodies are filmed. The plane of a particle can be filmed too.

    **Arguments:**

    - `session`; `path`, ending in ".mp4", ".webp" or ".gif"; `fps`: frames per second.
    - `width` and `height` of each body's picture, in pixels, even; with a viewpoint, of one picture with all bodies.
    - `camera`: as of `timsim.write_film`; a function is given the simulated time, so that with `page.viewpoint`
      the film shows what the browser shows.
    - `ground`: "marked", or "plain" for an even one.
    - `plots`: what is drawn beside the bodies: "reward", "activations", "contact forces", "learning curve". What the
      session does not have is left out.
    - `titles`: whether name and time stand above the bodies.
    - `annotations`: a function from a moment to the texts, plots and arrows that are drawn; `page.record` and the tab
      "Capture" give what programs add by `page.overlay`.

    **Attributes:** `path`; `frames` of the film; `painted`: how many of them were painted; `busy`: seconds spent
    painting; `full`: whether it has ended by itself, of which `stop` warns.

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
        camera: Camera = None,
        ground: Ground = "marked",
        plots: Sequence[str] = (),
        titles: bool = True,
        annotations: Annotating = no_annotations,
    ) -> None:
        self.path = _checked(path, fps, width, height, camera, ground, plots, session)
        self._session = session
        self._fps = rate_of(self.path, fps)
        self._options = PictureOptions(width, height, camera, ground, titles)
        painting = painting_of(session)
        if painting is None:
            raise ValueError(f"{session.name}: has neither a body nor local units, so there is nothing to film")
        self._painting = painting
        self._strip = LiveStrip(session, plots, height) if plots else None
        self._annotations = annotations
        self.frames = self.painted = 0
        self.busy = 0.0
        self.full = False
        self._stop = threading.Event()
        self._failed: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="motorgrad sim film", daemon=True)
        self._thread.start()

    @property
    def running(self) -> bool:
        """Whether it is filming."""
        return self._thread.is_alive()

    @property
    def seconds(self) -> float:
        """How long the film is so far."""
        return self.frames / self._fps

    def stop(self) -> None:
        """End the film and wait until its file is complete. A second call does nothing."""
        self._stop.set()
        self._thread.join()
        failed = self._failed
        self._failed = None
        if failed is not None:
            raise failed
        if self.full:
            self.full = False
            text = f"{self.path}: full after {self.seconds:.1f} s; what followed is not in it: film to an .mp4"
            warnings.warn(text, stacklevel=2)

    def _run(self) -> None:
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            painting = self._painting(self._session, self._session.snapshot(), self._options)
            try:
                first = self._paint(painting)
                size = (first.shape[1], first.shape[0])
                most = math.inf if self.path.suffix.lower() == ".mp4" else ROOM // first.nbytes
                write_frames(self.path, self._pictures(painting, most), size, self._fps)
            finally:
                painting.close()
        except Exception as error:  # raised by `stop`, in the caller's thread
            self._failed = error

    def _paint(self, painting: Painting) -> np.ndarray:
        moment = self._session.snapshot()
        added = self._annotations(moment)
        picture = annotate(painting.paint(moment, added.arrows), added.cards)
        if self._strip is None:
            return picture
        gap = np.full((len(picture), GAP, 3), 255, np.uint8)
        return np.concatenate([picture, gap, self._strip.paint(moment)], axis=1)

    def _pictures(self, painting: Painting, most: float) -> Iterator[np.ndarray]:
        begin = time.monotonic()
        while not self.frames or (not self._stop.is_set() and self.frames < most):
            since = time.monotonic()
            try:
                picture = self._paint(painting)
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
        self.full = not self._stop.is_set()


class SlowFilmRecorder:
    """Films every decision of a session's body from now on; the film is made when it is stopped.

    The film runs at a speed of its own whatever that of the run is, so that slow motion is smooth. At most 120
    simulated seconds are kept. A camera that moves and `annotations` are read 30 times a second while the run goes on;
    camera and arrows move smoothly between.

    **Arguments:** as of `FilmRecorder`; `speed`: simulated seconds per second of film, above 0; 0.25 is slow motion.

    **Attributes:** `path`; `seconds` recorded, of simulated time; `done`: the share of the film that is made.
    """

    def __init__(
        self,
        session: Session,
        path: str | os.PathLike[str],
        *,
        speed: float,
        fps: float = FPS,
        width: int = WIDTH,
        height: int = HEIGHT,
        camera: Camera = None,
        ground: Ground = "marked",
        plots: Sequence[str] = (),
        annotations: Annotating = no_annotations,
    ) -> None:
        self.path = _checked(path, fps, width, height, camera, ground, plots, session)
        check(math.isfinite(speed) and speed > 0, "speed", speed, "a number above 0")
        self._options: dict[str, Any] = {
            "fps": fps,
            "width": width,
            "height": height,
            "ground": ground,
            "speed": speed,
        }
        self._camera, self._plots = camera, plots
        self._recorder = MotionRecorder(session)
        self._watcher = Watcher(session, annotations, camera if callable(camera) else None)
        self.done = 0.0
        self._stopped = False

    @property
    def seconds(self) -> float:
        """Simulated seconds recorded so far."""
        return self._recorder.seconds

    @property
    def running(self) -> bool:
        """Whether it is recording."""
        return self._recorder.running

    def stop(self) -> None:
        """End the recording and make the film. A second call does nothing."""
        if self._stopped:
            return
        self._stopped = True
        self._watcher.stop()
        motion, seconds, found = self._recorder.stop()

        def moment(at: float) -> float:
            return float(np.interp(at, motion.time, seconds))

        camera, watcher = self._camera, self._watcher
        write_film(
            motion,
            self.path,
            camera=(lambda at: watcher.viewpoint(moment(at))) if callable(camera) else camera,
            plots=[found[name] for name in self._plots if name in found],
            annotations=lambda at: watcher.annotations(moment(at)),
            progress=self._note,
            **self._options,
        )

    def _note(self, made: int, of: int) -> None:
        self.done = made / of


def _checked(
    path: str | os.PathLike[str],
    fps: float,
    width: int,
    height: int,
    camera: Camera,
    ground: str,
    plots: Sequence[str],
    session: Session,
) -> Path:
    found = output_path(path, *ENDINGS)
    check_writable("path", found)
    check(math.isfinite(fps) and 0 < fps <= 120, "fps", fps, "above 0, at most 120")
    check_picture([] if session.model is None else [session.model], width, height, camera, ground)
    for name in plots:
        if name not in CHOICES:
            raise unknown("plot", name, CHOICES)
    return found
