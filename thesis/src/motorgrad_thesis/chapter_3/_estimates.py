"""Gradient estimates at fixed parameters: runs of GPOMDP, their exact variance, and the bias of short traces."""

import dataclasses
from collections.abc import Callable, Sequence

import jax
import numpy as np
from jaxtyping import Float

from motorgrad._errors import check
from motorgrad.learning import Agent, Baseline, gpomdp
from motorgrad.policies import Policy, Softmax, abilities, softmax
from motorgrad.tasks import ThreeState
from motorgrad.training import stepper_for
from motorgrad.worlds import FiniteMDP, chain, oracle, three_state


def comparison_point() -> Softmax:
    """The policy at which Baxter & Bartlett compare estimators."""
    return Softmax([[1.0, 1.0], [-1.0, -1.0]])


def estimates(
    decay: float, baseline: Baseline | None, lengths: Sequence[int], runs: int
) -> Float[np.ndarray, "lengths runs parameters"]:
    """Estimates of GPOMDP after these numbers of decisions, run by run, on the three-state MDP.

    Each run is one trajectory, continued from length to length, and the same for every decay and baseline.

    **Arguments:** `decay` of the trace; the baseline; `lengths` in decisions, rising; the number of runs.
    """
    stepper = stepper_for(ThreeState(), Agent(comparison_point(), gpomdp(decay, baseline)), range(runs))
    found = []
    for length in lengths:
        stepper.advance(length - stepper.decision)
        mean = stepper.state["cycle"].agent.gradient.mean
        found.append(np.asarray(mean.weights, float).reshape(runs, -1))
    return np.stack(found)


def relative_error(found: Float[np.ndarray, "*runs parameters"], exact: Float[np.ndarray, " parameters"]) -> np.ndarray:
    """Distance of each estimate from the exact gradient, relative to the gradient's norm."""
    return np.linalg.norm(found - exact, axis=-1) / np.linalg.norm(exact)


def along(found: Float[np.ndarray, "*runs parameters"], direction: Float[np.ndarray, " parameters"]) -> np.ndarray:
    """Component of each vector along `direction`, 1 for `direction` itself. Unlike a norm, it averages out noise."""
    return found @ direction / (direction @ direction)


def _undirected(mdp: FiniteMDP) -> Policy:
    return softmax(mdp.states, mdp.actions)


WORLDS: dict[str, tuple[Callable[[], FiniteMDP], Callable[[FiniteMDP], Policy]]] = {
    "three states": (three_state, lambda _: comparison_point()),
    "walk of 4": (lambda: chain(4), _undirected),
    "walk of 6": (lambda: chain(6), _undirected),
    "walk of 10": (lambda: chain(10), _undirected),
    "walk of 20": (lambda: chain(20), _undirected),
    "reset of 6": (lambda: chain(6, "reset"), _undirected),
    "reset of 10": (lambda: chain(10, "reset"), _undirected),
}
"""Worlds by name, with the policy at which the gradient is taken: chains as in figure 4.9, under random actions."""


def mixing_time(mdp: FiniteMDP, policy: Policy) -> int:
    r"""Steps after which the state's distribution is within a quarter of the stationary one in total variation from any
    start: $\min\{t : \max_s \frac12 \sum_{s'} |P^t_{ss'} - \pi_{s'}| \le \frac14\}$ (Levin & Peres, 2017)."""
    matrix = oracle.transition_matrix(mdp, policy)
    stationary = oracle.stationary_distribution(mdp, policy)
    after = np.eye(mdp.states)
    steps = 0
    while np.abs(after - stationary).sum(1).max() > 0.5:
        after = after @ matrix
        steps = steps + 1
    return steps


def biases(mdp: FiniteMDP, policy: Policy, reaches: Sequence[float] | np.ndarray) -> np.ndarray:
    r"""Relative bias of $\nabla_\beta$ for traces with a reach of $1/(1-\beta)$ decisions, each at least 1."""
    truth = oracle.flat(oracle.gradient(mdp, policy))
    found = [oracle.flat(oracle.biased_gradient(mdp, policy, 1 - 1 / reach)) for reach in reaches]
    return relative_error(np.stack(found), truth)


@dataclasses.dataclass(frozen=True)
class Parabola:
    """A variance as a function of the constant baseline $b$: `least` + `curvature` (b − `best`)²."""

    best: float
    least: float
    curvature: float

    def __call__(self, baseline: float | np.ndarray) -> float | np.ndarray:
        return self.least + self.curvature * (baseline - self.best) ** 2


def variance(mdp: FiniteMDP, policy: Policy, decay: float) -> Parabola:
    r"""$\lim_{T\to\infty} T\,\operatorname{tr}\operatorname{Cov}\big(\frac1T\sum_t (r_{t+1} - b)\,z_t\big)$ for every
    constant $b$: the total variance of the estimate, times the number of decisions.

    The sample is affine in the trace, and so is the solution of its Poisson equation, $A(x)\,z + c(x)$. The variance is
    the mean square of a martingale's increments, which requires only the first two moments of the trace in every state;
    all are solutions of linear equations. Correlations between nearby samples are included.

    **Arguments:** the MDP; a policy over as many actions; `decay` $\beta \in [0, 1)$ of the trace.
    """
    check(0 <= decay < 1, "decay", decay, "in [0, 1)")
    chosen = oracle.action_probabilities(mdp, policy)
    score = scores(mdp, policy)
    jump = np.einsum("sa,ast->sat", chosen, mdp.transitions)  # to state t by action a
    stationary = oracle.stationary_distribution(mdp, policy)
    pays = mdp.rewards[None, None] if mdp.rewards.ndim == 1 else mdp.rewards.T[:, :, None]
    pays = np.broadcast_to(pays, jump.shape)
    # three points determine a parabola
    values = [_total(jump, stationary, score, pays - baseline, decay) for baseline in (-1.0, 0.0, 1.0)]
    curvature = (values[0] + values[2]) / 2 - values[1]
    best = (values[0] - values[2]) / (4 * curvature)
    return Parabola(best, values[1] - curvature * best**2, curvature)


def _total(
    jump: Float[np.ndarray, "states actions states"],
    stationary: Float[np.ndarray, " states"],
    score: Float[np.ndarray, "states actions parameters"],
    pays: Float[np.ndarray, "states actions states"],
    decay: float,
) -> float:
    """Total variance if a step from state s by action a to state t has probability `jump` and reward `pays`."""
    matrix = jump.sum(1)
    one = np.eye(len(stationary))

    # moments of the trace before the decision, weighted by the probability of the state
    first = np.einsum("s,sat,sai->ti", stationary, jump, score)
    first = np.linalg.solve(one - decay * matrix.T, first)
    second = decay * np.einsum("sat,si,sai->t", jump, first, score) * 2
    second += np.einsum("s,sat,sai->t", stationary, jump, score**2)
    second = np.linalg.solve(one - decay**2 * matrix.T, second)

    # the Poisson equation
    slope = decay * np.linalg.solve(one - decay * matrix, np.einsum("sat,sat->s", jump, pays))
    weight = pays + slope
    drift = np.einsum("sat,sat,sai->si", jump, weight, score)
    constant = np.linalg.solve(one - matrix + stationary, drift - stationary @ drift)

    # D = w β z + d; the part predicted by the previous state is not noise
    offset = weight[..., None] * score[:, :, None] + constant
    mean_weight = np.einsum("sat,sat->s", jump, weight)
    mean_offset = np.einsum("sat,sati->si", jump, offset)

    def square(share: np.ndarray, w: np.ndarray, d: np.ndarray, where: str) -> np.ndarray:
        return (
            decay**2 * np.einsum(f"{where},{where},s->", share, w**2, second)
            + 2 * decay * np.einsum(f"{where},{where},{where}i,si->", share, w, d, first)
            + np.einsum(f"{where},{where}i,s->", share, d**2, stationary)
        )

    return float(square(jump, weight, offset, "sat") - square(np.ones(len(stationary)), mean_weight, mean_offset, "s"))


def scores(mdp: FiniteMDP, policy: Policy) -> Float[np.ndarray, "states actions parameters"]:
    """The score of every action in every state, in double precision."""
    with jax.enable_x64(True):
        double = jax.tree.map(lambda leaf: jax.numpy.asarray(leaf, float), policy)
        actions = abilities.enumerate(double)
        seen = jax.numpy.asarray(mdp.observations)
        found = jax.vmap(jax.vmap(double.score, (None, 0)), (0, None))(seen, actions)
        return np.concatenate([np.reshape(leaf, (*leaf.shape[:2], -1)) for leaf in jax.tree.leaves(found)], axis=-1)
