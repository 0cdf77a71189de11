"""Simulated annealing."""

import dataclasses

import numpy as np
from jaxtyping import Float

from motorgrad.schema import count, number
from motorgrad.search._methods import Places, State, WithCandidates
from motorgrad.search._space import reflected


@dataclasses.dataclass(frozen=True)
class Annealing(WithCandidates):
    r"""Simulated annealing (Kirkpatrick, Gelatt & Vecchi, 1983; thesis, section 2.5.1).

    Several independent chains. In each round Gaussian noise moves every chain from its place $x$ to a candidate $x'$,
    which it accepts by the rule of Metropolis et al. (1953), with the probability

    $$ \min\!\left(1, \exp\frac{R(x') - R(x)}{T_k\,s}\right), \qquad T_k = T\,c^k, $$

    where $k$ counts rounds and $s$ is the standard deviation of the scores of the first round that has any spread. The
    first candidate of all is the start, and the other chains begin at uniform samples, as at an infinite temperature. A
    score is that of the evaluation in which a chain came to its place: with noisy scores, it was also lucky. Failed
    candidates are never accepted.
    """

    candidates: int = count(12, 2, help="chains, one candidate each per round")
    temperature: float = number(
        0.5, 0, open_low=True, help="$T$, in standard deviations of the scores of the first round"
    )
    cooling: float = number(0.95, 0, 1, open_low=True, help="$c$, the factor of the temperature per round")
    width: float = number(
        0.1,
        0,
        open_low=True,
        help="standard deviation of the noise, as a fraction of a number's range. Numbers are reflected at the bounds",
    )

    def begin(self, start: Float[np.ndarray, " size"]) -> State:
        return {
            "places": np.tile(np.asarray(start, float), (self.candidates, 1)),
            "scores": np.full(self.candidates, np.nan),
            "spread": np.array(np.nan),
            "chances": np.ones(self.candidates),
            "rounds": np.array(0),
        }

    def ask(self, state: State, random: np.random.Generator) -> tuple[Places, State]:
        places = state["places"]
        moved = reflected(places + self.width * random.standard_normal(places.shape))
        if state["rounds"] == 0:
            moved = np.concatenate([places[:1], random.random((self.candidates - 1, places.shape[1]))])
        return moved, {**state, "chances": random.random(self.candidates)}

    def tell(self, state: State, candidates: Places, scores: Float[np.ndarray, " batch"]) -> State:
        known = np.isfinite(scores)
        spread = state["spread"]
        if np.isnan(spread) and known.any() and scores[known].std() > 0.0:
            spread = np.array(scores[known].std())
        heat = self.temperature * self.cooling ** int(state["rounds"]) * np.nan_to_num(spread, nan=1.0)
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):  # of a chain without a score, or no heat
            chance = np.exp((scores - state["scores"]) / heat)
        first = np.isnan(state["scores"])
        taken = known & (first | (scores >= state["scores"]) | (state["chances"] < chance))
        return {
            **state,
            "places": np.where(taken[:, None], candidates, state["places"]),
            "scores": np.where(taken, scores, state["scores"]),
            "spread": spread,
            "rounds": state["rounds"] + 1,
        }
