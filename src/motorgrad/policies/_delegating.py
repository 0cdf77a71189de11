"""Policies that leave the action to another policy, which sees something else than the observation."""

import abc
from typing import Any

import equinox as eqx
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies import abilities
from motorgrad.policies._policy import Policy


class Delegating(Policy):
    r"""A policy that acts by another one, on what that sees of the observation: $\pi(a \mid y) = \pi'(a \mid
    \varphi(y))$. A subclass defines `inner` and `seen`, and, where $\pi'$ depends on the observation, `acting`. What
    follows from $\pi'$ alone needs no method (`abilities.ActsByAnother`)."""

    @property
    @abc.abstractmethod
    def inner(self) -> Policy:
        r"""The other policy."""

    @abc.abstractmethod
    def seen(self, observation: Float[Array, " inputs"]) -> Float[Array, " features"]:
        r"""$\varphi(y)$, what the other policy sees."""

    def acting(self, observation: Float[Array, " inputs"]) -> Policy:
        r"""$\pi'$, the policy that acts on an observation; by default `inner`."""
        del observation
        return self.inner

    @property
    def outputs(self) -> int:
        return self.inner.outputs

    @property
    def actions(self) -> str | tuple[str, ...]:
        return self.inner.actions

    @property
    def uniforms(self) -> int:
        return self.inner.uniforms

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " outputs"]:
        return self.acting(observation).prob(self.seen(observation))

    def sample(self, observation: Float[Array, " inputs"], uniforms: Float[Array, " uniforms"]) -> Array:
        return self.acting(observation).sample(self.seen(observation), uniforms)

    def mode(self, observation: Float[Array, " inputs"]) -> Array:
        return self.acting(observation).mode(self.seen(observation))

    def log_prob(self, observation: Float[Array, " inputs"], action: Array) -> Float[Array, ""]:
        return self.acting(observation).log_prob(self.seen(observation), action)

    def hidden_activations(self, observation: Float[Array, " inputs"]) -> tuple[Float[Array, " units"], ...]:
        return abilities.hidden_activations(self.inner, self.seen(observation))

    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        return self.acting(observation).entropy(self.seen(observation))


class Seeing(Delegating):
    """A policy that acts by its `pool`, which has no memory."""

    pool: eqx.AbstractVar[Policy]

    @property
    def inner(self) -> Policy:
        return self.pool

    def _check_pool(self) -> None:
        check(isinstance(self.pool, Policy), "pool", type(self.pool).__name__, "a policy")
        check(not abilities.has_memory(self.pool), "pool", type(self.pool).__name__, "a policy without a memory")

    def entropy_estimate(
        self, observation: Float[Array, " inputs"], uniforms: Float[Array, " uniforms"]
    ) -> Float[Array, ""]:
        return abilities.entropy_estimate(self.pool, self.seen(observation), uniforms)


def units_of(policy: Policy) -> Any:
    """The units behind features and layers."""
    return units_of(policy.pool) if isinstance(policy, Seeing) else policy
