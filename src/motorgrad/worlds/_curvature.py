r"""The curvature of the average reward of finite MDPs, exactly: its Hessian, and what traces estimate of it."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies import Policy
from motorgrad.worlds import oracle
from motorgrad.worlds._chains import solved
from motorgrad.worlds._finite import FiniteMDP

Matrix = Float[np.ndarray, "parameters parameters"]


def hessian(mdp: FiniteMDP, policy: Policy) -> Matrix:
    r"""$\nabla^2\eta$ of the average reward, by automatic differentiation, in the order of `oracle.flat`.

    **Raises:** `ValueError` for a policy with another number of actions, and for a chain with several recurrent
    classes.
    """
    oracle.stationary_distribution(mdp, policy)  # which refuses what has none
    with jax.enable_x64(True):
        vector, chances = oracle.chances(mdp, policy)

        def average(theta: Array) -> Array:
            chosen = chances(theta)
            matrix = jnp.einsum("sa,ast->st", chosen, jnp.asarray(mdp.transitions))
            # the equations of the stationary distribution, of which one is redundant, and its sum
            system = (jnp.eye(mdp.states) - matrix).T.at[-1].set(1.0)
            stationary = jnp.linalg.solve(system, jnp.eye(mdp.states)[-1])
            return jnp.einsum("s,sa,as->", stationary, chosen, jnp.asarray(mdp.expected_rewards))

        return np.asarray(jax.jit(jax.hessian(average))(vector))


def biased_hessian(mdp: FiniteMDP, policy: Policy, decay: float, whole: bool = True) -> Matrix:
    r"""What traces of `decay` $\beta$ estimate of $\nabla^2\eta$ (see `motorgrad.learning.NewtonMetric`), in the order
    of `oracle.flat`:

    $$\sum_{s,a} \pi_s \pi(a \mid s)\,\big[\nabla^2\log\pi + \nabla\log\pi\,(\nabla\log\pi)'
    + \beta\,(\nabla\log\pi\,\bar z_s' + \bar z_s\,(\nabla\log\pi)')\big]\,Q_\beta(s, a)$$

    with the mean trace $\bar z_s$ on entering a state. If not `whole`, without the last two terms.
    """
    check(0 <= decay < 1, "decay", decay, "in [0, 1)")
    chosen = oracle.action_probabilities(mdp, policy)
    score = oracle.scores(mdp, policy)
    pi = oracle.stationary_distribution(mdp, policy)
    matrix = oracle.transition_matrix(mdp, policy)
    quality = mdp.expected_rewards + decay * mdp.transitions @ oracle.values(mdp, policy, decay)
    worth = chosen * quality.T
    with jax.enable_x64(True):
        vector, chances = oracle.chances(mdp, policy)
        second = jax.hessian(chances)(vector)  # π (∇² log π + ∇ log π ∇ log π') = ∇² π
    found = np.einsum("s,as,saij->ij", pi, quality, np.asarray(second))
    if not whole:
        return found
    later = np.einsum("s,sa,sai,ast->ti", pi, chosen, score, mdp.transitions)
    before = solved(np.eye(mdp.states) - decay * matrix.T, later)  # z̄, times the probability of the state
    pairs = decay * np.einsum("si,sa,saj->ij", before, worth, score)
    return found + pairs + pairs.T
