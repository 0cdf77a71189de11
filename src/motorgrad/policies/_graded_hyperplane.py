"""Graded units whose mean is linear in the inputs."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies._graded import GradedUnits, check_floor
from motorgrad.policies._policy import fixed


class GradedHyperplanes(GradedUnits):
    r"""Units that draw real numbers about a mean linear in the inputs, $m_i = w_i \cdot y + b_i$ (Williams, 1992, the
    Gaussian unit).

    Slopes: $\partial_{w_i} m_i = y$ and $\partial_{b_i} m_i = 1$; the rest is in `GradedUnits`.

    **Arguments:** `slope` $w$ of shape `(units, inputs)`; `level` $b$ and `log_deviation` $\lambda$, both `(units,)`;
    `floor` $s_{\min}$, the least deviation, above 0 and not learnt.
    """

    slope: Float[Array, "units inputs"] = eqx.field(converter=jnp.asarray)
    level: Float[Array, " units"] = eqx.field(converter=jnp.asarray)
    log_deviation: Float[Array, " units"] = eqx.field(converter=jnp.asarray)
    floor: Float[Array, ""] = fixed(converter=jnp.asarray, default=0.02)

    def __check_init__(self) -> None:
        check(self.slope.ndim == 2, "slope", self.slope.shape, "of shape (units, inputs)")
        for name in ("level", "log_deviation"):
            shape = getattr(self, name).shape
            check(shape == self.slope.shape[:1], name, shape, f"of shape {self.slope.shape[:1]}")
        check_floor(self.floor)

    @property
    def inputs(self) -> int:
        return self.slope.shape[1]

    def mean(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        # a sum of products, not a matrix product: the same rounding for one seed and for many
        return jnp.sum(self.slope * observation, axis=-1) + self.level

    def mean_gradient(self, observation: Float[Array, " inputs"]) -> dict[str, Array]:
        return {"slope": jnp.broadcast_to(observation, self.slope.shape), "level": jnp.ones_like(self.level)}
