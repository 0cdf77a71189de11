"""The texts, arrows and plots that programs add to a motion, as the player reads them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from timsim.film import Annotations, Arrow, Curve, Plot


def annotated(
    added: Sequence[Annotations], times: np.ndarray
) -> tuple[dict[str, Any], dict[str, np.ndarray], list[Plot]]:
    """Describe what is added to each frame.

    **Arguments:** `added`, one for each frame or none at all; `times` `(frames,)` s.

    **Returns:** the different `texts`, and name, colour and radius in m of the `arrows`; arrays `text`, the index of
    each frame's text, and `arrow`, start and end `(frames, 6 arrows)` m, NaN where there is none; and plots of the last
    values of all curves that change.
    """
    texts: dict[str, int] = {}
    arrows: dict[str, Arrow] = {}
    curves: dict[str, dict[float, float]] = {}
    spoken = []
    for frame, time in zip(added, times, strict=False):
        text = "\n".join(card for card in frame.cards if isinstance(card, str))
        spoken.append(texts.setdefault(text, len(texts)))
        arrows |= {arrow.name: arrow for arrow in frame.arrows}
        for card in frame.cards:
            if isinstance(card, Curve) and len(card.y):
                curves.setdefault(card.title, {})[float(time)] = float(card.y[-1])
    places = np.full((len(added), len(arrows), 6), np.nan, np.float32)
    for frame, row in zip(added, places, strict=True):
        for arrow in frame.arrows:
            row[list(arrows).index(arrow.name)] = arrow.ends.ravel()
    styles = [
        {"name": each.name, "colour": [x / 255 for x in bytes.fromhex(each.colour[1:])], "radius": each.radius}
        for each in arrows.values()
    ]
    plots = [
        Plot(title, np.array([*known]), np.array([*known.values()]))
        for title, known in curves.items()
        if len(set(known.values())) > 1
    ]
    columns = {"text": np.array(spoken, np.uint32), "arrow": places.reshape(len(added), -1)} if added else {}
    return {"texts": list(texts), "arrows": styles}, columns, plots
