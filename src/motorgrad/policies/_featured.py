"""Policies of the features of what is observed."""

from collections.abc import Callable
from typing import Self, TypeVar

import equinox as eqx
import jax
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies._features import FeatureMap
from motorgrad.policies._policy import Composed, Policy, in_structure

P = TypeVar("P", bound=Policy)


class Featured(Composed):
    r"""A policy that sees the features of an observation: $\pi(a \mid y) = \pi'(a \mid \varphi(y))$.

    The features are fixed; only the pool learns. Its score, Fisher matrix and blocks are those at $\varphi(y)$.

    **Arguments:** `pool`, a policy with as many inputs as there are features; `features`, $\varphi$, a `FeatureMap`;
    `observed`, the length of the observation. The last two are not trainable.

    **Example:**

    ```python
    features = FeatureMap(squares=True)
    policy = Featured(Hyperplanes(weights=[[1.0, 0.0, -2.0, 0.0]], bias=[0.5]), features, observed=2)
    ```
    """

    pool: Policy
    features: FeatureMap = eqx.field(static=True)
    observed: int = eqx.field(static=True)

    def __check_init__(self) -> None:
        check(isinstance(self.pool, Policy), "pool", type(self.pool).__name__, "a policy")
        check(not self.pool.has_memory, "pool", type(self.pool).__name__, "a policy without a memory")
        check(isinstance(self.features, FeatureMap), "features", self.features, "a FeatureMap")
        count = self.features.size(self.observed)
        check(self.pool.inputs == count, "pool.inputs", self.pool.inputs, f"{count}, the number of features")

    @property
    def inputs(self) -> int:
        return self.observed

    @property
    def outputs(self) -> int:
        return self.pool.outputs

    @property
    def actions(self) -> str | tuple[str, ...]:
        return self.pool.actions

    @property
    def uniforms(self) -> int:
        return self.pool.uniforms

    @property
    def hides(self) -> bool:
        return self.pool.hides

    def emit(self, action: Array) -> Array:
        return self.pool.emit(action)

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " outputs"]:
        return self.pool.prob(self.features.expanded(observation))

    def sample(self, observation: Float[Array, " inputs"], uniforms: Float[Array, " uniforms"]) -> Array:
        return self.pool.sample(self.features.expanded(observation), uniforms)

    def mode(self, observation: Float[Array, " inputs"]) -> Array:
        return self.pool.mode(self.features.expanded(observation))

    def log_prob(self, observation: Float[Array, " inputs"], action: Array) -> Float[Array, ""]:
        return self.pool.log_prob(self.features.expanded(observation), action)

    def score(self, observation: Float[Array, " inputs"], action: Array) -> Self:
        return in_structure(self, pool=self.pool.score(self.features.expanded(observation), action))

    def fisher(
        self, observation: Float[Array, " inputs"], action: Array
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        return self.pool.fisher(self.features.expanded(observation), action)

    def fisher_sum(
        self, observations: Float[Array, "decisions inputs"], actions: Array, weights: Float[Array, " decisions"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        return self.pool.fisher_sum(jax.vmap(self.features.expanded)(observations), actions, weights)

    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        return self.pool.entropy(self.features.expanded(observation))

    def enumerate(self) -> Array:
        return self.pool.enumerate()


def featured(features: FeatureMap, inputs: int, make: Callable[[int], P]) -> P | Featured:
    """What `make` makes of a number of inputs: of the features, where there are any beside the inputs."""
    check(isinstance(features, FeatureMap), "features", features, "a FeatureMap")
    return Featured(make(features.size(inputs)), features, inputs) if features.adds else make(inputs)
