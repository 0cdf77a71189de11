"""Frames into an mp4 file that browsers play."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np


def write_mp4(path: Path, frames: Iterable[np.ndarray], size: tuple[int, int], fps: float) -> None:
    """Write H.264 with 4:2:0 chroma and the index in front, so that a browser can play it while it loads.

    **Arguments:** frames `(height, width, 3)`, uint8; `size`: width and height, both even; `fps`: frames a second.

    The file is written beside its place and moved there when it is whole: a film that was interrupted leaves nothing.
    """
    import imageio_ffmpeg

    part = path.with_name(f".{path.stem}.{os.getpid()}.part.mp4")
    writer = imageio_ffmpeg.write_frames(
        str(part),
        size,
        fps=fps,  # type: ignore[arg-type]  # ffmpeg takes fractions too
        codec="libx264",
        pix_fmt_out="yuv420p",
        macro_block_size=2,
        output_params=["-crf", "20", "-preset", "veryfast", "-movflags", "+faststart"],
    )
    try:
        writer.send(None)
        with contextlib.closing(writer):
            for frame in frames:
                writer.send(np.ascontiguousarray(frame))
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
