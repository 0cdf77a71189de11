"""Motoneurons as a block."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad import policies
from motorgrad.lab.blocks.learning._counts import check_count
from motorgrad.lab.blocks.learning._units import Units, spread
from motorgrad.lab.diagram import Parameter, Setting


@dataclasses.dataclass(frozen=True)
class Motoneurons(Units):
    r"""A pool of motoneurons on one input, $p_i = \sigma(k_i\,(y - y^*_i))$ (section 4.2.2 of the thesis).

    Parameters: the thresholds $y^*$, then the gains $k$. The thresholds start anywhere within `threshold` ± `spread`.
    """

    name: ClassVar[str] = "motoneurons"

    units: Annotated[int, Setting("how many there are")] = 1
    threshold: Annotated[Any, Parameter("$y^*$ at the start, for all or for each")] = 0.5
    gain: Annotated[Any, Parameter("$k$ at the start, for all or for each")] = 0.0
    spread: Annotated[Any, Parameter("how far from `threshold` they start at most", low=0.0)] = 0.0

    def validate(self) -> None:
        check_count("units", self.units)
        for name in ("threshold", "gain", "spread"):
            self.check_broadcasts(name, (self.units,))

    @property
    def init_uniforms(self) -> int:
        return self.units

    def start(self, uniforms: Float[Array, " units"]) -> policies.Motoneurons:
        threshold = spread(self.threshold, self.spread, uniforms, (self.units,))
        return policies.Motoneurons(threshold, jnp.broadcast_to(jnp.asarray(self.gain, uniforms.dtype), (self.units,)))
