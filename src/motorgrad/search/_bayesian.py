"""Bayesian optimisation: a Gaussian process over the scores so far chooses what to try next."""

import dataclasses
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt
from jaxtyping import Float

from motorgrad._errors import check
from motorgrad._extras import require
from motorgrad.schema import Range, count, number, static
from motorgrad.search._methods import Places, State, WithCandidates

if TYPE_CHECKING:
    from motorgrad.search._gaussian_process import Data

MIN_CANDIDATES = 16  # for which the arrays of the process have room; the room is doubled when it is used up


@dataclasses.dataclass(frozen=True)
class BayesianOptimisation(WithCandidates):
    r"""Bayesian optimisation with a Gaussian process (thesis, section 7.3; Jones et al., 1998), by the package tinygp.

    The process is conditioned on all scores so far, and on their gradients where the score function returns
    `WithGradients`: the derivative of a Gaussian process is a Gaussian process, so a gradient sample is an observation
    with its sampling variance as noise. Scores are standardised. Length scales, one for each number, the process's
    standard deviation and the noise of the scores maximise the marginal likelihood, anew in each round.

    The first candidates are the start and a Latin hypercube. A later one is where the expected improvement on the
    greatest posterior mean of all tried places is greatest, or the upper confidence bound. The other candidates of a
    round are found in the same way, with the posterior mean taken for the score of each before (Kriging believer:
    Ginsbourger et al., 2010). A failed candidate counts as the lowest score.

    Time grows with the third power of the number of observations: of the candidates $n$, or of $n(1 + d)$ with the
    gradients of $d$ numbers. Some hundred candidates of up to about twenty numbers are practical. With a `memory`, the
    process forgets the others before each round, all but the one with the greatest score, and every round takes the
    same time (thesis, section 7.3: "forgetting samples").

    **Raises:** `RuntimeError` if tinygp is missing (`motorgrad[search]`).
    """

    candidates: int = count(4, 1, help="per round. With fewer, each is chosen with more known")
    initial: int = count(
        8, 2, help="candidates that must have a score before the process is used; they come in whole rounds"
    )
    kernel: Literal["matern", "squared-exponential"] = static(
        "matern",
        help=r'`"matern"`, with $\nu = 5/2$, twice differentiable; or `"squared-exponential"`, infinitely smooth',
    )
    acquisition: Literal["expected-improvement", "upper-confidence-bound"] = static(
        "expected-improvement", help=r'`"upper-confidence-bound"` is $\mu + \kappa\sigma$ (Srinivas et al., 2010)'
    )
    exploration: float = number(2.0, 0, help=r"$\kappa$ of the upper confidence bound")
    lengths: tuple[float, float] = static(
        (0.05, 5.0),
        allowed=Range(0, open_low=True),
        help="bounds of the length scales, as fractions of every number's range",
    )
    noise: tuple[float, float] = static(
        (1e-3, 1.0),
        allowed=Range(0, open_low=True),
        help="bounds of the standard deviation of a score's noise, in standard deviations of all scores. Two equal "
        "bounds fix it",
    )
    memory: int | None = count(
        None, 2, unit="candidates", help="that the process is conditioned on at most, at least `initial`; none for all"
    )
    forgets: Literal["oldest", "least-informative"] = static(
        "least-informative",
        help='what is forgotten: `"oldest"`, which leaves a moving window; or `"least-informative"`, one after another '
        "the candidate without which the posterior changes least, by relative entropy",
    )

    def validate(self) -> None:
        for name in ("lengths", "noise"):
            low, high = getattr(self, name)
            check(low <= high, name, (low, high), "two numbers, the lower first")
        least = f"at least initial = {self.initial}, or the process would never be used"
        check(self.memory is None or self.memory >= self.initial, "memory", self.memory, least)
        require("Bayesian optimisation needs", "tinygp", "search")

    def begin(self, start: Float[np.ndarray, " size"]) -> State:
        none = np.zeros((0, len(start)))
        start = np.array(start, float)
        settings = {"settings": self._bounds(len(start)).mean(axis=1)}
        return {"start": start, "places": none, "scores": none[:, 0], "gradients": none, "variances": none, **settings}

    def ask(self, state: State, random: np.random.Generator) -> tuple[Places, State]:
        from motorgrad.search._acquisition import most_worth
        from motorgrad.search._gaussian_process import Posterior

        size = len(state["start"])
        if np.isfinite(state["scores"]).sum() < self.initial:
            from scipy.stats import qmc  # loading it would slow down every command's start

            places = qmc.LatinHypercube(size, rng=random).random(self.candidates)
            if not len(state["scores"]):
                places[0] = state["start"]
            return places, state
        state = self._remembered(state)
        data = self._data(state)
        settings = self._fitted(state)
        exploration = float(self.exploration) if self.acquisition == "upper-confidence-bound" else None
        places = np.zeros((self.candidates, size))
        for place in range(self.candidates):
            posterior = Posterior(self.kernel, settings, data)
            places[place] = most_worth(posterior, exploration, random)
            data = data.believed(len(state["scores"]) + place, places[place], posterior(places[place, None])[0][0])
        return places, {**state, "settings": settings}

    def tell(self, state: State, candidates: Places, scores: Float[np.ndarray, " batch"]) -> State:
        unknown = np.full(candidates.shape, np.nan)
        more = {"places": candidates, "scores": scores, "gradients": unknown, "variances": unknown}
        return {**state, **{name: np.concatenate([state[name], values]) for name, values in more.items()}}

    def tell_gradients(self, state: State, candidates: Places, gradients: Places, variances: Places) -> State:
        found = dict(state)
        for name, values in (("gradients", gradients), ("variances", variances)):
            found[name] = np.concatenate([state[name][: -len(candidates)], values])
        return found

    def posterior(self, state: State, places: npt.ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Mean and standard deviation of the score function, without noise, at places (…, size), given a state.

        **Raises:** `ValueError` if the state has fewer than two scores.
        """
        from motorgrad.search._gaussian_process import Posterior

        known = int(np.isfinite(state["scores"]).sum())
        check(known > 1, "scores of the state", known, "at least two")
        places = np.asarray(places, float)
        level, scale = _standard(state["scores"])
        found = Posterior(self.kernel, self._fitted(state), self._data(state))
        mean, deviation = found(places.reshape(-1, places.shape[-1]))
        return (level + scale * mean).reshape(places.shape[:-1]), (scale * deviation).reshape(places.shape[:-1])

    def _remembered(self, state: State) -> State:
        """The state without what the process forgets, which is never the greatest score."""
        from motorgrad.search._forgetting import least_informative
        from motorgrad.search._gaussian_process import Posterior

        known = len(state["scores"])
        surplus = 0 if self.memory is None else known - self.memory
        if surplus <= 0:
            return state
        best = int(np.nanargmax(state["scores"]))
        if self.forgets == "oldest":
            gone = [each for each in range(known) if each != best][:surplus]
        else:
            posterior = Posterior(self.kernel, state["settings"], self._data(state))
            gone = least_informative(posterior, known, surplus, best)
        kept = {name: np.delete(state[name], gone, axis=0) for name in ("places", "scores", "gradients", "variances")}
        return {**state, **kept}

    def _data(self, state: State) -> "Data":
        """The observations in units of standardised scores, with room for the candidates of a round."""
        from motorgrad.search._gaussian_process import Data

        level, scale = _standard(state["scores"])
        known = np.isfinite(state["scores"])
        scores = (np.where(known, state["scores"], state["scores"][known].min()) - level) / scale
        # a full memory has one shape, before a round is forgotten and after
        needed = len(scores) if self.memory is not None and len(scores) > self.memory else len(scores) + self.candidates
        room = MIN_CANDIDATES
        while room < needed:
            room *= 2
        return Data.of(state["places"], scores, state["gradients"] / scale, state["variances"] / scale**2, room)

    def _fitted(self, state: State) -> Float[np.ndarray, " settings"]:
        """The logarithms of the settings that maximise the marginal likelihood."""
        from motorgrad.search._gaussian_process import fitted

        bounds = self._bounds(len(state["start"]))
        return fitted(self.kernel, self._data(state), np.stack([bounds.mean(axis=1), state["settings"]]), bounds)

    def _bounds(self, size: int) -> Float[np.ndarray, "settings 2"]:
        from motorgrad.search._gaussian_process import SIGNAL

        return np.log([*[self.lengths] * size, SIGNAL, self.noise])


def _standard(scores: Float[np.ndarray, " candidates"]) -> tuple[float, float]:
    """The mean of the scores that are known, and their standard deviation, or 1 where all are equal."""
    equal = np.nanmax(scores) == np.nanmin(scores)  # of equal numbers, the deviation is rounding
    return float(np.nanmean(scores)), 1.0 if equal else float(np.nanstd(scores))
