"""What a decision costs with thousands of local units, all of them asked or only those that can fire."""

from motorgrad.benchmarks._measure import Row, in_turn
from motorgrad.tasks import FallingParticle
from motorgrad.training import settings_for, stepper_of

WIDTH = 0.64  # in spacings: as many units can fire anywhere, however many there are


def index_row(units: int, seeds: int, decisions: int, pairs: int = 5, wanted: str = "") -> Row:
    """Decisions per second in total of a falling particle, with the spatial index and without."""
    task, width = FallingParticle(units=units), WIDTH / (units / 2) ** 0.5
    policy = {"copies": 2, "width": width, "least_log_width": -8.0}
    rates = {"centre": 2e-4 * (width / 0.16) ** 2, "log_width": 8e-4}
    learners = [
        stepper_of(task, settings_for(task, policy_settings=policy, rates=rates, index=index).agent(task), range(seeds))
        for index in (True, False)
    ]
    for learner in learners:
        learner.advance(decisions)  # compiles
    ours, other = (lambda own=learner: own.advance(decisions) for learner in learners)
    name = f"falling particle of {units:,} units, indexed ÷ all, {seeds:,} seed{'s' * (seeds > 1)}"
    return in_turn(name, "decisions/s", decisions * seeds, ours, other, pairs=pairs, wanted=wanted)
