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

import math
from collections.abc import Callable, Sequence
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, Int, PyTree

from motorgrad._errors import check, check_integer, choice
from motorgrad.policies import FiniteStateController, Policy, abilities, split, trainable
from motorgrad.worlds._chains import ROUNDING, evaluate, expected_change, lead, solved, stationary
from motorgrad.worlds._finite import FiniteMDP, action_index

P = TypeVar("P", bound=Policy)


def to_float64(policy: P) -> P:
    """The policy with its real numbers in double precision. Call it within `jax.enable_x64`."""
    return jax.tree.map(
        lambda leaf: jnp.asarray(np.asarray(leaf, np.float64)) if eqx.is_inexact_array(leaf) else leaf, policy
    )


def action_probabilities(mdp: FiniteMDP, policy: Policy) -> Float[np.ndarray, "states actions"]:
    r"""$\pi(a \mid y(s))$ of every action in every state."""
    with jax.enable_x64(True):
        parameters, settings = split(to_float64(policy))
        return np.asarray(_chances(parameters, settings, mdp.observations, _index(mdp, policy), mdp.actions))


def chances(mdp: FiniteMDP, policy: Policy) -> tuple[Float[Array, " parameters"], Callable[[Array], Array]]:
    """The parameters as one vector, and the `action_probabilities` as a function of it that JAX differentiates. Call it
    within `jax.enable_x64`."""
    parameters, settings = split(to_float64(policy))
    vector, build = ravel_pytree(parameters)
    index = _index(mdp, policy)
    return vector, lambda v: _chances(build(v), settings, mdp.observations, index, mdp.actions)


def scores(mdp: FiniteMDP, policy: Policy) -> Float[np.ndarray, "states actions parameters"]:
    r"""$\nabla\log\pi$ of every action in every state, 0 for those that are impossible."""
    with jax.enable_x64(True):
        parameters, settings = split(to_float64(policy))
        score = _log_slopes(parameters, settings, mdp.observations, _index(mdp, policy), mdp.actions)
        return np.where(action_probabilities(mdp, policy)[..., None] > 0, score, 0)


def transition_matrix(mdp: FiniteMDP, policy: Policy) -> Float[np.ndarray, "states states"]:
    r"""$P_{ss'} = \sum_a \pi(a \mid y(s))\,P_{ss'}(a)$."""
    return np.einsum("sa,ast->st", action_probabilities(mdp, policy), mdp.transitions)


def stationary_distribution(mdp: FiniteMDP, policy: Policy) -> Float[np.ndarray, " states"]:
    r"""$\pi$ with $\pi' P = \pi'$ and $\sum\pi = 1$. A chain without a unique one is refused."""
    return stationary(transition_matrix(mdp, policy))


def average_reward(mdp: FiniteMDP, policy: Policy | Sequence[int] | Int[np.ndarray, " states"]) -> float:
    r"""$\eta = \pi' r$.

    **Arguments:** `mdp`; `policy`: a policy, or a table with the action of every state, as `optimal_policy` returns it.
    With a table, it is the average from the start state, which exists even if there are several recurrent classes.
    """
    if isinstance(policy, Policy):
        return float(stationary_distribution(mdp, policy) @ _mean_rewards(mdp, policy))
    table = np.asarray(policy)
    every = np.arange(mdp.states)
    right = table.shape == (mdp.states,) and np.issubdtype(table.dtype, np.integer)
    check(right, "policy", policy, f"a policy, or a table of {mdp.states} integers, the action of every state")
    known = (table >= 0) & (table < mdp.actions)
    check(known.all(), "policy", table[~known].tolist(), f"a table of actions from 0 to {mdp.actions - 1}")
    return float(evaluate(mdp.transitions[table, every], mdp.expected_rewards[table, every])[0][mdp.start])


def gradient(mdp: FiniteMDP, policy: P) -> P:
    r"""$\nabla\eta = \pi'\,\nabla P\,[I - P + e\pi']^{-1} r$, exactly."""
    matrix = transition_matrix(mdp, policy)
    pi = stationary(matrix)
    value = solved(np.eye(mdp.states) - matrix + pi[None, :], _mean_rewards(mdp, policy))
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
    matrix = transition_matrix(mdp, policy)
    rewards = _mean_rewards(mdp, policy)
    pi = stationary(matrix)
    return solved(np.eye(mdp.states) - matrix + pi[None, :], rewards - pi @ rewards)


def lagged_gradient(mdp: FiniteMDP, policy: P, lag: int) -> P:
    r"""$\pi'\,\nabla P\,P^k r = \mathbb E[r_{t+1}\nabla\log\pi(a_{t-k} \mid y_{t-k})]$: what a reward says of the
    action taken $k$ decisions before, the `lag`. Over all lags these add up to the `gradient`."""
    check_integer("lag", lag, 0, unit="decisions")
    quality = mdp.expected_rewards
    if lag > 0:
        later = np.linalg.matrix_power(transition_matrix(mdp, policy), lag - 1) @ _mean_rewards(mdp, policy)
        quality = mdp.transitions @ later
    return _contract(mdp, policy, stationary_distribution(mdp, policy), quality)


def stationary_score(mdp: FiniteMDP, policy: Policy) -> Float[np.ndarray, "states parameters"]:
    r"""$\nabla\log\pi_s$ of every state's stationary probability, in the order of `flat`; 0 for states never visited.

    From $\nabla\pi' = \pi'\,\nabla P\,[I - P + e\pi']^{-1}$.
    """
    matrix = transition_matrix(mdp, policy)
    chance = action_probabilities(mdp, policy)
    pi = stationary(matrix)
    flow = np.einsum("s,sa,sai,ast->it", pi, chance, scores(mdp, policy), mdp.transitions)
    slope = solved((np.eye(mdp.states) - matrix + pi[None, :]).T, flow.T)
    return np.where(pi[:, None] > 0, slope / np.where(pi > 0, pi, 1)[:, None], 0)


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
    matrix = transition_matrix(mdp, policy)
    rewards = _mean_rewards(mdp, policy)
    pi = stationary(matrix)
    ahead = 1.0 if discount is None else discount
    level = pi @ rewards if discount is None else 0.0
    error = rewards - level + ahead * matrix @ critic - critic
    later = solved(np.eye(mdp.states) - decay * matrix, error)
    quality = mdp.expected_rewards + mdp.transitions @ (ahead * critic + decay * later)
    return _contract(mdp, policy, pi, quality)


def optimal_baseline(
    mdp: FiniteMDP, policy: Policy, decay: float, each: str = "policy"
) -> Float[np.ndarray, " baselines"]:
    r"""$b^* = \mathbb E[z^2 r]\,/\,\mathbb E[z^2]$: the constants by which $(r - b)\,z$ has the least mean square, for
    a trace of `decay` $\beta$ (Greensmith, Bartlett & Baxter, 2004).

    `each` says what has one of its own: the `"policy"`, with squared lengths for $z^2$; every `"unit"`, in the order of
    `abilities.blocks`; or every `"parameter"`, in the order of `flat`.
    """
    check(0 <= decay < 1, "decay", decay, "in [0, 1)")
    choice("each", each, ("policy", "unit", "parameter"))
    chance = action_probabilities(mdp, policy)
    score = scores(mdp, policy)
    pi = stationary_distribution(mdp, policy)
    matrix = transition_matrix(mdp, policy)
    taken = chance[:, :, None] * score
    later = np.einsum("s,sai,ast->ti", pi, taken, mdp.transitions)
    # z just before a state, and its square, times the probability of the state
    first = solved(np.eye(mdp.states) - decay * matrix.T, later)
    joint = 2 * decay * first[:, None] * score + pi[:, None, None] * np.square(score)
    again = np.einsum("sa,sai,ast->ti", chance, joint, mdp.transitions)
    second = solved(np.eye(mdp.states) - decay**2 * matrix.T, again)
    squares = chance[:, :, None] * (decay**2 * second[:, None] + joint)
    weights = squares.sum((0, 1))
    pay = np.einsum("sai,as->i", squares, mdp.expected_rewards)
    if each == "parameter":
        return pay / weights
    if each == "policy":
        return np.atleast_1d(pay.sum() / weights.sum())
    with jax.enable_x64(True):
        build = ravel_pytree(trainable(to_float64(policy)))[1]
        pays, all_weights = (
            np.concatenate([np.asarray(block).sum(1) for block in abilities.blocks(policy, build(jnp.asarray(vector)))])
            for vector in (pay, weights)
        )
    return pays / all_weights


def fisher(mdp: FiniteMDP, policy: Policy) -> Float[np.ndarray, "parameters parameters"]:
    r"""The Fisher matrix $\sum_s \pi_s \sum_a \pi(a \mid s)\,\nabla\log\pi\,(\nabla\log\pi)'$, in the order of `flat`.

    Blocks between the parameters of independent units are zero.
    """
    weight = stationary_distribution(mdp, policy)[:, None] * action_probabilities(mdp, policy)
    return np.einsum("sa,sai,saj->ij", weight, *[scores(mdp, policy)] * 2)


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


def discounted_gradient(mdp: FiniteMDP, policy: P, discount: float, decay: float = 1.0) -> P:
    r"""The gradient of `discounted_return`: $\sum_t \gamma^t \Pr(s_t)'\,\nabla P\,(I - \gamma P)^{-1} r$.

    With a `decay` $\lambda$ below 1, what samples $\gamma^t r_{t+1} z_t$ with a trace of that decay estimate:
    $\gamma\lambda$ in the place of the last $\gamma$.
    """
    check(0 <= discount < 1, "discount", discount, "in [0, 1)")
    check(0 <= decay <= 1, "decay", decay, "in [0, 1]")
    resolvent = np.eye(mdp.states) - discount * transition_matrix(mdp, policy)
    visits = solved(resolvent.T, np.eye(mdp.states)[mdp.start])
    return _contract(mdp, policy, visits, _quality(mdp, policy, discount * decay))


def optimal_policy(mdp: FiniteMDP) -> tuple[Int[np.ndarray, " states"], float]:
    """The best action in every state (ignoring partial observability), and the `average_reward` of this table.

    Policy iteration (Howard, 1960) on the average reward from every state, and among actions that are equal in it on
    the differential values. It is defined even where a policy splits the states into several recurrent classes. An
    action replaces another if it is better by more than rounding.
    """
    every = np.arange(mdp.states)
    moves = mdp.transitions
    rewards = mdp.expected_rewards
    choice = np.zeros(mdp.states, int)
    seen = set()
    while choice.tobytes() not in seen:  # rounding could lead back to a table
        seen.add(choice.tobytes())
        gain, value = evaluate(moves[choice, every], rewards[choice, every])
        ahead, unsure = lead(choice, *expected_change(moves, gain))
        better = ahead > unsure
        if not better.any():  # then of the actions that keep the average, those of greater value
            equal = ahead >= -unsure
            change, doubt = expected_change(moves, value)
            ahead, unsure = lead(choice, rewards + change, doubt + ROUNDING * np.abs(rewards))
            better = equal & (ahead > unsure)
        choice = np.where(better.any(0), np.where(better, ahead, -np.inf).argmax(0), choice)
    return choice, average_reward(mdp, choice)


def joint(mdp: FiniteMDP, policy: Policy) -> FiniteMDP:
    """The MDP in which a policy's hidden units and memory are visible.

    Its actions are all that the policy draws, in the order of `abilities.enumerate`. A state of it is one of `mdp` and,
    changing fastest, an internal state of the policy where it is a `FiniteStateController`, 0 at the start. All
    functions of this module take the result together with `policy`. With `mdp` itself they take a policy with hidden
    units too, by its marginal probabilities; but not one with a memory.

    **Raises:** `ValueError` for a policy without hidden units, with another memory, or that does not fit `mdp`.
    """
    kind = type(policy).__name__
    check(abilities.has_hidden_units(policy), "policy", kind, "a policy with hidden units or internal states")
    remembers = isinstance(policy, FiniteStateController)
    known = remembers or not abilities.has_memory(policy)
    check(known, "policy", kind, "a policy without a memory, or a FiniteStateController")
    inner = policy.states if remembers else 1
    seen = mdp.observations.shape[1]
    check(policy.observation_size == seen, "policy.observation_size", policy.observation_size, f"{seen}, the MDP's")
    actions = abilities.enumerate(policy)
    index = np.asarray(jax.vmap(lambda action: action_index(abilities.task_action(policy, action)))(actions))
    check(index.max() < mdp.actions, "policy", f"{index.max() + 1} actions", f"over the MDP's {mdp.actions} actions")
    following = np.eye(inner)[np.asarray(actions[:, 0], int) if remembers else np.zeros(len(actions), int)]
    states = mdp.states * inner
    transitions = np.einsum("ast,ah->asth", mdp.transitions[index], following)  # the same from every internal state
    transitions = np.repeat(transitions.reshape(len(actions), mdp.states, states), inner, axis=1)
    rewards = np.repeat(mdp.rewards if mdp.rewards.ndim == 1 else mdp.rewards[index], inner, axis=-1)
    observations = np.repeat(mdp.observations, inner, axis=0)
    if remembers:
        observations = np.concatenate([observations, np.tile(np.eye(inner), (mdp.states, 1))], axis=1)
    return FiniteMDP(transitions, rewards, observations, mdp.start * inner)


def best_memoryless(mdp: FiniteMDP, starts: int = 20) -> tuple[Float[np.ndarray, "kinds actions"], float]:
    """The best policy that acts on the present observation alone, and the average reward that it earns.

    Such a policy is a table of the probability of every action for every kind of observation. It may have to act at
    random (Singh, Jaakkola & Jordan, 1994). The table is found by gradient ascent on the exact average reward, from the
    even table and `starts` - 1 random ones. So the result is a lower bound, and the optimum unless all starts lead to
    lesser maxima. Probabilities are at least some 1e-9.

    **Returns** the table, its rows in the order of `np.unique(mdp.observations, axis=0)`, and its average reward.
    """
    from scipy.optimize import minimize  # loading it would slow down every command's start
    from scipy.special import softmax

    check_integer("starts", starts, 1)
    kinds, kind = np.unique(mdp.observations, axis=0, return_inverse=True)
    shape = (len(kinds), mdp.actions)
    rng = np.random.default_rng(0)
    member = np.eye(len(kinds))[kind.ravel()]

    def loss(logits: np.ndarray) -> tuple[float, np.ndarray]:
        table = softmax(logits.reshape(shape), axis=1)
        chance = member @ table
        matrix = np.einsum("sa,ast->st", chance, mdp.transitions)
        rewards = np.sum(chance.T * mdp.expected_rewards, 0)
        pi = stationary(matrix)
        value = solved(np.eye(mdp.states) - matrix + pi[None, :], rewards)
        quality = mdp.expected_rewards + mdp.transitions @ value
        slope = member.T @ (pi[:, None] * quality.T)  # by the probabilities
        slope = table * (slope - np.sum(table * slope, axis=1, keepdims=True))  # and by the logits
        return -float(pi @ rewards), -slope.ravel()

    first = [np.zeros(shape), *rng.normal(size=(starts - 1, *shape), scale=2.0)]
    bounds = [(-10, 10)] * math.prod(shape)
    options = {"ftol": 1e-15, "gtol": 1e-12}
    found = [minimize(loss, start.ravel(), jac=True, bounds=bounds, options=options) for start in first]
    best = min(found, key=lambda each: each.fun)
    return softmax(best.x.reshape(shape), axis=1), -float(best.fun)


def flat(gradient: Policy) -> Float[np.ndarray, " parameters"]:
    """The numbers of a gradient as one vector, in the order of the policy's fields."""
    return np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(gradient)])


def _index(mdp: FiniteMDP, policy: Policy) -> Int[np.ndarray, " drawn"]:
    """The MDP's action to which each of all that the policy may draw leads."""
    seen = mdp.observations.shape[1]
    if abilities.has_memory(policy):
        check(
            policy.inputs == seen, "policy", type(policy).__name__, "a policy without a memory, or as `joint` takes it"
        )
    index = np.asarray(_emitted(policy))
    if abilities.has_hidden_units(policy) and len(index) == mdp.actions:  # the MDP is that of `joint`
        index = np.arange(len(index))
    count = len(np.unique(index))
    check(count == mdp.actions, "policy", f"{count} actions", f"over the MDP's {mdp.actions} actions")
    return index


@eqx.filter_jit
def _emitted(policy: Policy) -> Int[Array, " drawn"]:
    return jax.vmap(lambda action: action_index(abilities.task_action(policy, action)))(abilities.enumerate(policy))


# Compiled whole: one by one, the operations of a policy take longer to compile than all together.
@eqx.filter_jit
def _chances(
    parameters: PyTree,
    settings: PyTree,
    observations: Float[np.ndarray, "states inputs"],
    index: Int[np.ndarray, " drawn"],
    actions: int,
) -> Float[Array, "states actions"]:
    policy = eqx.combine(parameters, settings)
    log_prob = jax.vmap(jax.vmap(policy.log_prob, (None, 0)), (0, None))
    each = jnp.exp(log_prob(jnp.asarray(observations), abilities.enumerate(policy)))
    # Of a policy with hidden units, several actions look alike to the world.
    return jax.ops.segment_sum(each.T, index, actions).T


@eqx.filter_jit
def _log_slopes(parameters: PyTree, *rest: PyTree) -> Float[Array, "states actions parameters"]:
    vector, build = ravel_pytree(parameters)
    return jax.jacfwd(lambda v: jnp.log(_chances(build(v), *rest)))(vector)


@eqx.filter_jit
def _slope_of_worth(parameters: PyTree, worth: Float[np.ndarray, "states actions"], *rest: PyTree) -> PyTree:
    return jax.grad(lambda theta: jnp.sum(worth * _chances(theta, *rest)))(parameters)


def _mean_rewards(mdp: FiniteMDP, policy: Policy) -> Float[np.ndarray, " states"]:
    return np.einsum("sa,as->s", action_probabilities(mdp, policy), mdp.expected_rewards)


def _discounted(mdp: FiniteMDP, policy: Policy, discount: float) -> Float[np.ndarray, " states"]:
    resolvent = np.eye(mdp.states) - discount * transition_matrix(mdp, policy)
    return solved(resolvent, _mean_rewards(mdp, policy))


def _quality(mdp: FiniteMDP, policy: Policy, decay: float) -> Float[np.ndarray, "actions states"]:
    """The discounted value of each action in each state when the policy is followed afterwards."""
    return mdp.expected_rewards + decay * mdp.transitions @ _discounted(mdp, policy, decay)


def _contract(
    mdp: FiniteMDP, policy: P, weight: Float[np.ndarray, " states"], quality: Float[np.ndarray, "actions states"]
) -> P:
    r"""$\sum_s w_s \sum_a \nabla\pi(a \mid s)\,Q(s, a)$, with the policy's derivative by automatic differentiation."""
    with jax.enable_x64(True):
        parameters, settings = split(to_float64(policy))
        worth = weight[:, None] * quality.T
        slope = _slope_of_worth(parameters, worth, settings, mdp.observations, _index(mdp, policy), mdp.actions)
        return jax.tree.map(np.asarray, slope)
