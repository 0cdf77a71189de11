r"""Soft actor-critic: the gradient of an action's value, learned from experience of any age (Haarnoja et al., 2018).

`ActionValueGradient` uses each decision once, in its turn. Here decisions are kept, and values and policy learn from
batches of them, many times. $Q(y, a)$ may be learned from whatever a policy did, so the noise that explores may last
for several decisions (`Autoregressive`), and targets may be relabelled (`Hindsight`).
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jax.typing import DTypeLike
from jaxtyping import Array, Float, PyTree

from motorgrad._errors import check
from motorgrad._goal import Goal
from motorgrad.learning._action_values import PathwiseEstimator, check_differentiable
from motorgrad.learning._baselines import Transition
from motorgrad.learning._branching import Flag, Scalar, where
from motorgrad.learning._critics import ValueNetwork, value_network
from motorgrad.learning._estimator import EstimatorState
from motorgrad.learning._replay import Drawn, Experience, Replay
from motorgrad.learning._schedules import Annealed, Steps, at
from motorgrad.learning._surrogate import gradient_of
from motorgrad.policies import Architecture, MultilayerPerceptron, Policy, abilities, adapted, split, trainable
from motorgrad.schema import Part, count, inner, number


class EnsembleState(NamedTuple):
    """The networks; their slow copies, of what is learned alone; the state of Adam."""

    weights: tuple[ValueNetwork, ...]
    slow: PyTree
    rule: optax.OptState


class ActionValueEnsemble(Part):
    r"""The value $Q(y, a)$ of an action by several networks, of which the least counts (Fujimoto et al., 2018).

    Each learns by Adam from

    $$r + \gamma\,\big(\min_k \bar Q_k(y', a') + \alpha H(\pi(\cdot \mid y'))\big),\qquad a' \sim \pi(\cdot \mid y'),$$

    whatever the policy was when the decision was made. $\bar Q$ are slow copies of the networks, which follow them by
    the share `tracking` at every step.
    """

    discount: float = number(0.99, 0, 1, open_high=True, help=r"$\gamma$, the weight of the next value")
    learning_rate: float | Annealed = number(5e-4, 0, help="learning rate of Adam")
    tracking: float = number(
        0.01, 0, 1, help="the share of the distance to the networks by which their slow copies move at a step"
    )
    members: int = count(2, 1, 1_000, help="number of networks")
    network: Architecture = inner(
        MultilayerPerceptron(sparsity=0.0, activation="relu", standardise=True),
        help="the hidden layers. They see the observation and the action, in one vector",
    )

    def init(self, inputs: int, dtype: DTypeLike, key: jax.Array) -> EnsembleState:
        """The state before any decision, for this many `inputs`: observation and action."""
        weights = tuple(value_network(self.network, inputs, dtype, own) for own in jax.random.split(key, self.members))
        learned = split(cast(Any, weights))[0]
        return EnsembleState(weights, learned, optax.scale_by_adam().init(learned))

    def values(
        self,
        weights: tuple[ValueNetwork, ...],
        observation: Float[Array, "batch inputs"],
        action: Float[Array, "batch actions"],
    ) -> Float[Array, "members batch"]:
        """$Q_k(y, a)$ of all members."""
        joined = jnp.concatenate([observation, action], axis=1).astype(weights[0].weights.dtype)
        return jnp.stack([jax.vmap(member)(joined) for member in weights])

    def adapted(self, state: EnsembleState, observation: Array, action: Array) -> EnsembleState:
        """The state after one more decision was seen, for networks that keep statistics."""
        seen = jnp.concatenate([observation, action]).astype(state.weights[0].weights.dtype)
        after = [
            eqx.tree_at(lambda each: each.layers, member, adapted(member.layers, seen)) for member in state.weights
        ]
        return state._replace(weights=tuple(after))

    def update(
        self,
        state: EnsembleState,
        policy: Policy,
        drawn: Drawn,
        entropy_coefficient: Scalar | None,
        key: jax.Array,
        steps: Steps = None,
    ) -> EnsembleState:
        """The state after a step down the squared errors of a batch of decisions; the parameters have made `steps`."""
        learned, settings = split(cast(Any, state.weights))
        following = drawn.next_observation
        numbers = jax.random.uniform(key, (len(following), policy.uniforms), following.dtype)
        action = jax.vmap(policy.sample)(following, numbers)
        later = jnp.min(self.values(eqx.combine(state.slow, settings), following, action), axis=0)
        if entropy_coefficient is not None:
            entropy = jax.vmap(partial(abilities.entropy_estimate, policy))(following, numbers)
            later = later + entropy_coefficient * entropy
        wanted = (drawn.reward + self.discount * (1 - drawn.terminated) * later).astype(later.dtype)

        def loss(learned: PyTree) -> Float[Array, ""]:
            found = self.values(eqx.combine(learned, settings), drawn.observation, drawn.action)
            return 0.5 * drawn.mean(jnp.sum(jnp.square(found - wanted), axis=0))

        moves, rule = optax.scale_by_adam().update(jax.grad(loss)(learned), state.rule)
        rate = at(self.learning_rate, steps)
        learned = eqx.apply_updates(learned, jax.tree.map(lambda move: (-rate * move).astype(move.dtype), moves))
        slow = jax.tree.map(lambda old, new: (old + self.tracking * (new - old)).astype(old.dtype), state.slow, learned)
        return EnsembleState(eqx.combine(learned, settings), slow, rule)


class EntropyState(NamedTuple):
    """The logarithm of the entropy coefficient, and the state of Adam."""

    log_worth: Float[Array, ""]
    rule: optax.OptState


class EntropyTarget(Part):
    r"""A wanted entropy of the policy, for which the weight $\alpha$ of the entropy bonus is learned (Haarnoja et al.,
    2018b).

    With each batch, $\log\alpha$ makes a step of Adam: down where the mean entropy of an action is above `target`, up
    where it is below.
    """

    target: float = number(
        -1.0,
        unit="nats",
        help="the wanted entropy of each number of an action, on average; that of a number that is uniform between two "
        "bounds is the logarithm of their distance",
    )
    start: float = number(0.1, 0, open_low=True, help=r"the first $\alpha$, in rewards")
    learning_rate: float = number(5e-4, 0, help="learning rate of Adam")

    def init(self, dtype: DTypeLike) -> EntropyState:
        """The state at the start."""
        log_worth = jnp.log(jnp.asarray(self.start, dtype))
        return EntropyState(log_worth, optax.scale_by_adam().init(log_worth))

    def update(self, state: EntropyState, policy: Policy, drawn: Drawn, key: jax.Array) -> EntropyState:
        """The state after a step with a batch of decisions."""
        observation = drawn.observation
        numbers = jax.random.uniform(key, (len(observation), policy.uniforms), observation.dtype)
        entropy = drawn.mean(jax.vmap(partial(abilities.entropy_estimate, policy))(observation, numbers))
        above = (entropy / policy.outputs - self.target).astype(state.log_worth.dtype)
        move, rule = optax.scale_by_adam().update(above, state.rule)
        log_worth = state.log_worth - self.learning_rate * cast(Array, move)
        return EntropyState(log_worth.astype(state.log_worth.dtype), rule)


class SoftActorCritic(PathwiseEstimator):
    r"""Soft actor-critic (Haarnoja et al., 2018): the policy climbs the value of its actions, at decisions from the
    past.

    Decisions are kept. Each time that the parameters move, after every `improve` decisions, batches are drawn, and for
    each batch the values make a step, and then the policy along

    $$g = \nabla_\theta\,\mathbb E\big[\min_k Q_k(y, a_\theta(y, u)) + \alpha H(\pi(\cdot \mid y))\big]$$

    with fresh random numbers $u$. A policy whose noise lasts explores with it, and is judged by what it does on
    average: by independent noise of the same spread. Without `entropy` or an `entropy_target`, the deviations of graded
    units shrink to their `floor`, which then sets how far they explore.

    Of the settings of `Estimator`, `improve`, `entropy` ($\alpha$) and `reward_scaling` have an effect; `trace` has
    none, and the others are refused.

    **Raises:** `ValueError` for parts that have no place in it; from `init`, for a policy whose actions are not all
    real numbers.

    ```python
    replay = mg.learning.Replay(batch=256, updates=25, hindsight=mg.learning.Hindsight())
    estimator = mg.learning.SoftActorCritic(improve=100, replay=replay)
    agent = mg.Agent(mg.policies.bounded_hyperplanes(task, floor=0.3), estimator, mg.learning.Adam(5e-4))
    ```
    """

    values: ActionValueEnsemble = inner(ActionValueEnsemble(), help="the values of actions, and how they are learned")
    replay: Replay = inner(Replay(), help="how much experience is kept, and how often it is used")
    entropy_target: EntropyTarget | None = inner(
        None, help=r"none, or the entropy for which $\alpha$ is learned, in place of `entropy`"
    )

    def validate(self) -> None:
        super().validate()
        both = self.entropy is not None and self.entropy_target is not None
        check(not both, "entropy", self.entropy, "None with an entropy_target, which learns it")
        wanted = "a number of decisions with SoftActorCritic"
        check(isinstance(self.improve, int), "improve", self.improve, wanted)

    @property
    def online(self) -> bool:
        return False

    @property
    def climbs(self) -> bool:
        return True

    @property
    def one_stream(self) -> str | None:
        return "the experience kept by SoftActorCritic"

    @property
    def needs_goal(self) -> str | None:
        return None if self.replay.hindsight is None else "replay.hindsight"

    def init(self, policy: Policy, key: jax.Array | None = None) -> EstimatorState:
        lasting = abilities.marginal(policy)
        more = abilities.has_memory(lasting) or abilities.has_hidden_units(policy)
        plain = policy.actions == "continuous" and not more
        wanted = "one with real-valued actions, such as BoundedHyperplanes, and no memory but lasting noise"
        check(plain, "policy", type(policy).__name__, f"{wanted}, for SoftActorCritic")
        key = jax.random.key(0) if key is None else key
        dtype = jax.tree.leaves(trainable(policy))[0].dtype
        observation = jnp.zeros(lasting.inputs, dtype)
        numbers = jnp.zeros(lasting.uniforms, dtype)
        action = lasting.mode(observation)

        def slope(numbers: Array) -> PyTree[Array]:
            return gradient_of(lambda present: jnp.sum(present.sample(observation, numbers)), lasting)

        check_differentiable(policy, slope, numbers)
        values = self.values.init(observation.size + action.size, dtype, jax.random.fold_in(key, 2))
        experience = self.replay.init(observation, action, jax.random.fold_in(key, 3))
        scaling = None if self.reward_scaling is None else self.reward_scaling.init(dtype)
        entropy = None if self.entropy_target is None else self.entropy_target.init(dtype)
        return EstimatorState(None, values, None, None, scaling, experience, entropy=entropy)

    def sample(
        self, state: EstimatorState, policy: Policy, transition: Transition, steps: Steps = None
    ) -> tuple[PyTree[Array], EstimatorState]:
        scaling, dropped = state.scaling, transition.diverged
        shown = policy.observation_size  # behind it stands what a policy with lasting noise remembers
        seen = transition.observation[:shown]
        following = transition.next_observation[:shown]
        values = where(dropped, state.baseline, self.values.adapted(state.baseline, seen, transition.action))
        if self.reward_scaling is not None and scaling is not None:
            scaling = where(dropped, scaling, self.reward_scaling.update(scaling, transition.reward))
        entry = (seen, transition.action, transition.reward, following, transition.terminated, dropped)
        batch = self.replay.add(state.batch, *entry)  # type: ignore[arg-type]
        reward = transition.reward.astype(batch.rewards.dtype)
        return reward, state._replace(baseline=values, scaling=scaling, batch=batch)

    def restart(self, state: EstimatorState, policy: Policy) -> EstimatorState:
        scaling = state.scaling
        scaling = scaling if self.reward_scaling is None or scaling is None else self.reward_scaling.restart(scaling)
        return state._replace(batch=self.replay.restart(state.batch), scaling=scaling)  # type: ignore[arg-type]

    @property
    def seeds_in_turn(self) -> bool:
        return True

    def ready(self, batch: Experience) -> Flag:
        return self.replay.ready(batch)

    def drawn(self, batch: Experience, goal: Goal | None) -> tuple[Drawn, Array]:
        keys = jax.random.split(jax.random.wrap_key_data(batch.key), (self.replay.updates, 2))
        return jax.vmap(lambda key: self.replay.draw(batch, key, goal))(keys[:, 0]), jax.random.key_data(keys[:, 1])

    def climb(
        self, state: PyTree, drawn: tuple[Drawn, Array], step: Callable[[PyTree, PyTree[Array]], PyTree]
    ) -> PyTree:
        factor = 1.0
        if self.reward_scaling is not None:
            factor = self.reward_scaling.factor(state.estimator.scaling)

        def once(state: PyTree, each: tuple[Drawn, Array]) -> tuple[PyTree, None]:
            drawn, words = each
            of_next, of_this = jax.random.split(jax.random.wrap_key_data(words))
            drawn = drawn._replace(reward=(factor * drawn.reward).astype(drawn.reward.dtype))
            learned = state.estimator.entropy
            entropy_coefficient = None if self.entropy is None else at(self.entropy, state.steps)
            if self.entropy_target is not None:
                learned = self.entropy_target.update(learned, abilities.marginal(state.policy), drawn, of_this)
                entropy_coefficient = jnp.exp(learned.log_worth)
            marginal = abilities.marginal(state.policy)
            values = self.values.update(
                state.estimator.baseline, marginal, drawn, entropy_coefficient, of_next, state.steps
            )
            state = state._replace(estimator=state.estimator._replace(baseline=values, entropy=learned))
            return step(state, self._gradient(values, state.policy, drawn, entropy_coefficient, of_this)), None

        return jax.lax.scan(once, state, drawn)[0]

    def used(self, batch: Experience) -> Experience:
        return self.replay.renewed(batch)

    def _gradient(
        self, values: EnsembleState, policy: Policy, drawn: Drawn, entropy_coefficient: Scalar | None, key: jax.Array
    ) -> PyTree[Array]:
        """The mean gradient of the least value over a batch, for actions drawn anew."""
        observation = drawn.observation
        numbers = jax.random.uniform(key, (len(observation), abilities.marginal(policy).uniforms), observation.dtype)

        def gain(whole: Policy) -> Float[Array, ""]:
            present = abilities.marginal(whole)
            action = jax.vmap(present.sample)(observation, numbers)
            gains = jnp.min(self.values.values(values.weights, observation, action), axis=0)
            if entropy_coefficient is not None:
                entropy = jax.vmap(partial(abilities.entropy_estimate, present))(observation, numbers)
                gains = gains + entropy_coefficient * entropy
            return drawn.mean(gains)

        return gradient_of(gain, policy)
