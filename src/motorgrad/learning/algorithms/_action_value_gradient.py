r"""The action value gradient, AVG (Vasan et al., 2024): online, through the action, without a score.

Learners by scores ask how a change of parameters changes the *probability* of the action that was drawn. With
real-valued actions, one can ask how it changes the *action*. A policy draws it as a function of random numbers,
$a_\theta(y, u)$. Where the value $Q(y, a)$ of an action is known,

$$\nabla_\theta\,\mathbb E\,Q(y, a) = \mathbb E\,\nabla_\theta\,Q(y, a_\theta(y, u)),$$

the pathwise gradient, or that of reparameterisation (Kingma & Welling, 2014). It has no reward in it and needs no
baseline, and it is only as good as the slope of $Q$.
"""

from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jax.typing import DTypeLike
from jaxtyping import Array, Float, PyTree, UInt32

from motorgrad._branching import Flag, Scalar, any_of, where
from motorgrad._running import RunningMean, add_observation, add_sample, running_mean
from motorgrad.learning._chain import Adam, Optimizer, PolyakAveraging, Transformation, adam_scaling
from motorgrad.learning._critics import ValueNetwork, value_network
from motorgrad.learning._gradient_learner import (
    GradientLearner,
    averaging_field,
    optimizer_field,
    transformations_field,
)
from motorgrad.learning._gradients import gradient_of
from motorgrad.learning._learner import Learner, Needs, Transition
from motorgrad.learning._scaling import RewardScaling, ScalingState
from motorgrad.learning._schedules import Annealed, Steps, at
from motorgrad.learning.algorithms._presets import DISCOUNT, Learnable, PolicyTable, behind_layers, preset
from motorgrad.policies import Architecture, MultilayerPerceptron, Policy, abilities, adapted, split, trainable
from motorgrad.schema import Part, inner, number, register

MIN_VARIANCE = 1e-4
"""The least variance of errors by which they are divided."""


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
        self,
        state: ActionValueState,
        policy: Policy,
        observation: Float[Array, " inputs"],
        uniforms: Float[Array, " uniforms"],
        entropy_coefficient: Scalar = 0.0,
    ) -> PyTree[Array]:
        r"""$\nabla_\theta\,[Q(y, a_\theta(y, u)) + \alpha H(\pi(\cdot \mid y))]$, with $\alpha$ as the
        `entropy_coefficient`, for the random numbers $u$ from which the action was drawn, the `uniforms`."""

        def gain(present: Policy) -> Float[Array, ""]:
            value = self.value(state.weights, observation, present.sample(observation, uniforms))
            return value + entropy_coefficient * present.entropy(observation)

        return gradient_of(gain, policy)

    def update(
        self, state: ActionValueState, policy: Policy, transition: Transition, entropy_coefficient: Scalar = 0.0
    ) -> ActionValueState:
        """The state after a transition."""
        observation = transition.observation
        action = transition.action
        following = transition.next_observation
        layers = adapted(state.weights.layers, _joined(state.weights, observation, action))
        weights = eqx.tree_at(lambda each: each.layers, state.weights, layers)
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


class ActionValueGradientState(NamedTuple):
    """The policy and the values; the states of the gradient transformations; the random numbers of the newest decision,
    `uniforms`; the state of the `scaling` of rewards; how often the parameters have moved, `steps`. Between `observe`
    and `update` there is the gradient `sample`, and whether it is to be dropped, `diverged`."""

    policy: Policy
    values: ActionValueState
    chain: tuple[PyTree, ...]
    uniforms: Float[Array, " uniforms"]
    scaling: ScalingState | None = None
    steps: Steps = None
    sample: PyTree = None
    diverged: Flag | None = None


class ActionValueGradient(GradientLearner):
    r"""The action value gradient, AVG (Vasan et al., 2024): the policy follows the value of its action, not its reward.

    $$g = \nabla_\theta\,\big[Q(y, a_\theta(y, u)) + \alpha H(\pi(\cdot \mid y))\big]$$

    with $Q$ learned beside it, for policies with real-valued actions. Both learn from every decision, once. The entropy
    and its gradient are exact, where the paper takes $-\log\pi(a \mid y)$ of the drawn action, which has the same mean
    and more noise. There is no trace: a sample is that of the newest action alone, and what comes later is in $Q$.

    **Raises:** from `init`, `ValueError` for a policy whose actions are not all real numbers.

    ```python
    agent = mg.learning.ActionValueGradient(mg.policies.bounded_hyperplanes(task), entropy=0.05)
    ```
    """

    aliases: ClassVar[Mapping[str, str]] = {
        "units": "policy.units",
        "discount": "values.discount",
        "learning_rate": "optimizer.learning_rate",
        "weight_decay": "optimizer.weight_decay",
    }

    values: ActionValues = inner(ActionValues(), help="the value $Q$ of an action, and how it is learned")
    entropy: float | Annealed | None = number(
        None, 0, help=r"none, or $\alpha$, what a nat of entropy is worth in scaled reward"
    )
    reward_scaling: RewardScaling | None = inner(
        None, help="none, or `RewardScaling` of rewards before anything else sees them"
    )
    optimizer: Optimizer = optimizer_field(Adam(3e-4, b1=0.0))
    transformations: tuple[Transformation, ...] = transformations_field()
    averaging: PolyakAveraging | None = averaging_field()

    def validate(self) -> None:
        super().validate()
        self.check_takes_every_gradient(sees_decisions=False)

    @property
    def needs(self) -> Needs:
        return Needs(actions="differentiable", memory="none")

    def init(self, key: jax.Array) -> ActionValueGradientState:
        policy = self.first_policy(key)
        dtype = jax.tree.leaves(trainable(policy))[0].dtype
        values = jax.random.fold_in(jax.random.fold_in(key, 2), 2)
        return ActionValueGradientState(
            policy=policy,
            values=self.values.init(policy, dtype, values),
            chain=self.chain.init(policy),
            uniforms=jnp.zeros(policy.uniforms, dtype),
            scaling=None if self.reward_scaling is None else self.reward_scaling.init(dtype),
            steps=self.first_steps(),
        )

    def act(
        self,
        state: ActionValueGradientState,
        observation: Float[Array, " inputs"],
        uniforms: Float[Array, " uniforms"],
    ) -> tuple[ActionValueGradientState, Array]:
        action = state.policy.sample(observation, uniforms)
        return state._replace(uniforms=uniforms.astype(state.uniforms.dtype)), action

    def observe(self, state: ActionValueGradientState, transition: Transition) -> ActionValueGradientState:
        """Find the gradient sample of the newest action, and let the values learn from what it led to."""
        dropped = transition.diverged
        policy = where(dropped, state.policy, abilities.adapted(state.policy, transition.next_observation))
        scaling = state.scaling
        reward = transition.reward
        if self.reward_scaling is not None and scaling is not None:
            scaling = where(dropped, scaling, self.reward_scaling.update(scaling, reward))
            reward = self.reward_scaling.factor(scaling) * reward
        observation = jnp.asarray(transition.observation, state.uniforms.dtype)
        transition = transition._replace(observation=observation, reward=reward)
        coefficient = 0.0 if self.entropy is None else at(self.entropy, state.steps)
        sample = self.values.gradient(state.values, policy, observation, state.uniforms, coefficient)
        values = self.values.update(state.values, policy, transition, coefficient)
        zero = jax.tree.map(jnp.zeros_like, sample)
        after = state._replace(
            policy=policy, values=values, scaling=scaling, sample=where(dropped, zero, sample), diverged=dropped
        )
        ended = any_of(transition.terminated, transition.truncated, dropped)
        return where(ended, self.restart(after), after)

    def restart(self, state: ActionValueGradientState) -> ActionValueGradientState:
        """The state at the start of an episode."""
        scaling = state.scaling
        if self.reward_scaling is not None and scaling is not None:
            scaling = self.reward_scaling.restart(scaling)
        return state._replace(values=self.values.restart(state.values), scaling=scaling)

    def update(self, state: ActionValueGradientState) -> ActionValueGradientState:
        r"""Move the parameters of the policy, $\theta \leftarrow \theta + \alpha g$."""
        moved = self.chain.step(state, state.sample)
        if state.diverged is not None:
            moved = where(state.diverged, state, moved)
        return moved._replace(sample=None, diverged=None)


register(Learner, "action-value-gradient", ActionValueGradient)


@preset("avg", "real-valued actions, learned from every decision once")
def avg(task: Learnable, steps: int, policy: PolicyTable | None = None) -> dict[str, Any]:
    r"""Action value gradient (Vasan et al., 2024): follows the learned value of an action, through the action.

    For tasks with real-valued actions. Policy and action values have two hidden layers of 256 leaky rectifiers each,
    whose last output has length 1, and see inputs relative to their running mean and deviation. Both learn from every
    decision, once, by Adam without momentum: $\gamma$ = 0.99, rates 3e-4 and 1e-3. A nat of entropy is worth 0.05
    scaled rewards. The paper has other rates and entropies for every few tasks; here one setting is meant to serve,
    with rewards divided by the deviation of their discounted sum. The deviation of a unit is its own, and not a
    function of the input.

    **Arguments** and **Returns:** as `natural`.

    **Raises:** as `natural`; for a task whose actions are not all real numbers.
    """
    network = {"hidden": [256, 256], "layer_norm": False, "sparsity": 0.0, "standardise": True, "unit_length": True}
    return {
        "kind": "action-value-gradient",
        "policy": behind_layers(task, network, policy),
        "values": {"discount": DISCOUNT, "learning_rate": 1e-3, "network": network},
        "entropy": 0.05,
        "reward_scaling": {"discount": DISCOUNT},
        "optimizer": {"kind": "adam", "learning_rate": 3e-4, "b1": 0.0},
    }
