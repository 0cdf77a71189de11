"""Local units: each fires only near its centre."""

import abc
from typing import Self

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies._capped import CappedUnits
from motorgrad.policies._policy import fixed, in_structure

Limits = tuple[float, float] | None


class GaussianUnits(CappedUnits):
    r"""Units whose log-probability of firing falls with the squared distance $\rho = \frac12\sum_j z_j^2$ from a
    centre $\mu$, $z_j = (y_j - \mu_j)/\sigma_j$, in widths $\sigma_j = e^{\lambda_j}$.

    $p$ is capped at $1 - 10^{-6}$, where the score is 0: at the centre of a unit that always fires the score of silence
    has no finite value.
    """

    centre: eqx.AbstractVar[Float[Array, "units inputs"]]
    log_width: eqx.AbstractVar[Float[Array, "units inputs"]]
    log_width_limits: eqx.AbstractVar[Limits]

    @abc.abstractmethod
    def log_height(self) -> Float[Array, " units"]:
        """Log-probability of firing at the centre, before the cap."""

    @property
    def inputs(self) -> int:
        return self.centre.shape[1]

    @property
    def outputs(self) -> int:
        return self.centre.shape[0]

    def limited(self) -> Self:
        if self.log_width_limits is None:
            return self
        return eqx.tree_at(lambda units: units.log_width, self, jnp.clip(self.log_width, *self.log_width_limits))

    def _scaled(self, observation: Float[Array, " inputs"]) -> Float[Array, "units inputs"]:
        return (observation - self.centre) * jnp.exp(-self.log_width)

    def _log_fire(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        return self.log_height() - 0.5 * jnp.sum(self._scaled(observation) ** 2, axis=-1)


class LocalGaussians(GaussianUnits):
    r"""Local Gaussian units of a fixed height, $p_i = p_\max \exp(-\frac12 \sum_j ((y_j - \mu_j)/\sigma_j)^2)$.

    Score, firing: $\partial_{\mu_j} = (y_j - \mu_j)/\sigma_j^2$, $\partial_{\lambda_j} = ((y_j - \mu_j)/\sigma_j)^2$;
    silent: the same times $-p/(1 - p)$ (section 6.2, with the height tied to the widths: see `FreeGaussians`).

    **Arguments:** `centre` and `log_width`, both `(units, inputs)`; `p_max`, a number or `(units,)`, in (0, 1];
    `log_width_limits`, the least and the greatest `log_width` that learning leaves, `None` for no limits.
    """

    centre: Float[Array, "units inputs"] = eqx.field(converter=jnp.asarray)
    log_width: Float[Array, "units inputs"] = eqx.field(converter=jnp.asarray)
    p_max: Float[Array, " units"] = fixed(converter=jnp.asarray, default=1.0)
    log_width_limits: Limits = eqx.field(static=True, default=None)

    def __check_init__(self) -> None:
        _check_shapes(self)
        check(
            self.p_max.shape in ((), self.centre.shape[:1]),
            "p_max",
            self.p_max.shape,
            f"one number or of shape {self.centre.shape[:1]}",
        )
        if not isinstance(self.p_max, Tracer):  # while tracing there is no value to look at
            p_max = np.asarray(self.p_max)
            check(np.all((p_max > 0) & (p_max <= 1)), "p_max", p_max.tolist(), "in (0, 1]")

    def log_height(self) -> Float[Array, " units"]:
        return jnp.log(self.p_max)

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Self:
        surprise = self._surprise(observation, action)[:, None]
        scaled = self._scaled(observation)
        return in_structure(self, centre=surprise * scaled * jnp.exp(-self.log_width), log_width=surprise * scaled**2)


class FreeGaussians(GaussianUnits):
    r"""Local Gaussian units with a learnt height, $p_i = e^{\alpha_i}\,\prod_j \mathcal N(y_j; \mu_j, \sigma_j)$.

    The density is normalised as in equation 6.1, so that widening a unit lowers it: hence the score's $z^2 - 1$.

    Score, firing: $\partial_\alpha = 1$, $\partial_{\mu_j} = (y_j - \mu_j)/\sigma_j^2$,
    $\partial_{\lambda_j} = z_j^2 - 1$; silent: the same times $-p/(1 - p)$.

    **Arguments:** `centre` and `log_width`, both `(units, inputs)`; `log_mass` $\alpha$, `(units,)`;
    `log_width_limits` as of `LocalGaussians`.
    """

    centre: Float[Array, "units inputs"] = eqx.field(converter=jnp.asarray)
    log_width: Float[Array, "units inputs"] = eqx.field(converter=jnp.asarray)
    log_mass: Float[Array, " units"] = eqx.field(converter=jnp.asarray)
    log_width_limits: Limits = eqx.field(static=True, default=None)

    def __check_init__(self) -> None:
        _check_shapes(self)
        check(
            self.log_mass.shape == self.centre.shape[:1],
            "log_mass",
            self.log_mass.shape,
            f"of shape {self.centre.shape[:1]}",
        )

    def log_height(self) -> Float[Array, " units"]:
        return self.log_mass - jnp.sum(self.log_width, axis=-1) - 0.5 * self.inputs * jnp.log(2 * jnp.pi)

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Self:
        surprise = self._surprise(observation, action)
        scaled = self._scaled(observation)
        return in_structure(
            self,
            centre=surprise[:, None] * scaled * jnp.exp(-self.log_width),
            log_width=surprise[:, None] * (scaled**2 - 1),
            log_mass=surprise,
        )


def _check_shapes(units: GaussianUnits) -> None:
    check(units.centre.ndim == 2, "centre", units.centre.shape, "of shape (units, inputs)")
    check(
        units.log_width.shape == units.centre.shape,
        "log_width",
        units.log_width.shape,
        f"of shape {units.centre.shape}",
    )
    limits = units.log_width_limits
    check(limits is None or limits[0] < limits[1], "log_width_limits", limits, "None, or two numbers, low < high")
