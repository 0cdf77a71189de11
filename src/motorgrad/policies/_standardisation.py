"""The first layer of a network: inputs relative to what has been seen so far."""

from typing import Self

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree, UInt32

from motorgrad._running import RunningMean, add_observation, standardised
from motorgrad.policies._parameters import fixed


class Standardisation(eqx.Module):
    r"""Subtracts the running mean of each input and divides by its standard deviation, clipped to ±5 (Welford, 1962).

    The statistics are part of the network, though nothing that a gradient moves: a stored policy has them, a frozen
    one keeps them. A learner adds every observation that an action led to.

    **Arguments:** `mean` and `variance` of the inputs, what rounding took from each, and the `count` of observations.
    """

    mean: Float[Array, " inputs"] = fixed()
    mean_carry: Float[Array, " inputs"] = fixed()
    variance: Float[Array, " inputs"] = fixed()
    variance_carry: Float[Array, " inputs"] = fixed()
    count: UInt32[Array, ""] = fixed()

    @classmethod
    def of(cls, inputs: int) -> Self:
        """The layer before any observation, which only clips."""
        zeros = jnp.zeros(inputs)
        return cls(zeros, zeros, zeros, zeros, jnp.zeros((), jnp.uint32))

    @property
    def _statistics(self) -> tuple[RunningMean, RunningMean]:
        mean = RunningMean(self.mean, self.mean_carry, self.count)
        return mean, RunningMean(self.variance, self.variance_carry, self.count)

    def __call__(self, x: Float[Array, " inputs"], *, key: Array | None = None) -> Float[Array, " inputs"]:
        del key  # equinox hands one to every layer
        return standardised(*self._statistics, x)

    def adapted(self, x: Float[Array, " inputs"]) -> Self:
        """The layer after one more observation."""
        mean, variance = add_observation(*self._statistics, x.astype(self.mean.dtype))
        return type(self)(mean.mean, mean.carry, variance.mean, variance.carry, mean.count)


def adapted(module: PyTree, x: Float[Array, " inputs"]) -> PyTree:
    """A network, as a policy or a critic holds it, after one more observation: its first layer may keep statistics.

    **Arguments:** the `module`, frozen; what it sees, `x`.
    """
    layers = module.layers if isinstance(module, eqx.nn.Sequential) else ()
    if not layers or not isinstance(layers[0], Standardisation):
        return module
    return eqx.tree_at(lambda each: each.layers[0], module, layers[0].adapted(x))
