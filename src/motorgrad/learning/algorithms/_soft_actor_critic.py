r"""Soft actor-critic: the gradient of an action's value, learned from experience of any age (Haarnoja et al., 2018).

`ActionValueGradient` uses each decision once, in its turn. Here decisions are kept, and values and policy learn from
batches of them, many times. $Q(y, a)$ may be learned from whatever a policy did, so the noise that explores may last
for several decisions (`Autoregressive`), and targets may be relabelled (`Hindsight`).
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jax.typing import DTypeLike
from jaxtyping import Array, Float, Int, PyTree

from motorgrad._branching import Scalar
from motorgrad._errors import check
from motorgrad.learning._action_value_ensemble import EnsembleState
from motorgrad.learning._gradients import gradient_of
from motorgrad.learning._learner import Decision, Learner, Needs
from motorgrad.learning._replay import Drawn, Experience
from motorgrad.learning._replay_learner import ReplayLearner, coded
from motorgrad.learning._scaling import ScalingState
from motorgrad.learning._schedules import Annealed, Steps, at
from motorgrad.learning.algorithms._presets import Learnable, PolicyTable, behind_layers, horizon, preset
from motorgrad.policies import Policy, abilities, trainable
from motorgrad.schema import Part, inner, number, register


class EntropyState(NamedTuple):
    """The logarithm of the entropy coefficient, and the state of Adam."""

    log_coefficient: Float[Array, ""]
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
        "bounds is the logarithm of their distance, and that of n equal alternatives log n",
    )
    start: float = number(0.1, 0, open_low=True, help=r"the first $\alpha$, in rewards")
    learning_rate: float = number(5e-4, 0, help="learning rate of Adam")

    def init(self, dtype: DTypeLike) -> EntropyState:
        """The state at the start."""
        log_coefficient = jnp.log(jnp.asarray(self.start, dtype))
        return EntropyState(log_coefficient, optax.scale_by_adam().init(log_coefficient))

    def update(self, state: EntropyState, policy: Policy, drawn: Drawn, key: jax.Array) -> EntropyState:
        """The state after a step with a batch of decisions."""
        observation = drawn.observation
        numbers = jax.random.uniform(key, (len(observation), policy.uniforms), observation.dtype)
        entropy = drawn.mean(jax.vmap(partial(abilities.entropy_estimate, policy))(observation, numbers))
        size = 1 if policy.actions == "discrete" else policy.outputs
        above = (entropy / size - self.target).astype(state.log_coefficient.dtype)
        move, rule = optax.scale_by_adam().update(above, state.rule)
        log_coefficient = state.log_coefficient - self.learning_rate * cast(Array, move)
        return EntropyState(log_coefficient.astype(state.log_coefficient.dtype), rule)


class SoftActorCriticState(NamedTuple):
    """The policy; the action values; the `experience`; how many decisions were kept since the last update, `waiting`;
    the states of the gradient transformations; the state of the `entropy` coefficient that is learned, and of the
    `scaling` of rewards; how often the parameters have moved, `steps`; of a policy whose noise lasts its `memory`, and
    what it saw and drew."""

    policy: Policy
    values: EnsembleState
    experience: Experience
    waiting: Int[Array, ""]
    chain: tuple[PyTree, ...]
    entropy: EntropyState | None = None
    scaling: ScalingState | None = None
    steps: Steps = None
    memory: Float[Array, " memory"] | None = None
    decision: Decision | None = None


class SoftActorCritic(ReplayLearner):
    r"""Soft actor-critic (Haarnoja et al., 2018): the policy follows the value of its actions, at decisions from the
    past.

    Decisions are kept. After every `update_every` of them, batches are drawn, and for each batch the values make a step
    towards

    $$r + \gamma\,\big(\min_k \bar Q_k(y', a') + \alpha H(\pi(\cdot \mid y'))\big),\qquad a' \sim \pi(\cdot \mid y'),$$

    and then the policy along

    $$g = \nabla_\theta\,\mathbb E\big[\min_k Q_k(y, a_\theta(y, u)) + \alpha H(\pi(\cdot \mid y))\big]$$

    with fresh random numbers $u$. A policy whose noise lasts explores with it, and is judged by what it does on
    average: by independent noise of the same spread. Without `entropy` or an `entropy_target`, the deviations of graded
    units shrink to their `floor`, which then sets how far they explore.

    **Raises:** `ValueError` for an `entropy` with an `entropy_target`; from `init`, for a policy whose actions are not
    all real numbers.

    ```python
    replay = mg.learning.Replay(batch=256, updates=25, hindsight=mg.learning.Hindsight())
    policy = mg.policies.bounded_hyperplanes(task, floor=0.3)
    agent = mg.learning.SoftActorCritic(policy, update_every=100, replay=replay)
    ```
    """

    entropy: float | Annealed | None = number(
        None, 0, help=r"none, or $\alpha$, what a nat of entropy is worth in scaled reward"
    )
    entropy_target: EntropyTarget | None = inner(
        None, help=r"none, or the entropy for which $\alpha$ is learned, in place of `entropy`"
    )

    @property
    def needs(self) -> Needs:
        return super().needs._replace(actions="differentiable or few")

    def validate(self) -> None:
        super().validate()
        both = self.entropy is not None and self.entropy_target is not None
        check(not both, "entropy", self.entropy, "None with an entropy_target, which learns it")

    def init(self, key: jax.Array) -> SoftActorCriticState:
        policy = self.first_policy(key)
        dtype = jax.tree.leaves(trainable(policy))[0].dtype
        entropy = None if self.entropy_target is None else self.entropy_target.init(dtype)
        return SoftActorCriticState(**self.first_fields(policy, key), entropy=entropy)

    def update_from_batch(self, state: SoftActorCriticState, batch: Drawn, key: jax.Array) -> SoftActorCriticState:
        """The state after a step of the values and one of the policy, with a batch of decisions."""
        of_next, of_this = jax.random.split(key)
        policy = abilities.marginal(state.policy)
        learned = state.entropy
        coefficient = None if self.entropy is None else at(self.entropy, state.steps)
        if self.entropy_target is not None and learned is not None:
            learned = self.entropy_target.update(learned, policy, batch, of_this)
            coefficient = jnp.exp(learned.log_coefficient)

        later = self._expected(
            partial(self.values.later, state.values), policy, batch.next_observation, coefficient, of_next
        )
        values = self.values.update(state.values, batch, later, state.steps)
        gradient = self._gradient(values, state.policy, batch, coefficient, of_this)
        return self.chain.step(state._replace(values=values, entropy=learned), gradient)

    def _gradient(
        self, values: EnsembleState, policy: Policy, batch: Drawn, coefficient: Scalar | None, key: jax.Array
    ) -> PyTree[Array]:
        """The mean gradient of the least value over a batch."""
        least = partial(self.values.least, values)

        def gain(whole: Policy) -> Float[Array, ""]:
            present = abilities.marginal(whole)
            return batch.mean(self._expected(least, present, batch.observation, coefficient, key))

        return gradient_of(gain, policy)

    def _expected(
        self,
        value: Callable[[Array, Array], Float[Array, " decisions"]],
        policy: Policy,
        observation: Float[Array, "batch inputs"],
        coefficient: Scalar | None,
        key: jax.Array,
    ) -> Float[Array, " batch"]:
        """The `value` of a policy's actions with what their entropy is worth: of one action that is drawn anew for each
        observation, or the mean over all alternatives by their probabilities."""
        numbers = jax.random.uniform(key, (len(observation), policy.uniforms), observation.dtype)
        if policy.actions == "discrete":
            every = jnp.arange(policy.outputs)
            seen = jnp.repeat(observation, policy.outputs, axis=0)
            acted = jnp.tile(jax.vmap(partial(coded, policy))(every), (len(observation), 1))
            values = value(seen, acted).reshape(len(observation), policy.outputs)
            found = jnp.sum(jax.vmap(policy.prob)(observation) * values, axis=1)
        else:
            found = value(observation, jax.vmap(policy.sample)(observation, numbers))
        if coefficient is None:
            return found
        return found + coefficient * jax.vmap(partial(abilities.entropy_estimate, policy))(observation, numbers)


register(Learner, "soft-actor-critic", SoftActorCritic)

MAX_REPLAY_CAPACITY = 300_000
"""Observations that the preset keeps."""
BATCHES = 4
"""Batches that the preset draws at a time."""
START = 500
"""Observations from which the preset begins to learn."""
BELOW_UNIFORM = 1.7
"""Nats by which the entropy of a real number that is wanted is below that of a uniform one: so it is -1 between -1 and
1, as Haarnoja et al. (2018b) have it."""
ENTROPY_OF_ALTERNATIVES = 0.1
"""The entropy of a choice that is wanted, in nats."""
LEARNING_RATE = 1e-3
"""Of the preset's values and policy: layer norms allow more than the usual 3e-4."""


@preset("sac", "real-valued actions, above all with a goal: it learns from the fewest decisions")
def sac(task: Learnable, steps: int, policy: PolicyTable | None = None) -> dict[str, Any]:
    r"""Soft actor-critic (Haarnoja et al., 2018) with replay, lasting noise, and targets in hindsight.

    For tasks with real-valued actions, or with a few alternatives. Policy and two action values have two hidden layers
    of 128 rectifiers each, with layer norms, and see inputs relative to their running mean and deviation. After every
    eight decisions, or four where the task has a goal, four batches of 128 are drawn from the newest 300,000
    observations, and each makes a step of Adam with a learning rate of 1e-3 for values and policy. $\gamma = 1 - 1/h$
    with a horizon $h$ of a fifth of the longest episode, from 10 to 100 decisions; rewards are divided by the deviation
    of their discounted sum.

    The weight of the entropy bonus is learned: real numbers keep 1.7 nats less than uniform ones, alternatives 0.1
    nats. On a task with a `goal`, such as `compose` and `myosuite` make, a third of the drawn decisions get the place
    that was reached some $h$ decisions later as their target (Andrychowicz et al., 2017), and a third the target of
    another episode. Such a task explores by its targets, and has no entropy bonus: the deviation of a squashed number
    starts at 0.5 and shrinks to 0.1 at most, and noise has the autocorrelation $1 - 15/h$, at least 0.

    **Arguments** and **Returns:** as `natural`.

    **Raises:** as `natural`; for a task with binary actions, or with more than 64 alternatives.

    ```python
    task = mg.tasks.myosuite("myoHandReachRandom-v0")
    run = mg.train(task, mg.presets.sac(task, steps=300_000), steps=300_000)
    ```
    """
    ahead = horizon(task, 1 / 5)
    network = {"hidden": [128, 128], "activation": "relu", "sparsity": 0.0, "standardise": True}
    own = behind_layers(task, network, policy)
    alternatives = task.actions == "discrete"
    explores = alternatives or task.goal is None
    if own["kind"] in ("bounded-hyperplanes", "graded-hyperplanes"):
        # The filter of noise that lasts as long as that of "ppo-short-horizon" would delay actions, and a limb would
        # swing about its target in place of holding it (docs/myosuite.md).
        noise = {"floor": 0.01} if explores else {"floor": 0.1, "autocorrelation": max(0.0, 1 - 15 / ahead)}
        own = {**own, "deviation": 0.5, **noise}
    entropy = ENTROPY_OF_ALTERNATIVES
    if not alternatives:
        width = np.ptp(np.asarray(task.action_range, float).reshape(-1, 2), axis=1)
        bounded = np.where(np.isfinite(width), width, 2.0)  # an unbounded number counts as one between -1 and 1
        entropy = float(np.log(bounded).mean()) - BELOW_UNIFORM
    hindsight = {"kind": "hindsight", "share": 2 / 3, "ahead": ahead, "others": 0.5}
    return {
        "kind": "soft-actor-critic",
        "policy": own,
        "update_every": BATCHES if task.goal is not None else 2 * BATCHES,
        "values": {"discount": 1 - 1 / ahead, "network": network, "learning_rate": LEARNING_RATE},
        "replay": {
            "capacity": min(MAX_REPLAY_CAPACITY, max(START, 5 * steps // 4)),
            "start": START,
            "batch": 128,
            "updates": BATCHES,
            "hindsight": None if task.goal is None else hindsight,
        },
        "entropy_target": {"target": entropy} if explores else None,
        "reward_scaling": {"discount": 1 - 1 / ahead},
        "optimizer": {"kind": "adam", "learning_rate": LEARNING_RATE},
    }
