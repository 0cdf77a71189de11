"""Hidden layers by plain settings: how many, how wide, and how they start."""

import abc
import math
from collections.abc import Callable
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp

from motorgrad._errors import check
from motorgrad.policies._standardisation import Standardisation
from motorgrad.schema import Part, Range, static

Activation = Literal["elu", "gelu", "leaky-relu", "relu", "silu", "tanh"]
ACTIVATIONS: dict[str, Callable[..., Any]] = {
    "elu": jax.nn.elu,
    "gelu": jax.nn.gelu,
    "leaky-relu": jax.nn.leaky_relu,
    "relu": jax.nn.relu,
    "silu": jax.nn.silu,
    "tanh": jax.numpy.tanh,
}
"""The nonlinearities of `MultilayerPerceptron` by name."""
MAX_LAYER_WIDTH = 100_000


class Architecture(Part):
    """The hidden layers of a network by their settings.

    A subclass defines `build`. Registered (`motorgrad.learning.register`), it has a name in options and TOML:

    ```python
    class Wide(mg.policies.Architecture):
        '''One wide layer.'''

        width: int = mg.learning.count(512, 1)

        def build(self, inputs, key):
            return eqx.nn.Sequential([eqx.nn.Linear(inputs, self.width, key=key), eqx.nn.Lambda(jax.nn.relu)])
    ```
    """

    @abc.abstractmethod
    def build(self, inputs: int, key: jax.Array) -> eqx.Module:
        """The layers: a module that maps a vector of length `inputs` to a vector. `key` draws its parameters."""


class MultilayerPerceptron(Architecture):
    r"""Hidden layers with layer normalisation and sparse initial weights (Elsayed, Vasan & Mahmood, 2024).

    Each layer is $h' = f(N(W h + b))$. $N$ shifts and scales the potentials of a layer to mean 0 and variance 1 (Ba,
    Kiros & Hinton, 2016), without parameters. The weights of a unit with $n$ inputs are drawn from
    U[$-1/\sqrt n, 1/\sqrt n$], then $\lceil \text{sparsity} \cdot n \rceil$ of them, at most $n - 1$, are set to 0. The
    biases start at 0.

    **Raises:** `ValueError` for a value out of range.

    ```python
    policy = mg.policies.softmax(task, network=mg.policies.MultilayerPerceptron(hidden=(128, 128)))
    ```
    """

    hidden: tuple[int, ...] = static(
        (128, 128),
        converter=tuple,
        allowed=Range(1, MAX_LAYER_WIDTH, kind="int"),
        help="the number of units in each layer, from the inputs on",
    )
    activation: Activation = static("leaky-relu", help="the nonlinearity $f$ of every layer, as in `jax.nn`")
    layer_norm: bool = static(True, help="whether potentials are normalised before the nonlinearity")
    sparsity: float = static(
        0.9, allowed=Range(0, 1, open_high=True), help="the share of each unit's weights that start at 0"
    )
    standardise: bool = static(
        False, help="whether the inputs are first made relative to their running mean and deviation, `Standardisation`"
    )
    unit_length: bool = static(
        False, help="whether the output of the last layer is scaled to length 1 (Bjorck et al., 2022)"
    )

    def validate(self) -> None:
        check(self.hidden, "hidden", self.hidden, "at least one layer, such as (128,)")

    def build(self, inputs: int, key: jax.Array) -> eqx.nn.Sequential:
        layers: list[Any] = [Standardisation.of(inputs)] if self.standardise else []
        for width in self.hidden:
            key, own = jax.random.split(key)
            layers.append(sparse_linear(inputs, width, self.sparsity, own))
            if self.layer_norm:
                layers.append(eqx.nn.LayerNorm(width, use_weight=False, use_bias=False))
            layers.append(eqx.nn.Lambda(ACTIVATIONS[self.activation]))
            inputs = width
        layers += [eqx.nn.Lambda(of_unit_length)] if self.unit_length else []
        return eqx.nn.Sequential(layers)


def of_unit_length(x: jax.Array) -> jax.Array:
    """A vector over its Euclidean length; those shorter than some 1e-3 stay shorter than 1, and 0 stays 0."""
    return x * jax.lax.rsqrt(jnp.sum(jnp.square(x)) + 1e-6)


def sparse_linear(inputs: int, outputs: int, sparsity: float, key: jax.Array) -> eqx.nn.Linear:
    """A layer that starts with equinox's uniform weights, a share of each unit's set to 0, and biases of 0.

    At least one weight of a unit is kept: a unit without any would be deaf.
    """
    drawn, chosen = jax.random.split(key)
    layer = eqx.nn.Linear(inputs, outputs, key=drawn)
    silent = min(math.ceil(sparsity * inputs), inputs - 1)
    weight = layer.weight
    if silent:  # XLA takes seconds to compile a sort
        ranks = jnp.argsort(jax.random.uniform(chosen, weight.shape), axis=1)
        weight = jnp.where(ranks < silent, 0, weight)
    return eqx.tree_at(lambda each: (each.weight, each.bias), layer, (weight, jnp.zeros(outputs, weight.dtype)))
