r"""Averages of the parameters: the policy to keep, while the learner goes on from where it is."""

import dataclasses
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Int

from motorgrad._errors import check
from motorgrad._running import RunningMean, add_sample, running_mean
from motorgrad.policies import Policy, split, trainable

P = TypeVar("P", bound=Policy)


@dataclasses.dataclass(frozen=True)
class WeightAverage:
    r"""The mean $\bar\theta$ of the parameters after each of the last steps (Polyak & Juditsky, 1992).

    With a constant step size the parameters end in a cloud about the optimum; its middle is nearer. The learner acts by
    $\theta$; the policy that it gives away, to a run and to its evaluation, has $\bar\theta$.

    $\bar\theta$ is $\theta$ itself up to `start`. The n-th step after moves it by
    $\bar\theta \leftarrow \bar\theta + \max(1/n, \rho)\,(\theta - \bar\theta)$.

    **Arguments:**

    - `start` $\ge 0$: how many steps of the parameters are left out; the mean is that of all steps since.
    - `rate` $\rho \in [0, 1]$: 0 for a mean that forgets nothing; with more it has a memory of $1/\rho$ steps.
    """

    start: int = 0
    rate: float = 0.0

    def __post_init__(self) -> None:
        check(0 <= self.start < 2**31, "start", self.start, "a number of steps of the parameters, at least 0")
        check(0 <= self.rate <= 1, "rate", self.rate, "in [0, 1]")

    def init(self, policy: Policy) -> RunningMean:
        """The average before any step: the parameters themselves."""
        return running_mean(trainable(policy))._replace(mean=trainable(policy))

    def update(self, state: RunningMean, policy: Policy, steps: Int[Array, ""]) -> RunningMean:
        """Take in the parameters after the last of so many `steps`."""
        moved = trainable(policy)
        late = steps > self.start
        counted = add_sample(state, moved, self.rate)
        followed = running_mean(moved)._replace(mean=moved)
        return jax.tree.map(lambda new, old: jnp.where(late, new, old), counted, followed)

    def begin_from(self, state: RunningMean, policy: Policy) -> RunningMean:
        """The average of nothing but this policy, of one seed or of many."""
        fresh = jax.tree.map(jnp.zeros_like, state)
        return fresh._replace(mean=trainable(policy))

    def kept(self, state: RunningMean, policy: P) -> P:
        """The policy with the averaged parameters."""
        return eqx.combine(state.mean, split(policy)[1])
