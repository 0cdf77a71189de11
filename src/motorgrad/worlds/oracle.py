r"""Exact answers for finite MDPs, by linear algebra in double precision.

For a policy on a finite MDP, with transition matrix $P$, stationary distribution $\pi$ and reward vector $r$, every
quantity that an estimator estimates has a closed form (Baxter & Bartlett, 2001). Each function takes any `FiniteMDP`
and any `Policy` with as many actions: a discrete one, or one of binary units whose bits spell the action. Gradients
have the structure of the policy's trainable part, with float64 NumPy arrays; `flat` concatenates them into one vector.

The derivative of $P$ is taken by automatic differentiation of the policy's log-probability, so the oracle is
independent of the analytic scores that the learner uses.

**Raises:** `ValueError` for a policy with another number of actions, for a chain with several recurrent classes where a
stationary distribution is needed, and for a decay or discount outside [0, 1).

```python
mdp = mg.worlds.three_state()
policy = mg.policies.Softmax(np.zeros((2, 2)))
mg.worlds.oracle.average_reward(mdp, policy)
```
"""

from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, Int
from scipy.sparse.csgraph import connected_components

from motorgrad._errors import check
from motorgrad.policies import Policy, split
from motorgrad.worlds._finite import FiniteMDP, action_index

P = TypeVar("P", bound=Policy)


def to_float64(policy: P) -> P:
    """The policy with its real numbers in double precision. Call it within `jax.enable_x64`."""
    return jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float64) if eqx.is_inexact_array(leaf) else leaf, policy)


def action_probabilities(mdp: FiniteMDP, policy: Policy) -> Float[np.ndarray, "states actions"]:
    r"""$\pi(a \mid y(s))$ of every action in every state."""
    with jax.enable_x64(True):
        return np.asarray(_probabilities(mdp, to_float64(policy)))


def transition_matrix(mdp: FiniteMDP, policy: Policy) -> Float[np.ndarray, "states states"]:
    r"""$P_{ss'} = \sum_a \pi(a \mid y(s))\,P_{ss'}(a)$."""
    return np.einsum("sa,ast->st", action_probabilities(mdp, policy), mdp.transitions)


def stationary_distribution(mdp: FiniteMDP, policy: Policy) -> Float[np.ndarray, " states"]:
    r"""$\pi$ with $\pi' P = \pi'$ and $\sum\pi = 1$. A chain without a unique one is refused."""
    return _stationary(transition_matrix(mdp, policy))


def average_reward(mdp: FiniteMDP, policy: Policy) -> float:
    r"""$\eta = \pi' r$."""
    return float(stationary_distribution(mdp, policy) @ _mean_rewards(mdp, policy))


def gradient(mdp: FiniteMDP, policy: P) -> P:
    r"""$\nabla\eta = \pi'\,\nabla P\,[I - P + e\pi']^{-1} r$, exactly."""
    matrix = transition_matrix(mdp, policy)
    pi = _stationary(matrix)
    value = np.linalg.solve(np.eye(mdp.states) - matrix + pi[None, :], _mean_rewards(mdp, policy))
    return _contract(mdp, policy, pi, mdp.expected_rewards + mdp.transitions @ value)


def biased_gradient(mdp: FiniteMDP, policy: P, decay: float) -> P:
    r"""$\nabla_\beta\eta = \pi'\,\nabla P\,(I - \beta P)^{-1} r$: what a trace of `decay` $\beta$ estimates."""
    check(0 <= decay < 1, "decay", decay, "in [0, 1)")
    return _contract(mdp, policy, stationary_distribution(mdp, policy), _quality(mdp, policy, decay))


def values(mdp: FiniteMDP, policy: Policy, discount: float | None = None) -> Float[np.ndarray, " states"]:
    r"""The value of each state.

    With a `discount` $\gamma \in [0, 1)$, $(I - \gamma P)^{-1} r$; with `None`, the differential value of the average
    reward, $[I - P + e\pi']^{-1} (r - \eta e)$, whose stationary mean is 0.
    """
    if discount is not None:
        check(0 <= discount < 1, "discount", discount, "in [0, 1)")
        return _discounted(mdp, policy, discount)
    matrix, rewards = transition_matrix(mdp, policy), _mean_rewards(mdp, policy)
    pi = _stationary(matrix)
    return np.linalg.solve(np.eye(mdp.states) - matrix + pi[None, :], rewards - pi @ rewards)


def critic_gradient(
    mdp: FiniteMDP, policy: P, critic: Float[np.ndarray, " states"], decay: float, discount: float | None = None
) -> P:
    r"""What a trace of `decay` $\beta$ estimates with the temporal differences of a `critic` $v$ as advantages:

    $$\pi'\,\nabla P\,\big[r + \gamma v + \beta\,(I - \beta P)^{-1} \bar\delta\big], \qquad
    \bar\delta = r - \rho + \gamma P v - v$$

    (with rewards as a function of the successor state), for a `discount` $\gamma$, or with `None` for the average
    reward, with $\gamma = 1$ and $\rho = \eta$. With exact values $\bar\delta = 0$, so the result does not depend on
    the decay.
    """
    check(0 <= decay < 1, "decay", decay, "in [0, 1)")
    check(discount is None or 0 <= discount <= 1, "discount", discount, "None or in [0, 1]")
    matrix, rewards = transition_matrix(mdp, policy), _mean_rewards(mdp, policy)
    pi, ahead = _stationary(matrix), 1.0 if discount is None else discount
    level = pi @ rewards if discount is None else 0.0
    error = rewards - level + ahead * matrix @ critic - critic
    later = np.linalg.solve(np.eye(mdp.states) - decay * matrix, error)
    quality = mdp.expected_rewards + mdp.transitions @ (ahead * critic + decay * later)
    return _contract(mdp, policy, pi, quality)


def fisher(mdp: FiniteMDP, policy: Policy) -> Float[np.ndarray, "parameters parameters"]:
    r"""The Fisher matrix $\sum_s \pi_s \sum_a \pi(a \mid s)\,\nabla\log\pi\,(\nabla\log\pi)'$, in the order of `flat`.

    Blocks between the parameters of independent units are zero.
    """
    with jax.enable_x64(True):
        parameters, settings = split(to_float64(policy))
        vector, build = ravel_pytree(parameters)
        score = jax.jacfwd(lambda v: jnp.log(_probabilities(mdp, eqx.combine(build(v), settings))))(vector)
        weight = stationary_distribution(mdp, policy)[:, None] * action_probabilities(mdp, policy)
        return np.einsum("sa,sai,saj->ij", weight, *[np.where(weight[..., None] > 0, score, 0)] * 2)


def natural_gradient(mdp: FiniteMDP, policy: P) -> P:
    r"""$F^{+}\nabla\eta$: the gradient multiplied by the pseudo-inverse of the `fisher` matrix.

    It is the direction of steepest ascent per change of the policy itself (Kakade, 2001), whatever its parametrisation.
    """
    with jax.enable_x64(True):
        vector, build = ravel_pytree(jax.tree.map(jnp.asarray, gradient(mdp, policy)))
        direction = np.linalg.pinv(fisher(mdp, policy), rcond=1e-12, hermitian=True) @ np.asarray(vector)
        return jax.tree.map(np.asarray, build(jnp.asarray(direction)))


def discounted_return(mdp: FiniteMDP, policy: Policy, discount: float) -> float:
    r"""$\mathbb E \sum_{t \ge 0} \gamma^t r_{t+1}$ from the start state, with `discount` $\gamma \in [0, 1)$."""
    check(0 <= discount < 1, "discount", discount, "in [0, 1)")
    return float(_discounted(mdp, policy, discount)[mdp.start])


def discounted_gradient(mdp: FiniteMDP, policy: P, discount: float) -> P:
    r"""The gradient of `discounted_return`: $\sum_t \gamma^t \Pr(s_t)'\,\nabla P\,(I - \gamma P)^{-1} r$."""
    check(0 <= discount < 1, "discount", discount, "in [0, 1)")
    resolvent = np.eye(mdp.states) - discount * transition_matrix(mdp, policy)
    visits = np.linalg.solve(resolvent.T, np.eye(mdp.states)[mdp.start])
    return _contract(mdp, policy, visits, _quality(mdp, policy, discount))


def optimal_policy(mdp: FiniteMDP) -> tuple[Int[np.ndarray, " states"], float]:
    """The best action in every state (ignoring partial observability), and the average reward from the start, accurate
    to about 1e-7 of the state values.

    Policy iteration (Howard, 1960) at a discount so close to 1 that its optimum is that of the average reward
    (Blackwell, 1962); it is defined even where a policy splits the states into several recurrent classes.
    """
    near_one = 1 - 1e-7
    every = np.arange(mdp.states)
    choice = np.zeros(mdp.states, int)
    while True:
        matrix, pay = mdp.transitions[choice, every], mdp.expected_rewards[choice, every]
        value = np.linalg.solve(np.eye(mdp.states) - near_one * matrix, pay)
        quality = mdp.expected_rewards + near_one * mdp.transitions @ value
        # A change must improve by more than rounding, else equal actions would alternate for ever.
        better = quality.max(0) > quality[choice, every] + 1e-12 * max(1.0, np.abs(value).max())
        if not better.any():
            break
        choice = np.where(better, quality.argmax(0), choice)
    return choice, float((1 - near_one) * value[mdp.start])


def flat(gradient: Policy) -> Float[np.ndarray, " parameters"]:
    """The numbers of a gradient as one vector, in the order of the policy's fields."""
    return np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(gradient)])


def _stationary(matrix: Float[np.ndarray, "states states"]) -> Float[np.ndarray, " states"]:
    r"""Solve $\pi'(I - P + ee') = e'$, which has one solution if and only if there is exactly one closed recurrent
    class."""
    count, of = connected_components(matrix > 0, connection="strong")
    leaving = {of[i] for i, j in zip(*np.nonzero(matrix), strict=True) if of[i] != of[j]}
    closed = count - len(leaving)
    check(closed == 1, "policy", f"{closed} recurrent classes", "one whose chain has a unique stationary distribution")
    return np.linalg.solve((np.eye(len(matrix)) - matrix + 1).T, np.ones(len(matrix)))


def _probabilities(mdp: FiniteMDP, policy: Policy) -> Float[Array, "states actions"]:
    actions = policy.enumerate()
    check(len(actions) == mdp.actions, "policy", f"{len(actions)} actions", f"over the MDP's {mdp.actions} actions")
    order = jnp.argsort(jax.vmap(action_index)(actions))
    log_prob = jax.vmap(jax.vmap(policy.log_prob, (None, 0)), (0, None))
    return jnp.exp(log_prob(jnp.asarray(mdp.observations), actions[order]))


def _mean_rewards(mdp: FiniteMDP, policy: Policy) -> Float[np.ndarray, " states"]:
    return np.einsum("sa,as->s", action_probabilities(mdp, policy), mdp.expected_rewards)


def _discounted(mdp: FiniteMDP, policy: Policy, discount: float) -> Float[np.ndarray, " states"]:
    resolvent = np.eye(mdp.states) - discount * transition_matrix(mdp, policy)
    return np.linalg.solve(resolvent, _mean_rewards(mdp, policy))


def _quality(mdp: FiniteMDP, policy: Policy, decay: float) -> Float[np.ndarray, "actions states"]:
    """The discounted value of each action in each state when the policy is followed afterwards."""
    return mdp.expected_rewards + decay * mdp.transitions @ _discounted(mdp, policy, decay)


def _contract(
    mdp: FiniteMDP, policy: P, weight: Float[np.ndarray, " states"], quality: Float[np.ndarray, "actions states"]
) -> P:
    r"""$\sum_s w_s \sum_a \nabla\pi(a \mid s)\,Q(s, a)$, with the policy's derivative by automatic differentiation."""
    with jax.enable_x64(True):
        parameters, settings = split(to_float64(policy))
        worth = jnp.asarray(weight[:, None] * quality.T)

        def total(theta: Any) -> Array:
            return jnp.sum(worth * _probabilities(mdp, eqx.combine(theta, settings)))

        vector, build = ravel_pytree(parameters)
        slope = jax.grad(lambda v: total(build(v)))(vector)
        return jax.tree.map(np.asarray, build(slope))
