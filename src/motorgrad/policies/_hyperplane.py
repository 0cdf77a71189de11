"""The hyperplane unit: fires on one side of a soft linear boundary."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies._binary import SigmoidUnits


class Hyperplanes(SigmoidUnits):
    r"""Units that fire with probability $p_i = \sigma(w_i \cdot y + b_i)$.

    Score: $\partial_w = (A - p)\,y$ and $\partial_b = A - p$ (equation 5.1 of the thesis).

    **Arguments:** `weights` of shape `(units, inputs)` and `bias` of shape `(units,)`.
    """

    weights: Float[Array, "units inputs"] = eqx.field(converter=jnp.asarray)
    bias: Float[Array, " units"] = eqx.field(converter=jnp.asarray)

    def __check_init__(self) -> None:
        check(self.weights.ndim == 2, "weights", self.weights.shape, "of shape (units, inputs)")
        check(self.bias.shape == self.weights.shape[:1], "bias", self.bias.shape, f"of shape {self.weights.shape[:1]}")

    @property
    def inputs(self) -> int:
        return self.weights.shape[1]

    @property
    def outputs(self) -> int:
        return self.weights.shape[0]

    def potential(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        # A sum of products, not a matrix product: the same rounding for one seed and for many.
        return jnp.sum(self.weights * observation, axis=-1) + self.bias

    def potential_gradient(self, observation: Float[Array, " inputs"]) -> dict[str, Array]:
        return {"weights": jnp.broadcast_to(observation, self.weights.shape), "bias": jnp.ones_like(self.bias)}
