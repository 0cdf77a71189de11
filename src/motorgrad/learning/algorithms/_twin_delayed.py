r"""TD3: twin delayed deep deterministic policy gradient, from experience of any age (Fujimoto, van Hoof & Meger, 2018).

Soft actor-critic follows the value of the actions that a policy *draws*. Here it is that of its most probable action,
$\mu_\theta(y)$, which is all that is learned; the noise that explores is the policy's own, and stays as it is.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PyTree

from motorgrad._branching import where_any
from motorgrad.learning._action_value_ensemble import EnsembleState
from motorgrad.learning._gradients import gradient_of
from motorgrad.learning._learner import Decision, Learner
from motorgrad.learning._replay import Drawn, Experience
from motorgrad.learning._replay_learner import ReplayLearner
from motorgrad.learning._scaling import ScalingState
from motorgrad.learning._schedules import Steps
from motorgrad.learning.algorithms._presets import Learnable, PolicyTable, behind_layers, horizon, preset
from motorgrad.policies import Policy, abilities, split, trainable
from motorgrad.schema import count, number, register


class TwinDelayedState(NamedTuple):
    """The policy; the parameters of its `slow` copy; the action values; the `experience`; how many decisions were kept
    since the last update, `waiting`; how many `batches` were used; the states of the gradient transformations, and of
    the `scaling` of rewards; how often the policy has moved, `steps`; of a policy whose noise lasts its `memory`, and
    what it saw and drew."""

    policy: Policy
    slow: PyTree[Array]
    values: EnsembleState
    experience: Experience
    waiting: Int[Array, ""]
    batches: Int[Array, ""]
    chain: tuple[PyTree, ...]
    scaling: ScalingState | None = None
    steps: Steps = None
    memory: Float[Array, " memory"] | None = None
    decision: Decision | None = None


class TwinDelayed(ReplayLearner):
    r"""TD3 (Fujimoto, van Hoof & Meger, 2018): the policy follows the value of its most probable action.

    Decisions are kept. After every `update_every` of them, batches are drawn, and for each batch the values make a step
    towards

    $$r + \gamma \min_k \bar Q_k\big(y', \bar a\big),\qquad \bar a \sim \bar\pi(\cdot \mid y')
    \text{ within the central share of its noise,}$$

    so that a sharp peak of a value is no target. After every `delay` batches the policy makes a step along

    $$g = \nabla_\theta\,\mathbb E\,Q_1(y, \mu_\theta(y)).$$

    $\bar Q$ and $\bar\pi$ are slow copies of the values and of the policy. The paper adds clipped normal noise to
    $\bar\mu$ instead, and moves the slow copies with the policy alone; here they move with every batch.

    **Raises:** from `init`, `ValueError` for a policy whose actions are not all real numbers.

    ```python
    policy = mg.policies.bounded_hyperplanes(task, deviation=0.2)
    agent = mg.learning.TwinDelayed(policy, update_every=40, replay=mg.learning.Replay(updates=10))
    ```
    """

    delay: int = count(2, 1, 1_000_000, unit="batches", help="from one step of the policy to the next")
    smoothing: float = number(
        0.95, 0, 1, help="the central share of the policy's noise from which next actions are drawn; 0 for no noise"
    )
    tracking: float = number(0.01, 0, 1, help="the share of the distance by which the policy's slow copy moves")

    def init(self, key: jax.Array) -> TwinDelayedState:
        policy = self.first_policy(key)
        batches = jnp.zeros((), jnp.int32)
        return TwinDelayedState(**self.first_fields(policy, key), slow=trainable(policy), batches=batches)

    def update_from_batch(self, state: TwinDelayedState, batch: Drawn, key: jax.Array) -> TwinDelayedState:
        """The state after a step of the values with a batch of decisions, and one of the policy where that is due."""
        following = batch.next_observation
        slow = abilities.marginal(eqx.combine(state.slow, split(state.policy)[1]))
        drawn = jax.random.uniform(key, (len(following), slow.uniforms), following.dtype)
        # An action is a quantile of its distribution: of numbers about ½ it is near the most probable one.
        central = 0.5 + self.smoothing * (drawn - 0.5)
        later = self.values.later(state.values, following, jax.vmap(slow.sample)(following, central))
        values = self.values.update(state.values, batch, later, state.steps)
        batches = (state.batches + 1) % self.delay

        def moved(state: TwinDelayedState) -> TwinDelayedState:
            return self.chain.step(state, self._gradient(values, state.policy, batch))

        state = where_any(batches == 0, moved, state._replace(values=values, batches=batches))
        slow_copy = jax.tree.map(
            lambda old, new: (old + self.tracking * (new - old)).astype(old.dtype), state.slow, trainable(state.policy)
        )
        return state._replace(slow=slow_copy)

    def set_policy(self, state: TwinDelayedState, policy: Policy) -> TwinDelayedState:
        """The state with another policy in place, also of the slow copy. States of many seeds are allowed."""
        state = super().set_policy(state, policy)
        return state._replace(slow=trainable(state.policy))

    def _gradient(self, values: EnsembleState, policy: Policy, batch: Drawn) -> PyTree[Array]:
        """The mean gradient of the first value over a batch, for the most probable actions."""

        def gain(whole: Policy) -> Float[Array, ""]:
            action = jax.vmap(abilities.marginal(whole).mode)(batch.observation)
            return batch.mean(self.values.values(values.weights, batch.observation, action)[0])

        return gradient_of(gain, policy)


register(Learner, "twin-delayed", TwinDelayed)


@preset("td3", "real-valued actions, by a policy without entropy; for comparison with `sac`")
def td3(task: Learnable, steps: int, policy: PolicyTable | None = None) -> dict[str, Any]:
    r"""TD3 (Fujimoto, van Hoof & Meger, 2018) with replay, lasting noise, and targets in hindsight.

    For tasks with real-valued actions. Networks, hindsight, discount and scaled rewards are those of `sac`. After every
    40 decisions, ten batches of 256 are drawn, with a learning rate of 5e-4; the policy moves with every second batch.
    The deviation of a squashed number stays at 0.3. Averaging begins with the last eighth of the `steps`.

    **Arguments** and **Returns:** as `natural`.

    **Raises:** as `natural`; for a task whose actions are not all real numbers.
    """
    ahead = horizon(task, 1 / 5)
    network = {"hidden": [128, 128], "activation": "relu", "sparsity": 0.0, "standardise": True}
    own = behind_layers(task, network, policy)
    if own["kind"] in ("bounded-hyperplanes", "graded-hyperplanes"):
        own = {**own, "deviation": 0.3, "autocorrelation": max(0.0, 1 - 15 / ahead)}
    hindsight = {"kind": "hindsight", "share": 2 / 3, "ahead": ahead, "others": 0.5}
    moves = max(0, steps - 1_000) // 40 * 10 // 2
    return {
        "kind": "twin-delayed",
        "policy": own,
        "update_every": 40,
        "values": {"discount": 1 - 1 / ahead, "network": network},
        "replay": {
            "capacity": min(300_000, max(1_000, 5 * steps // 4)),
            "start": 1_000,
            "updates": 10,
            "hindsight": None if task.goal is None else hindsight,
        },
        "reward_scaling": {"discount": 1 - 1 / ahead},
        "optimizer": {"kind": "adam", "learning_rate": 5e-4},
        "averaging": {"start": max(0, moves - steps // 40 * 10 // 2 // 8)},
    }
