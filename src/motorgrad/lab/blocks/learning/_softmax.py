"""A choice among alternatives as a block."""

import dataclasses
from typing import Annotated, Any, ClassVar

from jaxtyping import Array, Float

from motorgrad import policies
from motorgrad.lab.blocks.learning._counts import check_count
from motorgrad.lab.blocks.learning._units import Units, spread
from motorgrad.lab.diagram import Parameter, Setting


@dataclasses.dataclass(frozen=True)
class Softmax(Units):
    r"""One of some alternatives, $\pi_k \propto \exp(w_k \cdot y)$. The action is its number, from 0.

    Parameters: the weights $w$, alternative by alternative.
    """

    name: ClassVar[str] = "softmax"

    alternatives: Annotated[int, Setting("how many there are")] = 2
    observed: Annotated[int, Setting("how many numbers they see")] = 1
    weights: Annotated[Any, Parameter("$w$ at the start, for all or (alternatives, observed)")] = 0.0
    spread: Annotated[Any, Parameter("how far from `weights` they start at most", low=0.0)] = 0.0

    def validate(self) -> None:
        check_count("alternatives", self.alternatives)
        check_count("observed", self.observed)
        for name in ("weights", "spread"):
            self.check_broadcasts(name, (self.alternatives, self.observed))

    @property
    def init_uniforms(self) -> int:
        return self.alternatives * self.observed

    def start(self, uniforms: Float[Array, " weights"]) -> policies.Softmax:
        return policies.Softmax(spread(self.weights, self.spread, uniforms, (self.alternatives, self.observed)))
