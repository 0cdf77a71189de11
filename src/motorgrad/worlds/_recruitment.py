"""The loads of chapter 4, and exact answers for rewards that depend only on the present input and action.

Such a task is a contextual bandit. The expectation is over given inputs with given weights (a quadrature), and over all
actions of the policy, so it is exact for any reward; a policy of $N$ binary units has $2^N$ actions. Everything is in
double precision. The policy's log-probability is differentiated automatically, independently of the analytic scores
that the learner uses.
"""

from collections.abc import Callable, Mapping
from typing import ClassVar, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import numpy.typing as npt
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, Int

from motorgrad._errors import check
from motorgrad._groups import by_group, check_groups
from motorgrad.policies import Policy, abilities, split
from motorgrad.worlds._world import World
from motorgrad.worlds.oracle import to_float64

P = TypeVar("P", bound=Policy)
Reward = Callable[[Float[Array, " inputs"], Array], Float[Array, ""]]


class UniformLoads(World):
    """Independent loads from U[`low`, `high`] (section 4.3.1 of the thesis). The state is the load."""

    uniforms: ClassVar[int] = 1
    reset_uniforms: ClassVar[int] = 1

    def __init__(self, low: float = 0.0, high: float = 1.0) -> None:
        check(low < high, "low, high", (low, high), "an interval, low < high")
        self.low, self.high = low, high

    def reset(self, uniforms: Float[Array, " 1"]) -> Float[Array, ""]:
        return self.low + (self.high - self.low) * uniforms[0]

    def step(self, state: Float[Array, ""], action: Array, uniforms: Float[Array, " 1"]) -> Float[Array, ""]:
        return self.reset(uniforms)


class QueriedLoads(UniformLoads):
    """Loads chosen by the learner: the last number of the action, clipped to [`low`, `high`].

    The first load is drawn from U[`low`, `high`]. The state is the load.
    """

    uniforms: ClassVar[int] = 0

    def step(self, state: Float[Array, ""], action: Array, uniforms: Float[Array, " 0"]) -> Float[Array, ""]:
        return jnp.clip(action[-1], self.low, self.high).astype(state.dtype)


class SweepingLoads(World):
    """The load starts at `low` and grows by U[`least`, `most`] per step (section 4.3.2 of the thesis).

    The state is the load. It grows without bound; the task decides where a sweep ends.
    """

    uniforms: ClassVar[int] = 1

    def __init__(self, low: float = -2.0, least: float = 0.1, most: float = 0.3) -> None:
        check(0 < least <= most, "least, most", (least, most), "positive, least <= most")
        self.low, self.least, self.most = low, least, most

    def reset(self, uniforms: Float[Array, " 0"]) -> Float[Array, ""]:
        return jnp.asarray(self.low, jnp.result_type(float))

    def step(self, state: Float[Array, ""], action: Array, uniforms: Float[Array, " 1"]) -> Float[Array, ""]:
        return state + self.least + (self.most - self.least) * uniforms[0]


class Attempt(NamedTuple):
    """The state of `RepeatedLoads`: the `load`, and which `attempt` at it comes next, from 0."""

    load: Float[Array, ""]
    attempt: Int[Array, ""]


class RepeatedLoads(World):
    """The loads of another world, each of which stays for some decisions, the `attempts` at it. The state is an
    `Attempt`."""

    def __init__(self, loads: World, attempts: int) -> None:
        check(attempts >= 1, "attempts", attempts, "at least 1")
        self.loads, self.attempts = loads, attempts

    @property
    def uniforms(self) -> int:  # type: ignore[override]  # pyright: ignore[reportIncompatibleVariableOverride]
        """Those of the other world, which are used only where the load changes."""
        return self.loads.uniforms

    @property
    def reset_uniforms(self) -> int:  # type: ignore[override]  # pyright: ignore[reportIncompatibleVariableOverride]
        """Those of the other world."""
        return self.loads.reset_uniforms

    def reset(self, uniforms: Float[Array, " reset_uniforms"]) -> Attempt:
        return Attempt(self.loads.reset(uniforms), jnp.zeros((), jnp.int32))

    def step(self, state: Attempt, action: Array, uniforms: Float[Array, " uniforms"]) -> Attempt:
        attempt = (state.attempt + 1) % self.attempts
        load = jnp.where(attempt > 0, state.load, self.loads.step(state.load, action, uniforms))
        return Attempt(load, attempt)


def immediate_reward(policy: Policy, inputs: npt.ArrayLike, weights: npt.ArrayLike, reward: Reward) -> float:
    r"""$\eta = \sum_x w_x \sum_a \pi(a \mid x)\, r(x, a)$.

    **Arguments:** the policy; `inputs` (points, inputs) and their `weights` (points,), which sum to one; `reward`, a
    JAX function of an input and an action.
    """
    with jax.enable_x64(True):
        total, vector, _ = _expectation(policy, inputs, weights, reward)
        return float(total(vector))


def immediate_gradient(policy: P, inputs: npt.ArrayLike, weights: npt.ArrayLike, reward: Reward) -> P:
    r"""$\nabla\eta$ in the structure of the policy's trainable part, as float64 NumPy arrays. Arguments as in
    `immediate_reward`."""
    with jax.enable_x64(True):
        total, vector, build = _expectation(policy, inputs, weights, reward)
        return jax.tree.map(np.asarray, build(jax.grad(total)(vector)))


def mean_field(
    policy: P,
    inputs: npt.ArrayLike,
    weights: npt.ArrayLike,
    reward: Reward,
    rate: float | Mapping[str, float],
    decisions: npt.ArrayLike,
) -> P:
    r"""Follow steepest ascent on average: the solution of $d\theta/dt = \alpha\,\nabla\eta(\theta)$.

    Online learning with an unbiased estimate converges to it as the step size goes to zero; $t$ counts decisions.

    **Arguments:**

    - `policy`: the initial policy.
    - `inputs`, `weights`, `reward`: as in `immediate_reward`.
    - `rate`: the step size $\alpha$ of all parameters, or of each field by name.
    - `decisions` (times,): at which to return the policy, ascending, from 0 or more.

    **Returns:** the policy at those times, which lead in every trainable array.

    **Raises:** `ValueError` for times that do not ascend, for a rate that is negative, infinite or not a number, a
    field without a rate, or a rate without a field.
    """
    from scipy.integrate import solve_ivp  # loading it would slow down every command's start

    times = np.asarray(decisions, float)
    ascending = times.ndim == 1 and len(times) > 0 and times[0] >= 0 and (np.diff(times) > 0).all()
    check(ascending and np.isfinite(times[-1]), "decisions", times.tolist(), "ascending finite numbers of at least 0")
    check_groups("step size", "rate", rate)
    with jax.enable_x64(True):
        total, vector, build = _expectation(policy, inputs, weights, reward)
        start = build(vector)
        given = by_group("step size", "rate", rate, start)
        rates = np.asarray(ravel_pytree(jax.tree.map(lambda r, p: jnp.broadcast_to(r, p.shape), given, start))[0])
        slope = jax.jit(jax.grad(total))
        if times[-1] == 0:  # nothing to integrate
            return jax.tree.map(np.asarray, jax.vmap(build)(vector[None]))
        found = solve_ivp(
            lambda _, theta: rates * np.asarray(slope(theta)),
            (0.0, times[-1]), np.asarray(vector), method="LSODA", t_eval=times, rtol=1e-7, atol=1e-9,
        )  # fmt: skip
        if not found.success:
            raise RuntimeError(f"the mean field could not be integrated: {found.message}")
        return jax.tree.map(np.asarray, jax.vmap(build)(jnp.asarray(found.y.T)))


def _expectation(
    policy: P, inputs: npt.ArrayLike, weights: npt.ArrayLike, reward: Reward
) -> tuple[Callable[[Array], Array], Array, Callable[[Array], P]]:
    """The expected reward as a function of one vector of all parameters, that vector, and its inverse
    transformation."""
    points = jnp.asarray(inputs, jnp.float64)
    mass = jnp.asarray(weights, jnp.float64)
    wanted = f"of shape (points, {policy.inputs})"
    check(points.ndim == 2 and points.shape[1] == policy.inputs, "inputs", points.shape, wanted)
    check(mass.shape == points.shape[:1], "weights", mass.shape, f"of shape {points.shape[:1]}, as many as inputs")
    check(abs(float(mass.sum()) - 1) < 1e-9, "weights", float(mass.sum()), "such that they sum to 1")
    parameters, settings = split(to_float64(policy))
    actions = abilities.enumerate(policy)
    worth = mass[:, None] * jax.vmap(jax.vmap(reward, (None, 0)), (0, None))(points, actions)
    vector, build = ravel_pytree(parameters)

    def total(theta: Float[Array, " parameters"]) -> Array:
        acting = eqx.combine(build(theta), settings)
        log_prob = jax.vmap(jax.vmap(acting.log_prob, (None, 0)), (0, None))(points, actions)
        return jnp.sum(worth * jnp.exp(log_prob))

    return total, vector, build
