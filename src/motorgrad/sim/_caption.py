"""Words on a picture."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

import numpy as np

INK, HALO = (38, 42, 48), (240, 244, 248)


@functools.cache
def _font(size: int) -> Any:
    import matplotlib
    from PIL import ImageFont

    # the font that matplotlib brings along: the same letters on every system
    return ImageFont.truetype(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf", size)


def caption(picture: np.ndarray, left: str, right: str) -> np.ndarray:
    """The picture `(height, width, 3)` with `left` and `right` written along its upper edge, as a new array.

    Letters shrink until both fit beside one another; what does not fit at eight pixels is cut with an ellipsis.
    """
    from PIL import Image, ImageDraw

    height, width = picture.shape[:2]
    image = Image.fromarray(np.ascontiguousarray(picture))
    pen = ImageDraw.Draw(image)
    margin = max(4, round(0.035 * height))
    size = max(8, round(0.046 * height))
    room = width - 3 * margin - pen.textlength(right, _font(size))
    while size > 8 and pen.textlength(left, _font(size)) > room:
        size -= 1
        room = width - 3 * margin - pen.textlength(right, _font(size))
    font = _font(size)
    if pen.textlength(left, font) > room:
        while left and pen.textlength(left + "…", font) > room:
            left = left[:-1]
        left += "…"
    halo = max(1, size // 9)
    pen.text((margin, margin), left, INK, font, stroke_width=halo, stroke_fill=HALO)
    pen.text((width - margin, margin), right, INK, font, anchor="ra", stroke_width=halo, stroke_fill=HALO)
    return np.asarray(image)
