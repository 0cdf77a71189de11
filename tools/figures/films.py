"""Short films of what motorgrad can do: bodies before and after learning.

Each shows seed 0, with sampled actions. No seed was chosen; the pages of the tasks have the results of many.
"""

from motorgrad.tasks import Task
from motorgrad.training import evaluate
from timsim import Motion, motion_of
from tools.figures._work import Work
from tools.figures.composed import reach

DECISIONS = {
    "hexapod-learns-to-walk": 200_000,
    "hexapod-walks-with-four-units": 100_000,
    "hopper-learns-to-hop": 100_000,
    "arm-learns-to-reach": 60_000,
}
"""How long each film's seed learns, by the name of its picture."""


def hexapod_walk(work: Work) -> list[Motion]:
    """A hexapod learns to walk with 24 independent muscles and all senses."""
    return _before_and_after(work, "hexapod-proprioception", DECISIONS["hexapod-learns-to-walk"], "hexapod-walk")


def hexapod_synergies(work: Work) -> list[Motion]:
    """A hexapod learns to walk with four units that drive its muscles in groups."""
    return _before_and_after(work, "hexapod-synergy", DECISIONS["hexapod-walks-with-four-units"], "hexapod-synergy")


def hopper_hop(work: Work) -> list[Motion]:
    """A hopper learns to hop."""
    return _before_and_after(work, "hopper", DECISIONS["hopper-learns-to-hop"], "hopper-hop")


def arm_reach(work: Work) -> list[Motion]:
    """An arm with six muscles learns to reach for targets: any MJCF body, with a task of terms."""
    return _before_and_after(work, reach(), DECISIONS["arm-learns-to-reach"], "arm-reach", seconds=8.0)


def _before_and_after(work: Work, task: Task | str, steps: int, keep: str, seconds: float = 5.0) -> list[Motion]:
    """The motion of the task's own learner before learning and after `steps` decisions."""
    run = work.train(task, None, steps, seeds=1, keep=keep)
    shown = round(seconds / run.task.period)
    return [
        motion_of(run, evaluate(run, shown, untrained=untrained), run.seeds[0], label, seconds)
        for untrained, label in ((True, "before learning"), (False, "after learning"))
    ]
