"""A genetic algorithm on real numbers."""

import dataclasses

import numpy as np
from jaxtyping import Float, Int

from motorgrad._errors import check
from motorgrad.schema import count, number
from motorgrad.search._methods import Places, State, WithCandidates
from motorgrad.search._space import reflected


@dataclasses.dataclass(frozen=True)
class Genetic(WithCandidates):
    """A genetic algorithm on real numbers (Holland, 1975; thesis, section 2.5.1).

    Each candidate has two parents of the present generation, each the better of a few drawn at random (a tournament).
    It has every number from either parent with equal chances (uniform crossover; Syswerda, 1989), or is the first
    parent's copy, and Gaussian noise is added to some of its numbers. The candidates of a round are the next
    generation, in which the best of the last replace the worst. Only the order of the scores counts. The first
    generation is the start and uniform samples. Failed candidates rank last.
    """

    candidates: int = count(12, 2, help="per round, which are a generation")
    tournament: int = count(
        2, 1, help="from how many, drawn with replacement, a parent is the best; 1 for no selection"
    )
    crossover: float = number(0.7, 0, 1, help="chance that a candidate has two parents")
    mutation: float = number(0.5, 0, 1, help="chance that noise is added to a number")
    width: float = number(
        0.1,
        0,
        open_low=True,
        help="standard deviation of the noise, as a fraction of a number's range. Numbers are reflected at the bounds",
    )
    elite: int = count(1, 0, help="how many of the best of a generation stay in the next, with their scores")

    def validate(self) -> None:
        super().validate()
        check(self.elite < self.candidates, "elite", self.elite, f"less than the {self.candidates} candidates")

    def begin(self, start: Float[np.ndarray, " size"]) -> State:
        start = np.asarray(start, float)
        return {"population": np.zeros((0, len(start))), "scores": np.zeros(0), "start": start}

    def ask(self, state: State, random: np.random.Generator) -> tuple[Places, State]:
        count = self.candidates
        size = len(state["start"])
        if len(state["scores"]) == 0:
            return np.concatenate([state["start"][None], random.random((count - 1, size))]), state
        first, second = (state["population"][self._winners(state["scores"], random)] for _ in range(2))
        mixed = (random.random(count) < self.crossover)[:, None] & (random.random((count, size)) < 0.5)
        noise = self.width * random.standard_normal((count, size))
        changed = random.random((count, size)) < self.mutation
        return reflected(np.where(mixed, second, first) + np.where(changed, noise, 0.0)), state

    def tell(self, state: State, candidates: Places, scores: Float[np.ndarray, " batch"]) -> State:
        ranked = np.where(np.isfinite(scores), scores, -np.inf)
        kept = np.argsort(-state["scores"], kind="stable")[: self.elite]
        stay = np.argsort(-ranked, kind="stable")[: self.candidates - len(kept)]
        return {
            **state,
            "population": np.concatenate([state["population"][kept], candidates[stay]]),
            "scores": np.concatenate([state["scores"][kept], ranked[stay]]),
        }

    def _winners(self, scores: Float[np.ndarray, " population"], random: np.random.Generator) -> Int[np.ndarray, " n"]:
        """The places of as many parents as there are candidates."""
        drawn = random.integers(len(scores), size=(self.candidates, self.tournament))
        return drawn[np.arange(self.candidates), scores[drawn].argmax(axis=1)]
