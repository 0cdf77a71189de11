r"""Advantages: rewards, scaled, above a baseline or critic, and normalized."""

from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from motorgrad._branching import where
from motorgrad.learning._baselines import Advantage, Baseline
from motorgrad.learning._learner import Transition
from motorgrad.learning._reward_criteria import RewardCriterion
from motorgrad.learning._scaling import RewardScaling, RootMeanSquare
from motorgrad.policies import Policy, trainable

S = TypeVar("S", bound=Any)
"""A state with the fields `baseline`, `scaling`, `normalization` and `criterion`, those of the four parts, `None` for
an absent one."""


class Advantages(NamedTuple):
    """The parts that make advantages of rewards, each of which may be absent."""

    baseline: Baseline | None = None
    reward_scaling: RewardScaling | None = None
    normalization: RootMeanSquare | None = None
    criterion: RewardCriterion | None = None

    def init(self, policy: Policy, key: jax.Array) -> dict[str, PyTree]:
        """The fields of a state before the first decision. The `key` matters where the baseline is drawn at random."""
        dtype = jax.tree.leaves(trainable(policy))[0].dtype
        return {
            "baseline": None if self.baseline is None else self.baseline.start(policy, dtype, key),
            "scaling": None if self.reward_scaling is None else self.reward_scaling.init(dtype),
            "normalization": None if self.normalization is None else self.normalization.init(dtype),
            "criterion": None if self.criterion is None else self.criterion.init(dtype),
        }

    def observe(self, state: S, observation: Float[Array, " inputs"]) -> S:
        """The state once an action is chosen on an observation."""
        if self.baseline is None:
            return state
        return state._replace(baseline=self.baseline.observe(state.baseline, observation))

    def paid(self, state: S, transition: Transition) -> tuple[Transition, S]:
        """The transition with what it pays by the criterion in place of its reward, and the state after it. One that
        diverged changes nothing."""
        if self.criterion is None:
            return transition, state
        increment, accumulated = self.criterion.update(state.criterion, transition.reward)
        accumulated = where(transition.diverged, state.criterion, accumulated)
        return transition._replace(reward=increment), state._replace(criterion=accumulated)

    def update(self, state: S, policy: Policy, transition: Transition) -> tuple[Advantage, S]:
        """The advantage of a transition, and the state after it. One that diverged changes nothing learned."""
        dropped = transition.diverged
        scaling = state.scaling
        if self.reward_scaling is not None:
            scaling = where(dropped, scaling, self.reward_scaling.update(scaling, transition.reward))
            transition = transition._replace(reward=self.reward_scaling.factor(scaling) * transition.reward)
        advantage = Advantage(transition.reward, transition.reward)
        baseline = state.baseline
        if self.baseline is not None:
            found = self.baseline.update(baseline, policy, transition)
            if not (isinstance(found, tuple) and len(found) == 2 and isinstance(found[0], Advantage)):
                raise TypeError(f"baseline {type(self.baseline).__name__}: update must return (Advantage, state)")
            advantage, baseline = found
        normalization = state.normalization
        if self.normalization is not None:
            updated = self.normalization.update(normalization, advantage.value)
            advantage = times(self.normalization.factor(updated), advantage)
            normalization = where(dropped, normalization, updated)
        return advantage, state._replace(baseline=baseline, scaling=scaling, normalization=normalization)

    def restart(self, state: S) -> S:
        """The state at the start of an episode."""
        return state._replace(
            baseline=None if self.baseline is None else self.baseline.restart(state.baseline),
            scaling=None if self.reward_scaling is None else self.reward_scaling.restart(state.scaling),
            criterion=None if self.criterion is None else self.criterion.init(state.criterion.value.dtype),
        )

    def level(self, state: Any) -> Float[Array, ""]:
        """The level of rewards that the baseline has found; 0 without one."""
        return jnp.zeros(()) if self.baseline is None else self.baseline.level(state.baseline)

    def solve(self, state: S) -> S:
        """Do the work of a critic that is due once in many decisions."""
        return state if self.baseline is None else state._replace(baseline=self.baseline.solve(state.baseline))

    @property
    def single_stream(self) -> str | None:
        """The part that needs successive decisions of one environment, in words; `None` where none does."""
        fit = getattr(self.baseline, "fit", None)
        return f"a critic fitted by {type(fit).__name__}" if getattr(fit, "single_stream", False) else None


def times(factor: Float[Array, ""], advantage: Advantage) -> Advantage:
    """An advantage, multiplied."""
    return jax.tree.map(lambda each: factor * each, advantage)
