"""OLGARB on linear recruitment, beside a hand-written compiled loop of it; and what the natural step costs."""

from motorgrad.benchmarks._beside_loop import loop_row
from motorgrad.benchmarks._measure import Row, in_turn
from motorgrad.benchmarks._recruitment_loop import recruitment_loop
from motorgrad.tasks import LinearRecruitment
from motorgrad.training import settings_for, stepper_of


def recruitment_row(seeds: int, decisions: int, pairs: int = 5, wanted: str = "") -> Row:
    """Updates per second in total of pools of eight, against the loop's on one core."""
    task = LinearRecruitment(units=8)
    numbers = (task.units, task.slope, task.intercept, settings_for(task).rate)
    name = f"linear recruitment of {task.units}, OLGARB"
    return loop_row(name, task, lambda steps: recruitment_loop(steps, 1, *numbers), seeds, decisions, pairs, wanted)


def natural_row(seeds: int, decisions: int, pairs: int = 5) -> Row:
    """Updates per second in total of pools of sixteen: the natural step against the plain one."""
    task = LinearRecruitment(units=16)
    natural = settings_for(task, metric="fisher", dampings={"threshold": 0.05}, rate=1e-4)
    learners = [stepper_of(task, settings.agent(task), range(seeds)) for settings in (natural, settings_for(task))]
    for learner in learners:
        learner.advance(decisions)  # compiles
    ours, other = (lambda own=learner: own.advance(decisions) for learner in learners)
    name = f"linear recruitment of {task.units}, natural ÷ plain step, {seeds:,} seed{'s' * (seeds > 1)}"
    return in_turn(name, "updates/s", decisions * seeds, ours, other, pairs=pairs)
