"""How the weights of a linear critic are learnt."""

import dataclasses
import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from motorgrad._errors import check
from motorgrad._running import RunningMean, add_sample, running_mean
from motorgrad.learning._choose import NEVER, Flag, where, where_any


class Evidence(NamedTuple):
    r"""What one decision tells a critic.

    `trace` $e$ of the features; their `change` $d = \phi(y_t) - \gamma\phi(y_{t+1})$; the `reward`; and the temporal
    difference, `error`.
    """

    trace: Float[Array, " features"]
    change: Float[Array, " features"]
    reward: Float[Array, ""]
    error: Float[Array, ""]


@dataclasses.dataclass(frozen=True)
class TemporalDifference:
    r"""TD(λ), $w \leftarrow w + \alpha\,\delta e$ (Sutton, 1988; Tsitsiklis & Van Roy, 1999).

    **Arguments:**

    - `rate` $\alpha \ge 0$. Steps are stable where $\alpha$ times the squared length of the features is well below 1.
      0 leaves the weights as they are.
    - `level_rate` in [0, 1]: the n-th reward moves the mean of rewards by $\max(1/n, \text{level rate})$ of its
      distance from it.
    """

    rate: float = 0.01
    level_rate: float = 1e-3

    def __post_init__(self) -> None:
        check(0 <= self.rate < math.inf, "rate", self.rate, "a finite number of at least 0")
        check(0 <= self.level_rate <= 1, "level_rate", self.level_rate, "in [0, 1]")

    def init(self, weights: Float[Array, " features"]) -> None:
        """It knows nothing but the weights."""
        del weights

    def update(
        self, weights: Float[Array, " features"], state: None, evidence: Evidence, dropped: Flag = False
    ) -> tuple[Float[Array, " features"], None]:
        """The weights after one decision; as they were where its reward is to be `dropped`."""
        return where(dropped, weights, weights + self.rate * evidence.error * evidence.trace), state

    def solve(
        self, weights: Float[Array, " features"], state: None, level: Float[Array, ""]
    ) -> tuple[Float[Array, " features"], None]:
        """There is nothing to be solved."""
        del level
        return weights, state

    def rest(self, state: None) -> Int[Array, ""]:
        """No decision is ever followed by a solution."""
        return jnp.asarray(NEVER, jnp.int32)


class LeastSquaresState(NamedTuple):
    r"""`means` of $e d'$, $e r$ and $e$; their `sums` over the decisions since, of which so many are `gathered`."""

    means: RunningMean
    sums: tuple[Float[Array, "features features"], Float[Array, " features"], Float[Array, " features"]]
    gathered: Int[Array, ""]


@dataclasses.dataclass(frozen=True)
class LeastSquares:
    r"""Recursive least squares for temporal differences, LSTD(λ) (Bradtke & Barto, 1996; Boyan, 2002).

    The weights are those with which the temporal differences, weighted by the trace, are 0 in the mean:

    $$(A + d\,I)\,w = b, \qquad A = \overline{e\,(\phi_t - \gamma\phi_{t+1})'}, \qquad
    b = \overline{e\,r} - \rho\,\overline{e}.$$

    The means are running ones: the n-th decision moves them by $\max(1/(n + 1), \text{rate})$ of its distance from
    them. $A$ starts as `initial` times the identity, which counts as one decision. Without damping, these are the
    weights of the recursion by rank-one updates of $A^{-1}$. That recursion would pile up rounding errors, and while it
    forgets, directions in which nothing happens would grow without bounds. So it is $A$ that is kept, and the system
    solved every `interval` decisions, which the means take in together. Between two solutions the weights rest.

    **Arguments:**

    - `rate` in [0, 1]: the means have a memory of 1/rate decisions; 0 forgets nothing, for a policy that stays.
    - `initial` > 0: of the order of a squared feature.
    - `damping` $d \ge 0$, in the same units. It bounds the weights where features hardly vary, and of the values of the
      average reward, which are known but for a constant, it chooses small ones.
    - `interval` $\ge 1$: decisions from one solution to the next.
    """

    rate: float = 1e-3
    initial: float = 1.0
    damping: float = 1e-3
    interval: int = 100

    def __post_init__(self) -> None:
        check(0 <= self.rate <= 1, "rate", self.rate, "in [0, 1]")
        check(0 < self.initial < math.inf, "initial", self.initial, "a finite number above 0")
        check(0 <= self.damping < math.inf, "damping", self.damping, "a finite number of at least 0")
        check(1 <= self.interval < 2**31, "interval", self.interval, "a positive number of decisions")

    @property
    def level_rate(self) -> float:
        """The mean of rewards has the memory of the other means."""
        return self.rate

    def init(self, weights: Float[Array, " features"]) -> LeastSquaresState:
        """The means before any decision."""
        matrix = self.initial * jnp.eye(weights.size, dtype=weights.dtype)
        started = running_mean((matrix, weights, weights))._replace(mean=(matrix, weights, weights))
        none = (jnp.zeros_like(matrix), weights, weights)
        return LeastSquaresState(started._replace(count=started.count + 1), none, jnp.zeros((), jnp.int32))

    def update(
        self, weights: Float[Array, " features"], state: LeastSquaresState, evidence: Evidence, dropped: Flag = False
    ) -> tuple[Float[Array, " features"], LeastSquaresState]:
        """The weights, which rest, and the sums after one decision; as they were where it is to be `dropped`."""
        e = evidence.trace
        new = (e[:, None] * evidence.change, e * evidence.reward, e)
        one = jnp.ones((), jnp.int32)
        new, one = where(dropped, jax.tree.map(jnp.zeros_like, (new, one)), (new, one))
        sums = jax.tree.map(jnp.add, state.sums, new)
        return weights, state._replace(sums=sums, gathered=state.gathered + one)

    def solve(
        self, weights: Float[Array, " features"], state: LeastSquaresState, level: Float[Array, ""]
    ) -> tuple[Float[Array, " features"], LeastSquaresState]:
        r"""The weights that solve the system, if it is time, rewards being compared with the `level` $\rho$."""

        def solve(old: Any) -> Any:
            # The barrier keeps the compiler from working ahead of the loop in `where_any`.
            weights, state = old
            mean, state = jax.lax.optimization_barrier((level, state))
            block = jax.tree.map(lambda total: total / self.interval, state.sums)
            means = add_sample(state.means, block, 1 - (1 - self.rate) ** self.interval, self.interval)
            matrix, pay, trace = means.mean
            damped = matrix + self.damping * jnp.eye(weights.size, dtype=weights.dtype)
            solved = jnp.linalg.solve(damped, pay - mean * trace)
            solved = jnp.where(jnp.all(jnp.isfinite(solved)), solved, weights)  # a singular system has none yet
            return solved, LeastSquaresState(means, jax.tree.map(jnp.zeros_like, state.sums), state.gathered * 0)

        return where_any(self.rest(state) < 0, solve, (weights, state))

    def rest(self, state: LeastSquaresState) -> Int[Array, ""]:
        """How many decisions at least come before the one that `solve` is to follow."""
        return self.interval - 1 - state.gathered
