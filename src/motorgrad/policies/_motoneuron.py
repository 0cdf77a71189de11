"""The motoneuron: a threshold and a gain on one input."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies._binary import SigmoidUnits


class Motoneurons(SigmoidUnits):
    r"""A pool of motoneurons on one common input, $p_i = \sigma(k_i (y - y^*_i))$.

    Score: $\partial_{y^*} = -(A - p)\,k$ and $\partial_k = (A - p)(y - y^*)$ (section 4.2.2 of the thesis).

    **Arguments:** `threshold` $y^*$ and `gain` $k$, both of shape `(units,)`; a negative gain fires below threshold.
    """

    threshold: Float[Array, " units"] = eqx.field(converter=jnp.asarray)
    gain: Float[Array, " units"] = eqx.field(converter=jnp.asarray)

    def __check_init__(self) -> None:
        check(self.threshold.ndim == 1, "threshold", self.threshold.shape, "of shape (units,)")
        check(self.gain.shape == self.threshold.shape, "gain", self.gain.shape, f"of shape {self.threshold.shape}")

    @property
    def inputs(self) -> int:
        return 1

    @property
    def outputs(self) -> int:
        return self.threshold.shape[0]

    def potential(self, observation: Float[Array, " 1"]) -> Float[Array, " units"]:
        return self.gain * (observation[0] - self.threshold)

    def potential_gradient(self, observation: Float[Array, " 1"]) -> dict[str, Array]:
        return {"threshold": -self.gain, "gain": observation[0] - self.threshold}
