"""What experience says of a finite world: a posterior over its transitions, and the gradient under it."""

import dataclasses
from typing import Self, TypeVar

import jax
import numpy as np
import numpy.typing as npt
from jaxtyping import Float, Int

from motorgrad._errors import check, check_integer
from motorgrad.policies import Policy
from motorgrad.worlds import oracle
from motorgrad.worlds._finite import FiniteMDP

P = TypeVar("P", bound=Policy)


@dataclasses.dataclass(frozen=True, eq=False)
class TransitionPosterior:
    r"""A distribution over the finite worlds that experience allows (Dearden, Friedman & Andre, 1999; thesis, section
    7.3: "inferring a distribution over possible environment models").

    Rewards and observations are known, transitions are not: the successors of every action in every state have
    probabilities of their own, with a Dirichlet distribution. Its parameters are the times that each successor was
    seen, plus the prior's. Begin with `TransitionPosterior.of`.

    - `parameters` (actions, states, states): of the Dirichlet distributions, above 0.
    - `known`: a world with the rewards, the observations and the start; its transitions are not looked at.

    ```python
    belief = TransitionPosterior.of(mdp).updated([0], [1], [2])  # action 1 led from state 0 to state 2
    slope = belief.gradient(policy, np.random.default_rng(0), models=10)
    ```
    """

    parameters: Float[np.ndarray, "actions states states"]
    known: FiniteMDP

    def __post_init__(self) -> None:
        shape = self.known.transitions.shape
        check(self.parameters.shape == shape, "parameters.shape", self.parameters.shape, f"{shape}")
        least = float(self.parameters.min())
        check(least > 0 and np.isfinite(self.parameters).all(), "least of parameters", least, "above 0, and all finite")

    @classmethod
    def of(cls, mdp: FiniteMDP, prior: float = 1.0) -> Self:
        """What is known before any experience of a world like `mdp`, of which only rewards, observations and start are
        taken: each row counts as much as `prior` decisions that led to every state alike."""
        check(0 < prior < np.inf, "prior", prior, "a finite number above 0")
        return cls(np.full(mdp.transitions.shape, prior / mdp.states), mdp)

    def updated(self, states: npt.ArrayLike, actions: npt.ArrayLike, after: npt.ArrayLike) -> Self:
        """The posterior after some decisions: the state of each, the action's index, and the state that followed."""
        found: list[Int[np.ndarray, " decisions"]] = []
        for name, given, most in (
            ("states", states, self.known.states),
            ("actions", actions, self.known.actions),
            ("after", after, self.known.states),
        ):
            each = np.asarray(given)
            check(each.ndim == 1 and each.dtype.kind in "iu", name, given, "a list of integers")
            inside = (each >= 0) & (each < most)
            check(inside.all(), name, each[~inside].tolist(), f"from 0 to {most - 1}")
            found.append(each)
        before, chosen, following = found
        lengths = {len(each) for each in found}
        check(len(lengths) == 1, "states, actions, after", sorted(lengths), "as many of each")
        parameters = self.parameters.copy()
        np.add.at(parameters, (chosen, before, following), 1.0)
        return dataclasses.replace(self, parameters=parameters)

    def mean(self) -> FiniteMDP:
        """The world with the mean of the transitions."""
        return self._with(self.parameters / self.parameters.sum(axis=-1, keepdims=True))

    def sample(self, random: np.random.Generator) -> FiniteMDP:
        """A world drawn from the posterior."""
        drawn = random.standard_gamma(self.parameters)
        return self._with(drawn / drawn.sum(axis=-1, keepdims=True))

    def gradient(self, policy: P, random: np.random.Generator, models: int = 10) -> P:
        """The mean over `models` sampled worlds of the exact gradient of the average reward."""
        check_integer("models", models, 1)
        slopes = [oracle.gradient(self.sample(random), policy) for _ in range(models)]
        return jax.tree.map(lambda *each: np.mean(each, axis=0), *slopes)

    def _with(self, transitions: np.ndarray) -> FiniteMDP:
        known = self.known
        return FiniteMDP(transitions, known.rewards, known.observations, known.start)
