r"""Critics: value functions, by which an action is judged by the state that it led to.

$$\delta_t = r_{t+1} - \rho + \gamma\,v(y_{t+1}) - v(y_t)$$

takes the place of $r - b$. With a trace of decay $\gamma\lambda$ the samples $\delta_t z_t$ add up to every score times
its generalised advantage, $\sum_t s_t \sum_{k \ge 0} (\gamma\lambda)^k \delta_{t+k}$ (Schulman et al., 2016).
"""

import abc
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from motorgrad._errors import check
from motorgrad._running import RunningMean, add_sample, running_mean
from motorgrad._tree import Part, count, number, static
from motorgrad.learning._baselines import Advantage, Baseline, Transition
from motorgrad.learning._branching import NEVER, Flag, where, where_any
from motorgrad.policies import FeatureMap, Policy

Weights = Float[Array, " features"]


class CriticStep(NamedTuple):
    r"""What one decision tells a critic.

    `features` $\phi(y_t)$ and `next_features` $\phi(y_{t+1})$, 0 where the episode terminated; the `reward`, and the
    `level` $\rho$ that it is compared with; the temporal difference `error` $\delta$; $\gamma$ and $\lambda$,
    `discount` and `decay`.
    """

    features: Weights
    next_features: Weights
    reward: Float[Array, ""]
    level: Float[Array, ""]
    error: Float[Array, ""]
    discount: Any
    decay: Any


class CriticFit(Part):
    """How the weights of a linear critic are learned."""

    @abc.abstractmethod
    def init(self, weights: Weights) -> Any:
        """The state before any decision."""

    @abc.abstractmethod
    def update(self, weights: Weights, state: Any, step: CriticStep, dropped: Flag = False) -> tuple[Weights, Any]:
        """The weights and the state after one decision. One that is to be `dropped` changes nothing learned."""

    @abc.abstractmethod
    def restart(self, state: Any) -> Any:
        """The state at the start of an episode."""

    @property
    @abc.abstractmethod
    def mean_rate(self) -> Any:
        """One over the memory of the mean of rewards: the n-th moves it by at least this share of the distance."""

    def solve(self, weights: Weights, state: Any, level: Float[Array, ""]) -> tuple[Weights, Any]:
        """Do the work that is due once in many decisions, with rewards compared with the `level`."""
        return weights, state

    def rest(self, state: Any) -> Int[Array, ""]:
        """For how many decisions at least `solve` changes nothing."""
        return jnp.asarray(NEVER, jnp.int32)


class TemporalDifference(CriticFit):
    r"""TD(λ) with accumulating traces (Sutton, 1988; Tsitsiklis & Van Roy, 1999).

    $w \leftarrow w + \alpha\,\delta e$ with $e \leftarrow \gamma\lambda e + \phi$.

    **Arguments:**

    - `learning_rate`: $\alpha \ge 0$. Steps are stable where $\alpha$ times the squared length of the features is well
      below 1.
    - `level_rate`: in [0, 1]; the n-th reward moves the mean of rewards by $\max(1/n, \text{level rate})$ of its
      distance from it.
    """

    learning_rate: float = number(0.01, 0)
    level_rate: float = number(1e-3, 0, 1)

    @property
    def mean_rate(self) -> Any:
        return self.level_rate

    def init(self, weights: Weights) -> Weights:
        return weights

    def update(
        self, weights: Weights, state: Weights, step: CriticStep, dropped: Flag = False
    ) -> tuple[Weights, Weights]:
        trace = step.discount * step.decay * state + step.features
        return where(dropped, weights, weights + self.learning_rate * step.error * trace), trace

    def restart(self, state: Weights) -> Weights:
        return jnp.zeros_like(state)


class LeastSquaresState(NamedTuple):
    r"""The `trace` $e$; the `means` of $e d'$, $e r$ and $e$; their `sums` over the `gathered` decisions since."""

    trace: Weights
    means: RunningMean
    sums: tuple[Float[Array, "features features"], Weights, Weights]
    gathered: Int[Array, ""]


class LeastSquares(CriticFit):
    r"""Recursive least squares for temporal differences, LSTD(λ) (Bradtke & Barto, 1996; Boyan, 2002).

    The weights are those for which the temporal differences, weighted by the trace, have the mean 0:

    $$(A + d\,I)\,w = b, \qquad A = \overline{e\,(\phi_t - \gamma\phi_{t+1})'}, \qquad
    b = \overline{e\,r} - \rho\,\overline{e}.$$

    The means are running ones: the n-th decision moves them by $\max(1/(n + 1), \text{rate})$ of its distance from
    them. $A$ starts as `initial` times the identity, which counts as one decision. Without damping, these are the
    weights of the recursion by rank-one updates of $A^{-1}$. That recursion accumulates rounding errors, and while it
    forgets, directions in which nothing happens grow without bounds. So $A$ itself is kept and the system solved every
    `interval` decisions, which the means take in together. Between two solutions the weights do not change.

    **Arguments:**

    - `rate`: in [0, 1]; the means have a memory of 1/rate decisions. 0 forgets nothing, for a policy that stays.
    - `initial`: above 0, of the order of a squared feature.
    - `damping`: $d \ge 0$, in the same units. It bounds the weights where features hardly vary. Values of the average
      reward are known but for a constant; damping chooses small ones.
    - `interval` (decisions): from one solution to the next, at least 1.
    """

    rate: float = number(1e-3, 0, 1)
    initial: float = number(1.0, 0, open_low=True, at_start=True)
    damping: float = number(1e-3, 0)
    interval: int = count(100, 1)

    @property
    def mean_rate(self) -> Any:
        return self.rate  # the mean of rewards has the memory of the other means

    def init(self, weights: Weights) -> LeastSquaresState:
        matrix = self.initial * jnp.eye(weights.size, dtype=weights.dtype)
        started = running_mean((matrix, weights, weights))._replace(mean=(matrix, weights, weights))
        none = (jnp.zeros_like(matrix), weights, weights)
        return LeastSquaresState(weights, started._replace(count=started.count + 1), none, jnp.zeros((), jnp.int32))

    def update(
        self, weights: Weights, state: LeastSquaresState, step: CriticStep, dropped: Flag = False
    ) -> tuple[Weights, LeastSquaresState]:
        e = step.discount * step.decay * state.trace + step.features
        new = (e[:, None] * (step.features - step.discount * step.next_features), e * step.reward, e)
        one = jnp.ones((), jnp.int32)
        new, one = where(dropped, jax.tree.map(jnp.zeros_like, (new, one)), (new, one))
        sums = jax.tree.map(jnp.add, state.sums, new)
        return weights, state._replace(trace=e, sums=sums, gathered=state.gathered + one)

    def solve(
        self, weights: Weights, state: LeastSquaresState, level: Float[Array, ""]
    ) -> tuple[Weights, LeastSquaresState]:
        def solve(old: Any) -> Any:
            # The barrier keeps the compiler from working ahead of the loop in `where_any`.
            weights, state = old
            mean, state = jax.lax.optimization_barrier((level, state))
            block = jax.tree.map(lambda total: total / self.interval, state.sums)
            forgotten = -jnp.expm1(self.interval * jnp.log1p(-jnp.asarray(self.rate, weights.dtype)))
            means = add_sample(state.means, block, forgotten, self.interval)
            matrix, pay, trace = means.mean
            damped = matrix + self.damping * jnp.eye(weights.size, dtype=weights.dtype)
            solved = jnp.linalg.solve(damped, pay - mean * trace)
            solved = jnp.where(jnp.all(jnp.isfinite(solved)), solved, weights)  # a singular system has none yet
            empty = jax.tree.map(jnp.zeros_like, state.sums)
            return solved, LeastSquaresState(state.trace, means, empty, state.gathered * 0)

        return where_any(self.rest(state) < 0, solve, (weights, state))

    def rest(self, state: LeastSquaresState) -> Int[Array, ""]:
        return self.interval - 1 - state.gathered

    def restart(self, state: LeastSquaresState) -> LeastSquaresState:
        return state._replace(trace=jnp.zeros_like(state.trace))


class Features(FeatureMap):
    r"""What a linear critic sees of a decision: the inputs, and more (see `FeatureMap` for what is made of them).

    **Arguments:**

    - `squares`: whether the squares of the inputs are among the features.
    - `products`: whether the products of all pairs of inputs are.
    - `nonlinear`: how many nonlinear features there are.
    - `shape`: the kind of these: `"tanh"`, `"fourier"`, `"radial"` or `"grid"`.
    - `scale`: above 0; the greater, the shorter the distance between inputs that the nonlinear features tell apart.
    - `seed`: of the random numbers of the nonlinear features.
    - `actions`: whether it sees the previous action too, at whose effect the inputs may only hint; 0 at the start of an
      episode. A discrete action is a number for each alternative, 1 for the one that was taken.
    - `bias`: whether it has a constant input of 1 too. It is of no use for the average reward of a task without
      episodes, where values are known but for a constant.
    """

    actions: bool = static(False)
    bias: bool = static(True)

    def __call__(self, observation: Float[Array, " inputs"], previous: Float[Array, " action"]) -> Weights:
        parts = [self.expanded(observation)]
        parts += [previous] if self.actions else []
        parts += [jnp.ones(1, observation.dtype)] if self.bias else []
        return jnp.concatenate(parts)


class CriticState(NamedTuple):
    r"""`weights` of the features; the present decision's `features`, and the action `previous` to it; the mean of
    rewards, `reward`; `fit`, the state of the fitting rule."""

    weights: Weights
    features: Weights
    previous: Float[Array, " action"]
    reward: RunningMean
    fit: Any


class LinearCritic(Baseline):
    r"""A value function $v(y_t) = w \cdot \phi(y_t, a_{t-1})$, learned from rewards, and its temporal differences.

    Without a `discount` it is for the average reward: $\gamma = 1$, $\rho$ is the running mean of rewards, and $v$ is
    the *differential* value, the sum of what is yet to be earned above the mean, known but for a constant (Tsitsiklis &
    Van Roy, 1999). With a `discount` $\gamma$ there is no $\rho$, and $v$ is the discounted value.

    A state in which an episode *terminated* has the value 0; one in which it was *truncated* has the critic's value. A
    temporal difference is taken before the critic learns from it.

    **Arguments:**

    - `features`: $\phi$, `Features` or a `Part` of your own, called as `features(observation, previous)` with two
      vectors, which returns a vector.
    - `discount`: none for the average reward, or $\gamma \in [0, 1]$; 1 needs a task with episodes.
    - `decay`: $\lambda \in [0, 1]$ of the critic's own trace. The longer the trace, the less it matters that $\phi$
      cannot tell all states apart, and the noisier $v$ is. 1 for the average reward needs a task with episodes.
    - `fit`: how $w$ is learned, `TemporalDifference` or `LeastSquares`.

    **Raises:** `ValueError` for a value out of range; from `init`, for features that are no vector.

    ```python
    critic = mg.learning.LinearCritic(mg.learning.Features(squares=True), fit=mg.learning.TemporalDifference(0.05))
    agent = mg.Agent(policy, estimator=mg.learning.gae(critic, decay=0.9))
    ```
    """

    needs_decision: ClassVar[bool] = True

    features: Features | Callable[..., Any] = Features()
    discount: float | None = number(None, 0, 1)
    decay: float = number(0.9, 0, 1)
    fit: CriticFit = LeastSquares()

    def validate(self) -> None:
        made = callable(self.features) and isinstance(self.features, Part)
        check(made, "features", self.features, "a Part that can be called, such as Features()")

    @property
    def horizon(self) -> Any:
        r"""$\gamma$, the weight of the next state's value; 1 for the average reward."""
        return 1.0 if self.discount is None else self.discount

    @property
    def needs_episodes(self) -> str | None:
        if isinstance(self.discount, float) and self.discount == 1:
            return "discount = 1"
        return "decay = 1" if self.discount is None and isinstance(self.decay, float) and self.decay == 1 else None

    def init(self, policy: Policy, dtype: Any) -> CriticState:
        seen = jnp.zeros(policy.inputs, dtype)
        observation = policy.judged(seen)
        previous = jnp.zeros_like(_as_vector(policy, policy.mode(seen), dtype))
        shape = jax.eval_shape(self.features, observation, previous).shape
        check(len(shape) == 1 and shape[0] > 0, "features", f"of shape {shape}", "a vector")
        zeros = jnp.zeros(shape, dtype)
        return CriticState(zeros, zeros, previous, running_mean(jnp.zeros((), dtype)), self.fit.init(zeros))

    def level(self, state: CriticState) -> Float[Array, ""]:
        r"""The running mean of rewards, $\rho$."""
        return state.reward.mean

    def value_at(
        self, state: CriticState, observation: Float[Array, " inputs"], previous: Float[Array, " action"]
    ) -> Float[Array, ""]:
        """$v$ of an observation, with the action previous to it as `Features` takes it."""
        return jnp.sum(state.weights * self._features(state, observation, previous))

    def observe(self, state: CriticState, observation: Float[Array, " inputs"]) -> CriticState:
        return state._replace(features=self._features(state, observation, state.previous))

    def update(self, state: CriticState, policy: Policy, transition: Transition) -> tuple[Advantage, CriticState]:
        dtype, reward = state.weights.dtype, transition.reward
        previous = _as_vector(policy, transition.action, dtype)
        following = self._features(state, transition.next_observation, previous)
        if transition.terminated is not False:
            following = jnp.where(transition.terminated, 0, following)
        level = self._compared(state)
        change = state.features - self.horizon * following
        error = (reward - level - jnp.sum(state.weights * change)).astype(dtype)
        mean = add_sample(state.reward, reward, self.fit.mean_rate)
        mean = where(transition.diverged, state.reward, mean)
        seen = jnp.asarray(reward, dtype)
        step = CriticStep(state.features, following, seen, level, error, self.horizon, self.decay)
        weights, fit = self.fit.update(state.weights, state.fit, step, transition.diverged)
        return Advantage(error, error), CriticState(weights, state.features, previous, mean, fit)

    def solve(self, state: CriticState) -> CriticState:
        weights, fit = self.fit.solve(state.weights, state.fit, self._compared(state))
        return state._replace(weights=weights, fit=fit)

    def rest(self, state: CriticState) -> Int[Array, ""]:
        return self.fit.rest(state.fit)

    def restart(self, state: CriticState) -> CriticState:
        return state._replace(fit=self.fit.restart(state.fit), previous=jnp.zeros_like(state.previous))

    def _compared(self, state: CriticState) -> Float[Array, ""]:
        """What rewards are compared with: their mean, or 0 for discounted values."""
        return state.reward.mean if self.discount is None else jnp.zeros_like(state.reward.mean)

    def _features(self, state: CriticState, observation: Array, previous: Array) -> Weights:
        dtype = state.weights.dtype
        return self.features(observation.astype(dtype), previous.astype(dtype)).astype(dtype)


def _as_vector(policy: Policy, action: Array, dtype: Any) -> Float[Array, " action"]:
    """An action as a vector: a discrete one as a number for each alternative."""
    return action.astype(dtype) if action.ndim else jax.nn.one_hot(action, policy.outputs, dtype=dtype)
