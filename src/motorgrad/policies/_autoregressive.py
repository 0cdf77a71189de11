"""Graded units whose noise lasts for several decisions."""

from typing import Any, Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float, PyTree

from motorgrad._errors import check
from motorgrad.policies import abilities
from motorgrad.policies._delegating import Delegating, units_of
from motorgrad.policies._parameters import fixed, in_structure, split, trainable, with_fields
from motorgrad.policies._policy import Composed, Policy
from motorgrad.policies._starting import Initial, InitialPolicy, then
from motorgrad.schema import Range, static

CORRELATION = Range(0, 1, open_high=True)


class Autoregressive(Delegating, Composed):
    r"""Graded units whose noise is correlated from decision to decision. An activation $x_i$ is drawn around a mix of
    the unit's location $m_i(y)$ and its last activation, a first-order autoregressive process (Korenkevych et al.,
    2019):

    $$x_t = (1 - \rho)\,m(y_t) + \rho\,x_{t-1} + \sqrt{1 - \rho^2}\,s\,\varepsilon_t, \qquad
    \varepsilon_t \sim \mathcal N(0, 1).$$

    While $m$ stays, $x$ has the mean $m$ and the standard deviation $s$, whatever the `autocorrelation` $\rho$ is, and
    the noise of decisions $k$ apart is correlated by $\rho^k$. A muscle and a limb average over quick noise, so that
    independent noise hardly moves them. Noise that lasts does, and the learner sees what the movement was worth.

    The last activation is the policy's memory, and a part of what the units see: $x = 0$ at the start of an episode. It
    depends on the past through the actions alone, so the score is exact, and batches may be used again. Bounded units
    mix the numbers before they are squashed or clipped. The most probable action is a low-pass filter of that without
    a memory, with a time constant of $-1/\log\rho$ decisions.

    Not `filtered`, the mean action stays as it is, and only the noise $n$ lasts:

    $$x_t = m(y_t) + n_t, \qquad n_t = \rho\,n_{t-1} + \sqrt{1 - \rho^2}\,s\,\varepsilon_t.$$

    The memory is then the last noise, $n = x - m(y)$. It depends on the parameters, which the score leaves out. So this
    is for learners that need no score, such as `SoftActorCritic`; others refuse it.

    **Arguments:** `policy`, graded hyperplanes with normal noise, or features or layers before them; `autocorrelation`
    $\rho$ in [0, 1), not trainable; `filtered`, whether the mean is filtered, too.

    **Raises:** `ValueError` for other units, and for a $\rho$ out of range.

    **Example:**

    ```python
    units = BoundedHyperplanes(weights=[[0.5, -1.0]], bias=[0.2], log_deviation=[-1.0])
    policy = Autoregressive(units, 0.8)
    seen = policy.observation_with_memory(policy.initial_memory(), jnp.array([0.3, 0.1]))
    action = policy.sample(seen, jax.random.uniform(key, (policy.uniforms,)))
    memory = policy.remember(seen, action)
    ```
    """

    policy: Policy
    autocorrelation: Float[Array, ""] = fixed(converter=jnp.asarray, default=0.8)
    filtered: bool = eqx.field(static=True, default=True)

    def __check_init__(self) -> None:
        pool = units_of(self.policy)
        units = "graded hyperplanes, which are normal, squashed or clipped"
        check(getattr(pool, "normal", False), "policy", type(pool).__name__, units)
        check(self.autocorrelation.shape == (), "autocorrelation", self.autocorrelation.shape, "one number")
        if not isinstance(self.autocorrelation, Tracer):  # a tracer has no value to check
            rho = float(np.asarray(self.autocorrelation))
            check(CORRELATION.allows(rho), "autocorrelation", rho, str(CORRELATION))

    @property
    def observation_size(self) -> int:
        return self.policy.inputs

    @property
    def inputs(self) -> int:
        return self.policy.inputs + self.policy.outputs

    @property
    def inner(self) -> Policy:
        return self.policy

    def seen(self, observation: Float[Array, " inputs"]) -> Float[Array, " observation"]:
        return observation[: self.observation_size]

    def acting(self, observation: Float[Array, " inputs"]) -> Policy:
        """The policy without a memory that acts alike after the last activation."""
        return self._given(observation, self.policy)

    @property
    def marginal(self) -> Any:
        return self.policy

    @property
    def remembers_parameters(self) -> bool:
        return not self.filtered

    @property
    def has_exact_score(self) -> bool:
        return self.filtered

    def initial_memory(self) -> Float[Array, " units"]:
        return jnp.zeros_like(units_of(self.policy).bias)

    def observation_with_memory(
        self, memory: Float[Array, " units"] | None, observation: Float[Array, " observation"]
    ) -> Float[Array, " inputs"]:
        assert memory is not None
        return jnp.concatenate([observation, memory.astype(observation.dtype)])

    def remember(self, seen: Float[Array, " inputs"], action: Array) -> Float[Array, " units"]:
        pool = units_of(self.policy)
        number = pool.number_before(action)
        if not self.filtered:
            number = number - pool.number_before(self.policy.mode(self.seen(seen)))
        return number.astype(pool.bias.dtype)

    def adapted(self, seen: Float[Array, " inputs"]) -> Self:
        policy = abilities.adapted(self.policy, self.seen(seen))
        return self if policy is self.policy else with_fields(self, policy=policy)

    def score(self, observation: Float[Array, " inputs"], action: Array) -> Self:
        score = self.acting(observation).score(self.seen(observation), action)
        return in_structure(self, policy=self._by_own_parameters(observation, score))

    def fisher(
        self, observation: Float[Array, " inputs"], action: Array
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        matrices = abilities.fisher(self.acting(observation), self.seen(observation), action)
        ones = jax.tree.map(jnp.ones_like, trainable(self.policy))
        factors = abilities.blocks(self.policy, self._by_own_parameters(observation, ones))
        return tuple(row[:, :, None] * row[:, None, :] * F for row, F in zip(factors, matrices, strict=True))

    def _given(self, seen: Float[Array, " inputs"], own: Policy) -> Any:
        """What acts alike after the last activation, for units whose `own` policy this is."""
        last = seen[self.observation_size :]
        rho = self.autocorrelation
        pool = units_of(own)
        rest = jnp.sqrt(1 - rho * rho)
        passed = 1 - rho if self.filtered else jnp.ones_like(rho)
        fields = {
            "weights": passed * pool.weights,
            "bias": passed * pool.bias + rho * last,
            "log_deviation": pool.log_deviation + jnp.log(rest),
            "floor": rest * pool.floor,
        }
        dtype = pool.bias.dtype
        return eqx.tree_at(units_of, own, with_fields(pool, **{name: x.astype(dtype) for name, x in fields.items()}))

    def _by_own_parameters(self, seen: Float[Array, " inputs"], gradient: PyTree) -> PyTree:
        """A gradient by the parameters of `_given` as one by the policy's own, which they are linear functions of, each
        of its own."""
        learned, settings = split(self.policy)
        _, pull = jax.vjp(lambda own: trainable(self._given(seen, eqx.combine(own, settings))), learned)
        return pull(gradient)[0]


class InitialLasting(InitialPolicy):
    """Graded units whose noise may last for several decisions."""

    autocorrelation: float = static(
        0.0,
        allowed=CORRELATION,
        help="correlation of the noise of two successive decisions; above 0, the policy is `Autoregressive`",
    )
    filtered: bool = static(
        True, help="whether the mean action is filtered like such noise, which keeps the score exact"
    )

    def lasting(self, made: Initial) -> Initial:
        """An initial policy with noise of this autocorrelation; unchanged if it is 0."""
        if self.autocorrelation == 0:
            return made
        rho = jnp.asarray(self.autocorrelation)
        return then(lambda policy: Autoregressive(policy, rho, self.filtered), made)
