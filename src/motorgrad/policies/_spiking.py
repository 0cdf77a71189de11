"""Spiking units: leaky integrate-and-fire neurons with a noisy threshold, whose score is Hebbian."""

import math
from typing import Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies._arguments import SizedTask, sizes
from motorgrad.policies._binary import SigmoidUnits
from motorgrad.policies._parameters import fixed, with_fields
from motorgrad.policies._policy import check_shapes
from motorgrad.policies._starting import Initial, InitialPolicy, check_interval, function_of
from motorgrad.schema import Range, static

DECAY = Range(0, 1, open_high=True)


class SpikingUnits(SigmoidUnits):
    r"""Leaky integrate-and-fire neurons that fire at random, the more probably the further their membrane potential is
    above their threshold (Bartlett & Baxter, 1999; Gerstner & Kistler, 2002, on escape noise).

    Every unit keeps a trace of each of its inputs since its own last spike. With the action $A_i \in \{0, 1\}$, a spike
    or none, and the `decay` $\kappa$,

    $$e_{ij} \leftarrow \kappa\,(1 - A_i)\,e_{ij} + y_j, \qquad u_i = \sum_j w_{ij} e_{ij}, \qquad
    p_i = \sigma(u_i - \vartheta_i).$$

    So the potential $u$ of a silent unit goes to $w \cdot y/(1 - \kappa)$ with a time constant of $-1/\log\kappa$
    decisions, and a spike sets it back to 0. Potentials are in units of the noise: the larger the weights and the
    threshold, the more regular the spikes. With $\kappa = 0$ the units are hyperplanes.

    **The score is Hebbian**: $\partial_{w_{ij}} = (A_i - p_i)\,e_{ij}$ and $\partial_{\vartheta_i} = -(A_i - p_i)$. A
    weight grows where its input came before a spike and reward followed, by what is left of the input; a spike that was
    sure to come teaches nothing. The trace depends on the past through the inputs and the actions alone, not on the
    parameters. So the score is exact.

    The traces are the memory, from 0 at the start of an episode, and what the units see is the observation and the
    traces. Critics see the observation alone.

    **Arguments:** `weights` $w$ of shape `(units, observation)`; `threshold` $\vartheta$ of shape `(units,)`; `decay`
    $\kappa$ in [0, 1), not trainable.

    **Raises:** `ValueError` for other shapes, and for a $\kappa$ out of range.

    **Example:**

    ```python
    unit = SpikingUnits(weights=[[3.0]], threshold=[15.0], decay=0.9)
    memory = unit.initial_memory()
    for _ in range(20):
        seen = unit.observation_with_memory(memory, jnp.array([1.0]))
        spike = unit.mode(seen)  # every seventh decision
        memory = unit.remember(seen, spike)
    ```
    """

    weights: Float[Array, "units observation"] = eqx.field(converter=jnp.asarray)
    threshold: Float[Array, " units"] = eqx.field(converter=jnp.asarray)
    decay: Float[Array, ""] = fixed(converter=jnp.asarray, default=0.9)

    def __check_init__(self) -> None:
        shape = self.weights.shape
        check(len(shape) == 2, "weights", shape, "of shape (units, observation)")
        check_shapes(self, shape[:1], "threshold")
        check(self.decay.shape == (), "decay", self.decay.shape, "one number")
        if not isinstance(self.decay, Tracer):  # a tracer has no value to check
            kappa = float(np.asarray(self.decay))
            check(DECAY.allows(kappa), "decay", kappa, str(DECAY))

    @property
    def observation_size(self) -> int:
        return self.weights.shape[1]

    @property
    def inputs(self) -> int:
        return self.observation_size + self.weights.size

    @property
    def outputs(self) -> int:
        return self.weights.shape[0]

    def initial_memory(self) -> Float[Array, " traces"]:
        return jnp.zeros_like(self.weights).ravel()

    def observation_with_memory(
        self, memory: Float[Array, " traces"] | None, observation: Float[Array, " observation"]
    ) -> Float[Array, " inputs"]:
        assert memory is not None
        traces = self.decay * memory.reshape(self.weights.shape) + observation
        return jnp.concatenate([observation, traces.ravel().astype(observation.dtype)])

    def remember(self, seen: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, " traces"]:
        """The traces after the spikes, which clear those of their units."""
        return ((1 - action)[:, None] * self.traces(seen)).ravel().astype(self.weights.dtype)

    def critic_observation(self, seen: Float[Array, " inputs"]) -> Float[Array, " observation"]:
        return seen[: self.observation_size]

    def traces(self, seen: Float[Array, " inputs"]) -> Float[Array, "units observation"]:
        """$e$, what each unit keeps of its inputs since its last spike."""
        return seen[self.observation_size :].reshape(self.weights.shape)

    def potential(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        r"""$u_i - \vartheta_i$, the membrane potential above the threshold."""
        return jnp.sum(self.weights * self.traces(observation), axis=-1) - self.threshold

    def potential_gradient(self, observation: Float[Array, " inputs"]) -> dict[str, Array]:
        return {"weights": self.traces(observation), "threshold": -jnp.ones_like(self.threshold)}

    def with_temperature(self, factor: float | Float[Array, ""]) -> Self:
        return with_fields(self, weights=self.weights / factor, threshold=self.threshold / factor)


class InitialSpiking(InitialPolicy):
    """Spiking units of equal `weight` on every input, with thresholds drawn from U[`low`, `high`].

    By default they fire half of the time, more or less, and nothing that they see makes a difference at first.
    """

    time_constant: float = static(
        10.0, allowed=Range(0, 1e6, open_high=True), unit="decisions", help="of the membrane; 0 for units that forget"
    )
    weight: float = static(0.0, help="the weight of every input at the start")
    low: float = static(-1.0, help="the lower end of the range of the thresholds")
    high: float = static(1.0, help="its upper end")

    def validate(self) -> None:
        super().validate()
        check_interval(self.low, self.high)

    def start(self, task: SizedTask | int) -> Initial:
        inputs, outputs = sizes(task, self.units)
        decay = math.exp(-1 / self.time_constant) if self.time_constant else 0.0

        def initial(key: jax.Array) -> SpikingUnits:
            threshold = jax.random.uniform(key, (outputs,), minval=self.low, maxval=self.high)
            weights = jnp.full((outputs, inputs), self.weight, threshold.dtype)
            return SpikingUnits(weights, threshold, jnp.asarray(decay, threshold.dtype))

        return initial


spiking = function_of(InitialSpiking)
