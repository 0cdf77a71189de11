"""What a worker tells its page."""

import time
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from motorgrad.sim.live._snapshot import Sizes


class Ready(NamedTuple):
    """The worker can begin: how large everything is, and what it is called."""

    sizes: Sizes
    period: float
    settings: dict[str, float]
    observations: list[str]
    actions: list[str]
    muscles: list[str]
    feet: list[str]
    readings: list[str]


class Reply(NamedTuple):
    """What became of an order: a line, settings that have changed, and fields of the model that have."""

    decision: int
    text: str
    kind: str
    settings: dict[str, float]
    fields: Mapping[str, np.ndarray]
    wall: float

    def put_into(self, model: Any) -> None:
        for name, values in self.fields.items():
            np.copyto(getattr(model, name), values)


def reply(
    decision: int,
    text: str,
    kind: str = "change",
    settings: dict[str, float] | None = None,
    fields: Mapping[str, np.ndarray] | None = None,
) -> Reply:
    return Reply(decision, text, kind, settings or {}, fields or {}, time.time())
