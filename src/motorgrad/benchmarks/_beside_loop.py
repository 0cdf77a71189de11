"""A learner of many seeds beside a hand-written compiled loop of the same learner."""

from collections.abc import Callable

from motorgrad.benchmarks._measure import Row, in_turn
from motorgrad.tasks import Task
from motorgrad.training import settings_for, stepper_of

LOOP_STEPS = 4_000_000


def loop_row(
    name: str, task: Task, loop: Callable[[int], object], seeds: int, decisions: int, pairs: int, wanted: str
) -> Row:
    """Updates per second in total, of the task's own learner, against the loop's on one core.

    **Arguments:** the row's `name`; the `task`; `loop`, which learns for so many decisions; the `seeds` that learn
    together, for so many `decisions` each; how many `pairs` of both; what is `wanted`.
    """
    learner = stepper_of(task, settings_for(task).agent(task), range(seeds))
    learner.advance(decisions)  # compiles
    loop(10)  # compiles
    name = f"{name} ÷ compiled loop, {seeds:,} seed{'s' * (seeds > 1)}"
    ours, other = lambda: learner.advance(decisions), lambda: loop(LOOP_STEPS)
    return in_turn(name, "updates/s", decisions * seeds, ours, other, LOOP_STEPS, pairs, wanted)
