"""Graded units that act between two bounds."""

from collections.abc import Sequence
from typing import Literal

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from motorgrad._errors import check, choice
from motorgrad.policies._arguments import SizedTask, sizes
from motorgrad.policies._autoregressive import InitialLasting
from motorgrad.policies._densities import DENSITIES, Clipped, Density, Squashed
from motorgrad.policies._featured import InitialFeatured
from motorgrad.policies._graded import GradedHyperplanes, GradedUnits, StartsNoisy
from motorgrad.policies._parameters import fixed
from motorgrad.policies._starting import POSITIVE, Initial, InitialPolicy, function_of
from motorgrad.schema import Range, static

Shape = Literal["squashed", "clipped", "truncated", "beta"]


class BoundedUnits(GradedUnits):
    r"""A pool of $N$ units with activations in [low, high], each drawn from a density of location $m_i(y)$ and spread
    $s_i = s_{\min} + e^{\lambda_i}$.

    The density is one of `DENSITIES`, on [−1, 1], which stands for [low, high]: $a = c + h u$ with the middle $c$ and
    half the range $h$. So location and spread are in units of half the range, whatever the range is.

    The score is $\partial_m \log\pi\,\nabla m$ and $\partial_{\log s} \log\pi\,e^\lambda/s$, and finite for every
    action, the bounds included. The Fisher matrix is exact, with cross terms of location and spread.

    A subclass defines `inputs`, `mean_gradient` and `mean`, which is the location in units of half the range from its
    middle, and not the mean activation.
    """

    low: eqx.AbstractVar[Float[Array, " units"]]
    high: eqx.AbstractVar[Float[Array, " units"]]
    density: eqx.AbstractVar[str]

    @property
    def _density(self) -> Density:
        return DENSITIES[self.density]

    def _spread_out(self, u: Float[Array, " units"]) -> Float[Array, " units"]:
        """Numbers in [−1, 1] moved to [low, high], whose ends are reached exactly."""
        inside = (self.low + self.high) / 2 + (self.high - self.low) / 2 * u
        inside = jnp.clip(inside, self.low, self.high)
        return jnp.where(u <= -1, self.low, jnp.where(u >= 1, self.high, inside))

    def _folded(self, action: Float[Array, " units"]) -> Float[Array, " units"]:
        """The inverse of `_spread_out`. What lies outside counts as at the end."""
        inside = (action - (self.low + self.high) / 2) / ((self.high - self.low) / 2)
        least = 1 - jnp.finfo(inside.dtype).epsneg
        inside = jnp.clip(inside, -least, least)
        return jnp.where(action <= self.low, -1, jnp.where(action >= self.high, 1, inside))

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        """The mean activations, of squashed units the median."""
        return self._spread_out(self._density.mean(self.mean(observation), self.deviation))

    def sample(self, observation: Float[Array, " inputs"], uniforms: Float[Array, " units"]) -> Float[Array, " units"]:
        return self._spread_out(self._density.sample(self.mean(observation), self.deviation, uniforms))

    def mode(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        """The most probable activations, of squashed units the median."""
        return self._spread_out(self._density.mode(self.mean(observation)))

    def log_probs(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, " units"]:
        """Log-density of each unit's activation; at a bound that has a probability of its own, its logarithm."""
        u = self._folded(action)
        log = self._density.log_prob(self.mean(observation), self.deviation, u)
        return jnp.where(self._density.at_end(u), log, log - jnp.log((self.high - self.low) / 2))

    def _slopes(
        self, observation: Float[Array, " inputs"], action: Float[Array, " units"]
    ) -> tuple[Float[Array, " units"], Float[Array, " units"]]:
        return self._density.slopes(self.mean(observation), self.deviation, self._folded(action))

    def _information(self, observation: Float[Array, " inputs"]) -> tuple[Array, Array, Array]:
        of_m, both, of_s = self._density.information(self.mean(observation), self.deviation)
        location = jnp.sqrt(jnp.maximum(of_m, 0))
        cross = jnp.where(location > 0, both / jnp.where(location > 0, location, 1), 0)
        return location, cross, jnp.sqrt(jnp.maximum(of_s - cross * cross, 0))

    def entropies(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        """Entropy of each unit, in nats."""
        density = self._density
        m = self.mean(observation)
        s = self.deviation
        return density.entropy(m, s) + density.inside(m, s) * jnp.log((self.high - self.low) / 2)

    def entropy_estimate(
        self, observation: Float[Array, " inputs"], uniforms: Float[Array, " units"]
    ) -> Float[Array, ""]:
        if not isinstance(self._density, Squashed):
            return self.entropy(observation)
        found = self._density.entropy_estimate(self.mean(observation), self.deviation, uniforms)
        return jnp.sum(found + jnp.log((self.high - self.low) / 2))


class BoundedHyperplanes(BoundedUnits, GradedHyperplanes):
    r"""Units that act in [low, high], with a location linear in the inputs, $m_i = w_i \cdot y + b_i$, and a spread of
    their own, the same at all inputs.

    | `density` | an activation in [−1, 1] | mode |
    |---|---|---|
    | `"squashed"` | $\tanh(m + s\varepsilon)$ (Haarnoja et al., 2018) | $\tanh m$, the median |
    | `"clipped"` | $m + s\varepsilon$, clipped; the ends have a probability (Fujita & Maeda, 2018) | $m$, clipped |
    | `"truncated"` | normal, given that it is within (Burkardt, 2014) | $m$, clipped |
    | `"beta"` | beta distribution with $\alpha, \beta \ge 1$ (Chou et al., 2017) | $\tanh m$ |

    **Arguments:** `weights` $w$ of shape `(units, inputs)`; `bias` $b$ and `log_deviation` $\lambda$, both `(units,)`;
    not trainable: `floor` $s_{\min}$, the lower bound of the spread, positive; `low` and `high`, the bounds, `(units,)`
    or one number for all; `density`, by name.

    **Example:**

    ```python
    units = BoundedHyperplanes(weights=[[0.5, -1.0]], bias=[0.2], log_deviation=[-1.0], low=0.0, high=1.0)
    ```
    """

    low: Float[Array, " units"] = fixed(converter=jnp.asarray, default=-1.0)
    high: Float[Array, " units"] = fixed(converter=jnp.asarray, default=1.0)
    density: str = eqx.field(static=True, default="squashed")

    @property
    def normal(self) -> bool:
        return isinstance(self._density, Clipped)

    def number_before(self, action: Float[Array, " units"]) -> Float[Array, " units"]:
        return self._density.number_before(self._folded(action))  # type: ignore[attr-defined]

    def __check_init__(self) -> None:
        GradedHyperplanes.__check_init__(self)
        choice("density", self.density, DENSITIES)
        each = self.weights.shape[:1]
        for name in ("low", "high"):
            shape = getattr(self, name).shape
            check(shape in ((), each), name, shape, f"one number, or of shape {each}")
        if not isinstance(self.low, Tracer) and not isinstance(self.high, Tracer):
            low = np.asarray(self.low)
            high = np.asarray(self.high)
            bounded = np.isfinite(low).all() and np.isfinite(high).all() and (low < high).all()
            check(bounded, "low, high", (low.tolist(), high.tolist()), "finite, low < high")


class InitialBounded(StartsNoisy, InitialPolicy):
    """Graded units that act within bounds."""

    density: Shape = static("squashed", help="density of a graded activation; squashed and clipped ones are normal")
    level: float = static(
        0.0,
        allowed=Range(-1, 1, open_low=True, open_high=True),
        help="the most probable activation at the start, as a fraction of half the range from its middle",
    )
    deviation: float = static(0.5, allowed=POSITIVE, help="the spread at the start, in units of half the range")
    floor: float = static(0.02, allowed=POSITIVE, help="the least spread that learning may reach")

    def within(self, ranges: Sequence[tuple[float, float]], inputs: int) -> BoundedHyperplanes:
        """Bounded hyperplanes with zero weights, one for each of the `ranges`."""
        units = len(ranges)
        noise, floor = self.noise(units)
        location = jnp.full(units, DENSITIES[self.density].location(self.level))
        low, high = jnp.asarray(ranges, noise.dtype).T
        return BoundedHyperplanes(jnp.zeros((units, inputs)), location, noise, floor, low, high, self.density)


class InitialBoundedHyperplanes(InitialLasting, InitialFeatured, InitialBounded):
    """Graded hyperplanes that act within the bounds of the task's actions (its `action_range`), from −1 to 1 without a
    task.

    All units have zero weights: their most probable activation is the same for every observation.
    """

    def validate(self) -> None:
        super().validate()
        normal = isinstance(DENSITIES[self.density], Clipped) or not self.autocorrelation
        check(normal, "density", self.density, "'squashed' or 'clipped' with an autocorrelation")

    def start(self, task: SizedTask | int) -> Initial:
        inputs, outputs = sizes(task, self.units)
        ranges = bounds_of(task, outputs)
        return self.lasting(self.behind(inputs, lambda seen: self.within(ranges, seen)))


bounded_hyperplanes = function_of(InitialBoundedHyperplanes)


def bounds_of(task: SizedTask | int, outputs: int) -> Sequence[tuple[float, float]]:
    """The range of each action of a task; from −1 to 1 without a task."""
    ranges = getattr(task, "action_range", ((-1.0, 1.0),) * outputs)
    check(len(ranges) == outputs, "units", outputs, f"{len(ranges)}, one for each action of the task")
    return ranges
