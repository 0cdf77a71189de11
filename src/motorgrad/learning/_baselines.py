r"""Baselines: the values with which rewards are compared, $\delta = r - b$.

A good baseline makes the gradient estimate far less noisy (Weaver & Tao, 2001). A constant does not bias it. A baseline
that follows the rewards biases short runs, and no longer biases long ones.

Baselines and critics share one interface. `init` makes the state, `observe` receives the observation for an action,
`update` receives the outcome of the action and returns the advantage. The reward is compared with the baseline *before*
the update.

A baseline may depend on the observation: $b(y_t)$ is what an action taken at $y_t$ is expected to earn. The observation
says nothing about which action was taken on it, so $b(y_t)$ does not bias the credit of that action. Older actions did
lead to $y_t$. Compared with $b(y_t)$ they would lose the credit for it: a trace of decay $\beta$ would estimate
$\nabla_\beta\eta - \beta\nabla_\beta\eta_b$, with $\eta_b$ the average of $b$. So only the newest action is compared
with $b(y_t)$, and older ones with a *level* $\ell$ that depends on no observation, the mean of all rewards:

$$g = (r - \ell)\,z_t + (\ell - b(y_t))\,w_0 s_t,$$

where $w_0 s_t$ is the newest score as the trace $z_t$ has it. For a trace without memory this is $(r - b(y_t))\,s_t$.
"""

import abc
from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
from jax.typing import DTypeLike
from jaxtyping import Array, Float, Int, PyTree

from motorgrad._branching import NEVER, where
from motorgrad._errors import check
from motorgrad._running import RunningMean, add_sample, counted_on, running_mean, two_sum
from motorgrad.learning._learner import Transition
from motorgrad.policies import Policy, abilities
from motorgrad.schema import Part, count, is_tracer, number


class Advantage(NamedTuple):
    r"""How much better an outcome was than expected, in units of reward.

    `value` is the advantage of the newest action. `trace` multiplies the eligibility trace: one number, or one for
    every parameter, in their structure. `newest`, where it is not `None`, multiplies the newest score and is added.
    """

    value: Float[Array, ""]
    trace: PyTree
    newest: Float[Array, ""] | None = None


class Baseline(Part):
    """What rewards are compared with: a baseline or a critic."""

    needs_eligibility: ClassVar[bool] = False
    """Whether `update` reads the eligibility of the transition, which is `None` otherwise."""
    newest_apart: ClassVar[bool] = False
    """Whether the newest action may have an advantage of its own, `Advantage.newest`."""
    needs_policy: ClassVar[bool] = False
    """Whether `update` asks the policy for probabilities, which no block of TimLab is told."""
    starts_at_random: ClassVar[bool] = False
    """Whether `start` draws random numbers."""

    @abc.abstractmethod
    def init(self, policy: Policy, dtype: DTypeLike) -> PyTree:
        """The state before any reward, for a policy's observations and actions."""

    def start(self, policy: Policy, dtype: DTypeLike, key: jax.Array) -> PyTree:
        """The state of one seed before any reward; `key` draws its random numbers. By default `init`."""
        return self.init(policy, dtype)

    @abc.abstractmethod
    def level(self, state: PyTree) -> Float[Array, ""]:
        """The present level of rewards, which depends on no observation: the metric `baseline` of a run."""

    @abc.abstractmethod
    def update(self, state: PyTree, policy: Policy, transition: Transition) -> tuple[Advantage, PyTree]:
        """The advantage of a transition, and the state after it. A transition that diverged must not change what the
        baseline has learned."""

    def observe(self, state: PyTree, observation: Float[Array, " inputs"]) -> PyTree:
        """The state once an action is chosen on `observation`."""
        return state

    def solve(self, state: PyTree) -> PyTree:
        """Do the work that is due once in many decisions. `decisions_until_due` returns when it is due."""
        return state

    def decisions_until_due(self, state: PyTree) -> Int[Array, ""]:
        """The least number of coming decisions in which `solve` changes nothing."""
        return jnp.asarray(NEVER, jnp.int32)

    def restart(self, state: PyTree) -> PyTree:
        """The state at the start of an episode."""
        return state

    @property
    def needs_episodes(self) -> str | None:
        """Why the baseline needs a task with episodes, as a setting; `None` where it does not."""
        return None


class ScalarBaseline(Baseline):
    """A baseline that depends on rewards alone. Subclasses define `init`, `level` and `learn`."""

    @abc.abstractmethod
    def learn(self, state: PyTree, reward: Float[Array, ""]) -> PyTree:
        """The state after a reward."""

    def update(self, state: PyTree, policy: Policy, transition: Transition) -> tuple[Advantage, PyTree]:
        error = transition.reward - self.level(state)
        return Advantage(error, error), where(transition.diverged, state, self.learn(state, transition.reward))


class Constant(ScalarBaseline):
    r"""A constant baseline, $b \equiv c$: for a task whose average reward is known. It does not bias the estimate."""

    value: float = number(help="$c$, in units of reward")

    def init(self, policy: Policy, dtype: DTypeLike) -> Float[Array, ""]:
        return jnp.zeros((), dtype)

    def level(self, state: Float[Array, ""]) -> Float[Array, ""]:
        return jnp.asarray(self.value, state.dtype)

    def learn(self, state: Float[Array, ""], reward: Float[Array, ""]) -> Float[Array, ""]:
        return state


class MeanReward(ScalarBaseline):
    r"""The running mean of all rewards, $b \leftarrow b + \delta/n$ for the n-th reward (Kimura et al., 1995)."""

    def init(self, policy: Policy, dtype: DTypeLike) -> RunningMean:
        return running_mean(jnp.zeros((), dtype))

    def level(self, state: RunningMean) -> Float[Array, ""]:
        return state.mean

    def learn(self, state: RunningMean, reward: Float[Array, ""]) -> RunningMean:
        return add_sample(state, reward)


class FixedStep(ScalarBaseline):
    r"""A mean that forgets, $b \leftarrow b + \gamma\delta$, and so follows a changing task (section 4.4.1)."""

    rate: float = number(0.01, 0, 1, open_low=True, help=r"$\gamma$, one over the memory in rewards")

    def init(self, policy: Policy, dtype: DTypeLike) -> Float[Array, ""]:
        return jnp.zeros((), dtype)

    def level(self, state: Float[Array, ""]) -> Float[Array, ""]:
        return state

    def learn(self, state: Float[Array, ""], reward: Float[Array, ""]) -> Float[Array, ""]:
        return state + self.rate * (reward - state)


class InputBaseline(Baseline):
    """A baseline that depends on the observation on which the newest action was taken."""

    newest_apart: ClassVar[bool] = True

    @abc.abstractmethod
    def value_at(self, state: PyTree, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        """The baseline $b(y)$ of an observation."""

    @abc.abstractmethod
    def learn(self, state: PyTree, observation: Float[Array, " inputs"], reward: Float[Array, ""]) -> PyTree:
        """The state after the reward of an action that was taken on `observation`."""

    def update(self, state: PyTree, policy: Policy, transition: Transition) -> tuple[Advantage, PyTree]:
        observation = abilities.critic_observation(policy, transition.observation)
        reward = transition.reward
        level = self.level(state)
        expected = self.value_at(state, observation)
        after = where(transition.diverged, state, self.learn(state, observation, reward))
        return Advantage(reward - expected, reward - level, level - expected), after


class LinearState(NamedTuple):
    """The `weights` of the inputs and, last, of 1; the `mean` of rewards."""

    weights: Float[Array, " inputs+1"]
    mean: RunningMean


class LinearBaseline(InputBaseline):
    r"""A linear function of the input, fitted by normalised least mean squares (Nagumo & Noda, 1967).

    $b(y) = w \cdot \phi(y)$ with $\phi(y) = (y, 1)$ and $w \leftarrow w + \gamma\,(r - b(y))\,\phi/|\phi|^2$. The step
    is relative to the length of the input, so no input is too large for it.
    """

    rate: float = number(0.01, 0, 1, open_low=True, help=r"$\gamma$; 1 fits every reward at once and remembers little")

    def init(self, policy: Policy, dtype: DTypeLike) -> LinearState:
        inputs = abilities.critic_observation(policy, jnp.zeros(policy.inputs)).size
        return LinearState(jnp.zeros(inputs + 1, dtype), running_mean(jnp.zeros((), dtype)))

    def level(self, state: LinearState) -> Float[Array, ""]:
        return state.mean.mean

    def value_at(self, state: LinearState, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        return jnp.sum(state.weights * _features(state, observation))

    def learn(self, state: LinearState, observation: Float[Array, " inputs"], reward: Float[Array, ""]) -> LinearState:
        features = _features(state, observation)
        error = reward - jnp.sum(state.weights * features)
        weights = state.weights + self.rate * error * features / jnp.sum(features**2)
        return LinearState(weights, add_sample(state.mean, reward))


def _features(state: LinearState, observation: Float[Array, " inputs"]) -> Float[Array, " inputs+1"]:
    return jnp.append(observation, 1).astype(state.weights.dtype)


class BinnedBaseline(InputBaseline):
    r"""The mean reward in each bin of one observed number.

    The bins have equal widths from `low` to `high`; values below or above belong to the first or the last. A bin
    without a reward yet has the mean of all rewards.

    **Raises:** `ValueError` for a value out of range; from `init`, for an input that the task does not have.
    """

    low: float = number(0.0, help="the lower bound, in units of the observed number")
    high: float = number(1.0, help="the upper bound")
    bins: int = count(10, 1, 1_000_000, help="number of bins")
    input: int = count(0, help="the index of the observed number")
    rate: float = number(
        0.0,
        0,
        1,
        help=r"$\gamma$; the n-th reward of a bin moves its mean by $\max(1/n, \gamma)$ of the distance: 0 for the "
        r"mean of all so far, more for a memory of $1/\gamma$ rewards",
    )

    def validate(self) -> None:
        known = not (is_tracer(self.low) or is_tracer(self.high))
        check(not known or self.low < self.high, "low, high", (self.low, self.high), "finite, low < high")

    def init(self, policy: Policy, dtype: DTypeLike) -> RunningMean:
        inputs = abilities.critic_observation(policy, jnp.zeros(policy.inputs)).size
        check(self.input < inputs, "input", self.input, f"one of {inputs} observed numbers, 0 … {inputs - 1}")
        return running_mean(jnp.zeros(self.bins + 1, dtype))._replace(count=jnp.zeros(self.bins + 1, jnp.uint32))

    def bin(self, observation: Float[Array, " inputs"]) -> Array:
        """The index of the bin of an observation."""
        place = (observation[self.input] - self.low) * (self.bins / (self.high - self.low))
        return jnp.clip(jnp.floor(place), 0, self.bins - 1).astype(jnp.int32)

    def level(self, state: RunningMean) -> Float[Array, ""]:
        return state.mean[-1]

    def value_at(self, state: RunningMean, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        # A comparison with every bin: inside a loop over many seeds it is quicker than an indexed load.
        means = jnp.where(state.count > 0, state.mean, state.mean[-1])
        return jnp.sum(jnp.where(self._mask(observation)[:-1], means[:-1], 0))

    def learn(self, state: RunningMean, observation: Float[Array, " inputs"], reward: Float[Array, ""]) -> RunningMean:
        mask = self._mask(observation)
        count = counted_on(state.count, mask)
        rates = jnp.broadcast_to(jnp.asarray(self.rate, state.mean.dtype), (self.bins,))
        least = jnp.append(rates, 0)  # the mean of all rewards forgets nothing
        step = jnp.maximum(1 / count.astype(state.mean.dtype), least.astype(state.mean.dtype))
        distance = (reward - state.mean) - state.carry
        moved = RunningMean(*two_sum(state.mean, state.carry, step * distance), count)
        return RunningMean(*(jnp.where(mask, new, old) for new, old in zip(moved, state, strict=True)))

    def _mask(self, observation: Float[Array, " inputs"]) -> Array:
        """The means that an observation belongs to: that of its bin and, last, that of all."""
        return jnp.append(jnp.arange(self.bins) == self.bin(observation), True)
