"""Which preset a task gets by itself: by what the task is, and not by its name.

The rules come from measured runs, which `docs/which-preset.md` shows.
"""

from typing import NamedTuple

from motorgrad._errors import check, is_integer
from motorgrad.learning._learner import MAX_ALTERNATIVES
from motorgrad.learning.algorithms._presets import STEPS, Learnable

MAX_MATRIX_INPUTS = 1_000
"""Observed numbers up to which a learner may keep matrices over all pairs of features, or a replay of observations: a
picture of 84 × 84 points has more."""
MAX_COVERED_INPUTS = 7
"""Observed numbers up to which the fixed features of `natural` cover their space: it balances the pole of CartPole for
good, and does not land the lunar lander, which shows two more."""
MIN_REPLAY_STEPS = 2_000
"""Decisions below which a training is over before a replay has taught much."""


class Choice(NamedTuple):
    """The preset that goes with a task.

    - `preset`: its name.
    - `reason`: what of the task decides.
    - `alternative`: the name of the preset to try beside it; `gain`: what speaks for that.

    As a string, all of it in one line.
    """

    preset: str
    reason: str
    alternative: str
    gain: str

    def __str__(self) -> str:
        return f"preset {self.preset!r}, because {self.reason}; preset {self.alternative!r} {self.gain}"


def choose(task: Learnable, steps: int = STEPS, envs: int = 1) -> Choice:
    """The preset that a task without a learner of its own gets by itself.

    It is chosen by what the task is: whether actions are real numbers, alternatives or on and off, whether the task has
    a goal, how many numbers it observes, how many decisions there are to learn from, and whether several environments
    feed one learner.

    **Arguments:** the `task`; the decisions of a training, per seed (`steps`); the environments of each seed (`envs`).

    **Returns** a `Choice`.

    **Raises:** `ValueError` for numbers below 1.

    ```python
    choice = mg.presets.choose(mg.make("composed"), steps=60_000)
    print(choice.preset)  # → sac
    ```
    """
    for name, number in (("steps", steps), ("envs", envs)):
        check(is_integer(number) and number >= 1, name, number, "an integer of at least 1")
    if task.observation_size > MAX_MATRIX_INPUTS:
        seen = f"it observes {task.observation_size:,} numbers, too many for matrices and replays"
        return Choice("ppo", seen, "stream-ac", "stores no decision at all")
    if task.actions not in ("continuous", "discrete"):
        kind = "mixed" if isinstance(task.actions, tuple) else task.actions
        return Choice("natural", f"its actions are {kind}", "natural-network", "has hidden layers that learn")
    if envs > 1:
        shared = f"{envs} environments feed each learner, which then keeps no replay"
        return Choice("natural", shared, "sac", "learns from fewer decisions of one environment")
    if task.actions == "discrete" and task.observation_size <= MAX_COVERED_INPUTS:
        few = f"it chooses among alternatives and observes {task.observation_size} numbers, which fixed features cover"
        return Choice("natural", few, "sac", "learns its features, from a replay")
    if task.actions == "discrete" and task.action_size > MAX_ALTERNATIVES:
        return Choice("natural", f"it chooses among {task.action_size:,} alternatives", "ppo", "is usual for many")
    if steps < MIN_REPLAY_STEPS:
        few = f"{steps:,} decisions are too few to learn from a replay"
        return Choice("natural", few, "sac", f"learns more from {MIN_REPLAY_STEPS:,} and more")
    acts = "its actions are real numbers" if task.actions == "continuous" else "it chooses among few alternatives"
    learns = "and it has a goal, for hindsight" if task.goal is not None else "and a replay learns from few decisions"
    return Choice("sac", f"{acts} {learns}", "natural", "takes less processor time a decision, and more decisions")
