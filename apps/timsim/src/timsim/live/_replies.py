"""What a worker sends to its session: about itself when it is ready, then events, settings and branches."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from timsim.live._snapshot import Sizes


class Ready(NamedTuple):
    """The first reply of a worker: array sizes, the period of a decision in s, the settings, and names."""

    sizes: Sizes
    period: float
    settings: dict[str, float]
    observations: list[str]
    actions: list[str]
    muscles: list[str]
    feet: list[str]
    metrics: list[str]


class Branch(NamedTuple):
    """One branch of a run, as a session shows it.

    - `name`; `parent`: the name of the branch that it left, or "" for the first.
    - `start`: the decision at which it left its parent; `end`: the last known one.
    - `edits`: its own pushes and edits, each with its decision, in words.
    - `present`: whether the run follows it; `beside`: whether it runs beside the present one.
    """

    name: str
    parent: str
    start: int
    end: int
    edits: tuple[tuple[int, str], ...]
    present: bool
    beside: bool


class Event(NamedTuple):
    """The outcome of an order, or another event.

    - `wall`: time of day, s since the epoch; `decision`: when it happened in the run.
    - `kind`: `"change"`, `"error"`, `"saved"`, `"loaded"`, `"lost"` where the simulation broke down or the body is out
      of this world after an intervention, or `"ended"` where the worker is gone.
    - `text`: one line.
    """

    wall: float
    decision: int
    text: str
    kind: str


class Reply(NamedTuple):
    """An event, whose text may be empty, with the settings that changed, and all branches where any has changed."""

    event: Event
    settings: Mapping[str, float]
    branches: tuple[Branch, ...] | None = None
