"""Random sampling, which other methods have to beat."""

import dataclasses

import numpy as np
from jaxtyping import Float

from motorgrad.search._checks import whole
from motorgrad.search._method import Method, Places, State


@dataclasses.dataclass(frozen=True)
class Uniform(Method):
    """Candidates anywhere within the bounds, each place as likely as any other, whatever was found before.

    - `candidates`: of a round, at least 1.
    """

    candidates: int = 12

    def __post_init__(self) -> None:
        whole("Uniform.candidates", self.candidates, 1)

    def batch(self, size: int) -> int:
        return self.candidates

    def begin(self, start: Float[np.ndarray, " size"]) -> State:
        return {"start": np.asarray(start, float)}

    def ask(self, state: State, random: np.random.Generator) -> tuple[Places, State]:
        return random.random((self.candidates, len(state["start"]))), state

    def tell(self, state: State, candidates: Places, scores: Float[np.ndarray, " batch"]) -> State:
        return state
