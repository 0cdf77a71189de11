"""Muscle synergies: groups of muscles driven together, given by name or found in recorded activations."""

import fnmatch
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from jaxtyping import Float

from motorgrad._errors import check, check_integer, unknown

_TINY = 1e-12


def synergy_matrix(synergies: Sequence[str], groups: Sequence[str]) -> Float[np.ndarray, "units groups"]:
    """The binary matrix of which groups of muscles each unit drives.

    **Arguments:** `synergies`: for each unit the names of its groups, separated by spaces; a name may be a pattern such
    as `depressor_*`. `groups`: the existing names, as in `Body.groups`.

    **Raises:** `ValueError` for no units, a unit without groups, or a name that matches no group.
    """
    check(len(synergies) > 0, "synergies", synergies, "at least one unit")
    matrix = np.zeros((len(synergies), len(groups)), np.float32)
    for unit, words in enumerate(synergies):
        check(isinstance(words, str) and words.split(), f"synergies[{unit}]", words, "names of groups of muscles")
        for word in words.split():
            named = [index for index, group in enumerate(groups) if fnmatch.fnmatchcase(group, word)]
            if not named:
                raise unknown(f"group of muscles in synergies[{unit}]:", word, groups)
            matrix[unit, named] = 1.0
    return matrix


class Synergies(NamedTuple):
    """Synergies found in recorded activations.

    - `weights` (units, groups): of each group in each synergy, from 0 to 1, the greatest being 1.
    - `strength` (decisions, units): activation of each synergy.
    - `explained`: the fraction of the activations' sum of squares explained by strength × weights, from 0 to 1.
    """

    weights: Float[np.ndarray, "units groups"]
    strength: Float[np.ndarray, "decisions units"]
    explained: float

    def names(self, groups: Sequence[str], least: float = 0.5) -> tuple[str, ...]:
        """The synergies as a task expects them: the names of the groups whose weight is at least `least`, in (0, 1]."""
        check(0 < least <= 1, "least", least, "in (0, 1]")
        check(len(groups) == self.weights.shape[1], "groups", len(groups), f"{self.weights.shape[1]} names")
        return tuple(
            " ".join(group for group, weight in zip(groups, row, strict=True) if weight >= least)
            for row in self.weights
        )


def find_synergies(
    activation: npt.ArrayLike, units: int, seed: int = 0, restarts: int = 8, iterations: int = 300
) -> Synergies:
    """Find synergies by non-negative matrix factorisation of activations, into strength × weights.

    The factors start at random and follow the multiplicative updates, which never increase the squared error; the best
    of several starts is returned. Synergies are ordered by their share in the activations.

    **Arguments:**

    - `activation` (…, groups): numbers of at least 0, such as `Evaluation.activation`.
    - `units`: number of synergies, at most the number of groups.
    - `seed`: seed of the random starts.
    - `restarts`: number of starts.
    - `iterations`: updates per start.

    **Raises:** `ValueError` for negative, infinite or all-zero activations, or invalid numbers.

    Source: D. D. Lee and H. S. Seung, *Algorithms for non-negative matrix factorization*, NIPS 13, 2001.
    """
    data = np.asarray(activation, float)
    data = data.reshape(-1, data.shape[-1]) if data.ndim else data[None, None]
    right = data.size > 0 and bool(np.isfinite(data).all() and (data >= 0).all() and data.any())
    check(right, "activation", np.asarray(activation), "finite numbers of at least 0, and not all of them 0")
    for name, value in (("units", units), ("restarts", restarts), ("iterations", iterations)):
        check_integer(name, value, 1)
    check(units <= data.shape[1], "units", units, f"at most the number of groups, {data.shape[1]}")
    random = np.random.default_rng(seed)
    total = float((data * data).sum())
    tries = [_factors(data, units, random, iterations) for _ in range(restarts)]
    errors = [float(((data - strength @ weights) ** 2).sum()) for strength, weights in tries]
    strength, weights = tries[int(np.argmin(errors))]
    scale = np.maximum(weights.max(1), _TINY)
    strength = strength * scale
    weights = weights / scale[:, None]
    order = np.argsort(-(strength**2).sum(0) * (weights**2).sum(1), kind="stable")
    return Synergies(weights[order], strength[:, order], 1.0 - min(errors) / total)


def _factors(
    data: np.ndarray, units: int, random: np.random.Generator, iterations: int
) -> tuple[np.ndarray, np.ndarray]:
    size = np.sqrt(data.mean() / units)
    strength = size * (0.1 + random.random((len(data), units)))
    weights = size * (0.1 + random.random((units, data.shape[1])))
    for _ in range(iterations):
        weights *= (strength.T @ data) / (strength.T @ strength @ weights + _TINY)
        strength *= (data @ weights.T) / (strength @ (weights @ weights.T) + _TINY)
    return strength, weights
