"""Units that remember with a diagonal linear recurrence, and learn online by its exact gradient."""

import math
from typing import NamedTuple, Self

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from motorgrad._errors import check
from motorgrad.policies import abilities
from motorgrad.policies._arguments import SizedTask, sizes
from motorgrad.policies._delegating import Delegating
from motorgrad.policies._output_units import output_units
from motorgrad.policies._parameters import outer, trainable, with_fields
from motorgrad.policies._policy import Composed, Policy, check_shapes
from motorgrad.policies._starting import POSITIVE, Initial, InitialPolicy, function_of
from motorgrad.schema import Range, count, static

TIME_CONSTANTS = Range(0, 1e6, open_low=True, open_high=True)


class Recurrence(NamedTuple):
    r"""What recurrent units remember: their activations $h$, and the derivatives of each by the unit's own parameters,
    $\partial h_i/\partial\nu_i$, $\partial h_i/\partial w_i$ and $\partial h_i/\partial b_i$."""

    activation: Float[Array, " units"]
    log_rate: Float[Array, " units"]
    weights: Float[Array, "units observation"]
    bias: Float[Array, " units"]


class Recurrent(Delegating, Composed):
    r"""Output units on the observation and on recurrent units, each of which forgets at a rate of its own:

    $$h_t = a\,h_{t-1} + \sqrt{1 - a^2}\,(W y_t + b), \qquad a = \exp(-e^\nu) \in (0, 1),$$

    element by element, from $h = 0$ at the start of an episode. Output units see $(y_t, h_t)$. This is the linear
    recurrent unit of Orvieto et al. (2023) with real $a$; the factor $\sqrt{1 - a^2}$ gives $h$ the variance of the
    drive where that is white noise, whatever $a$ is.

    **Gradients are exact and online.** As units do not feed each other, $\partial h_i/\partial\theta$ is nonzero for
    the unit's own parameters only, and is carried along by the same recurrence (real-time recurrent learning; Zucchet
    et al., 2023; Javed et al., 2023): $\partial_w h \leftarrow a\,\partial_w h + \sqrt{1 - a^2}\,y$, and likewise for
    $b$ and $\nu$. The score is that of the output units, and for the recurrent ones $\partial\log\pi/\partial h$ times
    these derivatives. It needs as many numbers as there are parameters, however long the past is. The past's
    derivatives are those of the parameters as they were then: exact while these stay, and up to terms of the learning
    rate where they move.

    What the units see is the observation, $h$ and its derivatives; a critic sees the observation and $h$ only. Blocks
    of the natural gradient are one for each recurrent unit, then those of the output units. Their Fisher matrices are
    samples for the recurrent units.

    **Arguments:** `log_rate` $\nu$ and `bias` $b$ of shape `(units,)`, `weights` $W$ of shape `(units, observation)`;
    `output`, any policy without a memory, with one input for each observed number and each recurrent unit.

    **Example:**

    ```python
    slow = Recurrent(jnp.log([0.01]), [[1.0, 0.0]], [0.0], Hyperplanes(jnp.zeros((1, 3)), jnp.zeros(1)))
    slow.decay  # [0.99]: the unit forgets with a time constant of 100 decisions
    ```
    """

    log_rate: Float[Array, " units"] = eqx.field(converter=jnp.asarray)
    weights: Float[Array, "units observation"] = eqx.field(converter=jnp.asarray)
    bias: Float[Array, " units"] = eqx.field(converter=jnp.asarray)
    output: Policy

    def __check_init__(self) -> None:
        shape = self.weights.shape
        check(len(shape) == 2, "weights", shape, "of shape (units, observation)")
        check_shapes(self, shape[:1], "log_rate", "bias")
        check(not abilities.has_memory(self.output), "output", type(self.output).__name__, "a policy without a memory")
        words = f"{sum(shape)}: {shape[1]} observed numbers and {shape[0]} recurrent units"
        check(self.output.inputs == sum(shape), "output.inputs", self.output.inputs, words)

    @property
    def decay(self) -> Float[Array, " units"]:
        """$a$, the share of its activation that a unit keeps to the next decision."""
        return jnp.exp(-jnp.exp(self.log_rate))

    @property
    def observation_size(self) -> int:
        return self.weights.shape[-1]

    @property
    def inputs(self) -> int:
        units, observed = self.weights.shape
        return observed + units * (3 + observed)

    def initial_memory(self) -> Float[Array, " memory"]:
        return jnp.zeros(self.inputs - self.observation_size, self.weights.dtype)

    @property
    def remembers_parameters(self) -> bool:
        return True

    @property
    def has_exact_score(self) -> bool:
        return True

    def observation_with_memory(
        self, memory: Float[Array, " memory"] | None, observation: Float[Array, " observation"]
    ) -> Float[Array, " inputs"]:
        assert memory is not None
        before = self._unpacked(memory)
        a = self.decay
        gain = jnp.sqrt(-jnp.expm1(-2 * jnp.exp(self.log_rate)))  # √(1 − a²), also where a is almost 1
        slope = -jnp.exp(self.log_rate) * a  # ∂a/∂ν
        drive = jnp.sum(self.weights * observation, axis=-1) + self.bias
        now = Recurrence(
            activation=a * before.activation + gain * drive,
            log_rate=a * before.log_rate + slope * (before.activation - a / gain * drive),
            weights=a[:, None] * before.weights + gain[:, None] * observation,
            bias=a * before.bias + gain,
        )
        parts = [observation, *(part.ravel().astype(observation.dtype) for part in now)]
        return jnp.concatenate(parts)

    def remember(self, seen: Float[Array, " inputs"], action: Array) -> Float[Array, " memory"]:
        return seen[self.observation_size :].astype(self.weights.dtype)

    def critic_observation(self, seen: Float[Array, " inputs"]) -> Float[Array, " observation+units"]:
        return seen[: sum(self.weights.shape)]

    @property
    def inner(self) -> Policy:
        return self.output

    def seen(self, observation: Float[Array, " inputs"]) -> Float[Array, " observation+units"]:
        """What the output units see: as a number it does not depend on the recurrent units' present parameters, but its
        derivative by them is that of the past."""
        shown = observation[: self.observation_size]
        past = self._unpacked(observation[self.observation_size :])
        still = jax.lax.stop_gradient(self)
        moved = past.log_rate * (self.log_rate - still.log_rate) + past.bias * (self.bias - still.bias)
        moved = moved + jnp.sum(past.weights * (self.weights - still.weights), axis=-1)
        return jnp.concatenate([shown, past.activation + moved])

    def hidden_activations(self, observation: Float[Array, " inputs"]) -> tuple[Float[Array, " units"], ...]:
        """The activations $h$ of the recurrent units, then the output units' own hidden layers."""
        view = self.seen(observation)
        return (view[self.observation_size :], *abilities.hidden_activations(self.output, view))

    def score(self, observation: Float[Array, " inputs"], action: Array) -> Self:
        view = self.seen(observation)
        slope = jax.grad(self.output.log_prob)(view, action)[self.observation_size :]
        carried = self._unpacked(observation[self.observation_size :])
        own = {name: slope * getattr(carried, name) for name in ("log_rate", "bias")}
        weights = slope[:, None] * carried.weights
        return with_fields(trainable(self), **own, weights=weights, output=self.output.score(view, action))

    def blocks(self, gradient: PyTree) -> tuple[Float[Array, "units parameters"], ...]:
        """One row for each recurrent unit, then the blocks of the output units."""
        own = jnp.concatenate([gradient.log_rate[:, None], gradient.weights, gradient.bias[:, None]], axis=1)
        return (own, *abilities.blocks(self.output, gradient.output))

    def from_blocks(self, blocks: tuple[Float[Array, "units parameters"], ...]) -> Self:
        own, *rest = blocks
        output = abilities.from_blocks(self.output, tuple(rest))
        fields = {"log_rate": own[:, 0], "weights": own[:, 1:-1], "bias": own[:, -1]}
        return with_fields(trainable(self), **fields, output=output)

    def fisher(
        self, observation: Float[Array, " inputs"], action: Array
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        own, *_ = self.blocks(self.score(observation, action))
        return (outer(own), *abilities.fisher(self.output, self.seen(observation), action))

    def limited(self) -> Self:
        """The policy with time constants from 0.1 to a million decisions, so that no derivative overflows."""
        inside = jnp.clip(self.log_rate, -math.log(1e6), math.log(10))
        return with_fields(self, log_rate=inside, output=abilities.limited(self.output))

    def _unpacked(self, memory: Float[Array, " memory"]) -> Recurrence:
        units, observed = self.weights.shape
        h = memory[:units]
        rate = memory[units : 2 * units]
        rest = memory[2 * units :]
        return Recurrence(h, rate, rest[:-units].reshape(units, observed), rest[-units:])


class InitialRecurrent(InitialPolicy):
    r"""Output units on the observation and on recurrent units, which remember.

    The time constants of recurrent units are spread evenly on a logarithmic scale. Their weights are drawn from a
    normal distribution of standard deviation `scale` $/\sqrt{\text{inputs}}$, and their biases are 0.
    """

    units: int | None = count(None, 1, help="the number of output units, by default one for each action of the task")
    hidden: int = count(8, 1, help="the number of recurrent units")
    shortest: float = static(
        1.0, allowed=TIME_CONSTANTS, unit="decisions", help="the shortest time constant at the start"
    )
    longest: float = static(30.0, allowed=TIME_CONSTANTS, unit="decisions", help="the longest")
    scale: float = static(1.0, allowed=POSITIVE, help="the size of the initial weights of the recurrent units")
    output: str = static("", help="the output units, a name of an initial policy; by default as of `layered`")

    def validate(self) -> None:
        super().validate()
        times = (self.shortest, self.longest)
        check(self.shortest <= self.longest, "shortest, longest", times, "shortest <= longest")

    def start(self, task: SizedTask | int) -> Initial:
        inputs, _ = sizes(task, self.units)
        make, _ = output_units(task, self.units, self.output)

        def made(key: jax.Array) -> Recurrent:
            weights = self.scale / math.sqrt(inputs) * jax.random.normal(key, (self.hidden, inputs))
            log_rate = -jnp.linspace(math.log(self.shortest), math.log(self.longest), self.hidden)
            return Recurrent(
                log_rate, weights, jnp.zeros(self.hidden), make(inputs + self.hidden, jax.random.fold_in(key, 1))
            )

        made(jax.random.key(0))  # refuses impossible settings at once, not only when a key arrives
        return made


recurrent = function_of(InitialRecurrent)
