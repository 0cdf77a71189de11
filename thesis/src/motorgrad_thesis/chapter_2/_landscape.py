"""A one-dimensional problem with an exact objective: the reward is a sum of bumps, the policy a Gaussian."""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad.learning import FixedStep

Point = Float[Array, "2"]
"""Parameters of the policy: mean and standard deviation."""


class Bumps(NamedTuple):
    r"""The reward $r(x) = \sum_i h_i \exp(-\frac12 (x - c_i)^2/w_i^2)$; three arrays of the same length."""

    height: Array | np.ndarray
    centre: Array | np.ndarray
    width: Array | np.ndarray


def objective(bumps: Bumps, point: Point) -> Float[Array, ""]:
    r"""$\rho(\mu, \sigma) = \mathbb E\,r(x)$ for $x \sim \mathcal N(\mu, \sigma^2)$, which equals $r(\mu)$ at $\sigma =
    0$.

    Convolving a Gaussian bump with Gaussian noise widens and lowers it: $\sigma^2$ adds to its variance, its area stays
    the same.
    """
    wide = jnp.sqrt(bumps.width**2 + point[1] ** 2)
    height = bumps.height * bumps.width / wide
    return jnp.sum(height * jnp.exp(-0.5 * ((point[0] - bumps.centre) / wide) ** 2))


@jax.jit
def surface(bumps: Bumps, points: Float[Array, "points 2"]) -> Float[Array, " points"]:
    """The objective at many points."""
    return jax.vmap(objective, (None, 0))(bumps, points)


def climb(
    bumps: Bumps, starts: Float[np.ndarray, "starts 2"], steps: int, records: int = 1
) -> Float[np.ndarray, "starts records 2"]:
    r"""Integrate $\dot\theta = \nabla\rho(\theta)$ from each start by fourth-order Runge–Kutta steps.

    **Arguments:** the reward; `starts`, means and standard deviations; `steps`, each a quarter unit of time; `records`,
    the number of evenly spaced times at which the point is recorded. **Returns** the recorded points; the last is the
    end.
    """
    return np.asarray(_climb(bumps, jnp.asarray(starts, float), steps // records, records))


@functools.partial(jax.jit, static_argnums=(2, 3))
def _climb(bumps: Bumps, starts: Array, each: int, records: int) -> Array:
    slope = jax.grad(objective, argnums=1)
    step = 0.25

    def move(point: Array, _: None) -> tuple[Array, None]:
        first = slope(bumps, point)
        second = slope(bumps, point + step / 2 * first)
        third = slope(bumps, point + step / 2 * second)
        fourth = slope(bumps, point + step * third)
        return point + step / 6 * (first + 2 * second + 2 * third + fourth), None

    def record(point: Array, _: None) -> tuple[Array, Array]:
        point = jax.lax.scan(move, point, length=each)[0]
        return point, point

    return jax.vmap(lambda start: jax.lax.scan(record, start, length=records)[1])(starts)


def learn(
    bumps: Bumps, starts: Float[np.ndarray, "runs 2"], decisions: int, rate: float, records: int, seed: int
) -> Float[np.ndarray, "runs records 2"]:
    r"""Hill climbing from rewards alone: each decision draws one $x \sim \mathcal N(\mu, \sigma^2)$ and sets $\theta
    \leftarrow \theta + \alpha\sigma^2 (r - b)\,\nabla\log p(x)$.

    The step size is $\alpha\sigma^2$ (Williams, 1992), because the score grows like $1/\sigma$. On average this changes
    the speed along the path, not the path.

    **Arguments:** the reward; `starts`, one for each run; `decisions` of each; `rate` $\alpha$; `records`, the number
    of evenly spaced times at which the point is recorded; `seed`. **Returns** means and deviations at those times.
    """
    baseline = FixedStep(0.02)
    each = decisions // records

    def decide(state: tuple, noise: Array) -> tuple[tuple, None]:
        (mean, deviation), compared = state
        reward = objective(bumps, jnp.stack([mean + deviation * noise, jnp.zeros(())]))
        scaled = deviation * jnp.stack([noise, noise**2 - 1])  # σ² times the score
        point = jnp.stack([mean, deviation]) + rate * (reward - baseline.level(compared)) * scaled
        return (point, baseline.learn(compared, reward)), None

    def run(start: Array, key: Array) -> Array:
        def record(state: tuple, block: Array) -> tuple[tuple, Array]:
            noise = jax.random.normal(jax.random.fold_in(key, block), (each,))
            state = jax.lax.scan(decide, state, noise)[0]
            return state, state[0]

        # the baseline begins at the reward of the start, so that the first steps are informative
        begin = (start, objective(bumps, start))
        return jax.lax.scan(record, begin, jnp.arange(records))[1]

    keys = jax.random.split(jax.random.key(seed), len(starts))
    return np.asarray(jax.jit(jax.vmap(run))(jnp.asarray(starts, float), keys))


def greatest(bumps: Bumps, low: float, high: float) -> float:
    """The greatest reward in an interval, on a grid of spacing 0.001."""
    x = np.arange(low, high, 1e-3)
    return float(surface(bumps, jnp.stack([x, np.zeros_like(x)], axis=1)).max())
