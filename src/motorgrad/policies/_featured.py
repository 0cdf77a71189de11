"""Policies that see functions of the observation: fixed features, or the output of hidden layers."""

from collections.abc import Callable
from typing import Any, Self

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from motorgrad._errors import check
from motorgrad.policies import abilities
from motorgrad.policies._architectures import Architecture
from motorgrad.policies._delegating import Seeing
from motorgrad.policies._features import INPUTS, FeatureMap
from motorgrad.policies._frozen import frozen, thawed
from motorgrad.policies._parameters import from_rows, in_structure, outer, rows, split, trainable, with_fields
from motorgrad.policies._policy import Composed, Policy
from motorgrad.policies._standardisation import adapted
from motorgrad.policies._starting import Initial, InitialPolicy
from motorgrad.schema import static


class Featured(Seeing, Composed):
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
        self._check_pool()
        check(isinstance(self.features, FeatureMap), "features", self.features, "a FeatureMap")
        count = self.features.size(self.observed)
        check(self.pool.inputs == count, "pool.inputs", self.pool.inputs, f"{count}, the number of features")

    @property
    def inputs(self) -> int:
        return self.observed

    def seen(self, observation: Float[Array, "*decisions inputs"]) -> Float[Array, "*decisions features"]:
        return self.features.expanded(observation)

    def adapted(self, seen: Float[Array, " inputs"]) -> Self:
        pool = abilities.adapted(self.pool, self.seen(seen))
        return self if pool is self.pool else with_fields(self, pool=pool)

    def score(self, observation: Float[Array, " inputs"], action: Array) -> Self:
        return in_structure(self, pool=self.pool.score(self.seen(observation), action))

    def score_sum(
        self, observations: Float[Array, "decisions inputs"], actions: Array, weights: Float[Array, "decisions sums"]
    ) -> Self:
        return in_structure(self, pool=abilities.score_sum(self.pool, self.seen(observations), actions, weights))

    def entropy_sum(self, observations: Float[Array, "decisions inputs"]) -> Float[Array, ""]:
        return abilities.entropy_sum(self.pool, self.seen(observations))

    def fisher(
        self, observation: Float[Array, " inputs"], action: Array
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        return abilities.fisher(self.pool, self.seen(observation), action)

    def fisher_sum(
        self, observations: Float[Array, "decisions inputs"], actions: Array, weights: Float[Array, " decisions"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        return abilities.fisher_sum(self.pool, self.seen(observations), actions, weights)


class Network(Seeing):
    r"""A policy behind hidden layers that learn: $\pi(a \mid y, \theta) = \pi'(a \mid h(y))$.

    $h$ is any equinox module that turns a vector into a vector, and $\pi'$ any policy over its output, such as
    hyperplanes or softmax. The module's floating-point arrays are trainable, but for fields declared with `fixed`. Its
    other leaves, such as activation functions, are part of the structure.

    The score of $\pi'$ is its own at $h(y)$. That of the layers is the vector-Jacobian product
    $(\partial h/\partial\theta)'\,\nabla_h \log\pi'$, by automatic differentiation.

    **Arguments:** `pool`, $\pi'$; `module`, $h$; `observed`, the length of the observation.

    **Raises:** `ValueError` for what is no module, and for one that cannot be called with an observation or does not
    return a vector of the length that the pool needs.

    **Example:**

    ```python
    layers = eqx.nn.MLP(in_size=3, out_size=16, width_size=16, depth=1, key=jax.random.key(0))
    policy = Network(softmax(16, 4), layers, observed=3)
    ```
    """

    pool: Policy
    module: Any = eqx.field(converter=frozen)
    observed: int = eqx.field(static=True)

    def __check_init__(self) -> None:
        self._check_pool()
        kind = type(self.module).__name__
        check(isinstance(self.module, eqx.Module), "module", kind, "an equinox module")
        observation = jax.ShapeDtypeStruct((self.observed,), jnp.result_type(float))
        try:
            found = jax.eval_shape(lambda module, y: thawed(module)(y), self.module, observation)
        except Exception as error:
            needed = f"a module that can be called with a vector of {self.observed} numbers"
            raise ValueError(f"module = {kind}: must be {needed}; {error}") from error
        shape = getattr(found, "shape", None)
        if shape != (self.pool.inputs,):
            returned = type(found).__name__ if shape is None else f"an array of shape {shape}"
            wanted = f"a vector of {self.pool.inputs} numbers, which the pool sees"
            raise ValueError(f"module = {kind}: must return {wanted}; it returns {returned}")

    @property
    def inputs(self) -> int:
        return self.observed

    def seen(self, observation: Float[Array, " inputs"]) -> Float[Array, " features"]:
        return thawed(self.module)(observation)

    def adapted(self, seen: Float[Array, " inputs"]) -> Self:
        module = adapted(self.module, seen)
        return self if module is self.module else with_fields(self, module=module)

    def hidden_activations(self, observation: Float[Array, " inputs"]) -> tuple[Float[Array, " units"], ...]:
        """The output of each layer of a sequence, or that of another module, and then the pool's own hidden layers."""
        module = thawed(self.module)
        found = []
        layers = module.layers if isinstance(module, eqx.nn.Sequential) else (module,)
        for layer in layers:
            observation = layer(observation)
            if isinstance(layer, eqx.nn.Lambda):
                found.append(observation)
        if not isinstance(layers[-1], eqx.nn.Lambda):
            found.append(observation)
        return (*found, *abilities.hidden_activations(self.pool, observation))

    def score(self, observation: Float[Array, " inputs"], action: Array) -> Self:
        learned, settings = split(self)

        def seen(module: PyTree) -> Float[Array, " features"]:
            return thawed(eqx.combine(module, settings.module))(observation)

        features, pull = jax.vjp(seen, learned.module)
        (own,) = pull(jax.grad(self.pool.log_prob)(features, action))
        return in_structure(self, module=own, pool=self.pool.score(features, action))

    def blocks(self, gradient: PyTree) -> tuple[Float[Array, "units parameters"], ...]:
        """The blocks of the pool, then a row of all parameters of the layers."""
        return (*abilities.blocks(self.pool, gradient.pool), rows(gradient.module, 1))

    def from_blocks(self, blocks: tuple[Float[Array, "units parameters"], ...]) -> Self:
        *pool, row = blocks
        module = from_rows(trainable(self).module, row)
        return in_structure(self, pool=abilities.from_blocks(self.pool, tuple(pool)), module=module)

    def fisher(
        self, observation: Float[Array, " inputs"], action: Array
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        """The pool's matrices, and the sample $ss'$ of the layers, without cross terms between them."""
        score = self.score(observation, action)
        return (*abilities.fisher(self.pool, self.seen(observation), action), outer(rows(score.module, 1)))


def featured(
    features: FeatureMap, inputs: int, make: Callable[[int], Policy], network: Architecture | None = None
) -> Initial:
    """What `make` makes of a number of inputs: of the features, where there are any beside the inputs, or of the output
    of hidden layers. With those it is a function of a key, so that every seed has its own."""

    def seeing(policy: Policy) -> Policy:
        return Featured(policy, features, inputs) if features.adds else policy

    count = features.size(inputs)
    if network is None:
        return seeing(make(count))

    def initial(key: jax.Array) -> Policy:
        module: Any = network.build(count, key)
        size = jax.eval_shape(module, jax.ShapeDtypeStruct((count,), jnp.result_type(float))).shape[0]
        return seeing(Network(make(size), module, count))

    return initial


class InitialFeatured(InitialPolicy):
    """Units that see features of the inputs, or the output of hidden layers."""

    features: FeatureMap = static(INPUTS, help="what the units see beside the inputs; by default nothing")
    network: Architecture | None = static(
        None, help="hidden layers between these inputs and the units, drawn from a seed's key; by default none"
    )

    def behind(self, inputs: int, make: Callable[[int], Policy]) -> Initial:
        """The units that `make` makes of a number of inputs, behind these features and layers."""
        return featured(self.features, inputs, make, self.network)
