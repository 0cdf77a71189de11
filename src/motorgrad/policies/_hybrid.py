"""Policies that combine binary decisions with real numbers: units of learned strength, and motor primitives."""

import math
from typing import Self, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from motorgrad._errors import check
from motorgrad.policies import abilities
from motorgrad.policies._arguments import SizedTask, sizes
from motorgrad.policies._binary import BinaryUnits, entropy_of, zero_hyperplanes
from motorgrad.policies._graded import GradedUnits, Noisy, StartsNoisy, check_floor, level_units, normal_of
from motorgrad.policies._local import InitialLaidOut, tiles
from motorgrad.policies._parameters import fixed, in_structure, is_plain, outer, per_unit, trainable
from motorgrad.policies._policy import Composed, Policy, check_shapes, has_rows
from motorgrad.policies._starting import POSITIVE, Initial, InitialPolicy, function_of
from motorgrad.schema import count, static

P = TypeVar("P", bound=Policy)


class GradedPool(Noisy, Policy):
    r"""Binary units with a learned strength, $a_i = f_i\,(m_i + s_i\,\varepsilon_i)$.

    $f_i \in \{0, 1\}$ is the decision of a pool and $\varepsilon_i \sim \mathcal N(0, 1)$ (section 6.5.4 of the thesis,
    with the stochastic real-valued units of section 6.2.3). The pool decides where a unit fires, the strength $m$ how
    strongly and in which direction it then acts. A silent unit contributes neither force nor noise, and its strength
    does not learn.

    The standard deviation is $s = s_{\min} + e^\lambda$. With $z = (a - m)/s$ the score is that of the pool for $f$,
    $f z/s$ for $m$ and $f (z^2 - 1)\,e^\lambda/s$ for $\lambda$.

    **Arguments:** `pool`, independent binary units, each with parameters of its own; `strength` $m$ and `log_deviation`
    $\lambda$, both `(units,)`; `floor` $s_{\min}$, the lower bound of the standard deviation, positive and not
    trainable.

    **Example:**

    ```python
    local = LocalGaussians(centre=[[0.3], [0.7]], log_width=[[-1.5], [-1.5]])
    policy = GradedPool(local, strength=[1.5, -0.5], log_deviation=[-1.4, -1.4])
    policy.mode(jnp.array([0.3]))  # [1.5, 0.0]: only the first unit is likely to fire
    ```
    """

    pool: BinaryUnits
    strength: Float[Array, " units"] = eqx.field(converter=jnp.asarray)
    log_deviation: Float[Array, " units"] = eqx.field(converter=jnp.asarray)
    floor: Float[Array, ""] = fixed(converter=jnp.asarray, default=0.05)

    def __check_init__(self) -> None:
        kind = type(self.pool).__name__
        check(isinstance(self.pool, BinaryUnits), "pool", kind, "a pool of binary units")
        check(has_rows(self.pool) and self.pool.independent, "pool", kind, "independent units of one kind")
        check_shapes(self, (self.pool.outputs,), "strength", "log_deviation")
        check_floor(self.floor)

    @property
    def inputs(self) -> int:
        return self.pool.inputs

    @property
    def outputs(self) -> int:
        return self.pool.outputs

    @property
    def uniforms(self) -> int:
        """The pool's, plus one per unit for its strength."""
        return self.pool.uniforms + self.outputs

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        """Firing probability of each unit."""
        return self.pool.prob(observation)

    def sample(
        self, observation: Float[Array, " inputs"], uniforms: Float[Array, " uniforms"]
    ) -> Float[Array, " units"]:
        fires = self.pool.sample(observation, uniforms[: self.pool.uniforms])
        noise = normal_of(uniforms[self.pool.uniforms :])
        strength = self.strength + self.deviation * noise.astype(self.strength.dtype)
        # A strength of exactly 0 would be read as silence.
        return jnp.where(fires > 0, jnp.where(strength == 0, jnp.finfo(strength.dtype).tiny, strength), 0.0)

    def mode(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        """The mean strength of the units that fire with probability above one half."""
        return jnp.where(self.pool.mode(observation) > 0, self.strength, 0.0)

    def log_prob(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, ""]:
        """Log-density, with respect to Lebesgue measure for units that fire and counting measure for silence."""
        fires, z = self._fires_and_z(action)
        drawn = -0.5 * z**2 - jnp.log(self.deviation) - 0.5 * math.log(2 * math.pi)
        return self.pool.log_prob(observation, fires) + jnp.sum(fires * drawn)

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Self:
        fires, z = self._fires_and_z(action)
        return in_structure(
            self,
            pool=self.pool.score(observation, fires),
            strength=fires * z / self.deviation,
            log_deviation=fires * (z * z - 1) * self._log_deviation_slope(),
        )

    def _fires_and_z(self, action: Float[Array, " units"]) -> tuple[Float[Array, " units"], Float[Array, " units"]]:
        """The units that fired, and each strength's distance from its mean in standard deviations."""
        return (action != 0).astype(self.strength.dtype), (action - self.strength) / self.deviation

    def blocks(self, gradient: PyTree) -> tuple[Float[Array, "units parameters"], ...]:
        """One row per unit: the pool's parameters, the strength, the log-deviation."""
        (rows,) = abilities.blocks(self.pool, gradient.pool)
        return (jnp.concatenate([rows, gradient.strength[:, None], gradient.log_deviation[:, None]], axis=1),)

    def from_blocks(self, blocks: tuple[Float[Array, "units parameters"], ...]) -> Self:
        (rows,) = blocks
        pool = abilities.from_blocks(self.pool, (rows[:, :-2],))
        return in_structure(self, pool=pool, strength=rows[:, -2], log_deviation=rows[:, -1])

    def fisher(
        self, observation: Float[Array, " inputs"], action: Float[Array, " units"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        r"""Exact: the pool's matrix, $p/s^2$ for $m$ and $2 p\,(e^\lambda/s)^2$ for $\lambda$, without cross terms."""
        fires, _ = self._fires_and_z(action)
        (pool,) = abilities.fisher(self.pool, observation, fires)
        p = self.prob(observation)
        own = jnp.stack([1 / self.deviation, math.sqrt(2) * self._log_deviation_slope()], axis=1)
        own = own * jnp.sqrt(p)[:, None]
        # Block diagonal, in the order of `blocks`: the pool's parameters first.
        (row,) = self.blocks(trainable(self))
        size = row.shape[1]
        whole = jnp.zeros((self.outputs, size, size), row.dtype)
        whole = whole.at[:, : size - 2, : size - 2].set(pool)
        return (whole.at[:, size - 2 :, size - 2 :].set(outer(own) * jnp.eye(2)),)

    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        """Entropy of the pool plus the differential entropy of the strengths of firing units, in nats."""
        drawn = jnp.log(self.deviation) + 0.5 * math.log(2 * math.pi * math.e)
        return self.pool.entropy(observation) + jnp.sum(self.prob(observation) * drawn)


class Primitives(Composed):
    r"""$N$ motor primitives with $K$ movement parameters each (section 5.4.1 of the thesis).

    A unit of `precondition` decides whether its primitive starts. If it does, $K$ units of `movement` draw its movement
    parameters. The first $N$ observed numbers are flags: 1 for a primitive that can start now, 0 for one that cannot,
    for example because it is already running. Both kinds of units see the rest $y$ of the observation. With the flags
    $c_i$ and the decisions $f_i$,

    $$\log\pi = \sum_i c_i \log\pi_i(f_i \mid y) + \sum_i f_i \sum_k \log\pi_{ik}(a_{ik} \mid y).$$

    So a choice without effect has no score: neither the precondition of a primitive that cannot start, nor the movement
    parameters of one that does not start.

    The action is $f$, then the movement parameters of the first primitive, of the second and so on; they are 0 for a
    primitive that does not start. The Fisher matrix has no cross terms between preconditions and movements.

    **Arguments:** `precondition`, $N$ independent binary units; `movement`, $N K$ graded units over the same inputs.
    Each unit must have parameters of its own.

    **Example:**

    ```python
    steps = Primitives(
        precondition=Hyperplanes(weights=[[-5.0]], bias=[-1.0]),
        movement=GradedHyperplanes(weights=[[0.4]], bias=[-0.2], log_deviation=[-1.6]),
    )
    steps.prob(jnp.array([1.0, -0.5]))  # [0.82, -0.4]: probability of starting, mean of its parameter
    steps.prob(jnp.array([0.0, -0.5]))  # [0.0, -0.4]: it cannot start now
    ```
    """

    precondition: BinaryUnits
    movement: GradedUnits

    def __check_init__(self) -> None:
        for name, pool, kind in (
            ("precondition", self.precondition, BinaryUnits),
            ("movement", self.movement, GradedUnits),
        ):
            given = type(pool).__name__
            check(isinstance(pool, kind), name, given, f"a pool of {kind.__name__}")
            check(has_rows(pool) and is_plain(pool), name, given, "units of one kind with parameters of their own")
        check(self.precondition.independent, "precondition", type(self.precondition).__name__, "independent units")
        count, inputs = self.precondition.outputs, self.precondition.inputs
        size = self.movement.outputs
        check(size % count == 0, "movement.outputs", size, f"a multiple of the {count} preconditions")
        check(self.movement.inputs == inputs, "movement.inputs", self.movement.inputs, f"{inputs}, the precondition's")

    @property
    def primitives(self) -> int:
        """The number of primitives $N$."""
        return self.precondition.outputs

    @property
    def inputs(self) -> int:
        return self.primitives + self.precondition.inputs

    @property
    def outputs(self) -> int:
        return self.primitives + self.movement.outputs

    @property
    def actions(self) -> str:
        return "continuous"

    @property
    def uniforms(self) -> int:
        return self.precondition.uniforms + self.movement.uniforms

    def _flags_and_rest(
        self, observation: Float[Array, " inputs"]
    ) -> tuple[Float[Array, " primitives"], Float[Array, " rest"]]:
        """Flags of the primitives that can start, and the rest of the observation."""
        return (observation[: self.primitives] > 0.5) * 1.0, observation[self.primitives :]

    def _per_parameter(self, primitives: Float[Array, " primitives"]) -> Float[Array, " movement"]:
        """Repeat a number of each primitive for all its movement parameters."""
        return jnp.repeat(primitives, self.movement.outputs // self.primitives)

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " outputs"]:
        """The probability that each primitive starts, then the mean of each movement parameter if it does."""
        can_start, rest = self._flags_and_rest(observation)
        return jnp.concatenate([can_start * self.precondition.prob(rest), self.movement.prob(rest)])

    def sample(self, observation: Float[Array, " inputs"], uniforms: Float[Array, " uniforms"]) -> Array:
        can_start, rest = self._flags_and_rest(observation)
        first = self.precondition.uniforms
        starts = can_start * self.precondition.sample(rest, uniforms[:first])
        return jnp.concatenate([starts, self._per_parameter(starts) * self.movement.sample(rest, uniforms[first:])])

    def mode(self, observation: Float[Array, " inputs"]) -> Array:
        """A primitive starts if its probability is above one half, with the means of its movement parameters."""
        can_start, rest = self._flags_and_rest(observation)
        starts = can_start * self.precondition.mode(rest)
        return jnp.concatenate([starts, self._per_parameter(starts) * self.movement.mode(rest)])

    def log_prob(self, observation: Float[Array, " inputs"], action: Array) -> Float[Array, ""]:
        can_start, rest = self._flags_and_rest(observation)
        starts = action[: self.primitives]
        movements = action[self.primitives :]
        precondition = jnp.sum(can_start * self.precondition.log_probs(rest, starts))
        return precondition + jnp.sum(self._per_parameter(starts) * self.movement.log_probs(rest, movements))

    def score(self, observation: Float[Array, " inputs"], action: Array) -> Self:
        can_start, rest = self._flags_and_rest(observation)
        starts = action[: self.primitives]
        movements = action[self.primitives :]
        return in_structure(
            self,
            precondition=_masked_rows(can_start, self.precondition.score(rest, starts)),
            movement=_masked_rows(self._per_parameter(starts), self.movement.score(rest, movements)),
        )

    def fisher(
        self, observation: Float[Array, " inputs"], action: Array
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        """Exact: the units' own matrices, times the probability that their choice has an effect."""
        can_start, rest = self._flags_and_rest(observation)
        starts = can_start * self.precondition.prob(rest)
        (precondition,) = abilities.fisher(self.precondition, rest, action[: self.primitives])
        (movement,) = abilities.fisher(self.movement, rest, action[self.primitives :])
        return can_start[:, None, None] * precondition, self._per_parameter(starts)[:, None, None] * movement

    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        """Entropy of the starts plus the differential entropy of the movement parameters of what starts, in nats."""
        can_start, rest = self._flags_and_rest(observation)
        starts = can_start * self.precondition.prob(rest)
        return entropy_of(starts) + jnp.sum(self._per_parameter(starts) * self.movement.entropies(rest))


def _masked_rows(mask: Float[Array, " units"], score: P) -> P:
    """The rows of a score where the mask is above 0, and zeros elsewhere."""
    return jax.tree.map(lambda x: jnp.where(per_unit(mask, x) > 0, x, 0), score)


class InitialGradedTiles(StartsNoisy, InitialLaidOut):
    """Local Gaussian units laid out by `tiles`, which act with a learned `strength` when they fire.

    A negative strength acts against the force of the unit.
    """

    strength: float = static(0.0, help="the mean strength of every unit at the start")
    deviation: float = static(0.5, allowed=POSITIVE, help="the standard deviation of the strength at the start")
    floor: float = static(0.05, allowed=POSITIVE, help="the least standard deviation that learning may reach")

    def start(self, task: SizedTask | int) -> Initial:
        pool = tiles(task, self.units, self.copies, self.width, self.p_max)
        log_deviation, floor = self.noise(pool.outputs)
        return GradedPool(pool, jnp.full_like(log_deviation, self.strength), log_deviation, floor)


graded_tiles = function_of(InitialGradedTiles)


class InitialPrimitives(StartsNoisy, InitialPolicy):
    """Motor primitives, each of which starts with probability one half whenever it can.

    The movement parameters have mean 0.
    """

    units: int | None = count(
        None,
        1,
        help="the length of an action: `count`, plus equally many parameters for each primitive; by default the task's",
    )
    count: int = count(2, 1, help="the number of primitives")
    deviation: float = static(
        0.3, allowed=POSITIVE, help="the standard deviation of the movement parameters at the start"
    )
    floor: float = static(0.02, allowed=POSITIVE, help="the least standard deviation that learning may reach")

    def start(self, task: SizedTask | int) -> Initial:
        inputs, outputs = sizes(task, self.units)
        fits = outputs % self.count == 0 and outputs > self.count
        check(fits, "count", self.count, f"a divisor of {outputs}, below it")
        check(inputs > self.count, "inputs", inputs, f"more than the {self.count} flags of primitives that can start")
        seen = inputs - self.count
        return Primitives(zero_hyperplanes(seen, self.count), level_units(seen, outputs - self.count, 0.0, self))


primitives = function_of(InitialPrimitives)
