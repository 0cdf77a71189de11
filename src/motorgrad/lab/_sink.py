"""Blocks that only look."""

import dataclasses

from motorgrad.lab._block import Block


@dataclasses.dataclass(frozen=True)
class Sink(Block):
    """A block without outputs, whose inputs are recorded at each of its ticks.

    Nothing of it is computed while the diagram runs. What it shows, it makes of a `Record` afterwards.
    """
