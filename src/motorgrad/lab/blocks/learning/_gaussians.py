"""Local Gaussian units as a block."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad import policies
from motorgrad._errors import check
from motorgrad.lab.blocks.learning._counts import check_count
from motorgrad.lab.blocks.learning._units import Units, spread
from motorgrad.lab.diagram import Parameter, Setting


@dataclasses.dataclass(frozen=True)
class Gaussians(Units):
    r"""Units that fire only near their centres, $p_i = p_\max \exp(-\frac12 \sum_j ((y_j - \mu_j)/\sigma_j)^2)$
    (section 6.2 of the thesis).

    Parameters: the centres $\mu$, unit by unit, then the logarithms of the widths $\sigma$. Centres start anywhere
    within `centre` ± `spread`.
    """

    name: ClassVar[str] = "gaussians"

    units: Annotated[int, Setting("how many there are")] = 1
    observed: Annotated[int, Setting("how many numbers they see")] = 1
    centre: Annotated[Any, Parameter(r"$\mu$ at the start, for all or (units, observed)")] = 0.0
    width: Annotated[Any, Parameter(r"$\sigma$ at the start, for all or (units, observed)", low=0.0, open=True)] = 0.5
    height: Annotated[Any, Parameter(r"$p_\max$, for all or for each", low=1e-6, high=1.0)] = 1.0
    spread: Annotated[Any, Parameter("how far from `centre` they start at most", low=0.0)] = 0.0
    limits: Annotated[
        tuple[float, float] | None, Setting("the least and the greatest width that learning leaves, or none")
    ] = (0.0183, 7.39)

    def validate(self) -> None:
        check_count("units", self.units)
        check_count("observed", self.observed)
        for name in ("centre", "width", "spread"):
            self.check_broadcasts(name, (self.units, self.observed))
        self.check_broadcasts("height", (self.units,))
        two = isinstance(self.limits, tuple) and len(self.limits) == 2
        numbers = two and all(isinstance(x, int | float) for x in self.limits or ())
        right = self.limits is None or (numbers and 0 < self.limits[0] < self.limits[1] < 1e6)
        check(right, "limits", self.limits, "None, or two widths, 0 < low < high < 1e6")

    @property
    def init_uniforms(self) -> int:
        return self.units * self.observed

    def start(self, uniforms: Float[Array, " centres"]) -> policies.Policy:
        return self.pool(uniforms)

    def pool(self, uniforms: Float[Array, " centres"]) -> policies.LocalGaussians:
        """The units at the start."""
        shape = (self.units, self.observed)
        centre = spread(self.centre, self.spread, uniforms, shape)
        width = jnp.broadcast_to(jnp.log(jnp.asarray(self.width, centre.dtype)), shape)
        height = jnp.broadcast_to(jnp.asarray(self.height, centre.dtype), (self.units,))
        limits = None if self.limits is None else (float(np.log(self.limits[0])), float(np.log(self.limits[1])))
        return policies.LocalGaussians(centre, width, p_max=height, log_width_limits=limits)
