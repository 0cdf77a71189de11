"""Hyperplane units as a block."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad import policies
from motorgrad.lab.blocks.learning._counts import check_count
from motorgrad.lab.blocks.learning._units import Units, spread
from motorgrad.lab.diagram import Parameter, Setting


@dataclasses.dataclass(frozen=True)
class Hyperplanes(Units):
    r"""Units that fire on one side of a soft boundary, $p_i = \sigma(w_i \cdot y + b_i)$ (section 5.2 of the thesis).

    Parameters: the weights $w$, unit by unit, then the biases $b$. Without weights every unit fires half of the time.
    """

    name: ClassVar[str] = "hyperplanes"

    units: Annotated[int, Setting("how many there are")] = 1
    observed: Annotated[int, Setting("how many numbers they see")] = 1
    weights: Annotated[Any, Parameter("$w$ at the start, for all or (units, observed)")] = 0.0
    bias: Annotated[Any, Parameter("$b$ at the start, for all or for each")] = 0.0
    spread: Annotated[Any, Parameter("how far from `weights` they start at most", low=0.0)] = 0.0

    def validate(self) -> None:
        check_count("units", self.units)
        check_count("observed", self.observed)
        for name in ("weights", "spread"):
            self.check_broadcasts(name, (self.units, self.observed))
        self.check_broadcasts("bias", (self.units,))

    @property
    def init_uniforms(self) -> int:
        return self.units * self.observed

    def start(self, uniforms: Float[Array, " weights"]) -> policies.Hyperplanes:
        weights = spread(self.weights, self.spread, uniforms, (self.units, self.observed))
        return policies.Hyperplanes(weights, jnp.broadcast_to(jnp.asarray(self.bias, weights.dtype), (self.units,)))
