"""How long a chain takes to forget where it began, and what a trace that reaches less far misses of the gradient."""

from collections.abc import Callable, Sequence

import numpy as np

from motorgrad.experiments.chapter_3._estimates import comparison_point, relative_error
from motorgrad.policies import Policy, Softmax, softmax
from motorgrad.worlds import FiniteMDP, chain, oracle, three_state


def _undirected(mdp: FiniteMDP) -> Softmax:
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
"""Worlds, and the policy at which the gradient is taken, by name: chains as in figure 4.9, under random actions."""


def mixing_time(mdp: FiniteMDP, policy: Policy) -> int:
    r"""Steps after which, wherever it began, the state's distribution is within a quarter of the stationary one in
    total variation: $\min\{t : \max_s \frac12 \sum_{s'} |P^t_{ss'} - \pi_{s'}| \le \frac14\}$ (Levin & Peres, 2017)."""
    matrix, stationary = oracle.transition_matrix(mdp, policy), oracle.stationary_distribution(mdp, policy)
    after, steps = np.eye(mdp.states), 0
    while np.abs(after - stationary).sum(1).max() > 0.5:
        after, steps = after @ matrix, steps + 1
    return steps


def biases(mdp: FiniteMDP, policy: Policy, reaches: Sequence[float] | np.ndarray) -> np.ndarray:
    r"""The relative bias of $\nabla_\beta$ where the trace reaches $1/(1-\beta)$ decisions, each at least 1."""
    truth = oracle.flat(oracle.gradient(mdp, policy))
    found = [oracle.flat(oracle.biased_gradient(mdp, policy, 1 - 1 / reach)) for reach in reaches]
    return relative_error(np.stack(found), truth)
