"""The film of the front page: a hexapod before and after its 24 muscles learned to walk."""

from motorgrad.experiments import motion_of
from motorgrad.sim import Motion
from motorgrad.training import evaluate
from tools.figures._work import Work

STEPS, SECONDS = 192_000, 5.0


def hexapod_walk(work: Work) -> list[Motion]:
    """Seed 0 of the task's own learner, with sampled actions: before learning, and after 192,000 decisions.

    No seed was chosen: `docs/reproduction-muscles.md` has the results of all.
    """
    run = work.train("hexapod", None, STEPS, seeds=1, keep="hexapod-walk")
    steps = round(SECONDS / run.task.period)
    return [
        motion_of(run, evaluate(run, steps, untrained=untrained), run.seeds[0], label, SECONDS)
        for untrained, label in ((True, "before learning"), (False, "after learning"))
    ]
