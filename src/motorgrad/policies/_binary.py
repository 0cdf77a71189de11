"""Pools of independent stochastic binary units: each decides whether it fires."""

import abc
from collections.abc import Sequence
from typing import Any, Self

import jax
import jax.numpy as jnp
from jax.scipy.special import xlog1py, xlogy
from jaxtyping import Array, Float

from motorgrad.policies._policy import Policy, has_rows, in_structure, outer, unit_rows


class BinaryUnits(Policy):
    r"""A pool of $N$ units that fire independently with probabilities $p_i(y)$.

    An action is a vector of $N$ zeros and ones, in the floating type of the parameters; its log-probability is the sum
    of the units' and its score the concatenation of theirs (section 4.2.1 of the thesis).
    """

    @property
    def independent(self) -> bool:
        """Whether each unit decides without regard to what the others do at the same decision."""
        return True

    @property
    def separate(self) -> bool:
        """Whether each unit has parameters of its own, which no other unit uses."""
        return has_rows(self)

    def sample(self, observation: Float[Array, " inputs"], uniforms: Float[Array, " units"]) -> Float[Array, " units"]:
        p = self.prob(observation)
        return (uniforms < p).astype(p.dtype)

    def mode(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        """1 where a unit fires with probability above one half."""
        p = self.prob(observation)
        return (p > 0.5).astype(p.dtype)

    def log_probs(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, " units"]:
        r"""Each unit's own term of $\log\pi$, its action being what it is in `action`."""
        p = self.prob(observation)
        return jnp.where(action > 0, jnp.log(p), jnp.log1p(-p))

    def log_prob(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, ""]:
        return jnp.sum(self.log_probs(observation, action))

    def blocks(self, gradient: Any) -> tuple[Float[Array, "units parameters"], ...]:
        """A row for each unit, where every trainable array leads with the units; else one row of what they share."""
        return (unit_rows(self, gradient),)

    def fisher(
        self, observation: Float[Array, " inputs"], action: Float[Array, " units"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        r"""Exact, $p\,s_1s_1' + (1 - p)\,s_0s_0'$ of the scores for firing and for silence, which is
        $p(1 - p)(s_1 - s_0)(s_1 - s_0)'$, as their mean is 0.

        Where several units share parameters it is the sample $ss'$.
        """
        p = self.prob(observation)
        (fire,), (silent,) = (self.blocks(self.score(observation, jnp.full_like(p, a))) for a in (1.0, 0.0))
        if fire.shape[0] != self.outputs:
            return super().fisher(observation, action)
        return (outer(jnp.sqrt(p * (1 - p))[:, None] * (fire - silent)),)

    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        return entropy_of(self.prob(observation))

    def enumerate(self) -> Float[Array, "actions units"]:
        """All $2^N$ firing patterns; the last unit's bit changes fastest."""
        return enumerate_binary(self.outputs)


class SigmoidUnits(BinaryUnits):
    r"""Units that fire with probability $\sigma(\phi_i(y))$ of a potential $\phi$.

    Their score is $\nabla \log \pi = (A - p)\,\nabla\phi$ for the action $A \in \{0, 1\}$ (appendix A.1).
    """

    @abc.abstractmethod
    def potential(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        r"""$\phi_i(y)$."""

    @abc.abstractmethod
    def potential_gradient(self, observation: Float[Array, " inputs"]) -> dict[str, Array]:
        r"""$\partial\phi_i/\partial\theta$ of every trainable field, by the field's name; units lead."""

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        return jax.nn.sigmoid(self.potential(observation))

    def log_probs(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, " units"]:
        # log σ of the signed potential stays finite and exact in the far tails, where log p would not.
        return jax.nn.log_sigmoid((2 * action - 1) * self.potential(observation))

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Self:
        surprise = action - self.prob(observation)
        gradient = self.potential_gradient(observation)
        return in_structure(
            self, **{k: surprise.reshape(surprise.shape + (1,) * (v.ndim - 1)) * v for k, v in gradient.items()}
        )

    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        potential = self.potential(observation)
        return jnp.sum(jax.nn.softplus(potential) - potential * jax.nn.sigmoid(potential))


def entropy_of(p: Float[Array, " units"]) -> Float[Array, ""]:
    """The entropy in nats of units that fire independently with these probabilities."""
    unsure = (p > 0) & (p < 1)
    p = jnp.where(unsure, p, 0.5)  # the slope of a unit that is sure is 0, and no number by the formula
    return -jnp.sum(jnp.where(unsure, xlogy(p, p) + xlog1py(1 - p, -p), 0))


def enumerate_binary(units: int) -> Float[Array, "actions units"]:
    """All firing patterns of `units` binary units, as floats."""
    codes = jnp.arange(2**units)[:, None] >> jnp.arange(units - 1, -1, -1)
    return (codes & 1).astype(jnp.result_type(float))


def product(lists: Sequence[Float[Array, "actions units"]]) -> Float[Array, "actions units"]:
    """Every action of one list beside every action of the next; the last list's change fastest."""
    joint = lists[0]
    for more in lists[1:]:
        left = jnp.repeat(joint, more.shape[0], axis=0)
        joint = jnp.concatenate([left, jnp.tile(more, (joint.shape[0], 1))], axis=1)
    return joint
