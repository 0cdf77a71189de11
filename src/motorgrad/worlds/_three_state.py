"""The three-state MDP on which policy-gradient estimators are compared."""

import numpy as np

from motorgrad.worlds._finite import FiniteMDP


def three_state() -> FiniteMDP:
    """The three-state, two-action MDP of Baxter & Bartlett (2001, section 4.1).

    Only state C is rewarded. Action 0 leads towards B from A and C, action 1 towards C; the features of the states are
    two numbers each, so that the policy cannot tell every state apart at will. The best policy earns 0.8.
    """
    first = [[0, 0.8, 0.2], [0.8, 0, 0.2], [0, 0.8, 0.2]]
    second = [[0, 0.2, 0.8], [0.2, 0, 0.8], [0, 0.2, 0.8]]
    features = np.array([[12, 6], [6, 12], [5, 5]]) / 18
    return FiniteMDP([first, second], [0, 0, 1], features)
