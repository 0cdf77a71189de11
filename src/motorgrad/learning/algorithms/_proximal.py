r"""Proximal policy optimisation: several steps from one batch of decisions (Schulman et al., 2017).

A gradient sample $\delta z$ holds at the parameters that chose the actions, so it is good for one step. To use a batch
again, it must be kept: what was seen, what was done and what it led to. Then, at any parameters near by,

$$L(\theta) = \frac1n \sum_t \min\big(\rho_t A_t,\ \operatorname{clip}(\rho_t, 1 - \epsilon, 1 + \epsilon)\,A_t\big),
\qquad \rho_t = \frac{\pi_\theta(a_t \mid y_t)}{\pi_{\text{old}}(a_t \mid y_t)},$$

measures the gain over the old policy. Decisions whose probability has changed by the share $\epsilon$ in the direction
of their advantage add nothing more.
"""

from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PyTree

from motorgrad._branching import NEVER, Flag, any_of, where, where_any
from motorgrad._errors import check
from motorgrad.learning._advantages import Advantages
from motorgrad.learning._baselines import Baseline, MeanReward
from motorgrad.learning._batches import Batch
from motorgrad.learning._chain import Adam, Optimizer, PolyakAveraging, Transformation
from motorgrad.learning._gradient_learner import (
    GradientLearner,
    averaging_field,
    optimizer_field,
    transformations_field,
)
from motorgrad.learning._gradients import gradient_of
from motorgrad.learning._learner import Decision, Learner, Needs, Transition, first_decision, with_decision
from motorgrad.learning._natural import Metric
from motorgrad.learning._reward_criteria import Accumulated, RewardCriterion, criterion_field
from motorgrad.learning._scaling import NormalizationState, RewardScaling, RootMeanSquare, ScalingState
from motorgrad.learning._schedules import Annealed, Steps, at
from motorgrad.learning.algorithms._presets import (
    DISCOUNT,
    SMALL,
    Learnable,
    PolicyTable,
    behind_layers,
    fitted_returns,
    horizon,
    large_batch,
    preset,
)
from motorgrad.policies import Policy, abilities
from motorgrad.schema import count, inner, number, register, static


class ProximalState(NamedTuple):
    """The policy; the `batch`; the states of the gradient transformations, of the `baseline`, of the `scaling` of
    rewards and of the `normalization` of advantages; how often the parameters have moved, `steps`; of a policy with
    hidden units or a memory what it saw and drew, and its `memory`; what the `criterion` has accumulated."""

    policy: Policy
    batch: Batch
    chain: tuple[PyTree, ...]
    baseline: PyTree = None
    scaling: ScalingState | None = None
    normalization: NormalizationState | None = None
    steps: Steps = None
    decision: Decision | None = None
    memory: Float[Array, " memory"] | None = None
    criterion: Accumulated | None = None


class ProximalPolicyOptimization(GradientLearner):
    r"""Proximal policy optimisation, PPO (Schulman et al., 2017): uses every batch of decisions several times.

    Once a batch of `update_every` decisions is full, its advantages are summed up from the last decision back,
    $A_t = \delta_t + \beta A_{t+1}$ with the `decay` $\beta$, $\gamma\lambda$ of generalised advantages (Schulman et
    al., 2016). The end of an episode, or of the batch, ends the sum. Then the decisions are shuffled and cut into
    `minibatches`, and the gradient of $L$ for each goes through metric, optimizer and further transformations. This
    happens `epochs` times.

    **Raises:** `ValueError` for parts that do not fit; from `init`, for a policy whose memory depends on its
    parameters.

    ```python
    critic = mg.learning.LinearCritic(discount=0.99)
    agent = mg.learning.ProximalPolicyOptimization(policy, critic, decay=0.94, update_every=512, minibatches=8)
    ```
    """

    aliases: ClassVar[Mapping[str, str]] = {
        "units": "policy.units",
        "learning_rate": "optimizer.learning_rate",
        "weight_decay": "optimizer.weight_decay",
        "damping": "metric.damping",
    }
    critic: ClassVar[str | None] = "baseline"

    baseline: Baseline | None = inner(
        MeanReward(), help="what rewards are compared with, a baseline or a critic; none for the rewards themselves"
    )
    decay: float = number(
        0.9,
        0,
        1,
        help=r"$\beta$, how much of a temporal difference is credited to the decision before; 1 needs a task "
        "with episodes",
    )
    update_every: int = count(2048, 2, unit="decisions", help="length of a batch")
    clip: float = number(
        0.2,
        0,
        open_low=True,
        help=r"$\epsilon$; a decision whose probability has changed by this share of it, in the direction of its "
        r"advantage, adds nothing to the gradient",
    )
    epochs: int = count(10, 1, 10_000, help="number of times that each decision is used")
    minibatches: int = count(
        1,
        1,
        1_000_000,
        help="into how many parts a batch is cut, each for a step of the parameters; a divisor of `update_every`",
    )
    standardise: bool = static(
        True, help="whether the advantages of a batch are made to have mean 0 and deviation 1; equal ones become 0"
    )
    entropy: float | Annealed | None = number(
        None, 0, help="none, or what a nat of entropy is worth in standardised advantages: it is added to $L$"
    )
    reward_scaling: RewardScaling | None = inner(
        None, help="none, or `RewardScaling` of rewards before anything else sees them"
    )
    normalization: RootMeanSquare | None = inner(
        None, help=r"none for temporal differences $\delta$ as they are, or `RootMeanSquare` to normalize them"
    )
    optimizer: Optimizer = optimizer_field(Adam(3e-4))
    metric: Metric | None = inner(
        None, help="none for the plain gradient; a `ConjugateGradient` or `FisherMetric` for the natural gradient"
    )
    transformations: tuple[Transformation, ...] = transformations_field()
    averaging: PolyakAveraging | None = averaging_field()
    criterion: RewardCriterion | None = criterion_field()

    def validate(self) -> None:
        super().validate()
        divides = self.update_every % self.minibatches == 0
        check(divides, "minibatches", self.minibatches, f"a divisor of update_every = {self.update_every}")
        name = type(self).__name__
        weighted = self.baseline is not None and self.baseline.needs_eligibility
        words = f"a critic, or one that does not see the eligibility, such as MeanReward, for {name}"
        check(not weighted, "baseline", type(self.baseline).__name__, words)
        reads = self.metric is None or (self.metric.reads_gradient and self.metric.steps_from == "any")
        words = f"one that reads a gradient, such as FisherMetric, for {name}"
        check(reads, "metric", type(self.metric).__name__, words)
        self.check_takes_every_gradient(sees_decisions=True)

    @property
    def advantages(self) -> Advantages:
        """The parts that make advantages of rewards."""
        return Advantages(self.baseline, self.reward_scaling, self.normalization, self.criterion)

    @property
    def needs(self) -> Needs:
        episodes = ["decay = 1"] if isinstance(self.decay, float) and self.decay == 1 else []
        if self.baseline is not None and self.baseline.needs_episodes:
            episodes.append(f"baseline.{self.baseline.needs_episodes}")
        if self.criterion is not None:
            episodes.append("criterion")
        kept = f"batches used again by {type(self).__name__}"
        return Needs(tuple(episodes), single_stream=kept, memory="independent")

    def init(self, key: jax.Array) -> ProximalState:
        policy = self.first_policy(key)
        own = jax.random.fold_in(key, 2)
        return ProximalState(
            policy=policy,
            batch=Batch.empty(policy, self.update_every, jax.random.fold_in(own, 1)),
            chain=self.chain.init(policy),
            steps=self.first_steps(),
            decision=first_decision(policy),
            memory=abilities.initial_memory(policy),
            **self.advantages.init(policy, own),
        )

    def act(
        self, state: ProximalState, observation: Float[Array, " inputs"], uniforms: Float[Array, " uniforms"]
    ) -> tuple[ProximalState, Array]:
        policy = state.policy
        seen = abilities.observation_with_memory(policy, state.memory, observation)
        action = policy.sample(seen, uniforms)
        state = with_decision(state, seen, action)
        state = self.advantages.observe(state, abilities.critic_observation(policy, seen))
        return state._replace(memory=abilities.remember(policy, seen, action)), abilities.task_action(policy, action)

    def observe(self, state: ProximalState, transition: Transition) -> ProximalState:
        """Keep the decision with its advantage. What diverged is dropped."""
        dropped = transition.diverged
        seen = abilities.observation_with_memory(state.policy, state.memory, transition.next_observation)
        policy = where(dropped, state.policy, abilities.adapted(state.policy, seen))
        state = state._replace(policy=policy)
        decided = Decision(jnp.asarray(transition.observation, state.batch.error.dtype), transition.action)
        decided = decided if state.decision is None else state.decision
        transition = transition._replace(
            observation=decided.observation,
            action=decided.action,
            next_observation=abilities.critic_observation(policy, seen),
        )
        transition, state = self.advantages.paid(state, transition)
        advantage, state = self.advantages.update(state, policy, transition)
        newest = 0 if advantage.newest is None else advantage.newest
        batch = state.batch.add(decided.observation, decided.action, advantage.trace, newest, dropped)
        chain = self.chain.map(lambda stage, own: stage.observe(own, policy, transition), state.chain)
        after = state._replace(batch=batch, chain=chain)
        ended = any_of(transition.terminated, transition.truncated, dropped)
        return after if ended is False else self._restarted(after, ended)

    def update(self, state: ProximalState) -> ProximalState:
        """Use a batch that is full, and fit the critic where that is due."""
        due = state.batch.waiting >= self.update_every
        chain = self.chain.map(lambda stage, own: stage.solve(own, state.policy, due), state.chain)
        state = self.advantages.solve(state)._replace(chain=chain)
        batch = state.batch

        def learned(state: ProximalState) -> ProximalState:
            # The barrier keeps the compiler from working ahead of the loop in `where_any`.
            return self._update_from_batch(*jax.lax.optimization_barrier((state, batch)))

        # The loop does not carry the batch: mapped over seeds, it would copy it.
        state = where_any(due, learned, state._replace(batch=None))  # type: ignore[arg-type]
        return state._replace(batch=where(due, batch.emptied(), batch))

    def decisions_until_due(self, state: ProximalState) -> Int[Array, ""]:
        count = jnp.asarray(NEVER, jnp.int32)
        if self.baseline is not None:
            count = self.baseline.decisions_until_due(state.baseline)
        count = jnp.minimum(count, self.chain.decisions_until_due(state.chain))
        return jnp.minimum(self.update_every - 1 - state.batch.waiting, count)

    def readings(self, state: ProximalState) -> dict[str, Array]:
        """The level of rewards, `baseline`."""
        return {"baseline": self.advantages.level(state)}

    def gradient(self, policy: Policy, rows: PyTree, bonus: Float[Array, ""] | None = None) -> PyTree[Array]:
        r"""$\nabla_\theta L$ at the parameters of `policy`, for the decisions in `rows`: observations, actions, their
        log-probabilities under the old policy and advantages; `bonus`, what a nat of entropy is worth, if anything."""
        observations, actions, old, advantages = rows

        def gain(present: Policy) -> Float[Array, ""]:
            ratio = jnp.exp(jax.vmap(present.log_prob)(observations, actions) - old)
            limited = jnp.clip(ratio, 1 - self.clip, 1 + self.clip)
            total = jnp.mean(jnp.minimum(ratio * advantages, limited * advantages))
            return total if bonus is None else total + bonus * jnp.mean(jax.vmap(present.entropy)(observations))

        return gradient_of(gain, policy)

    def _update_from_batch(self, state: ProximalState, batch: Batch) -> ProximalState:
        """The state after all steps of a batch."""
        advantages = batch.advantages(self.decay, self.standardise)
        old = jax.vmap(state.policy.log_prob)(batch.observations, batch.actions)
        rows = (batch.observations, batch.actions, old, advantages)

        def step(state: ProximalState, places: Int[Array, " size"]) -> tuple[ProximalState, None]:
            chosen = jax.tree.map(lambda each: each[places], rows)
            bonus = None if self.entropy is None else at(self.entropy, state.steps)
            return self.chain.step(state, self.gradient(state.policy, chosen, bonus)), None

        return jax.lax.scan(step, state, batch.order(self.epochs, self.minibatches))[0]

    def _restarted(self, state: ProximalState, ended: Flag) -> ProximalState:
        """The state where an episode has `ended`."""
        chain = self.chain.map(lambda stage, own: stage.restart(own, ended), state.chain)
        fresh = self.advantages.restart(state)._replace(
            batch=state.batch.restart(), memory=abilities.initial_memory(state.policy)
        )
        return where(ended, fresh, state)._replace(chain=chain)


register(Learner, "proximal", ProximalPolicyOptimization)


@preset("ppo", "observations of thousands of numbers, and comparison")
def ppo(task: Learnable, steps: int, policy: PolicyTable | None = None) -> dict[str, Any]:
    r"""Proximal policy optimisation (Schulman et al., 2017): ten epochs of the clipped surrogate over each batch.

    Policy and critic have two hidden layers of 64 units each. Both see inputs relative to their running mean and
    deviation, and rewards are divided by the deviation of their discounted sum. A batch is a fiftieth of the `steps`,
    from 256 to 2,048 decisions; minibatches have 64. Advantages are generalised ones with $\gamma = 0.99$ and
    $\lambda = 0.95$, standardised by batch. Adam's learning rate is 3e-4 for the policy. The critic is fitted to the
    $\lambda$-returns of each batch by 40 steps of Adam with a learning rate of 1e-3.

    **Arguments**, **Returns** and **Raises:** as `natural`.

    ```python
    agent = mg.presets.ppo("hopper", 200_000, {"epochs": 4})
    ```
    """
    return _proximal(task, steps, policy)


@preset("ppo-short-horizon", "bodies with dozens of muscles, and millions of decisions")
def ppo_short_horizon(task: Learnable, steps: int, policy: PolicyTable | None = None) -> dict[str, Any]:
    r"""The preset `ppo` for bodies with many muscles: it looks ahead for a fifth of an episode.

    With a horizon h of a fifth of the longest episode, from 10 to 100 decisions, $\gamma = 1 - 1/h$, so 0.95 for
    episodes of 100 decisions, and $\lambda = 0.9$. All else is as in `ppo`.

    Choose it for bodies with dozens of muscles, such as a hand, and a budget of a million decisions and more. With
    fewer decisions, and on a finger, `natural_network` learned more.

    **Arguments**, **Returns** and **Raises:** as `natural`.

    ```python
    task = mg.tasks.myosuite("myoHandReachRandom-v0")
    agent = mg.presets.ppo_short_horizon(task, steps=9_000_000)
    ```
    """
    ahead = horizon(task, 1 / 5)
    table = _proximal(task, steps, policy, discount=1 - 1 / ahead, decay=0.9)
    if table["policy"]["kind"] in ("bounded-hyperplanes", "graded-hyperplanes"):
        table["policy"] = {"autocorrelation": 1 - 4 / ahead, **table["policy"]}
    return table


def _proximal(
    task: Learnable, steps: int, policy: PolicyTable | None = None, discount: float = DISCOUNT, decay: float = 0.95
) -> dict[str, Any]:
    """Proximal policy optimisation as a table: the clipped surrogate, ten times over each batch."""
    batch = large_batch(steps)
    fit = fitted_returns(batch, passes=40, learning_rate=1e-3)
    return {
        "kind": "proximal",
        "policy": behind_layers(task, SMALL, policy),
        "baseline": {"kind": "network-critic", "discount": discount, "decay": decay, "network": SMALL, "fit": fit},
        "decay": discount * decay,
        "update_every": batch,
        "clip": 0.2,
        "epochs": 10,
        "minibatches": batch // 64,
        "reward_scaling": {"discount": discount},
        "optimizer": {"kind": "adam", "learning_rate": 3e-4},
    }
