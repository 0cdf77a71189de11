r"""Critics: value functions, which judge an action by the state to which it led.

$$\delta_t = r_{t+1} - \rho + \gamma\,v(y_{t+1}) - v(y_t)$$

takes the place of $r - b$. With a trace of decay $\gamma\lambda$ the samples $\delta_t z_t$ add up to every score times
its generalised advantage, $\sum_t s_t \sum_{k \ge 0} (\gamma\lambda)^k \delta_{t+k}$ (Schulman et al., 2016).
"""

import abc
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.typing import DTypeLike
from jaxtyping import Array, Float, Int, PyTree

from motorgrad._branching import Flag, where
from motorgrad._errors import check
from motorgrad._running import RunningMean, running_mean
from motorgrad.learning._baselines import Advantage, Baseline
from motorgrad.learning._centring import Centring, SimpleCentring
from motorgrad.learning._critic_fits import CriticFit, CriticStep, LeastSquares, Weights
from motorgrad.learning._learner import Transition
from motorgrad.learning._overshooting import BoundedTemporalDifference
from motorgrad.policies import (
    Architecture,
    FeatureMap,
    MultilayerPerceptron,
    Policy,
    abilities,
    adapted,
    frozen,
    split,
    thawed,
)
from motorgrad.schema import Part, inner, number, static


class Features(FeatureMap):
    """The features of a linear critic: the inputs, and functions of them (see `FeatureMap`)."""

    actions: bool = static(
        False,
        help="whether the critic also sees the previous action, whose effect the inputs may only hint at: 0 at the "
        "start of an episode, and a discrete one as a number per alternative, 1 for the one that was taken",
    )
    bias: bool = static(
        True,
        help="whether the critic also has a constant input of 1, useless for the average reward of a task without "
        "episodes, whose values are known only up to a constant",
    )

    def __call__(
        self, observation: Float[Array, "*decisions inputs"], previous: Float[Array, "*decisions action"] | None = None
    ) -> Float[Array, "*decisions features"]:
        parts = [self.expanded(observation)]
        parts += [previous] if self.actions and previous is not None else []
        parts += [jnp.ones((*observation.shape[:-1], 1), observation.dtype)] if self.bias else []
        return jnp.concatenate(parts, axis=-1)


def check_blind(features: Features) -> None:
    """Refuse features that see the previous action."""
    check(not features.actions, "features.actions", True, "False")


def endless(discount: float | None, decay: float) -> str | None:
    """The setting by which a value, or the trace that learns it, has no end but that of an episode; `None` where there
    is none."""
    if isinstance(discount, float) and discount == 1:
        return "discount = 1"
    return "decay = 1" if discount is None and isinstance(decay, float) and decay == 1 else None


class CriticState(NamedTuple):
    r"""The `weights`; the present decision's `features`, and the action `previous` to it; the level of rewards $\rho$,
    `reward`: their mean, or what `ValueBasedCentring` has found; `fit`, the state of the fitting rule."""

    weights: PyTree
    features: Weights
    previous: Float[Array, " action"]
    reward: RunningMean
    fit: PyTree


class Critic(Baseline):
    r"""A value function $v(y_t) = f_w(\phi(y_t, a_{t-1}))$, and its temporal differences. Subclasses define $f$."""

    features: Features | Callable[..., Any] = inner(
        Features(),
        help=r"$\phi$, `Features` or a `Part` of your own, called as `features(observation, previous)` with two "
        r"vectors, which returns a vector; their scale should be about 1 for a network",
    )
    discount: float | None = number(
        None, 0, 1, help=r"none for the average reward, or $\gamma$; 1 needs a task with episodes"
    )
    decay: float = number(
        0.9,
        0,
        1,
        help=r"$\lambda$ of the critic's own trace. The longer the trace, the less it matters that $\phi$ cannot tell "
        r"all states apart, and the noisier $v$ is. 1 for the average reward needs a task with episodes",
    )
    fit: CriticFit = inner(LeastSquares(), help="how $w$ is learned, `TemporalDifference` or `LeastSquares`")
    centring: eqx.AbstractVar[Centring | None]  # pyright: ignore[reportGeneralTypeIssues]

    @abc.abstractmethod
    def first_weights(self, features: int, dtype: DTypeLike, key: jax.Array) -> PyTree:
        """The weights before any reward, for this number of features."""

    @abc.abstractmethod
    def value(self, weights: PyTree, features: Weights) -> Float[Array, ""]:
        """The value of the features."""

    @abc.abstractmethod
    def fall(
        self, weights: PyTree, features: Weights, following: Weights, terminated: Flag
    ) -> tuple[Float[Array, ""], PyTree, PyTree]:
        r"""$v(y_t) - \gamma v(y_{t+1})$, the slope $\nabla_w v(y_t)$, and what `CriticStep` calls `next_features`."""

    def validate(self) -> None:
        made = callable(self.features) and isinstance(self.features, Part)
        check(made, "features", self.features, "a Part that can be called, such as Features()")
        if self.centring is not None and self.discount is not None and not self.fit.leaves_errors:
            name = type(self.fit).__name__
            errors = f"None or SimpleCentring with the fit {name}, which leaves no temporal difference to learn from"
            check(not self.centring.reads_errors, "centring", type(self.centring).__name__, errors)

    @property
    def horizon(self) -> float:
        r"""$\gamma$, the weight of the next state's value; 1 for the average reward."""
        return 1.0 if self.discount is None else self.discount

    @property
    def needs_episodes(self) -> str | None:
        return endless(self.discount, self.decay)

    def init(self, policy: Policy, dtype: DTypeLike) -> CriticState:
        return self.start(policy, dtype, jax.random.key(0))

    def start(self, policy: Policy, dtype: DTypeLike, key: jax.Array) -> CriticState:
        seen = jnp.zeros(policy.inputs, dtype)
        observation = abilities.critic_observation(policy, seen)
        previous = jnp.zeros_like(as_vector(policy, policy.mode(seen), dtype))
        shape = jax.eval_shape(self.features, observation, previous).shape
        check(len(shape) == 1 and shape[0] > 0, "features", f"of shape {shape}", "a vector")
        weights = self.first_weights(shape[0], dtype, key)
        learned = split(weights)[0] if isinstance(weights, eqx.Module) else weights
        fit = self.fit.init(jax.tree.map(jnp.zeros_like, learned), shape[0])
        return CriticState(weights, jnp.zeros(shape, dtype), previous, running_mean(jnp.zeros((), dtype)), fit)

    def level(self, state: CriticState) -> Float[Array, ""]:
        r"""The level of rewards, $\rho$."""
        return state.reward.mean

    def value_at(
        self, state: CriticState, observation: Float[Array, " inputs"], previous: Float[Array, " action"]
    ) -> Float[Array, ""]:
        """$v$ of an observation, with the action previous to it as `Features` takes it."""
        return self.value(state.weights, self._features(state, observation, previous))

    def observe(self, state: CriticState, observation: Float[Array, " inputs"]) -> CriticState:
        return state._replace(features=self._features(state, observation, state.previous))

    def update(self, state: CriticState, policy: Policy, transition: Transition) -> tuple[Advantage, CriticState]:
        dtype, reward = state.features.dtype, transition.reward
        previous = as_vector(policy, transition.action, dtype)
        following = self._features(state, transition.next_observation, previous)
        level = self.compared(state)
        fall, slope, next_features = self.fall(state.weights, state.features, following, transition.terminated)
        error = (reward - level - fall).astype(dtype)
        centring = SimpleCentring() if self.centring is None else self.centring
        mean = centring.follow(state.reward, reward, error, self.fit.mean_rate)
        mean = where(transition.diverged, state.reward, mean)
        seen = jnp.asarray(reward, dtype)
        observed = (state.features, following, transition.terminated)
        step = CriticStep(slope, next_features, seen, level, error, self.horizon, self.decay, *observed)
        weights, fit = self.fit.update(state.weights, state.fit, step, transition.diverged)
        return Advantage(error, error), CriticState(weights, state.features, previous, mean, fit)

    def solve(self, state: CriticState) -> CriticState:
        weights, fit = self.fit.solve(state.weights, state.fit, self.compared(state), self)
        return state._replace(weights=weights, fit=fit)

    def decisions_until_due(self, state: CriticState) -> Int[Array, ""]:
        return self.fit.decisions_until_due(state.fit)

    def restart(self, state: CriticState) -> CriticState:
        return state._replace(fit=self.fit.restart(state.fit), previous=jnp.zeros_like(state.previous))

    def compared(self, state: CriticState) -> Float[Array, ""]:
        """What rewards are compared with: their level, or 0 for discounted values without centring."""
        centred = self.discount is None or self.centring is not None
        return state.reward.mean if centred else jnp.zeros_like(state.reward.mean)

    def _features(self, state: CriticState, observation: Array, previous: Array) -> Weights:
        dtype = state.features.dtype
        return self.features(observation.astype(dtype), previous.astype(dtype)).astype(dtype)


class LinearCritic(Critic):
    r"""A value function $v(y_t) = w \cdot \phi(y_t, a_{t-1})$, learned from rewards, and its temporal differences.

    Without a `discount` it is for the average reward: $\gamma = 1$, $\rho$ is the running mean of rewards, and $v$ is
    the *differential* value, the sum of what is yet to be earned above the mean, known but for a constant (Tsitsiklis &
    Van Roy, 1999). With a `discount` $\gamma$ there is no $\rho$, unless rewards are centred, and $v$ is the
    discounted value.

    A state in which an episode *terminated* has the value 0; one in which it was *truncated* has the critic's value. A
    temporal difference is taken before the critic learns from it.

    **Raises:** `ValueError` for a value out of range; from `init`, for features that are no vector.

    ```python
    critic = mg.learning.LinearCritic(mg.learning.Features(squares=True), fit=mg.learning.TemporalDifference(0.05))
    agent = mg.Agent(policy, estimator=mg.learning.gae(critic, decay=0.9))
    ```
    """

    centring: Centring | None = inner(
        None,
        help=r"none, or how the level $\rho$ that rewards are compared with is learned, `SimpleCentring` or "
        r"`ValueBasedCentring`. None is `SimpleCentring` for the average reward, and no $\rho$ for discounted values",
    )

    def first_weights(self, features: int, dtype: DTypeLike, key: jax.Array) -> Weights:
        return jnp.zeros(features, dtype)

    def value(self, weights: Weights, features: Weights) -> Float[Array, ""]:
        return jnp.sum(weights * features)

    def fall(
        self, weights: Weights, features: Weights, following: Weights, terminated: Flag
    ) -> tuple[Float[Array, ""], Weights, Weights]:
        following = following if terminated is False else jnp.where(terminated, 0, following)
        return jnp.sum(weights * (features - self.horizon * following)), features, following


class ValueNetwork(eqx.Module):
    r"""Hidden layers, and a value linear in their output, $v = w \cdot h + b$."""

    layers: Any
    weights: Float[Array, " features"]
    bias: Float[Array, ""]

    def __call__(self, features: Weights) -> Float[Array, ""]:
        return jnp.sum(self.weights * thawed(self.layers)(features)) + self.bias


def value_network(network: Architecture, inputs: int, dtype: DTypeLike, key: jax.Array) -> ValueNetwork:
    """A network that sees so many `inputs`; the `key` draws its hidden layers, and its value is 0."""
    layers = frozen(network.build(inputs, key))
    layers = jax.tree.map(lambda leaf: leaf.astype(dtype) if eqx.is_inexact_array(leaf) else leaf, layers)
    size = jax.eval_shape(lambda layers, x: thawed(layers)(x), layers, jnp.zeros(inputs, dtype)).shape
    check(len(size) == 1 and size[0] > 0, "network", f"of output {size}", "one that returns a vector")
    return ValueNetwork(layers, jnp.zeros(size, dtype), jnp.zeros((), dtype))


class NetworkCritic(Critic):
    r"""A value function with hidden layers, $v(y_t) = w \cdot h(\phi(y_t, a_{t-1})) + b$, that all learn.

    Discount, levels and ends of episodes are those of `LinearCritic`. Every seed has hidden layers of its own, and $w$
    starts at 0. The steps are those of semi-gradient TD(λ): without bootstrapping ($\gamma\lambda = 1$) they descend
    the squared error; with it, nothing keeps them from diverging, but for the bound of `BoundedTemporalDifference`.

    **Raises:** `ValueError` for a value out of range, and for a `fit` that is for linear critics.

    ```python
    critic = mg.learning.NetworkCritic(discount=0.99, decay=0.8)
    agent = mg.Agent(policy, estimator=mg.learning.gae(critic, decay=0.8, update_every=1))
    ```
    """

    starts_at_random: ClassVar[bool] = True

    features: Features | Callable[..., Any] = Features(bias=False)
    decay: float = 0.8
    fit: CriticFit = inner(
        BoundedTemporalDifference(),
        help="how the parameters are learned: at every decision by `BoundedTemporalDifference` or "
        "`TemporalDifference`, batch by batch by `FittedReturns`",
    )
    network: Architecture = inner(MultilayerPerceptron(), help="the hidden layers")
    centring: Centring | None = inner(
        None, help=r"none, or how the level $\rho$ of rewards is learned, as for `LinearCritic`"
    )

    def validate(self) -> None:
        super().validate()
        check(not self.fit.linear, "fit", type(self.fit).__name__, "one for any function, such as TemporalDifference")

    def update(self, state: CriticState, policy: Policy, transition: Transition) -> tuple[Advantage, CriticState]:
        weights, dtype = state.weights, state.features.dtype
        following = self._features(state, transition.next_observation, as_vector(policy, transition.action, dtype))
        layers = adapted(weights.layers, following)
        if layers is not weights.layers:
            seen = eqx.tree_at(lambda each: each.layers, weights, layers)
            state = state._replace(weights=where(transition.diverged, weights, seen))
        return super().update(state, policy, transition)

    def first_weights(self, features: int, dtype: DTypeLike, key: jax.Array) -> ValueNetwork:
        return value_network(self.network, features, dtype, key)

    def value(self, weights: ValueNetwork, features: Weights) -> Float[Array, ""]:
        return weights(features)

    def fall(
        self, weights: ValueNetwork, features: Weights, following: Weights, terminated: Flag
    ) -> tuple[Float[Array, ""], ValueNetwork, None]:
        learned, settings = split(weights)
        value, slope = jax.value_and_grad(lambda w: eqx.combine(w, settings)(features))(learned)
        later = weights(following)
        later = later if terminated is False else jnp.where(terminated, 0, later)
        return value - self.horizon * later, slope, None


def as_vector(policy: Policy, action: Array, dtype: DTypeLike) -> Float[Array, " action"]:
    """An action as a vector: a discrete one as a number for each alternative."""
    return action.astype(dtype) if action.ndim else jax.nn.one_hot(action, policy.outputs, dtype=dtype)
