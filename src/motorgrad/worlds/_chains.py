"""Markov chains by linear algebra: stationary distributions, values, and their rounding errors."""

import warnings

import numpy as np
from jaxtyping import Float

from motorgrad._errors import check

ROUNDING = 16 * np.finfo(float).eps


def lead(choice: np.ndarray, worth: np.ndarray, doubt: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The advantage of each action over the chosen one in every state, and its possible rounding error."""
    every = np.arange(len(choice))
    return worth - worth[choice, every], doubt + doubt[choice, every]


def expected_change(moves: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The expected change of `values` by each action in each state, and its rounding error. Staying has no part in
    either, however probable it is."""
    others = np.where(np.eye(len(values), dtype=bool), 0.0, moves)
    change = np.sum(others * (values[None, :] - values[:, None]), -1)
    size = np.abs(values)
    return change, ROUNDING * (others @ size + others.sum(-1) * size)


def evaluate(matrix: np.ndarray, rewards: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The average reward from every state of a chain, which may have several recurrent classes, and the differential
    value of every state."""
    leaving = departures(matrix)
    gain = np.zeros(len(matrix))
    value = np.zeros(len(matrix))
    passing = np.ones(len(matrix), bool)
    for members in recurrent(matrix):
        inside = np.ix_(members, members)
        pi = balance(matrix[inside])
        gain[members] = pi @ rewards[members]
        short = rewards[members] - gain[members]
        worth = np.append(0.0, solve(leaving[inside][1:, 1:], short[1:]))  # relative to the first state
        value[members] = worth - pi @ worth
        passing[members] = False
    if passing.any():
        within = leaving[np.ix_(passing, passing)]
        onwards = matrix[np.ix_(passing, ~passing)]
        gain[passing] = solve(within, onwards @ gain[~passing])
        value[passing] = solve(within, rewards[passing] - gain[passing] + onwards @ value[~passing])
    return gain, value


def departures(matrix: np.ndarray) -> np.ndarray:
    """$I - P$ of a stochastic matrix. Its diagonal is the sum of what leaves a state, which is exact to rounding where
    a state is hardly ever left."""
    others = np.where(np.eye(len(matrix), dtype=bool), 0.0, matrix)
    return np.diag(others.sum(1)) - others


def solve(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """A linear system, refined by its residual in extended precision. **Raises** as `solved`."""
    from scipy.linalg import LinAlgWarning, lu_factor, lu_solve  # loading it would slow down every command's start

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LinAlgWarning)  # of a singular matrix: what comes of it is not finite
        factors = lu_factor(matrix)
        exact = matrix.astype(np.longdouble)
    with np.errstate(all="ignore"):
        found = lu_solve(factors, right, check_finite=False)
        for _ in range(2):
            found = found + lu_solve(factors, (right - exact @ found).astype(float), check_finite=False)
    return _checked(found)


def solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """A linear system. **Raises** `ValueError` where it has no unique solution in double precision."""
    try:
        return _checked(np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError:
        return _checked(np.array(np.nan))


def _checked(found: np.ndarray) -> np.ndarray:
    allowed = (
        "one that leaves states with probabilities which double precision tells from 0, at a discount well below 1"
    )
    check(np.isfinite(found).all(), "policy", "a chain whose linear equations have no unique solution", allowed)
    return found


def recurrent(matrix: np.ndarray) -> list[np.ndarray]:
    """The states of each closed recurrent class."""
    from scipy.sparse.csgraph import connected_components

    count, of = connected_components(matrix > 0, connection="strong")
    leaving = {of[i] for i, j in zip(*np.nonzero(matrix), strict=True) if of[i] != of[j]}
    return [np.flatnonzero(of == each) for each in range(count) if each not in leaving]


def stationary(matrix: Float[np.ndarray, "states states"]) -> Float[np.ndarray, " states"]:
    """The stationary distribution of a chain with exactly one recurrent class."""
    closed = recurrent(matrix)
    found = f"{len(closed)} recurrent classes"
    check(len(closed) == 1, "policy", found, "one whose chain has a unique stationary distribution")
    pi = np.zeros(len(matrix))
    pi[closed[0]] = balance(matrix[np.ix_(closed[0], closed[0])])
    return pi


def balance(matrix: np.ndarray) -> np.ndarray:
    """The stationary distribution of an irreducible chain, from the flows between its states."""
    leaving = departures(matrix)
    pi = np.ones(len(matrix))
    for _ in range(2):  # relative to any state, then to the most probable, where rounding is least
        one = pi.argmax()
        others = np.arange(len(matrix)) != one
        pi = np.ones(len(matrix))
        pi[others] = solve(leaving[np.ix_(others, others)].T, matrix[one, others])
    return pi / pi.sum()
