r"""Exact answers where a reward depends on the present input and action alone (a contextual bandit), as in chapter 4.

The expectation is over given inputs with given weights (a quadrature), and over every action of the policy, so it is
exact for any reward; a policy of $N$ binary units has $2^N$ actions. All is in double precision. The derivative is that
of the policy's log-probability by automatic differentiation, independent of the analytic scores that the learner uses.
"""

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import numpy.typing as npt
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float
from scipy.integrate import solve_ivp

from motorgrad._errors import check
from motorgrad._groups import by_group, check_groups
from motorgrad.policies import Policy, split
from motorgrad.worlds._double import double

P = TypeVar("P", bound=Policy)
Reward = Callable[[Float[Array, " inputs"], Array], Float[Array, ""]]


def immediate_reward(policy: Policy, inputs: npt.ArrayLike, weights: npt.ArrayLike, reward: Reward) -> float:
    r"""$\eta = \sum_x w_x \sum_a \pi(a \mid x)\, r(x, a)$.

    **Arguments:** the policy; `inputs` (points, inputs) and their `weights` (points,), which sum to one; `reward`, a
    JAX function of an input and an action.
    """
    with jax.enable_x64(True):
        total, vector, _ = _expectation(policy, inputs, weights, reward)
        return float(total(vector))


def immediate_gradient(policy: P, inputs: npt.ArrayLike, weights: npt.ArrayLike, reward: Reward) -> P:
    r"""$\nabla\eta$ in the structure of the policy's trainable part, as float64 NumPy arrays; arguments as above."""
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
    r"""Where steepest ascent takes a policy on average: the solution of $d\theta/dt = \alpha\,\nabla\eta(\theta)$.

    It is what online learning with an unbiased estimate does as the step size goes to zero, $t$ counting decisions.

    **Arguments:** the initial policy; `inputs`, `weights` and `reward` as in `immediate_reward`; `rate`, the step size
    $\alpha$ of all parameters, or of each field by name; `decisions` (times,), ascending from 0 or more, at which to
    look.

    **Returns:** the policy at those times, which lead in every trainable array.

    **Raises:** `ValueError` for times that do not ascend, and for a rate that is negative, infinite or no number, a
    field without a rate, or a rate without a field.
    """
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
        if times[-1] == 0:  # nothing to integrate: all is as it was
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
) -> tuple[Callable[[Any], Array], Array, Callable[[Any], P]]:
    """The expected reward as a function of all parameters in one vector, that vector, and how to take it apart."""
    points, mass = jnp.asarray(inputs, jnp.float64), jnp.asarray(weights, jnp.float64)
    wanted = f"of shape (points, {policy.inputs})"
    check(points.ndim == 2 and points.shape[1] == policy.inputs, "inputs", points.shape, wanted)
    check(mass.shape == points.shape[:1], "weights", mass.shape, f"of shape {points.shape[:1]}, as many as inputs")
    check(abs(float(mass.sum()) - 1) < 1e-9, "weights", float(mass.sum()), "such that they sum to 1")
    parameters, settings = split(double(policy))
    actions = policy.enumerate()
    worth = mass[:, None] * jax.vmap(jax.vmap(reward, (None, 0)), (0, None))(points, actions)
    vector, build = ravel_pytree(parameters)

    def total(theta: Any) -> Array:
        acting = eqx.combine(build(theta), settings)
        log_prob = jax.vmap(jax.vmap(acting.log_prob, (None, 0)), (0, None))(points, actions)
        return jnp.sum(worth * jnp.exp(log_prob))

    return total, vector, build
