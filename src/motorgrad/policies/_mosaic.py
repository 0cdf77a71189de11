"""Modules of a predictor and a controller each, of which those act that predict well (MOSAIC)."""

from typing import Self

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies import abilities
from motorgrad.policies._arguments import SizedTask, sizes
from motorgrad.policies._delegating import Delegating
from motorgrad.policies._output_units import output_units
from motorgrad.policies._parameters import fixed, in_structure, with_fields
from motorgrad.policies._policy import Composed, Policy, check_plain
from motorgrad.policies._starting import POSITIVE, Initial, InitialPolicy, function_of
from motorgrad.schema import Range, count, static


class Mosaic(Delegating, Composed):
    r"""Controllers that act as far as the predictor beside each of them is responsible for what is observed (MOSAIC:
    Wolpert & Kawato, 1998; Haruno, Wolpert & Kawato, 2001).

    Each of $N$ modules has a forward model, here linear in the last observation $y$ and the last action $a$, which
    predicts the next observation $y'$. Responsibilities are the normalised likelihoods of these predictions under
    normal noise of the deviation $\sigma$:

    $$\hat y'_i = y + W_i\,(y, a, 1), \qquad
    \lambda_i = \frac{\exp(-\lVert y' - \hat y'_i \rVert^2/2\sigma^2)}
    {\sum_k \exp(-\lVert y' - \hat y'_k \rVert^2/2\sigma^2)}$$

    At the start of an episode nothing has been predicted, and $\lambda_i = 1/N$. Responsibilities gate the controllers:
    all are linear units, and their potentials, or the means of graded units, are added up with these weights. This is a
    pool that sees $\lambda \otimes (y, 1)$. So they also gate how the controllers learn: the score of module $i$ is
    $\lambda_i$ times that of a single controller. In the same way they gate how the predictors learn, by normalised
    least mean squares and from every observation that an action led to, whatever the reward:

    $$W_i \leftarrow W_i + \kappa\,\lambda_i\,(y' - \hat y'_i)\,x'/\lVert x \rVert^2, \qquad x = (y, a, 1)$$

    The predictors are no parameters of the policy, so that no gradient of the reward moves them. The memory is the last
    observation and the last action. Left out of the original are responsibility predictors, which guess from other
    senses which module will be responsible.

    **Arguments:** `pool`, the controllers: linear units with `modules * (observed + 1)` inputs; `predictors`
    $W$, `(modules, observed, observed + outputs + 1)`; `deviation` $\sigma$, one number or one for each observed
    number, which is then in units of its own; `rate` $\kappa$ from 0 to 1, 0 for predictors that are given.
    """

    pool: Policy
    predictors: Float[Array, "modules observed regressors"] = fixed(converter=jnp.asarray)
    deviation: Float[Array, " observed"] = fixed(converter=jnp.asarray, default=0.1)
    rate: Float[Array, ""] = fixed(converter=jnp.asarray, default=0.1)

    def __check_init__(self) -> None:
        check_plain("pool", self.pool)
        shape = self.predictors.shape
        wanted = "of shape (modules, observed, observed + outputs + 1)"
        right = len(shape) == 3 and shape[2] == shape[1] + self.pool.outputs + 1
        check(right, "predictors", shape, wanted)
        needed = self.modules * (shape[1] + 1)
        check(self.pool.inputs == needed, "pool.inputs", self.pool.inputs, f"{needed}, modules * (observed + 1)")
        fits = self.deviation.shape in ((), shape[1:2])
        check(fits, "deviation", self.deviation.shape, f"one number, or of shape {shape[1:2]}")

    @property
    def inner(self) -> Policy:
        return self.pool

    @property
    def modules(self) -> int:
        """The number of modules $N$."""
        return self.predictors.shape[0]

    @property
    def observation_size(self) -> int:
        return self.predictors.shape[1]

    @property
    def inputs(self) -> int:
        """The observation; the last one and the last action; whether there was one."""
        return 2 * self.observation_size + self.pool.outputs + 1

    def responsibilities(self, observation: Float[Array, " inputs"]) -> Float[Array, " modules"]:
        r"""$\lambda$, from the observation with what is remembered."""
        error, _, predicted = self._errors(observation)
        fits = -0.5 * jnp.sum((error / self.deviation) ** 2, axis=-1)
        return jax.nn.softmax(jnp.where(predicted, fits, 0))

    def _errors(
        self, observation: Float[Array, " inputs"]
    ) -> tuple[Float[Array, "modules observed"], Float[Array, " regressors"], Array]:
        """How wrong each predictor was, what they saw, and whether they predicted anything."""
        size = self.observation_size
        shown = observation[:size]
        last = observation[size : 2 * size]
        # with a constant 1 at the end, which is also what says that there was a last decision
        regressors = observation[size:]
        change = jnp.sum(self.predictors * regressors, axis=-1)
        return shown - last - change, regressors, observation[-1] > 0

    def seen(self, observation: Float[Array, " inputs"]) -> Float[Array, " features"]:
        shown = observation[: self.observation_size]
        one = jnp.ones(1, shown.dtype)
        return (self.responsibilities(observation)[:, None] * jnp.concatenate([shown, one])).ravel()

    def critic_observation(self, seen: Float[Array, " inputs"]) -> Float[Array, " observed"]:
        return seen[: self.observation_size]

    def initial_memory(self) -> Float[Array, " memory"]:
        return jnp.zeros(self.inputs - self.observation_size, self.predictors.dtype)

    def observation_with_memory(
        self, memory: Float[Array, " memory"] | None, observation: Float[Array, " observed"]
    ) -> Float[Array, " inputs"]:
        assert memory is not None
        return jnp.concatenate([observation, memory.astype(observation.dtype)])

    def remember(self, seen: Float[Array, " inputs"], action: Array) -> Float[Array, " memory"]:
        dtype = self.predictors.dtype
        chosen = jax.nn.one_hot(action, self.outputs, dtype=dtype) if self.actions == "discrete" else action
        shown = seen[: self.observation_size]
        return jnp.concatenate([shown.astype(dtype), chosen.astype(dtype), jnp.ones(1, dtype)])

    def entropy_estimate(
        self, observation: Float[Array, " inputs"], uniforms: Float[Array, " uniforms"]
    ) -> Float[Array, ""]:
        return abilities.entropy_estimate(self.pool, self.seen(observation), uniforms)

    def adapted(self, seen: Float[Array, " inputs"]) -> Self:
        """The policy after its predictors have learned from one more observation."""
        error, regressors, predicted = self._errors(seen)
        gate = self.responsibilities(seen) * jnp.where(predicted, self.rate, 0)
        size = jnp.where(predicted, jnp.sum(regressors**2), 1)
        step = gate[:, None, None] * error[:, :, None] * regressors / size
        return with_fields(self, predictors=(self.predictors + step).astype(self.predictors.dtype))

    def score(self, observation: Float[Array, " inputs"], action: Array) -> Self:
        return in_structure(self, pool=self.pool.score(self.seen(observation), action))

    def fisher(
        self, observation: Float[Array, " inputs"], action: Array
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        return abilities.fisher(self.pool, self.seen(observation), action)


class InitialMosaic(InitialPolicy):
    """Modules with random predictors of little change, and controllers with zero weights.

    The predictors' entries are drawn from a normal distribution, different for every seed and module: equal predictors
    would stay equal, and share every responsibility.
    """

    modules: int = count(4, 1, 10_000, help="the number of predictors, each with a controller of its own")
    deviation: float = static(
        0.1, allowed=POSITIVE, help="deviation of the noise on predictions, in the units of the observation"
    )
    rate: float = static(0.1, allowed=Range(0, 1), help="how fast predictors learn; 0 for never")
    spread: float = static(0.1, allowed=POSITIVE, help="deviation of the predictors' entries at first")
    output: str = static("", help="the controllers, a name of an initial policy; by default as of `layered`")

    def start(self, task: SizedTask | int) -> Initial:
        inputs, _ = sizes(task, self.units)
        make, _ = output_units(task, self.units, self.output)

        def made(key: jax.Array) -> Mosaic:
            pool = make(self.modules * (inputs + 1), jax.random.fold_in(key, 1))
            shape = (self.modules, inputs, inputs + pool.outputs + 1)
            predictors = self.spread * jax.random.normal(key, shape)
            return Mosaic(pool, predictors, jnp.asarray(self.deviation), jnp.asarray(self.rate))

        eqx.filter_eval_shape(made, jax.random.key(0))  # refuses impossible settings at once
        return made


mosaic = function_of(InitialMosaic)
