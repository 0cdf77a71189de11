"""What presets were seen to reach, and their cost: from `measured.json`, which is drawn from stored runs by
`python -m tools.which_preset table`."""

import functools
import json
from collections.abc import Mapping
from importlib.resources import files
from typing import Any, NamedTuple


class Measured(NamedTuple):
    """Of a preset: the processor time of a decision in ms, on the cheapest and the dearest task, in words (`cost`);
    what was reached, by task (`reached`)."""

    cost: str
    reached: Mapping[str, str]


def measured(preset: str) -> Measured | None:
    """What a preset was seen to reach; `None` for one that was not measured."""
    found = _stored().get(preset)
    return None if found is None else Measured(**found)


@functools.cache
def _stored() -> dict[str, Any]:
    text = files("motorgrad.learning.algorithms").joinpath("measured.json").read_text(encoding="utf-8")
    return json.loads(text)
