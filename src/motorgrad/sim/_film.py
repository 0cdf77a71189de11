"""Films and still pictures of recorded motions."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from motorgrad._errors import check
from motorgrad.sim import _framing
from motorgrad.sim._caption import caption
from motorgrad.sim._motion import Motion, resample
from motorgrad.sim._renderer import Camera, Renderer, brush_of, check_picture, choose

GAP = 4  # pixels between motions side by side


@dataclass(frozen=True)
class Film:
    """What `film` made: the file, the renderer that was used ("gl" or "drawn"), its frames and its running time.

    `note` is empty for a rendered film; for a drawn one it says why, and which system packages give the rendered one.
    """

    path: Path
    renderer: str
    frames: int
    seconds: float
    note: str = ""


def film(
    motions: Motion | Sequence[Motion],
    path: str | os.PathLike[str],
    *,
    fps: float = 50,
    width: int = 640,
    height: int = 480,
    speed: float = 1.0,
    camera: Camera = None,
    renderer: Renderer = "auto",
    progress: Callable[[int, int], object] | None = None,
) -> Film:
    """Write a film of one motion, or of several side by side, each with its caption and its running time.

    **Arguments:**

    - `motions`: shown from left to right at the same scale; where one ends first, its last posture stays.
    - `path`: ends in ".mp4"; missing folders are made, an older film is replaced.
    - `fps`: frames a second of the film, above 0; it need not be that of the recording.
    - `width`, `height`: pixels of each motion's picture, even, at least 64.
    - `speed`: seconds of motion shown in a second of film, above 0; 0.25 is slow motion.
    - `camera`: a camera of the model by its name, or the azimuth in degrees of a camera that frames the whole motion
      (90 looks along +y). None: the model's camera "side" if it has one and the motion stays in its picture, else
      one that frames the motion, along the hinges of a planar body. A long path is followed.
      A drawn picture takes only the heading from a named camera, and frames the motion itself.
    - `renderer`: "gl" (OpenGL), "drawn" (matplotlib), or "auto": OpenGL where it works.
    - `progress`: called with the frames done and their total after each.

    **Returns:** a `Film`.

    **Raises:** `ValueError` for input that is out of range, naming it, before any work; `RuntimeError` where
    `renderer="gl"` and OpenGL does not work here.
    """
    motions = _motions(motions)
    target = target_of(path, ".mp4")
    check(np.isfinite(fps) and fps > 0, "fps", fps, "a number above 0")
    check(np.isfinite(speed) and speed > 0, "speed", speed, "a number above 0")
    kind, note = choose(renderer)
    check_picture([motion.model for motion in motions], width, height, camera)

    seconds = max(motion.seconds for motion in motions)
    frames = int(np.floor(seconds / speed * fps + 1e-6)) + 1
    shots = [resample(motion, np.arange(frames) * speed / fps) for motion in motions]
    full = len(motions) * width + (len(motions) - 1) * GAP
    pace = "" if speed == 1 else f"  ×{speed:g}"

    def pictures() -> Iterator[np.ndarray]:
        painters = _painters(motions, [shot[1] for shot in shots], width, height, camera, kind)
        canvas = np.full((height, full, 3), 255, np.uint8)
        try:
            for frame in range(frames):
                for index, (painter, motion, shot) in enumerate(zip(painters, motions, shots, strict=True)):
                    time, position, activation = (part[frame] for part in shot)
                    picture = painter.paint(frame, position, activation)
                    left = index * (width + GAP)
                    clock = f"{time - motion.time[0]:.2f} s{pace}"
                    canvas[:, left : left + width] = caption(picture, motion.label, clock)
                yield canvas
                if progress is not None:
                    progress(frame + 1, frames)
        finally:
            for painter in painters:
                painter.close()

    from motorgrad.sim._video import write_mp4

    target.parent.mkdir(parents=True, exist_ok=True)
    write_mp4(target, pictures(), (full, height), fps)
    return Film(target, kind, frames, frames / fps, note)


def still(
    motion: Motion,
    frame: int,
    path: str | os.PathLike[str] | None = None,
    *,
    width: int = 640,
    height: int = 480,
    camera: Camera = None,
    renderer: Renderer = "auto",
) -> np.ndarray:
    """One picture of a motion, framed as its film is, with caption and time.

    **Arguments:** `frame`: index of the recorded frame, from the end if negative; `path`: a file ending in ".png", or
    None for no file; the others as of `film`.

    **Returns:** `(height, width, 3)`, uint8.

    **Raises:** as `film` does.
    """
    _motions(motion)
    target = None if path is None else target_of(path, ".png")
    count = motion.time.size
    check(isinstance(frame, int | np.integer) and -count <= frame < count, "frame", frame, f"in [{-count}, {count})")
    kind, _ = choose(renderer)
    check_picture([motion.model], width, height, camera)
    row = int(frame) % count
    (painter,) = _painters([motion], [motion.position], width, height, camera, kind)
    try:
        picture = painter.paint(row, motion.position[row], motion.activation[row])
        picture = caption(picture, motion.label, f"{motion.time[row] - motion.time[0]:.2f} s")
    finally:
        painter.close()
    if target is not None:
        from PIL import Image

        target.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(picture).save(target)
    return picture.copy()


def _motions(motions: Motion | Sequence[Motion]) -> list[Motion]:
    listed = [motions] if isinstance(motions, Motion) else list(motions)
    check(listed, "motions", listed, "at least one Motion")
    for index, motion in enumerate(listed):
        check(isinstance(motion, Motion), f"motions[{index}]", motion, "a Motion")
    return listed


def target_of(path: str | os.PathLike[str], *suffixes: str) -> Path:
    """The file of a picture or a film. **Raises** `ValueError` for another ending than these, and for a folder."""
    target = Path(path)
    check(target.suffix.lower() in suffixes, "path", str(path), f"a file name ending in {' or '.join(suffixes)}")
    check(not target.is_dir(), "path", str(path), "a file, not a folder")
    return target


def _painters(
    motions: Sequence[Motion], positions: Sequence[np.ndarray], width: int, height: int, camera: Camera, kind: str
) -> list[Any]:
    """One painter for each motion, all with the same line of sight and, for the same kind of body, the same scale."""
    brush = brush_of(kind)
    models = [motion.model for motion in motions]
    groups: dict[tuple[int, int, int], list[int]] = {}
    for index, model in enumerate(models):
        groups.setdefault((model.nq, model.nbody, model.ngeom), []).append(index)
    painters: list[Any] = [None] * len(motions)
    for members in groups.values():
        view = _framing.frame([models[i] for i in members], [positions[i] for i in members], camera, width / height)
        for which, index in enumerate(members):
            painters[index] = brush(models[index], view, which, width, height)
    return painters
