"""Record a live run, to be replayed from one HTML file."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from motorgrad._errors import check
from motorgrad._files import check_writable
from timsim.film import Annotations, output_path
from timsim.live import Session
from timsim.panels._motion_recorder import MotionRecorder
from timsim.panels._watcher import Annotating, Watcher, no_annotations
from timsim.replay import Replay, write_replay


class ReplayRecorder:
    """Records every decision of a session's body from now on, until it is stopped, and writes it as a replay.

    A run that goes back in time discards what was recorded after that moment. Of a fast run (`speed` "max"), the
    stretches of consecutive decisions that the panels show are replayed one after the other. Targets are read four
    times a second.

    **Arguments:** `session`; `path`, ending in ".html"; `annotations`, read 30 times a second, as of `FilmRecorder`;
    `longest`: simulated seconds after which it ends by itself, above 0, at most 120; None for 120, of which `stop` then
    warns.

    **Attributes:** `path`; `seconds` recorded, of simulated time; `running`: whether it is recording; `full`: whether
    it has ended by itself; `replay`: what was written, None before `stop`.

    **Raises** `ValueError` for a session without a body, or a file that cannot be written; `stop` raises any later
    error.

    ```py
    recorder = ReplayRecorder(session, "run.html")
    recorder.stop()
    ```
    """

    def __init__(
        self,
        session: Session,
        path: str | os.PathLike[str],
        *,
        annotations: Annotating = no_annotations,
        longest: float | None = None,
    ) -> None:
        self.path: Path = output_path(path, ".html")
        check_writable("path", self.path)
        check(session.model is not None, "replay of", session.name, "a task or model with a body")
        self._session = session
        self._recorder = MotionRecorder(session, longest)
        self._watcher = Watcher(session, annotations)
        self.replay: Replay | None = None
        self._stopped = False

    @property
    def seconds(self) -> float:
        """Simulated seconds recorded so far."""
        return self._recorder.seconds

    @property
    def running(self) -> bool:
        """Whether it is recording."""
        return self._recorder.running

    @property
    def full(self) -> bool:
        """Whether it has ended by itself."""
        return self._recorder.full

    def stop(self) -> None:
        """End the recording and write the file. A second call does nothing."""
        if self._stopped:
            return
        self._stopped = True
        self._watcher.stop()
        motion, seconds, found = self._recorder.stop()
        # activations are plotted by the replay itself
        plots = [plot for name, plot in found.items() if name != "activations"]
        fps = min(60.0, max(5.0, 1 / self._session.period))

        def added(at: float) -> Annotations:
            return self._watcher.annotations(float(np.interp(at, motion.time, seconds)))

        self.replay = write_replay(motion, self.path, plots=plots, annotations=added, fps=fps)
