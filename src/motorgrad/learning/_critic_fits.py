"""How the weights of a critic are learned: temporal differences, and least squares."""

import abc
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PyTree

from motorgrad._branching import NEVER, Flag, Scalar, where, where_any
from motorgrad._linear_algebra import linear_solve
from motorgrad._running import RunningMean, add_sample, running_mean
from motorgrad.schema import Part, count, number

Weights = Float[Array, " features"]


class CriticStep(NamedTuple):
    r"""What a critic learns from one decision.

    `slope` $\nabla_w v(y_t)$, of a linear critic the features $\phi(y_t)$; for a linear critic, `next_features`
    $\phi(y_{t+1})$, 0 where the episode terminated; the `reward`, and the `level` $\rho$ that it is compared with; the
    temporal difference `error` $\delta$; $\gamma$ and $\lambda$, `discount` and `decay`. What the critic has `seen`
    of the decision and of the `following` one, $\phi(y_t)$ and $\phi(y_{t+1})$, and whether the episode `terminated`.
    """

    slope: PyTree[Array]
    next_features: PyTree
    reward: Float[Array, ""]
    level: Float[Array, ""]
    error: Float[Array, ""]
    discount: Scalar
    decay: Scalar
    seen: Weights | None = None
    following: Weights | None = None
    terminated: Flag = False


class CriticFit(Part):
    """How the weights of a critic are learned."""

    linear: ClassVar[bool] = True
    """Whether it is for linear critics alone, whose weights are one vector."""
    single_stream: ClassVar[bool] = False
    """Whether successive decisions must be of one environment."""
    leaves_errors: ClassVar[bool] = True
    """Whether the level of rewards may learn from the temporal differences of discounted values. Those of a rule that
    solves for the weights have the mean 0 at any level."""

    @abc.abstractmethod
    def init(self, weights: PyTree, features: int) -> PyTree:
        """The state before any decision, for a critic with `features` features and weights of this structure, all 0."""

    @abc.abstractmethod
    def update(self, weights: PyTree, state: PyTree, step: CriticStep, dropped: Flag = False) -> tuple[PyTree, PyTree]:
        """The weights and the state after one decision. A decision that is `dropped` changes nothing learned."""

    @abc.abstractmethod
    def restart(self, state: PyTree) -> PyTree:
        """The state at the start of an episode."""

    @property
    @abc.abstractmethod
    def mean_rate(self) -> float:
        """One over the memory of the mean of rewards: the n-th moves it by at least this share of the distance."""

    def solve(self, weights: PyTree, state: PyTree, level: Float[Array, ""], critic: Any) -> tuple[PyTree, PyTree]:
        """Do the work that is due once in many decisions, with rewards compared with the `level`.

        The `critic` whose weights they are has a function `value(weights, features)`, a `horizon` and a `decay`.
        """
        return weights, state

    def decisions_until_due(self, state: PyTree) -> Int[Array, ""]:
        """The least number of coming decisions in which `solve` changes nothing."""
        return jnp.asarray(NEVER, jnp.int32)


def level_rate() -> Any:
    """Declare the `level_rate` of a fit, one over the memory of the mean of rewards."""
    return number(
        1e-3,
        0,
        1,
        help="the n-th reward moves the mean of rewards by the greater of 1/n and this share of its distance",
    )


class LevelFit(CriticFit):
    """A fit with a rate of its own for the mean of rewards."""

    level_rate: eqx.AbstractVar[float]

    @property
    def mean_rate(self) -> float:
        return self.level_rate


class TemporalDifference(LevelFit):
    r"""TD(λ) with accumulating traces (Sutton, 1988; Tsitsiklis & Van Roy, 1999).

    $w \leftarrow w + \alpha\,\delta e$ with $e \leftarrow \gamma\lambda e + \nabla_w v(y_t)$; for a linear critic the
    gradient is $\phi$. The value of the next state counts as given.
    """

    linear: ClassVar[bool] = False

    learning_rate: float = number(
        0.01,
        0,
        help=r"$\alpha$. Steps of a linear critic are stable where $\alpha$ times the squared length of the features "
        r"is well below 1",
    )
    level_rate: float = level_rate()

    def init(self, weights: PyTree, features: int) -> PyTree:
        return weights

    def update(self, weights: PyTree, state: PyTree, step: CriticStep, dropped: Flag = False) -> tuple[PyTree, PyTree]:
        trace = jax.tree.map(lambda e, slope: step.discount * step.decay * e + slope, state, step.slope)
        rate = self.rate_of(step.error, trace)
        moved = eqx.apply_updates(weights, jax.tree.map(lambda e: rate * step.error * e, trace))
        return where(dropped, weights, moved), trace

    def rate_of(self, error: Float[Array, ""], trace: PyTree) -> Scalar:
        r"""The step size $\alpha$ of a decision."""
        return self.learning_rate

    def restart(self, state: PyTree) -> PyTree:
        return jax.tree.map(jnp.zeros_like, state)


MANY_FEATURES = 100
"""From so many features on, one product of matrices takes in all decisions of an interval. With 400 features this needs
a tenth of the time of a product of vectors at every decision. With a few features it is slower."""


class LeastSquaresState(NamedTuple):
    r"""The `trace` $e$; the `means` of $e d'$, $e r$ and $e$; what is `waiting` to enter them, of the decisions
    `gathered` since: the sums of $e d'$, $e r$ and $e$, or, of many features, the rows $e$, $d$ and $r$."""

    trace: Weights
    means: RunningMean
    waiting: tuple[Array, Array, Array]
    gathered: Int[Array, ""]


class LeastSquares(CriticFit):
    r"""Recursive least squares for temporal differences, LSTD(λ) (Bradtke & Barto, 1996; Boyan, 2002).

    The weights are those for which the temporal differences, weighted by the trace, have the mean 0:

    $$(A + d\,I)\,w = b, \qquad A = \overline{e\,(\phi_t - \gamma\phi_{t+1})'}, \qquad
    b = \overline{e\,r} - \rho\,\overline{e}.$$

    The means are running ones: the n-th decision moves them by $\max(1/(n + 1), \text{rate})$ of its distance from
    them. $A$ starts as `initial` times the identity, which counts as one decision. Without damping, these are the
    weights of the recursion by rank-one updates of $A^{-1}$. That recursion accumulates rounding errors, and while it
    forgets, directions in which nothing happens grow without bounds. So $A$ itself is kept and the system solved every
    `interval` decisions, which the means take in together. Between two solutions the weights do not change.
    """

    leaves_errors: ClassVar[bool] = False

    rate: float = number(
        1e-3, 0, 1, help="rate of forgetting: a memory of 1/rate decisions; 0 for a policy that does not change"
    )
    initial: float = number(
        1.0, 0, open_low=True, at_start=True, help="first diagonal of $A$, of the order of a squared feature"
    )
    damping: float = number(
        1e-3,
        0,
        help="$d$, in the same units. It bounds the weights where features hardly vary, and chooses small values of "
        "the average reward, which are known only up to a constant",
    )
    interval: int = count(100, 1, unit="decisions", help="time from one solution to the next")

    @property
    def mean_rate(self) -> float:
        return self.rate  # the mean of rewards has the memory of the other means

    def init(self, weights: Weights, features: int) -> LeastSquaresState:
        matrix = self.initial * jnp.eye(weights.size, dtype=weights.dtype)
        started = running_mean((matrix, weights, weights))._replace(mean=(matrix, weights, weights))
        started = started._replace(count=started.count + 1)
        if weights.size < MANY_FEATURES:
            waiting = (jnp.zeros_like(matrix), weights, weights)
        else:
            rows = jnp.zeros((self.interval, weights.size), weights.dtype)
            waiting = (rows, rows, rows[:, 0])
        return LeastSquaresState(weights, started, waiting, jnp.zeros((), jnp.int32))

    def update(
        self, weights: Weights, state: LeastSquaresState, step: CriticStep, dropped: Flag = False
    ) -> tuple[Weights, LeastSquaresState]:
        e = step.discount * step.decay * state.trace + step.slope
        change = step.slope - step.discount * step.next_features
        place = state.gathered
        if weights.size < MANY_FEATURES:
            new = (e[:, None] * change, e * step.reward, e)
            waiting = jax.tree.map(jnp.add, state.waiting, where(dropped, jax.tree.map(jnp.zeros_like, new), new))
        else:
            rows = zip(state.waiting, (e, change, step.reward), strict=True)
            waiting = tuple(old.at[place].set(where(dropped, old[place], row)) for old, row in rows)
        return weights, state._replace(trace=e, waiting=waiting, gathered=where(dropped, place, place + 1))

    def solve(
        self, weights: Weights, state: LeastSquaresState, level: Float[Array, ""], critic: Any
    ) -> tuple[Weights, LeastSquaresState]:
        def solve(old: tuple[Weights, LeastSquaresState]) -> tuple[Weights, LeastSquaresState]:
            # The barrier keeps the compiler from working ahead of the loop in `where_any`.
            weights, state = old
            mean, state = jax.lax.optimization_barrier((level, state))
            sums = state.waiting
            if weights.size >= MANY_FEATURES:
                traces, changes, rewards = sums
                sums = (traces.T @ changes, rewards @ traces, jnp.sum(traces, axis=0))
            solved, state = self.take_in(weights, state, sums, mean)
            empty = jax.tree.map(jnp.zeros_like, state.waiting)
            return solved, state._replace(waiting=empty, gathered=state.gathered * 0)

        return where_any(self.decisions_until_due(state) < 0, solve, (weights, state))

    def take_in(
        self, weights: Weights, state: LeastSquaresState, sums: tuple[Array, Array, Array], level: Float[Array, ""]
    ) -> tuple[Weights, LeastSquaresState]:
        """The solution, and the state, once the means have taken in the `sums` of $e d'$, $e r$ and $e$ over the
        decisions of one interval."""
        block = jax.tree.map(lambda total: total / self.interval, sums)
        forgotten = -jnp.expm1(self.interval * jnp.log1p(-jnp.asarray(self.rate, weights.dtype)))
        means = add_sample(state.means, block, forgotten, self.interval)
        matrix, pay, trace = means.mean
        damped = matrix + self.damping * jnp.eye(weights.size, dtype=weights.dtype)
        solved = linear_solve(damped, pay - level * trace)
        solved = jnp.where(jnp.all(jnp.isfinite(solved)), solved, weights)  # a singular system has none yet
        return solved, state._replace(means=means)

    def decisions_until_due(self, state: LeastSquaresState) -> Int[Array, ""]:
        return self.interval - 1 - state.gathered

    def restart(self, state: LeastSquaresState) -> LeastSquaresState:
        return state._replace(trace=jnp.zeros_like(state.trace))
