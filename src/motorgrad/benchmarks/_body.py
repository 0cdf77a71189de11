"""Bodies that learn, beside their bare physics replaying the same actions."""

import numpy as np
from mujoco.batch import Batch

from motorgrad.benchmarks._measure import Row, in_turn
from motorgrad.bodies import compile_model
from motorgrad.tasks import BodyTask
from motorgrad.training import BodyStepper, SideBySide, learner_of, settings_for


def body_row(name: str, task: BodyTask, seeds: int, decisions: int, pairs: int = 5, wanted: str = "") -> Row:
    """Physics steps per second of learning by the task's own learner, against `mujoco.batch` alone on the actions that
    the learner took."""

    def make() -> BodyStepper | SideBySide:
        found = learner_of(task, settings_for(task).agent(task), range(seeds))
        assert isinstance(found, BodyStepper | SideBySide)
        return found

    twin, learner = make(), make()
    learner.advance(decisions)  # compiles
    for _ in range(decisions):
        twin.advance(1)
    body = task.dynamics
    group_of = [body.groups.index(muscle.group) for muscle in body.muscles]
    model = compile_model(body)
    bare = Batch(model, seeds)
    bare.state[:] = twin.state["physics"]["state"]
    control = bare.bind("ctrl")
    actions = np.empty((pairs, decisions, seeds, model.nu))
    for part in actions:  # the twin learns bit for bit as the learner will
        for action in part:
            action[:] = twin.activation[:, group_of]
            twin.advance(1)
    parts = iter(actions)

    def replay() -> None:
        for action in next(parts):
            control[:] = action
            bare.step(nstep=task.substeps)

    steps = decisions * seeds * task.substeps
    what = f"{name}, learning ÷ bare physics, {seeds} seed{'s' * (seeds > 1)}"
    return in_turn(
        what, "physics steps/s", steps, lambda: learner.advance(decisions), replay, pairs=pairs, wanted=wanted
    )


def simulated_row(row: Row, task: BodyTask, wanted: str = "") -> Row:
    """How many seconds, of all seeds together, are simulated and learnt from in a second, of a `body_row`."""
    assert row.other is not None
    ours, other = (steps * task.period / task.substeps for steps in (row.ours, row.other))
    return Row("   in simulated time", ours, other, "simulated s/s", None, None, wanted)
