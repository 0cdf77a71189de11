"""What stands on pictures besides the body: its caption, and the texts, plots and arrows that a program adds."""

from __future__ import annotations

import dataclasses
import functools
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import PIL.Image

INK = (38, 42, 48)
HALO = (240, 244, 248)


@dataclasses.dataclass(frozen=True, eq=False)
class Arrow:
    """An arrow in the scene, with its `name` at its tip: `ends` `(2, 3)` m in world coordinates, the tip last;
    `colour` as `"#d9730d"`; `radius` of its shaft in m.
    """

    name: str
    ends: np.ndarray
    colour: str
    radius: float


@dataclasses.dataclass(frozen=True, eq=False)
class Curve:
    """A small plot on a picture: `x` and `y` `(n,)`, drawn in a `colour` below the words of its `title`."""

    title: str
    x: np.ndarray
    y: np.ndarray
    colour: str


@dataclasses.dataclass(frozen=True)
class Annotations:
    """What is added to one picture: `cards` stand in its upper right corner, one below the other; `arrows` in the
    scene.
    """

    cards: Sequence[str | Curve] = ()
    arrows: Sequence[Arrow] = ()

    def towards(self, later: Annotations, part: float) -> Annotations:
        """These annotations, with the arrows moved by a part, in [0, 1], of the way to where they are later."""
        tips = {arrow.name: arrow.ends for arrow in later.arrows}
        moved = [
            dataclasses.replace(arrow, ends=arrow.ends + part * (tips.get(arrow.name, arrow.ends) - arrow.ends))
            for arrow in self.arrows
        ]
        return dataclasses.replace(self, arrows=moved)


@functools.cache
def _font(size: int) -> Any:
    import matplotlib
    from PIL import ImageFont

    # matplotlib's own font is the same on every system
    return ImageFont.truetype(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf", size)


def _margin(height: int) -> int:
    return max(4, round(0.035 * height))


def caption(picture: np.ndarray, left: str, right: str) -> np.ndarray:
    """Write `left` and `right` along the upper edge of a copy of the picture `(height, width, 3)`.

    The font shrinks until both fit beside each other; text that does not fit at eight pixels is cut with an ellipsis.
    """
    from PIL import Image, ImageDraw

    height, width = picture.shape[:2]
    image = Image.fromarray(np.ascontiguousarray(picture))
    pen = ImageDraw.Draw(image)
    margin = _margin(height)
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


def write_names(picture: np.ndarray, places: Mapping[str, tuple[float, float]]) -> np.ndarray:
    """Write names above places, in pixels from the upper left corner, on a copy of the picture."""
    if not places:
        return picture
    from PIL import Image, ImageDraw

    image = Image.fromarray(np.ascontiguousarray(picture))
    pen = ImageDraw.Draw(image)
    size = max(8, round(0.8 * LETTERS * len(picture)))
    for name, (x, y) in places.items():
        place = (x, y - size // 3)
        halo = max(1, size // 9)
        pen.text(place, name, INK, _font(size), anchor="mb", stroke_width=halo, stroke_fill=HALO)
    return np.asarray(image)


LETTERS = 0.034  # size of the font of cards, as a share of the picture's height
LINE = 1.3  # height of a line of text, in font sizes
# size of a plot, in font sizes
WIDE = 12.0
TALL = 5.0
MAX_TEXT_WIDTH = 0.45  # as a share of the picture's width


def annotate(picture: np.ndarray, cards: Sequence[str | Curve]) -> np.ndarray:
    """Draw texts and small plots below the caption, at the right edge of a copy of the picture `(height, width, 3)`.
    What does not fit above the lower edge is left out.
    """
    if not cards:
        return picture
    from PIL import Image, ImageDraw

    height, width = picture.shape[:2]
    image = Image.fromarray(np.ascontiguousarray(picture))
    pen = ImageDraw.Draw(image)
    margin = _margin(height)
    size = max(8, round(LETTERS * height))
    font = _font(size)
    halo = max(1, size // 9)
    letters = max(8, int(MAX_TEXT_WIDTH * width / pen.textlength("n", font)))  # in a line
    top = 2 * margin + round(0.046 * height)
    for card in cards:
        if isinstance(card, Curve):
            wide = min(round(WIDE * size), width - 2 * margin)
            if top + (TALL + 2 * LINE) * size < height - margin:
                _draw_curve(image, card, width - margin - wide, top, wide, size)
            top += round((TALL + 2 * LINE) * size) + margin // 2
            continue
        for line in textwrap.wrap(card, letters):
            if top + LINE * size < height - margin:
                pen.text((width - margin, top), line, INK, font, anchor="ra", stroke_width=halo, stroke_fill=HALO)
            top += round(LINE * size)
    return np.asarray(image)


FINE = 3  # lines are drawn this many times larger, for smooth edges


def _draw_curve(image: PIL.Image.Image, curve: Curve, left: int, top: int, wide: int, size: int) -> None:
    """Draw a plot of a width, with its title, the limits of its axes, and text of a size, all in pixels."""
    from PIL import Image, ImageDraw

    pen = ImageDraw.Draw(image)
    small = _font(max(7, round(0.8 * size)))
    tall = round(TALL * size)
    line = round(LINE * size)
    box = (left, top, left + wide, top + tall + 2 * line)
    image.paste(Image.blend(image.crop(box), Image.new("RGB", (wide, tall + 2 * line), HALO), 0.75), box[:2])
    title = curve.title
    while len(title) > 1 and pen.textlength(title, _font(size)) > wide - size / 2:
        title = title.rstrip("…")[:-1] + "…"
    pen.text((left + size // 4, top), title, INK, _font(size))
    good = np.isfinite(curve.x) & np.isfinite(curve.y)
    x = curve.x[good]
    y = curve.y[good]
    if not len(x):
        return
    low = float(y.min())
    high = float(y.max())
    names = [f"{value:.3g}".replace("-", "−") for value in (high, low)]
    begin = left + round(max(pen.textlength(name, small) for name in names)) + size // 2
    top = top + line
    right = left + wide - size // 4
    for name, at in zip(names, (top, top + tall), strict=True):
        pen.text((begin - size // 4, at), name, INK, small, anchor="rt" if at == top else "rb")
    for value, at, anchor in ((x[0], begin, "la"), (x[-1], right, "ra")):
        pen.text((at, top + tall + size // 6), f"{value:.1f} s".replace("-", "−"), INK, small, anchor=anchor)
    across = (x - x[0]) / (float(np.ptp(x)) or 1.0) * (right - begin)
    up = 0.95 - 0.9 * ((y - low) / (high - low) if high > low else np.full(len(y), 0.5))
    mask = Image.new("L", (FINE * (right - begin), FINE * tall))
    points = np.stack([across, up * tall], 1) * FINE
    ImageDraw.Draw(mask).line([*map(tuple, points.tolist())], 255, round(FINE * max(1.2, size / 9)), "curve")
    mask = mask.resize((right - begin, tall), Image.Resampling.LANCZOS)
    image.paste(Image.new("RGB", mask.size, curve.colour), (begin, top), mask)
    pen.line([(begin, top), (begin, top + tall), (right, top + tall)], INK)
