"""Soft boxes: local units that fire inside an interval of every input."""

from typing import Self

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies._capped import CappedUnits
from motorgrad.policies._policy import in_structure


class SoftBoxes(CappedUnits):
    r"""Units that fire inside a box along the axes, $p_i = \prod_j \sigma(k\,(h_j - u_j))\,\sigma(k\,(h_j + u_j))$ with
    $u_j = y_j - \mu_j$.

    Each input has two opposed sigmoids, one for each wall, at the distance $h_j$ from the centre: a box of axes of
    different lengths, which a sphere cannot be (section 6.5.2 of the thesis). $h_j = e^{\text{log width}_j}$ is half
    the box's length and $k = e^{\text{log hardness}}$, so that neither becomes negative. In the middle of a box
    that is not hard for its size $p$ is well below 1. $p$ is capped at $1 - 10^{-6}$, where the score is 0.

    Score, firing, with $s^\mp_j = \sigma(-k\,(h_j \mp u_j))$: $\partial_{\mu_j} = k\,(s^-_j - s^+_j)$,
    $\partial_{\log h_j} = k\,h_j\,(s^-_j + s^+_j)$,
    $\partial_{\log k} = \sum_j k\,((h_j - u_j)\,s^-_j + (h_j + u_j)\,s^+_j)$; silent: the same times $-p/(1 - p)$.

    **Arguments:** `centre` and `log_width`, both `(units, inputs)`; `log_hardness`, `(units,)`.
    """

    centre: Float[Array, "units inputs"] = eqx.field(converter=jnp.asarray)
    log_width: Float[Array, "units inputs"] = eqx.field(converter=jnp.asarray)
    log_hardness: Float[Array, " units"] = eqx.field(converter=jnp.asarray)

    def __check_init__(self) -> None:
        shape = self.centre.shape
        check(self.centre.ndim == 2, "centre", shape, "of shape (units, inputs)")
        check(self.log_width.shape == shape, "log_width", self.log_width.shape, f"of shape {shape}")
        check(self.log_hardness.shape == shape[:1], "log_hardness", self.log_hardness.shape, f"of shape {shape[:1]}")

    @property
    def inputs(self) -> int:
        return self.centre.shape[1]

    @property
    def outputs(self) -> int:
        return self.centre.shape[0]

    def _walls(self, observation: Float[Array, " inputs"]) -> Float[Array, "2 units inputs"]:
        """How far inside each of the two opposed walls an observation is, in units of their softness."""
        away, half = observation - self.centre, jnp.exp(self.log_width)
        return jnp.exp(self.log_hardness)[:, None] * jnp.stack([half - away, half + away])

    def _log_fire(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        return jnp.sum(jax.nn.log_sigmoid(self._walls(observation)), axis=(0, 2))

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Self:
        surprise = self._surprise(observation, action)
        walls = self._walls(observation)
        slope = jax.nn.sigmoid(-walls)
        each = (surprise * jnp.exp(self.log_hardness))[:, None]
        return in_structure(
            self,
            centre=each * (slope[0] - slope[1]),
            log_width=each * jnp.exp(self.log_width) * (slope[0] + slope[1]),
            log_hardness=surprise * jnp.sum(walls * slope, axis=(0, 2)),
        )
