r"""Critics: what a state is worth to the policy that is being learnt, by which an action is judged by where it led.

$$\delta_t = r_{t+1} - \rho + \gamma\,v(y_{t+1}) - v(y_t)$$

takes the place of $r - b$. With a trace of decay $\gamma\lambda$ the samples $\delta_t z_t$ add up to every score times
its generalised advantage, $\sum_t s_t \sum_{k \ge 0} (\gamma\lambda)^k \delta_{t+k}$ (Schulman et al., 2016).
"""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from motorgrad._errors import check
from motorgrad._running import RunningMean, add_sample, running_mean
from motorgrad.learning._choose import Flag, where
from motorgrad.learning._critic_fit import Evidence, LeastSquares, TemporalDifference
from motorgrad.policies import Policy


class CriticState(NamedTuple):
    r"""`weights` of the features; the present decision's `features`, and the action `previous` to it; the eligibility
    `trace` of the features; the `level` $\rho$; `fit`, what the fitting rule knows."""

    weights: Float[Array, " features"]
    features: Float[Array, " features"]
    previous: Float[Array, " action"]
    trace: Float[Array, " features"]
    level: RunningMean
    fit: Any


@dataclasses.dataclass(frozen=True)
class Features:
    r"""What a linear critic sees: the inputs, and more.

    **Arguments:**

    - `squares`: of the inputs too.
    - `actions`: the previous action too, at whose effect the inputs may only hint; 0 at the start of an episode. Of a
      discrete action, a number for each alternative, 1 for the one that was taken.
    - `bias`: 1 too. For the average reward of a task without episodes, where values are known but for a constant, it is
      of no use.
    """

    squares: bool = False
    actions: bool = False
    bias: bool = True

    def __call__(
        self, observation: Float[Array, " inputs"], previous: Float[Array, " action"]
    ) -> Float[Array, " features"]:
        parts = [observation]
        parts += [jnp.square(observation)] if self.squares else []
        parts += [previous] if self.actions else []
        parts += [jnp.ones(1, observation.dtype)] if self.bias else []
        return jnp.concatenate(parts)


@dataclasses.dataclass(frozen=True)
class LinearCritic:
    r"""A value function $v(y_t) = w \cdot \phi(y_t, a_{t-1})$, learnt from rewards, and its temporal differences.

    A `discount` of `None` is for the average reward: $\gamma = 1$, and $\rho$ is the running mean of rewards, so that
    $v$ is the *differential* value, the sum of what is yet to be earned above the mean, known but for a constant
    (Tsitsiklis & Van Roy, 1999). With a `discount` $\gamma$ there is no $\rho$, and $v$ is the discounted value.

    A state in which an episode *terminated* is worth nothing; one in which it was *truncated* what the critic says. A
    temporal difference is taken before the critic learns from it.

    **Arguments:**

    - `features` $\phi$: `Features`, or a frozen dataclass of your own, called as `features(observation, previous)`
      with two vectors, which gives a vector.
    - `discount`: `None`, or $\gamma \in [0, 1]$; 1 is for tasks with episodes.
    - `decay` $\lambda \in [0, 1]$ of the critic's own trace, $e \leftarrow \gamma\lambda e + \phi$. The longer, the
      less it matters that $\phi$ cannot tell all states apart, and the noisier $v$ is. Below 1 for the average reward
      of tasks without episodes.
    - `fit`: how $w$ is learnt, `TemporalDifference` or `LeastSquares`.

    **Raises:** `ValueError` for what is out of its range.
    """

    features: Callable[[Array, Array], Array] = dataclasses.field(default_factory=Features)
    discount: float | None = None
    decay: float = 0.9
    fit: TemporalDifference | LeastSquares = dataclasses.field(default_factory=LeastSquares)

    def __post_init__(self) -> None:
        made = callable(self.features) and dataclasses.is_dataclass(self.features)
        check(made, "features", self.features, "a function that is a dataclass of its settings, such as Features()")
        check(self.discount is None or 0 <= self.discount <= 1, "discount", self.discount, "None or in [0, 1]")
        check(0 <= self.decay <= 1, "decay", self.decay, "in [0, 1]")
        known = isinstance(self.fit, TemporalDifference | LeastSquares)
        check(known, "fit", self.fit, "a TemporalDifference or LeastSquares")

    @property
    def ahead(self) -> float:
        r"""$\gamma$, by which the next state counts; 1 for the average reward."""
        return 1.0 if self.discount is None else self.discount

    def init(self, dtype: Any, policy: Policy) -> CriticState:
        """The state before any decision, for what a policy sees and does. **Raises** `ValueError` for features that are
        no vector."""
        observation = jnp.zeros(policy.inputs, dtype)
        previous = jnp.zeros_like(_numbers(policy, policy.mode(observation), dtype))
        shape = jax.eval_shape(self.features, observation, previous).shape
        check(len(shape) == 1 and shape[0] > 0, "features", f"of shape {shape}", "a vector")
        zeros = jnp.zeros(shape, dtype)
        level = running_mean(jnp.zeros((), dtype))
        return CriticState(zeros, zeros, previous, zeros, level, self.fit.init(zeros))

    def value(self, state: CriticState) -> Float[Array, ""]:
        r"""The running mean of rewards, $\rho$."""
        return state.level.mean

    def value_at(
        self, state: CriticState, observation: Float[Array, " inputs"], previous: Float[Array, " action"]
    ) -> Float[Array, ""]:
        """$v$ of an observation, the action previous to it being given as `Features` takes it."""
        return jnp.sum(state.weights * self._features(state, observation, previous))

    def see(self, state: CriticState, observation: Float[Array, " inputs"]) -> CriticState:
        """Take in what the present action is chosen on."""
        return state._replace(features=self._features(state, observation, state.previous))

    def follow(
        self,
        state: CriticState,
        policy: Policy,
        action: Array,
        reward: Float[Array, ""],
        next_observation: Float[Array, " inputs"],
        terminated: Flag = False,
        dropped: Flag = False,
    ) -> tuple[Float[Array, ""], CriticState]:
        r"""The temporal difference $\delta$ of a reward, and the critic once it has taken it in; one that is to be
        `dropped` it does not take in."""
        dtype = state.weights.dtype
        previous = _numbers(policy, action, dtype)
        ahead = self._features(state, next_observation, previous)
        if terminated is not False:
            ahead = jnp.where(terminated, 0, ahead)
        change = state.features - self.ahead * ahead
        pay = reward - self._level(state)
        error = (pay - jnp.sum(state.weights * change)).astype(dtype)
        trace = self.ahead * self.decay * state.trace + state.features
        level = add_sample(state.level, reward, self.fit.level_rate)
        level = where(dropped, state.level, level)
        evidence = Evidence(trace, change, jnp.asarray(reward, dtype), error)
        weights, fit = self.fit.update(state.weights, state.fit, evidence, dropped)
        return error, state._replace(weights=weights, previous=previous, trace=trace, level=level, fit=fit)

    def solve(self, state: CriticState) -> CriticState:
        """The critic with the weights that follow from what it has taken in, where its `fit` does not move them at
        every decision; to be called after every `follow` but those of which `rest` says that they need it not."""
        weights, fit = self.fit.solve(state.weights, state.fit, self._level(state))
        return state._replace(weights=weights, fit=fit)

    def rest(self, state: CriticState) -> Int[Array, ""]:
        """How many decisions at least come before the one that `solve` is to follow."""
        return self.fit.rest(state.fit)

    def restart(self, state: CriticState) -> CriticState:
        """The state at the start of an episode: its trace is empty, and there was no action."""
        return state._replace(trace=jnp.zeros_like(state.trace), previous=jnp.zeros_like(state.previous))

    def _level(self, state: CriticState) -> Float[Array, ""]:
        """What rewards are compared with."""
        return state.level.mean if self.discount is None else jnp.zeros_like(state.level.mean)

    def _features(self, state: CriticState, observation: Array, previous: Array) -> Float[Array, " features"]:
        dtype = state.weights.dtype
        return self.features(observation.astype(dtype), previous.astype(dtype)).astype(dtype)


def _numbers(policy: Policy, action: Array, dtype: Any) -> Float[Array, " action"]:
    """An action as a vector: of a discrete one, a number for each alternative."""
    return action.astype(dtype) if action.ndim else jax.nn.one_hot(action, policy.outputs, dtype=dtype)
