"""Soft spheres: local units that fire inside a radius, surely or not as their hardness says."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies._binary import SigmoidUnits


class SoftSpheres(SigmoidUnits):
    r"""Units that fire within a radius of a centre, $p_i = \sigma(k\,(r - \lVert y - \mu\rVert))$.

    The region of activation and the exploration, which lies at its boundary, are parameters apart: a hard sphere is
    nearly deterministic (section 6.5.2 of the thesis). $r = e^{\text{log radius}}$ and
    $k = e^{\text{log hardness}}$, so that neither becomes negative.

    Score, with the potential $\phi = k\,(r - d)$ at the distance $d$: $A - p$ times
    $\partial_\mu = k\,(y - \mu)/d$, $\partial_{\log r} = k\,r$, $\partial_{\log k} = \phi$. At the centre, the tip of a
    cone, no direction is better than another and $\partial_\mu = 0$.

    **Arguments:** `centre` of shape `(units, inputs)`; `log_radius` and `log_hardness`, both `(units,)`.
    """

    centre: Float[Array, "units inputs"] = eqx.field(converter=jnp.asarray)
    log_radius: Float[Array, " units"] = eqx.field(converter=jnp.asarray)
    log_hardness: Float[Array, " units"] = eqx.field(converter=jnp.asarray)

    def __check_init__(self) -> None:
        check(self.centre.ndim == 2, "centre", self.centre.shape, "of shape (units, inputs)")
        for name in ("log_radius", "log_hardness"):
            shape = getattr(self, name).shape
            check(shape == self.centre.shape[:1], name, shape, f"of shape {self.centre.shape[:1]}")

    @property
    def inputs(self) -> int:
        return self.centre.shape[1]

    @property
    def outputs(self) -> int:
        return self.centre.shape[0]

    def _distance(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        square = jnp.sum((observation - self.centre) ** 2, axis=-1)
        some = square > 0  # the root's slope at 0 is infinite: automatic differentiation must not meet it
        return jnp.where(some, jnp.sqrt(jnp.where(some, square, 1)), 0)

    def potential(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        return jnp.exp(self.log_hardness) * (jnp.exp(self.log_radius) - self._distance(observation))

    def potential_gradient(self, observation: Float[Array, " inputs"]) -> dict[str, Array]:
        hardness, distance = jnp.exp(self.log_hardness), self._distance(observation)
        outwards = jnp.where(distance > 0, hardness / jnp.where(distance > 0, distance, 1), 0)
        return {
            "centre": outwards[:, None] * (observation - self.centre),
            "log_radius": hardness * jnp.exp(self.log_radius),
            "log_hardness": self.potential(observation),
        }
