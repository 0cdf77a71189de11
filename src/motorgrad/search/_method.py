"""What a method of search is: it asks for the scores of candidates, and is told them."""

import abc

import numpy as np
from jaxtyping import Float

State = dict[str, np.ndarray]
"""All that a method knows, as named arrays that can be stored."""

Places = Float[np.ndarray, "batch size"]
"""Candidates: a row for each, places from 0 to 1 within the bounds of the numbers."""


class Method(abc.ABC):
    """A way to propose candidates. Subclasses are frozen dataclasses of settings, whose functions change nothing:

    ```
    state = method.begin(space.start)
    for each round:
        candidates, state = method.ask(state, random)
        state = method.tell(state, candidates, scores)
    ```

    All chance comes from the `numpy.random.Generator` that `ask` is handed. Greater scores are better.
    """

    @abc.abstractmethod
    def batch(self, size: int) -> int:
        """How many candidates a round has, of so many numbers each."""

    @abc.abstractmethod
    def begin(self, start: Float[np.ndarray, " size"]) -> State:
        """What is known at the start, given the places at which to begin."""

    @abc.abstractmethod
    def ask(self, state: State, random: np.random.Generator) -> tuple[Places, State]:
        """The candidates of a round, and the state in which to be told of them."""

    @abc.abstractmethod
    def tell(self, state: State, candidates: Places, scores: Float[np.ndarray, " batch"]) -> State:
        """Take in the scores of the candidates that were asked for; NaN says that one failed."""
