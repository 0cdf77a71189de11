"""Films and still pictures of recorded motions, and video files for browsers."""

from __future__ import annotations

import io
import itertools
import os
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from motorgrad._arguments import check_arguments
from motorgrad._errors import check
from motorgrad._extras import FILM, require
from motorgrad._files import replacing, write_atomically
from timsim.film._annotations import Annotations, annotate, caption
from timsim.film._appearance import muscle_colour
from timsim.film._framing import frame_motions
from timsim.film._gl import Ground
from timsim.film._motion import Motion, resample
from timsim.film._painter import Renderer, check_picture, choose_renderer, renderer_class
from timsim.film._plots import Plot, PlotStrip
from timsim.film._viewpoint import Camera, Viewpoint, viewpoint_at

ENDINGS = (".mp4", ".webp", ".gif")
GAP = 4  # pixels between motions side by side


@dataclass(frozen=True)
class Film:
    """The result of `write_film`: the file, the renderer used ("gl" or "drawn"), the number of frames and the running
    time.

    `note` is empty for a rendered film; for a drawn one it tells why, and which system packages enable rendering.
    """

    path: Path
    renderer: str
    frames: int
    seconds: float
    note: str = ""


def write_film(
    motions: Motion | Sequence[Motion],
    path: str | os.PathLike[str],
    *,
    fps: float = 50,
    width: int = 640,
    height: int = 480,
    speed: float = 1.0,
    camera: Camera = None,
    renderer: Renderer = "auto",
    ground: Ground = "marked",
    plots: Sequence[Plot] = (),
    annotations: Callable[[float], Annotations] | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> Film:
    """Write a film of one motion, or of several side by side, each with its caption and running time.

    **Arguments:**

    - `motions`: shown from left to right at the same scale; the last posture of a shorter one stays until the end.
    - `path`: ends in ".mp4", or in ".webp" or ".gif" for an animated picture that repeats forever, as a README shows
      it; missing folders are created, an existing film is replaced.
    - `fps`: frames per second of the film, above 0; it may differ from the recording's. A GIF has the nearest rate of
      which a frame lasts a whole number of hundredths of a second.
    - `width`, `height`: of each motion's picture in pixels, even, at least 64.
    - `speed`: seconds of motion per second of film, above 0; 0.25 is slow motion.
    - `camera`: the name of a camera of the model, or the azimuth in degrees of a camera that frames the whole motion
      (90 looks along +y). None: the model's camera "side" if it has one that contains the motion, else one that frames
      the motion, along the hinges of a planar body. A long path is followed. A drawn picture takes only the heading
      from a named camera, and frames the motion itself. Or a `Viewpoint`, or a function that returns one of the time on
      the motion's clock, for a camera that moves.
    - `renderer`: "gl" (OpenGL), "drawn" (matplotlib), or "auto": OpenGL where it works.
    - `ground`: "marked" shows the model's ground, with lines where it has no texture; "plain" an even one of the
      background's colour, for print.
    - `plots`: drawn to the right of the bodies, with a line at the present moment.
    - `annotations`: texts, small plots, and arrows in the scene of the first motion, as a function of the time on that
      motion's clock.
    - `progress`: called after each frame with the number of frames done and their total.

    **Returns:** a `Film`.

    **Raises:** `ValueError` for input out of range, before any work; `RuntimeError` where `renderer="gl"` and OpenGL
    does not work here.

    ```py
    write_film([before, after], "hop.mp4", speed=0.5)
    ```
    """
    check_arguments(write_film, locals())
    motions = _checked(motions)
    target = output_path(path, *ENDINGS)
    check(np.isfinite(fps) and fps > 0, "fps", fps, "a number above 0")
    check(np.isfinite(speed) and speed > 0, "speed", speed, "a number above 0")
    kind, note = choose_renderer(renderer)
    check_picture([motion.model for motion in motions], width, height, camera, ground)
    fps = rate_of(target, fps)

    seconds = max(motion.seconds for motion in motions)
    frames = int(np.floor(seconds / speed * fps + 1e-6)) + 1
    shots = [resample(motion, np.arange(frames) * speed / fps) for motion in motions]
    full = len(motions) * width + (len(motions) - 1) * GAP
    strip = PlotStrip(plots, height) if plots else None
    whole = full + (0 if strip is None else GAP + strip.width)
    pace = "" if speed == 1 else f"  ×{speed:g}"

    def pictures() -> Iterator[np.ndarray]:
        places = [shot[1] for shot in shots], [shot[3] for shot in shots]
        painters = _open_renderers(motions, *places, width, height, camera, kind, ground)
        canvas = np.full((height, whole, 3), 255, np.uint8)
        try:
            for frame in range(frames):
                added = Annotations() if annotations is None else annotations(shots[0][0][frame])
                for index, (painter, motion, shot) in enumerate(zip(painters, motions, shots, strict=True)):
                    time, position, activation, marks = (part[frame] for part in shot)
                    if (viewpoint := viewpoint_at(camera, time)) is not None:
                        painter.look(viewpoint)
                    arrows = added.arrows if index == 0 else ()
                    picture = painter.paint(frame, position, activation, marks, arrows=arrows)
                    left = index * (width + GAP)
                    clock = f"{time - motion.time[0]:.2f} s{pace}"
                    canvas[:, left : left + width] = caption(picture, motion.label, clock)
                    if strip is not None and index == 0:
                        canvas[:, full + GAP :] = strip.at(time)
                canvas[:, :full] = annotate(canvas[:, :full], added.cards)
                yield canvas
                if progress is not None:
                    progress(frame + 1, frames)
        finally:
            for painter in painters:
                painter.close()

    target.parent.mkdir(parents=True, exist_ok=True)
    write_frames(target, pictures(), (whole, height), fps)
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
    ground: Ground = "marked",
) -> np.ndarray:
    """Make one picture of a motion, framed as its film is, with caption and time.

    **Arguments:** `frame`: index of the recorded frame, from the end if negative; `path`: a file ending in ".png", or
    in ".svg" for a vector picture, or None for no file; the others as of `write_film`.

    A vector picture has the body's parts as outlines and muscles along their wrapped paths, coloured by activation, as
    `draw` draws them, without caption; its groups "parts" and "muscles" have a path for each. A `Viewpoint` is seen in
    perspective, any other camera along parallel lines.

    **Returns:** `(height, width, 3)`, uint8; of a vector picture, its pixels.

    **Raises:** as `write_film` does.
    """
    check_arguments(still, locals())
    _checked(motion)
    target = None if path is None else output_path(path, ".png", ".svg")
    count = motion.time.size
    check(isinstance(frame, int | np.integer) and -count <= frame < count, "frame", frame, f"in [{-count}, {count})")
    kind, _ = choose_renderer(renderer)
    check_picture([motion.model], width, height, camera, ground)
    row = int(frame) % count
    vector = target is not None and target.suffix.lower() == ".svg"
    kind = "drawn" if vector else kind
    (painter,) = _open_renderers([motion], [motion.position], [motion.marks], width, height, camera, kind, ground)
    try:
        painter.look(viewpoint_at(camera, float(motion.time[row])))
        picture = painter.paint(row, motion.position[row], motion.activation[row], motion.marks[row])
        if vector:
            assert target is not None
            target.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(target, painter.svg())
            return picture.copy()
        picture = caption(picture, motion.label, f"{motion.time[row] - motion.time[0]:.2f} s")
    finally:
        painter.close()
    if target is not None:
        from PIL import Image

        target.parent.mkdir(parents=True, exist_ok=True)
        with replacing(target) as file:
            Image.fromarray(picture).save(file, "PNG")
    return picture.copy()


def _checked(motions: Motion | Sequence[Motion]) -> list[Motion]:
    listed = [motions] if isinstance(motions, Motion) else list(motions)
    check(listed, "motions", listed, "at least one Motion")
    for index, motion in enumerate(listed):
        check(isinstance(motion, Motion), f"motions[{index}]", motion, "a Motion")
    return listed


def output_path(path: str | os.PathLike[str], *suffixes: str) -> Path:
    """The path of a picture or film. **Raises** `ValueError` for another ending than `suffixes`, and for a folder."""
    target = Path(path)
    check(target.suffix.lower() in suffixes, "path", str(path), f"a file name ending in {' or '.join(suffixes)}")
    check(not target.is_dir(), "path", str(path), "a file, not a folder")
    if target.suffix.lower() == ".mp4":
        require("an .mp4 film, unlike a .gif, needs", *FILM[1:])
    return target


def _open_renderers(
    motions: Sequence[Motion],
    positions: Sequence[np.ndarray],
    marks: Sequence[np.ndarray],
    width: int,
    height: int,
    camera: Camera,
    kind: str,
    ground: Ground,
) -> list[Any]:
    """One renderer for each motion, all with the same line of sight and, for the same kind of body, the same scale."""
    brush = renderer_class(kind)
    models = [motion.model for motion in motions]
    groups: dict[tuple[int, int, int], list[int]] = {}
    for index, model in enumerate(models):
        groups.setdefault((model.nq, model.nbody, model.ngeom), []).append(index)
    painters: list[Any] = [None] * len(motions)
    for members in groups.values():
        them, moved, marked = ([each[i] for i in members] for each in (models, positions, marks))
        found = None if callable(camera) or isinstance(camera, Viewpoint) else camera
        view = frame_motions(them, moved, marked, found, width / height)
        for which, index in enumerate(members):
            painters[index] = brush(models[index], view, which, width, height, ground)
    return painters


def rate_of(path: Path, fps: float) -> float:
    """The frame rate that the file format allows, nearest to the one wanted."""
    return 100 / max(1, round(100 / fps)) if path.suffix.lower() == ".gif" else fps


def write_frames(path: Path, frames: Iterator[np.ndarray], size: tuple[int, int], fps: float) -> None:
    """Write a film of the kind that its path's ending names; arguments as of `write_mp4`."""
    kind = path.suffix.lower()
    if kind == ".webp":
        write_webp(path, frames, fps)
    elif kind == ".gif":
        first = next(frames).copy()
        write_gif(path, itertools.chain([first], frames), fps, _with_muscles(first))
    else:
        write_mp4(path, frames, size, fps)


def _with_muscles(frame: np.ndarray) -> np.ndarray:
    """A frame with the colours of muscles below it, so that its palette contains them even if all muscles are
    silent."""
    shades = np.linspace(0, 1, frame.shape[1])[:, None]
    bands = [np.clip(light * 255 * muscle_colour(shades[:, 0]), 0, 255) for light in (0.7, 0.85, 1.0)]
    rows = np.repeat(np.array(bands, np.uint8), max(1, frame.shape[0] // 40), axis=0)
    return np.concatenate([frame, rows])


def write_mp4(path: Path, frames: Iterable[np.ndarray], size: tuple[int, int], fps: float) -> None:
    """Write H.264 with 4:2:0 chroma and the index in front, so that browsers can play it while it loads.

    **Arguments:** `frames` `(height, width, 3)`, uint8; `size`: width and height, both even; `fps`: frames per second.

    **Raises:** `RuntimeError` with ffmpeg's message where it fails.

    The file is written beside its place and moved there when complete, so that an interrupted film leaves nothing.
    """
    # messages go to a file: an unread pipe would fill and stop ffmpeg, and this process with it
    with replacing(path) as part, tempfile.TemporaryFile() as messages:
        # imageio-ffmpeg's own writer leaves its pipes for the garbage collector to close, with warnings
        with subprocess.Popen(
            _command(Path(part.name), size, fps), stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=messages
        ) as ffmpeg:
            assert ffmpeg.stdin is not None
            try:
                for frame in frames:
                    ffmpeg.stdin.write(np.ascontiguousarray(frame).data)
                ffmpeg.stdin.close()
            except BrokenPipeError:
                pass  # ffmpeg failed; its exit status and messages tell why
            except BaseException:
                ffmpeg.kill()
                raise
        if ffmpeg.returncode:
            messages.seek(0)
            reason = messages.read().decode(errors="replace").strip()
            raise RuntimeError(f"ffmpeg could not write {str(path)!r}: {reason or f'status {ffmpeg.returncode}'}")


def write_gif(path: Path, frames: Iterable[np.ndarray], fps: float, like: np.ndarray) -> None:
    """Write a GIF that repeats forever.

    **Arguments:** as of `write_mp4`, but a frame lasts a whole number of hundredths of a second; `like`: a frame whose
    256 most useful colours are used for all. With one palette, only what moves takes bytes.
    """
    from PIL import Image

    colours = Image.fromarray(like).quantize(256)
    pictures = (Image.fromarray(frame).quantize(palette=colours, dither=Image.Dither.NONE) for frame in frames)
    content = io.BytesIO()
    length = max(1, round(100 / fps)) * 10
    next(pictures).save(content, "GIF", save_all=True, append_images=pictures, duration=length, loop=0)
    write_atomically(path, content.getvalue())


def write_webp(path: Path, frames: Iterable[np.ndarray], fps: float, quality: int = 60) -> None:
    """Write an animated WebP that repeats forever.

    **Arguments:** as of `write_mp4`, but a frame lasts a whole number of milliseconds; `quality`: from 0 to 100.
    """
    from PIL import Image

    first, *others = (Image.fromarray(frame.copy()) for frame in frames)
    content = io.BytesIO()
    length = max(1, round(1000 / fps))
    first.save(content, "WEBP", save_all=True, append_images=others, duration=length, loop=0, quality=quality, method=4)
    write_atomically(path, content.getvalue())


def _command(path: Path, size: tuple[int, int], fps: float) -> list[str]:
    import imageio_ffmpeg

    # absolute and prefixed, so that ffmpeg takes no leading dash for an option and no colon for a protocol
    command = f"""{{}} -y -hide_banner -loglevel error
        -f rawvideo -pix_fmt rgb24 -s {size[0]}x{size[1]} -r {fps:.6f} -i -
        -an -c:v libx264 -preset veryfast -crf 20 -pix_fmt yuv420p -movflags +faststart -f mp4 {{}}"""
    places = iter((imageio_ffmpeg.get_ffmpeg_exe(), f"file:{path.absolute()}"))
    return [next(places) if word == "{}" else word for word in command.split()]
