"""Frames into an mp4 file that browsers play, or into a GIF."""

from __future__ import annotations

import io
import os
import subprocess
import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from motorgrad._files import write_atomically


def write_mp4(path: Path, frames: Iterable[np.ndarray], size: tuple[int, int], fps: float) -> None:
    """Write H.264 with 4:2:0 chroma and the index in front, so that a browser can play it while it loads.

    **Arguments:** frames `(height, width, 3)`, uint8; `size`: width and height, both even; `fps`: frames a second.

    **Raises:** `RuntimeError` with ffmpeg's own words where it fails.

    The file is written beside its place and moved there when it is whole: a film that was interrupted leaves nothing.
    """
    part = path.with_name(f".{path.stem}.{os.getpid()}.part.mp4")
    try:
        # messages go to a file: an unread pipe that fills would stop ffmpeg, and us with it
        with tempfile.TemporaryFile() as messages:
            # not imageio-ffmpeg's own writer, which leaves its pipes for the garbage collector to close, aloud
            with subprocess.Popen(
                _command(part, size, fps), stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=messages
            ) as ffmpeg:
                assert ffmpeg.stdin is not None
                try:
                    for frame in frames:
                        ffmpeg.stdin.write(np.ascontiguousarray(frame).data)
                    ffmpeg.stdin.close()
                except BrokenPipeError:
                    pass  # ffmpeg gave up; its exit status and messages say why
                except BaseException:
                    ffmpeg.kill()
                    raise
            if ffmpeg.returncode:
                messages.seek(0)
                reason = messages.read().decode(errors="replace").strip()
                raise RuntimeError(f"ffmpeg could not write {str(path)!r}: {reason or f'status {ffmpeg.returncode}'}")
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def write_gif(path: Path, frames: Iterable[np.ndarray], fps: float, like: np.ndarray) -> None:
    """Write a GIF that repeats for ever.

    **Arguments:** as of `write_mp4`, but that a frame's length is a whole number of hundredths of a second; `like`, a
    frame whose 256 most useful colours are those of all: where all have the same, only what moves takes bytes.
    """
    from PIL import Image

    colours = Image.fromarray(like).quantize(256)
    pictures = (Image.fromarray(frame).quantize(palette=colours, dither=Image.Dither.NONE) for frame in frames)
    content = io.BytesIO()
    length = max(1, round(100 / fps)) * 10
    next(pictures).save(content, "GIF", save_all=True, append_images=pictures, duration=length, loop=0)
    write_atomically(path, content.getvalue())


def _command(path: Path, size: tuple[int, int], fps: float) -> list[str]:
    import imageio_ffmpeg

    # a whole path: one that begins with a dash is no option, one with a colon no protocol
    command = f"""{{}} -y -hide_banner -loglevel error
        -f rawvideo -pix_fmt rgb24 -s {size[0]}x{size[1]} -r {fps:.6f} -i -
        -an -c:v libx264 -preset veryfast -crf 20 -pix_fmt yuv420p -movflags +faststart {{}}"""
    places = iter((imageio_ffmpeg.get_ffmpeg_exe(), f"file:{path.absolute()}"))
    return [next(places) if word == "{}" else word for word in command.split()]
