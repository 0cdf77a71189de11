"""Binary units that act with a learnt strength: where one fires, its action is a real number."""

import math
from typing import Any, Self

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies._binary import BinaryUnits
from motorgrad.policies._graded import LEAST, check_floor
from motorgrad.policies._policy import Policy, fixed, has_rows, in_structure, outer, trainable


class GradedPool(Policy):
    r"""A pool of binary units, each of which acts with a strength of its own when it fires: $a_i = f_i\,(m_i +
    s_i\,\varepsilon_i)$ with $f_i \in \{0, 1\}$ of the pool and $\varepsilon_i \sim \mathcal N(0, 1)$ (section 6.5.4 of
    the thesis, with the stochastic real-valued units of section 6.2.3).

    Where a unit fires follows from the pool, how strongly and to which side it then acts from $m$. A silent unit adds
    neither force nor noise, and learns nothing about its strength. The deviation is $s = s_{\min} + e^\lambda$. With
    $z = (a - m)/s$ the score is that of the pool for $f$, $f z/s$ for $m$ and $f (z^2 - 1)\,e^\lambda/s$ for $\lambda$.

    **Arguments:** `pool`, binary units that fire independently, each with parameters of its own; `strength` $m$ and
    `log_deviation` $\lambda$, both `(units,)`; `floor` $s_{\min}$, the least deviation, above 0 and not learnt.
    """

    pool: BinaryUnits
    strength: Float[Array, " units"] = eqx.field(converter=jnp.asarray)
    log_deviation: Float[Array, " units"] = eqx.field(converter=jnp.asarray)
    floor: Float[Array, ""] = fixed(converter=jnp.asarray, default=0.05)

    def __check_init__(self) -> None:
        kind = type(self.pool).__name__
        check(isinstance(self.pool, BinaryUnits), "pool", kind, "a pool of binary units")
        check(has_rows(self.pool) and self.pool.independent, "pool", kind, "independent units of one kind")
        for name in ("strength", "log_deviation"):
            shape = getattr(self, name).shape
            check(shape == (self.pool.outputs,), name, shape, f"of shape {(self.pool.outputs,)}")
        check_floor(self.floor)

    @property
    def inputs(self) -> int:
        return self.pool.inputs

    @property
    def outputs(self) -> int:
        return self.pool.outputs

    @property
    def actions(self) -> str:
        return "graded"

    @property
    def uniforms(self) -> int:
        """Those of the pool, and one for the strength of each unit."""
        return self.pool.uniforms + self.outputs

    @property
    def deviation(self) -> Float[Array, " units"]:
        """$s_i$, the standard deviation of the strength."""
        return self.floor + jnp.exp(self.log_deviation)

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        """With which probability each unit fires."""
        return self.pool.prob(observation)

    def sample(
        self, observation: Float[Array, " inputs"], uniforms: Float[Array, " uniforms"]
    ) -> Float[Array, " units"]:
        fires = self.pool.sample(observation, uniforms[: self.pool.uniforms])
        noise = jax.scipy.special.ndtri(jnp.maximum(uniforms[self.pool.uniforms :], LEAST))
        strength = self.strength + self.deviation * noise.astype(self.strength.dtype)
        # a strength of exactly 0 would pass for silence
        return jnp.where(fires > 0, jnp.where(strength == 0, jnp.finfo(strength.dtype).tiny, strength), 0.0)

    def mode(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        """The mean strength of the units that fire more often than not."""
        return jnp.where(self.pool.mode(observation) > 0, self.strength, 0.0)

    def log_prob(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, ""]:
        """Logarithm of the density: with respect to lengths for units that fire, and to counting for silence."""
        fires, z = self._parts(action)
        drawn = -0.5 * z**2 - jnp.log(self.deviation) - 0.5 * math.log(2 * math.pi)
        return self.pool.log_prob(observation, fires) + jnp.sum(fires * drawn)

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Self:
        fires, z = self._parts(action)
        parts = in_structure(
            self, strength=fires * z / self.deviation, log_deviation=fires * (z * z - 1) * self._slope()
        )
        return eqx.tree_at(lambda units: units.pool, parts, self.pool.score(observation, fires))

    def _parts(self, action: Float[Array, " units"]) -> tuple[Float[Array, " units"], Float[Array, " units"]]:
        """Which units fired, and how far from the mean each one's strength was, in deviations."""
        return (action != 0).astype(self.strength.dtype), (action - self.strength) / self.deviation

    def _slope(self) -> Float[Array, " units"]:
        r"""$\partial \log s/\partial\lambda = e^\lambda/s$."""
        return jnp.exp(self.log_deviation) / self.deviation

    def blocks(self, gradient: Any) -> tuple[Float[Array, "units parameters"], ...]:
        """A row for each unit: the pool's parameters, the strength, the logarithm of the deviation."""
        (rows,) = self.pool.blocks(gradient.pool)
        return (jnp.concatenate([rows, gradient.strength[:, None], gradient.log_deviation[:, None]], axis=1),)

    def from_blocks(self, blocks: tuple[Float[Array, "units parameters"], ...]) -> Self:
        (rows,) = blocks
        parts = in_structure(self, strength=rows[:, -2], log_deviation=rows[:, -1])
        return eqx.tree_at(lambda units: units.pool, parts, self.pool.from_blocks((rows[:, :-2],)))

    def fisher(
        self, observation: Float[Array, " inputs"], action: Float[Array, " units"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        r"""Exact: that of the pool, and $p/s^2$ and $2 p\,(e^\lambda/s)^2$; they do not mix."""
        fires, _ = self._parts(action)
        (pool,) = self.pool.fisher(observation, fires)
        p = self.prob(observation)
        own = jnp.stack([1 / self.deviation, math.sqrt(2) * self._slope()], axis=1) * jnp.sqrt(p)[:, None]
        # padded to the whole row: the pool's numbers first
        (filled,) = self.blocks(trainable(self))
        size = filled.shape[1]
        whole = jnp.zeros((self.outputs, size, size), filled.dtype)
        whole = whole.at[:, : size - 2, : size - 2].set(pool)
        return (whole.at[:, size - 2 :, size - 2 :].set(outer(own) * jnp.eye(2)),)

    def limited(self) -> Self:
        return eqx.tree_at(lambda units: units.pool, self, self.pool.limited())

    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        """Of the pool, and the differential one of the strengths of units that fire, in nats."""
        drawn = jnp.log(self.deviation) + 0.5 * math.log(2 * math.pi * math.e)
        return self.pool.entropy(observation) + jnp.sum(self.prob(observation) * drawn)

    def enumerate(self) -> Array:
        raise ValueError(f"{type(self).__name__}: has infinitely many actions: real numbers")
