"""The mirror of a task: which of its inputs and actions are each other's on the two sides of a symmetric body."""

from typing import NamedTuple


class Mirror(NamedTuple):
    """What a task becomes in a mirror that swaps left and right.

    In the mirror, the observed number `j` is `signs[j]` × the number `inputs[j]`, and action `i` is that of
    `outputs[i]`. Looking twice gives the task itself. An action that is its own image is one of the middle.

    - `inputs` (observation_size): for each observed number the index of its mirror image.
    - `signs` (observation_size): 1, or -1 where the sign turns, as that of a turn to the left does.
    - `outputs` (action_size): for each action the index of its mirror image.
    """

    inputs: tuple[int, ...]
    signs: tuple[int, ...]
    outputs: tuple[int, ...]
