"""The chain of figure 4.9: reward only at its far end."""

import numpy as np

from motorgrad._errors import check, choice
from motorgrad.worlds._finite import FiniteMDP

CHAIN_VARIANTS = ("walk", "reset")
"""What a wrong move does: one state back, or back to the start."""


def chain(length: int = 6, variant: str = "walk") -> FiniteMDP:
    r"""A line of `length` $= N$ states with actions left (0) and right (1), observed one-hot; 1 is paid on entering its
    right end, from where either action leads back to the start.

    The thesis calls the wait for a first reward under random actions exponential. That depends on what a wrong move
    does, so there are two variants:

    - `"walk"`: left is one state back. Random actions take $N(N - 1)$ steps on average (30 for $N = 6$).
    - `"reset"`: left is back to the start. Random actions take $2^N - 2$ steps (62): exponentially many.

    Episodes cut after $N - 1$ decisions (a task's `time_limit`) make the walk exponential as well: one episode in
    $2^{N - 1}$ sees the reward.

    **Raises:** `ValueError` for a length below 2 or an unknown variant.
    """
    check(isinstance(length, int) and length >= 2, "length", length, "an integer of at least 2")
    choice("variant", variant, CHAIN_VARIANTS)
    end = length - 1
    transitions = np.zeros((2, length, length))
    for state in range(end):
        transitions[0, state, max(state - 1, 0) if variant == "walk" else 0] = 1
        transitions[1, state, state + 1] = 1
    transitions[:, end, 0] = 1
    return FiniteMDP(transitions, np.eye(length)[end], np.eye(length))
