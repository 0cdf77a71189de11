"""A random walk that is pulled towards the best place that it has seen."""

import dataclasses

import numpy as np
from jaxtyping import Float

from motorgrad.schema import count, number
from motorgrad.search._methods import Places, State, WithCandidates
from motorgrad.search._space import reflected


@dataclasses.dataclass(frozen=True)
class Pulled(WithCandidates):
    r"""Random search with a pull towards the best (Rosenstein & Barto, 2001; thesis, section 2.5.1).

    Several walkers begin at the start. In each round Gaussian noise moves each of them, whatever its score. With
    probability $\beta$ a walker also takes a step towards the best place so far, $b$:

    $$ x \leftarrow x + B\,\alpha\,(b - x) + \sigma\epsilon, \qquad P(B = 1) = \beta, \quad P(B = 0) = 1 - \beta. $$

    The best place is that of the greatest single score of any walker; with noisy scores, it was also lucky. Failed
    candidates are never the best.
    """

    candidates: int = count(
        12, 1, help="walkers, one candidate each per round. The first candidate of all is the start"
    )
    width: float = number(0.05, 0, open_low=True, help=r"$\sigma$, as a fraction of every number's range")
    chance: float = number(0.3, 0, 1, help=r"$\beta$")
    pull: float = number(0.8, 0, 1, help=r"$\alpha$; 1 returns to the best place")

    def begin(self, start: Float[np.ndarray, " size"]) -> State:
        start = np.array(start, float)
        return {"walkers": np.tile(start, (self.candidates, 1)), "best": start, "score": np.array(np.nan)}

    def ask(self, state: State, random: np.random.Generator) -> tuple[Places, State]:
        walkers = state["walkers"]
        pulled = random.random(len(walkers)) < self.chance
        noise = self.width * random.standard_normal(walkers.shape)
        if np.isnan(state["score"]):
            noise[0] = 0.0  # the first candidate is the start itself
        towards = np.where(pulled[:, None], self.pull * (state["best"] - walkers), 0.0)
        moved = reflected(walkers + towards + noise)
        return moved, {**state, "walkers": moved}

    def tell(self, state: State, candidates: Places, scores: Float[np.ndarray, " batch"]) -> State:
        if not np.isfinite(scores).any():
            return state
        index = int(np.nanargmax(np.where(np.isfinite(scores), scores, np.nan)))
        if scores[index] <= state["score"]:
            return state
        return {**state, "best": candidates[index].copy(), "score": np.array(scores[index])}
