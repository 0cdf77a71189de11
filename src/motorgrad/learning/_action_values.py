r"""The gradient of an action's value, through the action (Vasan et al., 2024).

Every other estimator follows scores: it asks how a change of parameters changes the *probability* of the action that
was drawn. With real-valued actions, one can ask how it changes the *action*. A policy draws it as a function of random
numbers, $a_\theta(y, u)$. Where the value $Q(y, a)$ of an action is known,

$$\nabla_\theta\,\mathbb E\,Q(y, a) = \mathbb E\,\nabla_\theta\,Q(y, a_\theta(y, u)),$$

the pathwise gradient, or that of reparameterisation (Kingma & Welling, 2014). It has no reward in it and needs no
baseline, and it is only as good as the slope of $Q$.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jax.typing import DTypeLike
from jaxtyping import Array, Float, PyTree, UInt32

from motorgrad._errors import check
from motorgrad._running import RunningMean, add_observation, add_sample, running_mean
from motorgrad.learning._baselines import Baseline, Transition
from motorgrad.learning._branching import Scalar, where
from motorgrad.learning._chain import adam_scaling
from motorgrad.learning._critics import ValueNetwork, value_network
from motorgrad.learning._estimator import Estimator, EstimatorState
from motorgrad.learning._schedules import Steps, at
from motorgrad.learning._surrogate import gradient_of
from motorgrad.policies import Architecture, MultilayerPerceptron, Policy, abilities, adapted, split, trainable
from motorgrad.schema import Part, inner, number

MIN_VARIANCE = 1e-4


class ErrorScale(NamedTuple):
    """Mean and variance of rewards and of discounts, which are 0 where an episode terminates; the mean of squared
    returns of episodes; what the present one has `earned`."""

    rewards: tuple[RunningMean, RunningMean]
    discounts: tuple[RunningMean, RunningMean]
    squares: RunningMean
    earned: Float[Array, ""]


class ActionValueState(NamedTuple):
    """The network, the state of Adam, the scale of errors, and the key that draws the next actions."""

    weights: ValueNetwork
    rule: optax.OptState
    scale: ErrorScale
    key: UInt32[Array, " words"]


class ActionValues(Part):
    r"""The value $Q(y, a)$ of an action by a network, learned from every decision by expected SARSA with entropy.

    $$\delta = \big[r + \gamma\,\big(Q(y', a') + \alpha H(\pi(\cdot \mid y'))\big) - Q(y, a)\big]/\sigma,
    \qquad a' \sim \pi(\cdot \mid y'),$$

    and a step of Adam without momentum along $\delta\,\nabla Q(y, a)$. Errors have the scale

    $$\sigma^2 = \operatorname{Var} r + \operatorname{Var}\gamma_t \cdot \mathbb E\,G^2$$

    (Schaul et al., 2021), with $\gamma_t = 0$ where an episode terminated and $G$ the undiscounted return of an
    episode; rewards are those with the entropy added.
    """

    discount: float = number(0.99, 0, 1, open_high=True, help=r"$\gamma$, the weight of the next value")
    learning_rate: float = number(1e-3, 0, help="learning rate of Adam")
    b2: float = number(0.999, 0, 1, open_high=True, help="the decay of Adam's mean of squared gradients")
    network: Architecture = inner(
        MultilayerPerceptron(sparsity=0.0, layer_norm=False, standardise=True, unit_length=True),
        help="the hidden layers. They see the observation and the action, in one vector. With wide layers the "
        "last digits of a seed depend on how many seeds learn side by side",
    )

    @property
    def _rule(self) -> Any:
        return adam_scaling(0.0, self.b2)

    def init(self, policy: Policy, dtype: DTypeLike, key: jax.Array) -> ActionValueState:
        """The state before any decision; `key` draws the network, and then the next actions."""
        drawn, later = jax.random.split(key)
        inputs = policy.inputs + policy.mode(jnp.zeros(policy.inputs, dtype)).size
        weights = value_network(self.network, inputs, dtype, drawn)
        none = jnp.zeros((), dtype)
        pair = (running_mean(none), running_mean(none))
        scale = ErrorScale(pair, pair, running_mean(none), none)
        learned: PyTree = split(weights)[0]
        return ActionValueState(weights, self._rule.init(learned), scale, jax.random.key_data(later))

    def value(
        self, weights: ValueNetwork, observation: Float[Array, " inputs"], action: Float[Array, " actions"]
    ) -> Float[Array, ""]:
        """$Q(y, a)$."""
        return weights(_joined(weights, observation, action))

    def gradient(
        self, state: ActionValueState, policy: Policy, transition: Transition, entropy_coefficient: Scalar = 0.0
    ) -> PyTree[Array]:
        r"""$\nabla_\theta\,[Q(y, a_\theta(y, u)) + \alpha H(\pi(\cdot \mid y))]$, with $\alpha$ as the
        `entropy_coefficient`, for the random numbers $u$ from which the action of the transition was drawn."""

        def gain(present: Policy) -> Float[Array, ""]:
            action = present.sample(transition.observation, transition.uniforms)
            value = self.value(state.weights, transition.observation, action)
            return value + entropy_coefficient * present.entropy(transition.observation)

        return gradient_of(gain, policy)

    def update(
        self, state: ActionValueState, policy: Policy, transition: Transition, entropy_coefficient: Scalar = 0.0
    ) -> ActionValueState:
        """The state after a transition."""
        observation, action = transition.observation, transition.action
        weights, following = state.weights, transition.next_observation
        layers = adapted(weights.layers, _joined(weights, observation, action))
        weights = eqx.tree_at(lambda each: each.layers, weights, layers)
        key = jax.random.wrap_key_data(state.key)
        numbers = jax.random.uniform(jax.random.fold_in(key, 0), (policy.uniforms,), observation.dtype)
        going = 1 - jnp.asarray(transition.terminated, observation.dtype)
        later = self.value(weights, following, policy.sample(following, numbers))
        later = later + entropy_coefficient * policy.entropy(following)
        learned, settings = split(weights)

        def valued(learned: PyTree) -> Float[Array, ""]:
            return self.value(eqx.combine(learned, settings), observation, action)

        value, slope = jax.value_and_grad(valued)(learned)
        bonus = transition.reward + entropy_coefficient * policy.entropy(observation)
        scale = self._scaled(state.scale, bonus.astype(value.dtype), going)
        variance = scale.rewards[1].mean + scale.discounts[1].mean * scale.squares.mean
        sigma = jnp.where(variance > 0, jnp.sqrt(jnp.maximum(variance, MIN_VARIANCE)), 1)
        error = (transition.reward + self.discount * going * later - value) / sigma
        down = jax.tree.map(lambda g: -error * g, slope)
        moves, rule = self._rule.update(down, state.rule)
        learned = eqx.apply_updates(learned, jax.tree.map(lambda move: -self.learning_rate * move, moves))
        after = ActionValueState(
            eqx.combine(learned, settings), rule, scale, jax.random.key_data(jax.random.fold_in(key, 1))
        )
        return where(transition.diverged, state, after)

    def restart(self, state: ActionValueState) -> ActionValueState:
        """The state at the start of an episode."""
        return state._replace(scale=state.scale._replace(earned=jnp.zeros_like(state.scale.earned)))

    def _scaled(self, scale: ErrorScale, reward: Float[Array, ""], going: Float[Array, ""]) -> ErrorScale:
        earned = scale.earned + reward
        squares = where(going == 0, add_sample(scale.squares, jnp.square(earned)), scale.squares)
        discounts = add_observation(*scale.discounts, (self.discount * going).astype(reward.dtype))
        return ErrorScale(add_observation(*scale.rewards, reward), discounts, squares, earned * going)


def _joined(weights: ValueNetwork, observation: Array, action: Array) -> Float[Array, " inputs"]:
    return jnp.concatenate([observation, action]).astype(weights.weights.dtype)


class PathwiseEstimator(Estimator):
    """An estimator that follows the value of actions through the actions, and no score."""

    baseline: Baseline | None = None

    def validate(self) -> None:
        super().validate()
        name = type(self).__name__
        for part in ("baseline", "discount", "normalization", "bound", "reuse"):
            found = getattr(self, part)
            check(found is None, part, found, f"None with {name}, which has no advantages")
        check(self.entropy_in == "sample", "entropy_in", self.entropy_in, f"'sample' with {name}")

    @property
    def needs_decision(self) -> bool:
        return True

    def act(self, state: EstimatorState, observation: Float[Array, " inputs"], score: PyTree[Array]) -> EstimatorState:
        return state


def check_differentiable(policy: Policy, function: Callable[..., Any], *given: Any) -> None:
    """Refuse a policy where a function cannot be traced because JAX does not differentiate its actions."""
    try:
        jax.eval_shape(function, *given)
    except ValueError as error:  # such as the beta distribution, whose quantiles JAX does not differentiate
        wanted = "one whose actions JAX can differentiate, such as of the densities 'squashed' and 'clipped'"
        raise ValueError(f"policy = {type(policy).__name__!r}: must be {wanted}") from error


class ActionValueGradient(PathwiseEstimator):
    r"""The action value gradient, AVG (Vasan et al., 2024): samples follow the value of the action, not its reward.

    $$g = \nabla_\theta\,\big[Q(y, a_\theta(y, u)) + \alpha H(\pi(\cdot \mid y))\big]$$

    with $Q$ learned beside it, for policies with real-valued actions. The entropy and its gradient are exact, where the
    paper takes $-\log\pi(a \mid y)$ of the drawn action, which has the same mean and more noise. There is no trace: a
    sample is that of the newest action alone, and what comes later is in $Q$.

    Of the settings of `Estimator`, `improve`, `batch`, `entropy` ($\alpha$) and `reward_scaling` have an effect;
    `trace` has none, and the others are refused.

    **Raises:** `ValueError` for parts that have no place in it; from `init`, for a policy whose actions are not all
    real numbers.

    ```python
    estimator = mg.learning.ActionValueGradient(entropy=0.05)
    agent = mg.Agent(mg.policies.bounded_hyperplanes(task), estimator, mg.learning.Adam(3e-4, b1=0.0))
    ```
    """

    values: ActionValues = inner(ActionValues(), help="the value $Q$ of an action, and how it is learned")

    @property
    def needs_uniforms(self) -> bool:
        return True

    def init(self, policy: Policy, key: jax.Array | None = None) -> EstimatorState:
        more = abilities.has_memory(policy) or abilities.has_hidden_units(policy)
        plain = policy.actions == "continuous" and not more
        wanted = "one with real-valued actions, such as BoundedHyperplanes, and no memory, for ActionValueGradient"
        check(plain, "policy", type(policy).__name__, wanted)
        key = jax.random.key(0) if key is None else key
        dtype = jax.tree.leaves(trainable(policy))[0].dtype
        values = self.values.init(policy, dtype, jax.random.fold_in(key, 2))
        observation = jnp.zeros(policy.inputs, dtype)
        numbers = jnp.zeros(policy.uniforms, dtype)
        transition = Transition(observation, policy.mode(observation), observation[0], observation, uniforms=numbers)
        check_differentiable(policy, lambda values: self.values.gradient(values, policy, transition), values)
        return super().init(policy, key)._replace(trace=None, baseline=values)

    def sample(
        self, state: EstimatorState, policy: Policy, transition: Transition, steps: Steps = None
    ) -> tuple[PyTree[Array], EstimatorState]:
        values = state.baseline
        scaled, state = self._advantage(state, policy, transition)  # the reward, as nothing is subtracted
        transition = transition._replace(reward=scaled.value)
        entropy_coefficient = 0.0 if self.entropy is None else at(self.entropy, steps)
        gradient = self.values.gradient(values, policy, transition, entropy_coefficient)
        return gradient, state._replace(baseline=self.values.update(values, policy, transition, entropy_coefficient))

    def restart(self, state: EstimatorState, policy: Policy) -> EstimatorState:
        fresh = super().restart(state, policy)
        return fresh._replace(trace=None, baseline=self.values.restart(state.baseline))
