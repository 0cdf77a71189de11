r"""Credit only where the action changes: differences of action values at action transitions.

The policy gradient is $\mathbb E[\nabla\log\pi(a \mid y)\,(Q(y, a) - c)]$ for any $c$ that does not depend on $a$
(Sutton, McAllester, Singh & Mansour, 2000). The value of the action $b$ of the decision *before* is such a $c$. With
it, a sample is 0 if the action stays the same, and otherwise the worth of changing it:

$$g = (Q(y, a) - Q(y, b))\,\nabla\log\pi(a \mid y).$$

Limiting the estimate to action transitions is the idea of Grudic & Ungar (2000). Their algorithm, Action Transition
Policy Gradient, is known here by that description alone: the estimator and its values are derived from the policy
gradient theorem.
"""

from typing import ClassVar, Literal, NamedTuple

import jax
import jax.numpy as jnp
from jax.typing import DTypeLike
from jaxtyping import Array, Float, Int, PyTree

from motorgrad._branching import where
from motorgrad._errors import check
from motorgrad._running import RunningMean, add_sample, running_mean
from motorgrad.learning._baselines import Advantage, Baseline
from motorgrad.learning._critic_fits import CriticFit, CriticStep, LeastSquares, TemporalDifference
from motorgrad.learning._critics import Features, check_blind, endless
from motorgrad.learning._learner import Transition
from motorgrad.policies import Policy, abilities
from motorgrad.schema import inner, number, static

MAX_ACTIONS = 64


class TransitionState(NamedTuple):
    """The weights of every action's features, one action after the other; the mean of rewards; the state of the fit;
    the index of the `previous` action, -1 at the start of an episode."""

    weights: Float[Array, " actions*features"]
    reward: RunningMean
    fit: PyTree
    previous: Int[Array, ""]


class ActionTransitions(Baseline):
    r"""How much better an action is than the one before it, $Q(y_t, a_t) - Q(y_t, a_{t-1})$, by learned action values.

    Only the newest action is credited, whatever the trace: $Q$ contains what comes later. Use a trace of decay 0, which
    costs least. Values are linear in features of the observation, $Q(y, a) = w_a \cdot \phi(y)$, with
    weights for each action, and learned by expected SARSA (Van Seijen, Van Hasselt, Whiteson & Wiering, 2009):

    $$\delta = r - \rho + \gamma \sum_{a'} \pi(a' \mid y')\,Q(y', a') - Q(y, a).$$

    With exact values the mean of samples is the exact gradient: of the average reward without a `discount`. With
    inexact values it is $\mathbb E \sum_a \nabla\pi(a \mid y)\,Q(y, a)$ for these values. The first action
    of an episode has no predecessor and is compared with the mean over actions.

    **Raises:** `ValueError` for a value out of range, for features that see the previous action and for another fit;
    from `init`, for a policy with more than 64 actions, with real-valued ones, with hidden units or a memory.

    ```python
    estimator = mg.learning.Estimator(mg.learning.Exponential(0.0), mg.learning.ActionTransitions())
    agent = mg.Agent(mg.policies.softmax(task), estimator, mg.learning.SGD(0.1))
    ```
    """

    needs_policy: ClassVar[bool] = True
    newest_apart: ClassVar[bool] = True

    features: Features = inner(
        Features(bias=False),
        help=r"$\phi$, without the previous action. Those of a constant sum leave values of the average reward "
        r"undetermined by a constant, which does not matter here",
    )
    discount: float | None = number(
        None,
        0,
        1,
        help=r"$\gamma$, with $\rho = 0$, 1 for a task with episodes; none for the average reward, $\gamma = 1$",
    )
    decay: float = number(
        0.0, 0, 1, help=r"$\lambda$ of the trace of the features; 1 for the average reward needs a task with episodes"
    )
    fit: CriticFit = inner(LeastSquares(), help="how $w$ is learned, `LeastSquares` or `TemporalDifference`")
    relative_to: Literal["previous", "mean"] = static(
        "previous", help="what $Q(y, a)$ is compared with, the action before, or the mean, which makes it the advantage"
    )

    def validate(self) -> None:
        check_blind(self.features)
        known = isinstance(self.fit, LeastSquares | TemporalDifference)
        check(known, "fit", type(self.fit).__name__, "LeastSquares or TemporalDifference")

    @property
    def needs_episodes(self) -> str | None:
        return endless(self.discount, self.decay)

    def init(self, policy: Policy, dtype: DTypeLike) -> TransitionState:
        kind = policy.actions
        name = type(policy).__name__
        more = abilities.has_hidden_units(policy) or abilities.has_memory(policy)
        plain = kind in ("binary", "discrete") and not more
        wanted = "one with binary or discrete actions, no hidden units and no memory, for ActionTransitions"
        check(plain, "policy", name, wanted)
        few = policy.outputs <= MAX_ACTIONS if kind == "discrete" else 2**policy.outputs <= MAX_ACTIONS
        check(few, "policy", f"{name} of {policy.outputs} {kind} outputs", f"one of at most {MAX_ACTIONS} actions")
        size = self.features(jnp.zeros(policy.inputs, dtype)).size * len(abilities.enumerate(policy))
        weights = jnp.zeros(size, dtype)
        fit = self.fit.init(weights, size)
        return TransitionState(weights, running_mean(jnp.zeros((), dtype)), fit, jnp.full((), -1, jnp.int32))

    def level(self, state: TransitionState) -> Float[Array, ""]:
        return state.reward.mean

    def values(self, state: TransitionState, observation: Float[Array, " inputs"]) -> Float[Array, " actions"]:
        """$Q(y, a)$ of every action, in the order of `abilities.enumerate`."""
        phi = self.features(observation.astype(state.weights.dtype))
        return jnp.sum(state.weights.reshape(-1, phi.size) * phi, axis=1)

    def update(
        self, state: TransitionState, policy: Policy, transition: Transition
    ) -> tuple[Advantage, TransitionState]:
        dtype = state.weights.dtype
        actions = abilities.enumerate(policy)
        observation = transition.observation.astype(dtype)
        later = transition.next_observation.astype(dtype)
        rows = actions.reshape(len(actions), -1)
        taken = jnp.all(rows == jnp.ravel(transition.action), axis=1).argmax().astype(jnp.int32)

        def chances(y: Array) -> Float[Array, " actions"]:
            return jnp.exp(jax.vmap(lambda action: policy.log_prob(y, action))(actions)).astype(dtype)

        values = self.values(state, observation)
        compared = jnp.sum(chances(observation) * values)
        if self.relative_to == "previous":
            compared = jnp.where(state.previous >= 0, values[state.previous], compared)
        worth = values[taken] - compared

        slope = jnp.outer(jnp.arange(len(actions)) == taken, self.features(observation)).ravel().astype(dtype)
        following = jnp.outer(chances(later), self.features(later)).ravel().astype(dtype)
        following = jnp.where(transition.terminated, 0, following)
        horizon = 1.0 if self.discount is None else self.discount
        level = self._compared(state)
        reward = jnp.asarray(transition.reward, dtype)
        error = reward - level - jnp.sum(state.weights * (slope - horizon * following))
        step = CriticStep(slope, following, reward, level, error, horizon, self.decay)
        weights, fit = self.fit.update(state.weights, state.fit, step, transition.diverged)
        mean = where(transition.diverged, state.reward, add_sample(state.reward, reward, self.fit.mean_rate))
        return Advantage(worth, jnp.zeros_like(worth), worth), TransitionState(weights, mean, fit, taken)

    def solve(self, state: TransitionState) -> TransitionState:
        weights, fit = self.fit.solve(state.weights, state.fit, self._compared(state), self)
        return state._replace(weights=weights, fit=fit)

    def decisions_until_due(self, state: TransitionState) -> Int[Array, ""]:
        return self.fit.decisions_until_due(state.fit)

    def restart(self, state: TransitionState) -> TransitionState:
        return state._replace(fit=self.fit.restart(state.fit), previous=jnp.full_like(state.previous, -1))

    def _compared(self, state: TransitionState) -> Float[Array, ""]:
        return state.reward.mean if self.discount is None else jnp.zeros_like(state.reward.mean)
