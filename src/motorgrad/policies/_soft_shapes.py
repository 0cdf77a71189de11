"""Local units with a soft boundary: spheres and boxes."""

import math
from typing import ClassVar, Self

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies._arguments import SizedTask, sizes
from motorgrad.policies._binary import SigmoidUnits
from motorgrad.policies._local import CappedUnits, LocalUnits, StartsScattered
from motorgrad.policies._parameters import in_structure, with_fields
from motorgrad.policies._policy import check_shapes
from motorgrad.policies._starting import POSITIVE, Initial, InitialPolicy, function_of
from motorgrad.schema import static


class SoftSpheres(LocalUnits, SigmoidUnits):
    r"""Units that fire within a radius of a centre, $p_i = \sigma(k\,(r - \lVert y - \mu\rVert))$.

    The size of the region and the exploration at its boundary are separate parameters: a hard sphere is nearly
    deterministic (section 6.5.2 of the thesis). $r = e^{\text{log radius}}$ and $k = e^{\text{log hardness}}$ stay
    positive.

    Score: with the potential $\phi = k\,(r - d)$ at the distance $d$, $A - p$ times $\partial_\mu = k\,(y - \mu)/d$,
    $\partial_{\log r} = k\,r$ and $\partial_{\log k} = \phi$. At the centre the potential has a kink, and
    $\partial_\mu = 0$.

    **Arguments:** `centre` of shape `(units, inputs)`; `log_radius` and `log_hardness`, both `(units,)`.
    """

    size_field: ClassVar[str] = "log_radius"

    centre: Float[Array, "units inputs"] = eqx.field(converter=jnp.asarray)
    log_radius: Float[Array, " units"] = eqx.field(converter=jnp.asarray)
    log_hardness: Float[Array, " units"] = eqx.field(converter=jnp.asarray)

    def __check_init__(self) -> None:
        check(self.centre.ndim == 2, "centre", self.centre.shape, "of shape (units, inputs)")
        check_shapes(self, self.centre.shape[:1], "log_radius", "log_hardness")

    def _distance(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        square = jnp.sum((observation - self.centre) ** 2, axis=-1)
        away = square > 0  # the derivative of the root is infinite at 0: automatic differentiation must not meet it
        return jnp.where(away, jnp.sqrt(jnp.where(away, square, 1)), 0)

    def potential(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        return jnp.exp(self.log_hardness) * (jnp.exp(self.log_radius) - self._distance(observation))

    def potential_gradient(self, observation: Float[Array, " inputs"]) -> dict[str, Array]:
        hardness = jnp.exp(self.log_hardness)
        distance = self._distance(observation)
        outwards = jnp.where(distance > 0, hardness / jnp.where(distance > 0, distance, 1), 0)
        return {
            "centre": outwards[:, None] * (observation - self.centre),
            "log_radius": hardness * jnp.exp(self.log_radius),
            "log_hardness": self.potential(observation),
        }

    def with_temperature(self, factor: float | Float[Array, ""]) -> Self:
        return with_fields(self, log_hardness=self.log_hardness - jnp.log(factor))


class SoftBoxes(CappedUnits):
    r"""Units that fire inside a box, $p_i = \prod_j \sigma(k\,(h_j - u_j))\,\sigma(k\,(h_j + u_j))$, $u = y - \mu$.

    Each input has two opposed sigmoids, one per wall, at the distance $h_j$ from the centre. So a box can be longer in
    one input than in another, unlike a sphere (section 6.5.2 of the thesis). $h_j = e^{\text{log width}_j}$, half the
    length of the box, and $k = e^{\text{log hardness}}$ stay positive. If $k h_j$ is small, $p$ is well below 1 even at
    the centre. $p$ is capped at $1 - 10^{-6}$, where the score is 0.

    Score of firing, with $s^\mp_j = \sigma(-k\,(h_j \mp u_j))$: $\partial_{\mu_j} = k\,(s^-_j - s^+_j)$,
    $\partial_{\log h_j} = k\,h_j\,(s^-_j + s^+_j)$ and
    $\partial_{\log k} = \sum_j k\,((h_j - u_j)\,s^-_j + (h_j + u_j)\,s^+_j)$; of silence: the same times $-p/(1 - p)$.

    **Arguments:** `centre` and `log_width`, both `(units, inputs)`; `log_hardness`, `(units,)`.
    """

    box: ClassVar[bool] = True

    centre: Float[Array, "units inputs"] = eqx.field(converter=jnp.asarray)
    log_width: Float[Array, "units inputs"] = eqx.field(converter=jnp.asarray)
    log_hardness: Float[Array, " units"] = eqx.field(converter=jnp.asarray)

    def __check_init__(self) -> None:
        check(self.centre.ndim == 2, "centre", self.centre.shape, "of shape (units, inputs)")
        check_shapes(self, self.centre.shape, "log_width")
        check_shapes(self, self.centre.shape[:1], "log_hardness")

    def _along(self, observation: Float[Array, " inputs"]) -> Float[Array, "units inputs"]:
        """The place relative to the centre, along the axes of each box."""
        return observation - self.centre

    def _walls(self, observation: Float[Array, " inputs"]) -> Float[Array, "2 units inputs"]:
        """Distance inside each of the two opposed walls, times the hardness."""
        away = self._along(observation)
        half = jnp.exp(self.log_width)
        return jnp.exp(self.log_hardness)[:, None] * jnp.stack([half - away, half + away])

    def _log_fire(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        return jnp.sum(jax.nn.log_sigmoid(self._walls(observation)), axis=(0, 2))

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Self:
        surprise = self._surprise(observation, action)
        walls = self._walls(observation)
        slope = jax.nn.sigmoid(-walls)
        scale = (surprise * jnp.exp(self.log_hardness))[:, None]
        return in_structure(
            self,
            centre=scale * (slope[0] - slope[1]),
            log_width=scale * jnp.exp(self.log_width) * (slope[0] + slope[1]),
            log_hardness=surprise * jnp.sum(walls * slope, axis=(0, 2)),
        )


class InitialSoftSpheres(StartsScattered, InitialPolicy):
    """Soft spheres of equal `radius` and `hardness`, with centres drawn from U[`low`, `high`] in every input."""

    radius: float = static(0.5, allowed=POSITIVE, help="radius of every sphere, in the units of the inputs")
    hardness: float = static(10.0, allowed=POSITIVE, help="how steeply the probability falls at a unit's surface")
    low: float = static(-1.0, help="the lower end of the range of the centres in every input")
    high: float = static(1.0, help="its upper end")

    def start(self, task: SizedTask | int) -> Initial:
        inputs, outputs = sizes(task, self.units)

        def initial(key: jax.Array) -> SoftSpheres:
            centre = self.centres(key, outputs, inputs)
            sizes = (jnp.full(outputs, math.log(value), centre.dtype) for value in (self.radius, self.hardness))
            return SoftSpheres(centre, *sizes)

        return initial


soft_spheres = function_of(InitialSoftSpheres)


class InitialSoftBoxes(StartsScattered, InitialPolicy):
    """Soft boxes of equal `hardness`, with centres drawn from U[`low`, `high`] in every input."""

    width: float = static(
        0.5, allowed=POSITIVE, help="the distance from the centre to each wall, in the units of the inputs"
    )
    hardness: float = static(10.0, allowed=POSITIVE, help="how steeply the probability falls at a unit's surface")
    low: float = static(-1.0, help="the lower end of the range of the centres in every input")
    high: float = static(1.0, help="its upper end")

    def start(self, task: SizedTask | int) -> Initial:
        inputs, outputs = sizes(task, self.units)

        def initial(key: jax.Array) -> SoftBoxes:
            centre = self.centres(key, outputs, inputs)
            log_hardness = jnp.full(outputs, math.log(self.hardness), centre.dtype)
            return SoftBoxes(centre, jnp.full_like(centre, math.log(self.width)), log_hardness)

        return initial


soft_boxes = function_of(InitialSoftBoxes)
