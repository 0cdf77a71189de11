"""Episodes of finite MDPs, judged as a whole: exact values and gradients of any recursive criterion."""

from collections.abc import Callable
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Float

from motorgrad._errors import check, check_integer
from motorgrad.policies import Policy, trainable
from motorgrad.worlds import oracle
from motorgrad.worlds._finite import FiniteMDP

P = TypeVar("P", bound=Policy)
Recursion = Callable[[Any, Any, Any], Any]
"""The new value of an episode, from the value of the rewards so far, one more reward, and the number of those."""
MAX_HISTORIES = 20_000
"""Pairs of a state and a value that are told apart at one time; each has a gradient."""


def episode_value(mdp: FiniteMDP, policy: Policy, accumulated: Recursion, length: int) -> float:
    r"""$\mathbb E[c_T]$: what the rewards of an episode are worth together.

    All histories are followed that differ in their state or in their value so far.

    **Arguments:** the MDP and a policy over as many actions; `accumulated`, $\phi$ in $c_{t+1} = \phi(c_t, r_{t+1}, t)$
    with $c_0 = 0$, such as `motorgrad.learning.Maximum().accumulated`; the `length` $T$ of an episode, in decisions
    from the start state.

    **Raises:** `ValueError` for a policy with another number of actions, a length below 1, and more than 20,000 pairs
    of state and value.
    """
    return _expected(mdp, policy, accumulated, length)[0]


def episode_gradient(mdp: FiniteMDP, policy: P, accumulated: Recursion, length: int) -> P:
    """The gradient of `episode_value`, in the structure of the policy's trainable part."""
    with jax.enable_x64(True):
        build = ravel_pytree(trainable(oracle.to_float64(policy)))[1]
        slope = jnp.asarray(_expected(mdp, policy, accumulated, length)[1])
        return jax.tree.map(np.asarray, build(slope))


def _expected(
    mdp: FiniteMDP, policy: Policy, accumulated: Recursion, length: int
) -> tuple[float, Float[np.ndarray, " parameters"]]:
    """The expected value of an episode and its gradient."""
    check_integer("length", length, 1, unit="decisions")
    chosen = oracle.action_probabilities(mdp, policy)
    score = oracle.scores(mdp, policy)
    moves = np.einsum("sa,ast->sat", chosen, mdp.transitions)
    state = np.array([mdp.start])
    value = np.zeros(1)
    chance = np.ones(1)
    slope = np.zeros((1, score.shape[-1]))  # of the chances
    for count in range(length):
        history, action, after = np.nonzero(moves[state])
        reward = mdp.rewards[after] if mdp.rewards.ndim == 1 else mdp.rewards[action, state[history]]
        with jax.enable_x64(True):
            worth = jax.vmap(accumulated, (0, 0, None))(jnp.asarray(value[history]), jnp.asarray(reward), count)
        pairs, place = np.unique(np.stack([after, np.asarray(worth)]), axis=1, return_inverse=True)
        size = pairs.shape[1]
        words = f"of at most {MAX_HISTORIES:,} pairs of state and value; a shorter episode, or fewer rewards"
        check(size <= MAX_HISTORIES, "mdp", f"{size:,} pairs after {count + 1} decisions", words)
        member = place.ravel()
        share = moves[state[history], action, after]
        taken = score[state[history], action]
        more = share[:, None] * (slope[history] + chance[history, None] * taken)
        chance = np.bincount(member, share * chance[history], size)
        slope = np.stack([np.bincount(member, column, size) for column in more.T], axis=1)
        state = pairs[0].astype(int)
        value = pairs[1]
    return float(chance @ value), value @ slope
