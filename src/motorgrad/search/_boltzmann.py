"""The thesis's random search: perturb what was good before."""

import dataclasses

import numpy as np
from jaxtyping import Float

from motorgrad._errors import check
from motorgrad.search._checks import whole
from motorgrad.search._method import Method, Places, State
from motorgrad.search._space import reflected


@dataclasses.dataclass(frozen=True)
class Boltzmann(Method):
    r"""Random search with Boltzmann selection (thesis, section 5.3.3).

    A candidate is made from an existing sample, which is selected with a probability that grows with its average score
    $\bar R_i$,

    $$ p_i \propto \exp\!\left(\frac{\bar R_i}{T\,\sigma}\right), $$

    $\sigma$ the standard deviation of all samples' average scores. A few of its numbers, selected by chance, are moved
    by Gaussian noise. The first samples come from the start. Samples that failed are never selected. The thesis gives
    no numbers: these are ours.

    - `candidates`: of a round, at least 1.
    - `temperature`: $T$, above 0, in standard deviations of the scores; the less, the greedier.
    - `changed`: how many numbers are moved, at least 1.
    - `width`: standard deviation of the noise, above 0, in parts of a number's range. At a bound it is reflected.
    - `again`: the share of candidates, in [0, 1), that are a selected sample as it is, so that luck averages out where
      scores are noisy.
    """

    candidates: int = 12
    temperature: float = 0.5
    changed: int = 2
    width: float = 0.1
    again: float = 0.0

    def __post_init__(self) -> None:
        whole("Boltzmann.candidates", self.candidates, 1)
        whole("Boltzmann.changed", self.changed, 1)
        for name in ("temperature", "width"):
            value = getattr(self, name)
            check(0.0 < value < np.inf, f"Boltzmann.{name}", value, "a finite number above 0")
        check(0.0 <= self.again < 1.0, "Boltzmann.again", self.again, "in [0, 1)")

    def batch(self, size: int) -> int:
        return self.candidates

    def begin(self, start: Float[np.ndarray, " size"]) -> State:
        """One sample, the start, of which nothing is known yet."""
        return {"samples": np.array(start, float)[None], "total": np.zeros(1), "tries": np.zeros(1, np.int64)}

    def probabilities(self, state: State) -> Float[np.ndarray, " samples"]:
        """With which each sample is selected. Before any has a score it is the start."""
        known = state["tries"] > 0
        if not known.any():
            return np.eye(1, len(known))[0]
        scores = np.where(known, state["total"] / np.maximum(state["tries"], 1), -np.inf)
        spread = scores[known].std()
        # equal scores: all alike
        weights = np.exp((scores - scores.max()) / (self.temperature * spread)) if spread > 0.0 else known * 1.0
        return weights / weights.sum()

    def ask(self, state: State, random: np.random.Generator) -> tuple[Places, State]:
        chances = self.probabilities(state)
        chosen = state["samples"][random.choice(len(chances), self.candidates, p=chances)]
        size = chosen.shape[1]
        few = random.random(chosen.shape).argsort(axis=1) < min(self.changed, size)
        moved = reflected(chosen + few * self.width * random.standard_normal(chosen.shape))
        kept = random.random(self.candidates) < self.again
        if not state["tries"].any():
            kept[0] = True  # the start itself is the first sample
        return np.where(kept[:, None], chosen, moved), state

    def tell(self, state: State, candidates: Places, scores: Float[np.ndarray, " batch"]) -> State:
        samples, total, tries = (state[name].copy() for name in ("samples", "total", "tries"))
        for candidate, score in zip(candidates, scores, strict=True):
            if not np.isfinite(score):
                continue
            same = np.flatnonzero((samples == candidate).all(axis=1))
            if same.size:
                total[same[0]] += score
                tries[same[0]] += 1
            else:
                samples = np.concatenate([samples, candidate[None]])
                total, tries = np.append(total, score), np.append(tries, 1)
        return {"samples": samples, "total": total, "tries": tries}
