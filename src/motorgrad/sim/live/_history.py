"""The way back: complete states of the last minutes, from which every decision between them is made again."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import jax
import numpy as np

MOST_BYTES = 256 * 2**20
MOST_STATES = 900  # a quarter of an hour, at one a second


class Kept(NamedTuple):
    decision: int
    state: Any
    size: int


class History:
    """States in order of their decisions, the oldest dropped where they are too many, or too large together.

    What is random comes of the decision's number, so a decision made again is the same to the last bit, as long as
    nothing was changed by hand in between: whoever changes something keeps a state at once.
    """

    def __init__(self, most_bytes: int = MOST_BYTES, most_states: int = MOST_STATES):
        self._kept: list[Kept] = []
        self._most = most_bytes, most_states

    def keep(self, decision: int, state: Any) -> None:
        """Keep a state; those of this decision and of later ones are no longer what follows."""
        self.drop_from(decision)
        size = sum(leaf.nbytes for leaf in jax.tree.leaves(state) if isinstance(leaf, np.ndarray))
        self._kept.append(Kept(decision, state, size))
        bytes_, states = self._most
        total = sum(kept.size for kept in self._kept)
        while len(self._kept) > 1 and (total > bytes_ or len(self._kept) > states):
            total -= self._kept.pop(0).size

    def drop_from(self, decision: int) -> None:
        """Forget the states of this decision and later."""
        while self._kept and self._kept[-1].decision >= decision:
            self._kept.pop()

    def before(self, decision: int) -> Kept:
        """The last state that is not after a decision."""
        return next(kept for kept in self._backwards() if kept.decision <= decision)

    @property
    def oldest(self) -> int:
        return self._kept[0].decision if self._kept else 0

    @property
    def newest(self) -> int:
        return self._kept[-1].decision if self._kept else 0

    def _backwards(self) -> Iterator[Kept]:
        return reversed(self._kept)
