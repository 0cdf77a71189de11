"""Search methods: the interface, uniform sampling, and the thesis's random search."""

import abc
import dataclasses

import numpy as np
from jaxtyping import Float

from motorgrad.schema import Settings, count, number
from motorgrad.search._space import reflected

State = dict[str, np.ndarray]
"""Everything a method knows, as named arrays that can be stored."""

Places = Float[np.ndarray, "batch size"]
"""Candidates: one per row, as places from 0 to 1 within the bounds of the numbers."""


class Method(Settings, abc.ABC):
    """A method that proposes candidates. Subclasses are frozen dataclasses of settings, with pure functions:

    ```
    state = method.begin(space.start)
    for each round:
        candidates, state = method.ask(state, random)
        state = method.tell(state, candidates, scores)
    ```

    All randomness comes from the `numpy.random.Generator` passed to `ask`. Greater scores are better.
    """

    @abc.abstractmethod
    def batch(self, size: int) -> int:
        """The number of candidates per round, for candidates of `size` numbers."""

    @abc.abstractmethod
    def begin(self, start: Float[np.ndarray, " size"]) -> State:
        """The initial state, given the places at which to start."""

    @abc.abstractmethod
    def ask(self, state: State, random: np.random.Generator) -> tuple[Places, State]:
        """The candidates of a round, and the state to pass to `tell`."""

    @abc.abstractmethod
    def tell(self, state: State, candidates: Places, scores: Float[np.ndarray, " batch"]) -> State:
        """The state after a round, given the scores of its candidates; NaN marks a failed one."""

    def tell_gradients(self, state: State, candidates: Places, gradients: Places, variances: Places) -> State:
        """The state after `tell`, given also the derivatives of the scores by the places and their sampling variances,
        (batch, size), NaN where unknown. It is called where the score function returns `WithGradients`; by default they
        are ignored."""
        return state


@dataclasses.dataclass(frozen=True)
class WithCandidates(Method):
    """A method whose number of candidates per round is a setting."""

    candidates: int = count(12, 1, help="per round")

    def batch(self, size: int) -> int:
        return self.candidates


@dataclasses.dataclass(frozen=True)
class Uniform(WithCandidates):
    """Independent uniform samples within the bounds: a baseline for other methods."""

    def begin(self, start: Float[np.ndarray, " size"]) -> State:
        return {"start": np.asarray(start, float)}

    def ask(self, state: State, random: np.random.Generator) -> tuple[Places, State]:
        return random.random((self.candidates, len(state["start"]))), state

    def tell(self, state: State, candidates: Places, scores: Float[np.ndarray, " batch"]) -> State:
        return state


@dataclasses.dataclass(frozen=True)
class Boltzmann(WithCandidates):
    r"""Random search with Boltzmann selection (thesis, section 5.3.3).

    A candidate is made from an existing sample, selected with a probability that increases with its average score $\bar
    R_i$,

    $$ p_i \propto \exp\!\left(\frac{\bar R_i}{T\,\sigma}\right), $$

    where $\sigma$ is the standard deviation of the average scores of all samples. Gaussian noise is added to a few
    randomly selected numbers. The first candidates are made from the start. Failed samples are never selected. The
    thesis gives no settings; the defaults are ours.
    """

    temperature: float = number(
        0.5, 0, open_low=True, help="$T$, in standard deviations of the scores; lower values are greedier"
    )
    changed: int = count(2, 1, help="how many numbers are changed")
    width: float = number(
        0.1,
        0,
        open_low=True,
        help="standard deviation of the noise, as a fraction of a number's range. Numbers are reflected at the bounds",
    )
    again: float = number(
        0.0,
        0,
        1,
        open_high=True,
        help="the fraction of candidates that repeat a selected sample unchanged, which averages noisy scores",
    )

    def begin(self, start: Float[np.ndarray, " size"]) -> State:
        """One sample, the start, without a score."""
        return {"samples": np.array(start, float)[None], "total": np.zeros(1), "tries": np.zeros(1, np.int64)}

    def probabilities(self, state: State) -> Float[np.ndarray, " samples"]:
        """The selection probability of each sample. Without any scores, the start is selected."""
        known = state["tries"] > 0
        if not known.any():
            return np.eye(1, len(known))[0]
        scores = np.where(known, state["total"] / np.maximum(state["tries"], 1), -np.inf)
        spread = scores[known].std()
        # equal scores have equal weights
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
            kept[0] = True  # the first candidate is the start itself
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
                total = np.append(total, score)
                tries = np.append(tries, 1)
        return {"samples": samples, "total": total, "tries": tries}
