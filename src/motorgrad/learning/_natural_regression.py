r"""Natural gradients by regression (Peters & Schaal, 2008): no gradient is estimated, and no Fisher matrix.

The advantage of an action is approximated by $w \cdot \psi$, linear in its score $\psi = \nabla\log\pi$. The weights of
least square error are the natural gradient, $w = F^{-1}\nabla\eta$ (Sutton et al., 2000; Kakade, 2001). Both rules here
find them together with the values that advantages are relative to, and step along them in place of the estimator's
gradient, which they do not read.
"""

from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Int, PyTree

from motorgrad._branching import Flag, where, where_any
from motorgrad._errors import check
from motorgrad._linear_algebra import linear_solve
from motorgrad._running import RunningMean, add_sample, running_mean
from motorgrad.learning._chain import Updates
from motorgrad.learning._critic_fits import CriticFit, CriticStep, LeastSquares
from motorgrad.learning._critics import Features, check_blind, endless
from motorgrad.learning._learner import Transition
from motorgrad.learning._natural import Metric, zeros_of
from motorgrad.learning._schedules import Steps
from motorgrad.policies import Policy, abilities, trainable
from motorgrad.schema import inner, number


class RegressionMetric(Metric):
    """A metric that finds the direction of a step by regression on scores."""

    reads_gradient: ClassVar[bool] = False

    def score(self, policy: Policy, transition: Transition) -> Float[Array, " parameters"]:
        """The score of a decision, as one vector."""
        return ravel_pytree(policy.score(transition.observation, transition.action))[0]

    def along(self, policy: Policy, direction: Float[Array, " parameters"]) -> Updates:
        """The updates, which descend, of a direction that ascends."""
        return ravel_pytree(trainable(policy))[1](-direction)


class CompatibleState(NamedTuple):
    r"""The weights of the features $\phi$ and, last, $w$ of the scores; the mean of rewards; the state of the fit."""

    weights: Float[Array, " features"]
    reward: RunningMean
    fit: PyTree


class LeastSquaresNatural(RegressionMetric):
    r"""LSTD natural actor-critic (Peters & Schaal, 2008): least squares for values and advantages at once.

    By LSTD(λ), the weights $(v, w)$ solve

    $$r_{t+1} - \rho + \gamma\,v \cdot \phi(y_{t+1}) = v \cdot \phi(y_t) + w \cdot \psi_t + \text{noise},$$

    with $(\phi_t, \psi_t)$ as features of a decision and $(\phi_{t+1}, 0)$ as those of the next. The step is along $w$,
    the natural gradient. Give the learner an estimator without baseline: its gradient is not read.

    **Raises:** `ValueError` for a value out of range, and for features that see the previous action; from `init`, for a
    policy with more than 4,096 parameters.
    """

    features: Features = inner(Features(), help=r"$\phi$, without the previous action")
    discount: float | None = number(
        None, 0, 1, help=r"none for the average reward, or $\gamma$; 1 needs a task with episodes"
    )
    decay: float = number(0.9, 0, 1, help=r"$\lambda$ of the trace of the features")
    fit: CriticFit = inner(
        LeastSquares(),
        help="`LeastSquares`: memory, damping and interval, best that of the learner's steps, and the memory a few of "
        "them",
    )

    def validate(self) -> None:
        check_blind(self.features)
        check(isinstance(self.fit, LeastSquares), "fit", type(self.fit).__name__, "LeastSquares")

    @property
    def needs_episodes(self) -> str | None:
        return endless(self.discount, self.decay)

    def init(self, policy: Policy) -> CompatibleState:
        zeros = zeros_of(policy)
        seen = self.features(abilities.critic_observation(policy, jnp.zeros(policy.inputs, zeros.dtype)))
        weights = jnp.zeros(seen.size + zeros.size, zeros.dtype)
        return CompatibleState(weights, running_mean(jnp.zeros((), zeros.dtype)), self.fit.init(weights, weights.size))

    def observe(self, state: CompatibleState, policy: Policy, transition: Transition) -> CompatibleState:
        dtype = state.weights.dtype
        horizon = 1.0 if self.discount is None else self.discount
        score = self.score(policy, transition)
        present = self.features(abilities.critic_observation(policy, transition.observation))
        following = self.features(transition.next_observation)
        following = jnp.where(transition.terminated, 0, following)
        slope = jnp.concatenate([present, score]).astype(dtype)
        later = jnp.concatenate([following, jnp.zeros_like(score)]).astype(dtype)
        reward = jnp.asarray(transition.reward, dtype)
        level = self._level(state)
        error = reward - level - state.weights @ (slope - horizon * later)
        step = CriticStep(slope, later, reward, level, error, horizon, self.decay)
        weights, fit = self.fit.update(state.weights, state.fit, step, transition.diverged)
        mean = add_sample(state.reward, reward, self.fit.mean_rate)
        return CompatibleState(weights, where(transition.diverged, state.reward, mean), fit)

    def solve(self, state: CompatibleState, policy: Policy, due: Flag) -> CompatibleState:
        weights, fit = self.fit.solve(state.weights, state.fit, self._level(state), self)
        return state._replace(weights=weights, fit=fit)

    def decisions_until_due(self, state: CompatibleState) -> Int[Array, ""]:
        return self.fit.decisions_until_due(state.fit)

    def update(
        self, updates: Updates, state: CompatibleState, policy: Policy, steps: Steps, due: Flag
    ) -> tuple[Updates, CompatibleState]:
        size = ravel_pytree(trainable(policy))[0].size
        return self.along(policy, state.weights[-size:]), state

    def restart(self, state: CompatibleState, ended: Flag) -> CompatibleState:
        return state._replace(fit=where(ended, self.fit.restart(state.fit), state.fit))

    def _level(self, state: CompatibleState) -> Float[Array, ""]:
        return state.reward.mean if self.discount is None else jnp.zeros_like(state.reward.mean)


class EpisodicState(NamedTuple):
    r"""The sum of `scores` $x$ of the present episode, with a last entry of 1, its `earned` return $R$, the `weight`
    $\gamma^t$ and whether it `broke`; the `means` of $xx'$ and $xR$ over all episodes, and the `direction` that solves
    them."""

    scores: Float[Array, " parameters+1"]
    earned: Float[Array, ""]
    weight: Float[Array, ""]
    broke: Bool[Array, ""]
    means: RunningMean
    direction: Float[Array, " parameters"]


class EpisodicNatural(RegressionMetric):
    r"""Episodic natural actor-critic (Peters & Schaal, 2008): returns of episodes, regressed on their scores.

    $$\sum_t \gamma^t r_{t+1} = w \cdot \sum_t \gamma^t\psi_t + J + \text{noise} .$$

    The intercept $J$ is the mean return, and the step is along $w$, the natural gradient of it. No critic is needed,
    and no values of states. It takes more episodes than there are parameters to know all of $w$; damping makes up for
    what is missing. Give the learner an estimator without baseline: its gradient is not read.

    **Raises:** `ValueError` for a value out of range, for a task without episodes and for several `envs`; from
    `init`, for a policy with more than 4,096 parameters.
    """

    single_stream: ClassVar[bool] = True  # its means change with the end of an episode

    discount: float = number(1.0, 0, 1, open_low=True, help=r"$\gamma$ within an episode")
    rate: float = number(
        0.01, 0, 1, help=r"the n-th episode moves the means by $\max(1/n, \text{rate})$ of its distance"
    )
    damping: float = number(0.1, 0, open_low=True, help="$d$, in units of the squared sum of scores of an episode")

    @property
    def needs_episodes(self) -> str | None:
        return "kind = 'episodic-nac'"

    def init(self, policy: Policy) -> EpisodicState:
        zeros = zeros_of(policy)
        scores = jnp.zeros(zeros.size + 1, zeros.dtype)
        means = running_mean((jnp.zeros((scores.size, scores.size), zeros.dtype), scores))
        zero = jnp.zeros((), zeros.dtype)
        one = jnp.ones((), zeros.dtype)
        return EpisodicState(scores, zero, one, jnp.zeros((), bool), means, zeros)

    def observe(self, state: EpisodicState, policy: Policy, transition: Transition) -> EpisodicState:
        score = jnp.append(self.score(policy, transition), 0)
        after = state._replace(
            scores=(state.scores + state.weight * score).at[-1].set(1),
            earned=state.earned + (state.weight * transition.reward).astype(state.earned.dtype),
            weight=state.weight * self.discount,
        )
        return where(transition.diverged, state._replace(broke=jnp.ones((), bool)), after)

    def restart(self, state: EpisodicState, ended: Flag) -> EpisodicState:
        episode = state.scores, state.earned

        def take_in(means: RunningMean) -> RunningMean:
            # The barrier keeps the compiler from working ahead of the loop in `where_any`.
            scores, earned = jax.lax.optimization_barrier(episode)
            return add_sample(means, (scores[:, None] * scores, earned * scores), self.rate)

        whole = jnp.asarray(ended) & ~state.broke & (state.scores[-1] > 0)
        means = where_any(whole, take_in, state.means)
        fresh = EpisodicState(
            scores=jnp.zeros_like(state.scores),
            earned=jnp.zeros_like(state.earned),
            weight=jnp.ones_like(state.weight),
            broke=jnp.zeros_like(state.broke),
            means=means,
            direction=state.direction,
        )
        return where(ended, fresh, state._replace(means=means))

    def update(
        self, updates: Updates, state: EpisodicState, policy: Policy, steps: Steps, due: Flag
    ) -> tuple[Updates, EpisodicState]:
        def solve(old: Array) -> Array:
            # The barrier keeps the compiler from working ahead of the loop in `where_any`.
            squares, products = jax.lax.optimization_barrier(state.means.mean)
            share = jnp.maximum(squares[-1, -1], jnp.finfo(squares.dtype).tiny)
            mean = squares[-1, :-1] / share  # the intercept, taken out by hand, has no damping
            matrix = squares[:-1, :-1] - share * mean[:, None] * mean
            right = products[:-1] - products[-1] * mean
            return linear_solve(matrix + self.damping * jnp.eye(mean.size, dtype=mean.dtype), right)

        direction = where_any(due, solve, state.direction)
        return self.along(policy, direction), state._replace(direction=direction)
