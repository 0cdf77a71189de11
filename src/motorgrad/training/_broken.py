"""Policies that are not finite: which they are, in words."""

from collections.abc import Mapping, Sequence

import jax
import numpy as np
from jaxtyping import Bool

from motorgrad._arrays import AnyArray
from motorgrad.policies import Policy, trainable
from motorgrad.training._sweep import setting_text


def not_finite(policies: Policy) -> Bool[np.ndarray, " lanes"]:
    """Which of the policies along a leading axis have parameters that are not finite."""
    return np.any([not_all_finite(leaf) for leaf in jax.tree.leaves(trainable(policies))], axis=0)


def not_all_finite(numbers: AnyArray) -> Bool[np.ndarray, " lanes"]:
    """Along the leading axis of an array, where not all numbers are finite."""
    return np.any(~np.isfinite(np.reshape(numbers, (len(numbers), -1))), axis=1)


def lanes_in_words(
    which: Bool[np.ndarray, " lanes"], seeds: Sequence[int], settings: Sequence[Mapping[str, float]]
) -> str:
    """Some lanes in a few words: their seeds, in a sweep of each setting."""
    parts = []
    for place, lanes in enumerate(which.reshape(-1, len(seeds))):
        chosen = sorted(seed for seed, lane in zip(seeds, lanes, strict=True) if lane)
        more = f" and {len(chosen) - 5} more" if len(chosen) > 5 else ""
        words = f"seed{'s' * (len(chosen) > 1)} {', '.join(map(str, chosen[:5]))}{more}"
        parts += [f"{words} of {setting_text(settings[place])}" if settings else words] * bool(chosen)
    more = f"; and of {len(parts) - 5} more settings" if len(parts) > 5 else ""
    return "; ".join(parts[:5]) + more
