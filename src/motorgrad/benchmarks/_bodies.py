"""Bodies and environments: learning beside bare physics, and how long the hopper takes to learn."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)

import dataclasses
import functools
import importlib.util
import math
import time
from collections.abc import Iterator
from typing import Any, Literal

import gymnasium
import mujoco
import numpy as np
from mujoco.batch import Batch

import motorgrad  # noqa: F401 (registers the ids)
from motorgrad.benchmarks._measure import Row, in_turn
from motorgrad.bodies import BodyBatch, Mjcf, compile_model, group_places
from motorgrad.bodies import Hopper as HopperBody
from motorgrad.learning import SGD, Adam, Agent, Learner, olgarb, olpomdp
from motorgrad.policies import bounded_hyperplanes, hyperplanes, softmax
from motorgrad.presets import natural
from motorgrad.tasks import BodyTask, Hopper, HostTask, from_gymnasium, myosuite
from motorgrad.training import BodyStepper, SideBySide, agent_for, stepper_for, train, training_stepper_for


def body_row(
    name: str,
    task: BodyTask,
    seeds: int,
    decisions: int,
    pairs: int = 5,
    wanted: str = "",
    agent: Learner | None = None,
) -> Row:
    """Physics steps per second while learning, by default with the task's own agent, against `mujoco.batch` alone."""

    def make() -> BodyStepper | SideBySide:
        found = training_stepper_for(task, agent or agent_for(task), range(seeds))
        assert isinstance(found, BodyStepper | SideBySide)
        return found

    twin = make()
    learner = make()
    learner.advance(decisions)  # compiles
    for _ in range(decisions):
        twin.advance(1)
    body = task.dynamics
    group_of = group_places(body)
    model = compile_model(body)
    bare = Batch(model, seeds)
    bare.state[:] = twin.state["physics"]["state"]
    control = bare.bind("ctrl")
    actions = np.empty((pairs, decisions, seeds, model.nu))
    for part in actions:  # the twin learns bit for bit like the learner
        for action in part:
            action[:] = twin.control[:, group_of]
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
    """Seconds, of all seeds together, that are simulated and learned from per second, for a `body_row`."""
    assert row.other is not None
    ours, other = (steps * task.period / task.substeps for steps in (row.ours, row.other))
    return Row("   in simulated time", ours, other, "simulated s/s", wanted=wanted)


def composed_rows(name: str, task: BodyTask, seeds: int, decisions: int, pairs: int, wanted: str = "") -> Iterator[Row]:
    """Learning in a composed task, by OLGARB with linear units and by the preset `natural`."""
    units = hyperplanes if task.actions == "binary" else bounded_hyperplanes
    plain = Agent(units(task), olgarb(0.9), SGD(1e-3))
    for learner, agent, asked in (("OLGARB", plain, wanted), ("preset natural", natural(task), "")):
        yield body_row(f"{name}, {learner}", task, seeds, decisions, pairs, asked, agent)


def suite_rows(env_id: str, seeds: int, decisions: int, pairs: int, wanted: str = "") -> Iterator[Row]:
    """Learning in a task of MyoSuite, rebuilt, as `body_row`; and MyoSuite's own steps per second, against
    `mujoco.mj_step` alone. Without MyoSuite a row that says so."""
    if importlib.util.find_spec("myosuite") is None:
        yield Row(
            f"{env_id} (MyoSuite is not installed: extra myosuite)", math.nan, None, "physics steps/s", wanted=wanted
        )
        return
    yield from composed_rows(env_id, myosuite(env_id, actions="binary"), seeds, decisions, pairs, wanted)
    theirs = gymnasium.make(env_id)
    theirs.reset(seed=0)
    inner: Any = theirs.unwrapped
    data = mujoco.MjData(inner.model)
    controls = np.random.default_rng(0).uniform(size=(decisions, inner.model.nu))
    actions = (2 * controls - 1).astype(np.float32)

    def own() -> None:
        for action in actions:
            if any(theirs.step(action)[2:4]):
                theirs.reset()

    def bare() -> None:
        for control in controls:
            data.ctrl[:] = control
            mujoco.mj_step(inner.model, data, inner.frame_skip)

    steps = decisions * inner.frame_skip
    yield in_turn("   MyoSuite's own step ÷ mj_step", "physics steps/s", steps, own, bare, pairs=pairs)


def tendon_rows(seeds: int, decisions: int, pairs: int) -> Iterator[Row]:
    """Physics steps per second of Hill-type muscles on tendons that stretch, against rigid ones and against muscles of
    other kinds on the same body, at random activations; with the curves of Millard et al. too."""
    bodies: list[tuple[str, Any, Any, int]] = [
        ("arm6", Mjcf("arm6"), Mjcf("arm6", muscle_model="hill"), decisions),
        ("hopper", HopperBody(), HopperBody(muscle_model="hill"), decisions),
    ]
    if importlib.util.find_spec("myosuite") is not None:  # its steps take some ten times as long
        hand = Mjcf("myosuite:myohand_r")
        bodies.append(("myohand_r", hand, dataclasses.replace(hand, muscle_model="hill"), math.ceil(decisions / 20)))
    for name, plain, compliant, count in bodies:
        rigid, millard = (dataclasses.replace(compliant, **c) for c in ({"tendon": "rigid"}, {"curves": "millard"}))
        both = dataclasses.replace(rigid, curves="millard")
        actions = np.random.default_rng(0).uniform(size=(count, seeds, len(plain.groups)))
        other = "the thesis's" if name == "hopper" else "MuJoCo's own"
        for muscles, against, one, two, wanted in (
            ("muscles", "on rigid ones", compliant, rigid, "≥ 0.77"),
            ("muscles", other, compliant, plain, ""),
            ("muscles with Millard's curves", "on rigid ones", millard, both, "≥ 0.77"),
            ("muscles with Millard's curves", "with De Groote's", millard, compliant, ""),
        ):
            first, second = (functools.partial(_stepped, BodyBatch(body, seeds), actions) for body in (one, two))
            what = f"{name}, {muscles} on compliant tendons ÷ {against}, {seeds} seed{'s' * (seeds > 1)}"
            steps = count * seeds * 10
            yield in_turn(what, "physics steps/s", steps, first, second, pairs=pairs, wanted=wanted)


def _stepped(batch: BodyBatch, actions: np.ndarray) -> None:
    for action in actions:
        batch.step(action)


HOPPER = "motorgrad/Hopper-v0"


def vector_row(copies: int, decisions: int, pairs: int) -> Row:
    """Decisions per second of the vector environment, against `BodyBatch` alone on the same actions."""
    task = Hopper()
    actions = np.random.default_rng(0).integers(0, 2, (decisions, copies, 2), dtype=np.int8)
    environment = gymnasium.make_vec(HOPPER, num_envs=copies)
    environment.reset(seed=0)
    bare = BodyBatch(task.dynamics, copies, substeps=task.substeps)

    def ours() -> None:
        for action in actions:
            environment.step(action)

    def other() -> None:
        for action in actions.astype(np.float32):
            bare.step(action)

    ours()  # compiles
    name = f"{HOPPER}, vector of {copies} ÷ bare physics"
    return in_turn(name, "decisions/s", decisions * copies, ours, other, pairs=pairs)


def single_row(decisions: int, pairs: int) -> Row:
    """Decisions per second of the environment from `gymnasium.make`, against `mujoco.mj_step` with the muscle law."""
    task = Hopper()
    actions = np.random.default_rng(0).integers(0, 2, (decisions, 2), dtype=np.int8)
    environment = gymnasium.make(HOPPER)
    environment.reset(seed=0)
    body = task.dynamics
    model = compile_model(body)
    group_of = group_places(body)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)

    def ours() -> None:
        for action in actions:
            if any(environment.step(action)[2:4]):
                environment.reset()

    def other() -> None:
        for action in actions[:, group_of]:
            data.ctrl[:] = action
            mujoco.mj_step(model, data, task.substeps)

    ours()  # compiles
    return in_turn(f"{HOPPER}, single ÷ mj_step", "decisions/s", decisions, ours, other, pairs=pairs)


def foreign_row(seeds: int, decisions: int, pairs: int) -> Row:
    """Decisions per second of learning in CartPole, against stepping the bare environments at random."""
    task = from_gymnasium("CartPole-v1")
    agent = Agent(softmax(task), olpomdp(0.99), Adam(0.003))
    learner = stepper_for(task, agent, range(seeds))
    learner.advance(decisions)  # compiles
    bare = [gymnasium.make("CartPole-v1") for _ in range(seeds)]
    for seed, environment in enumerate(bare):
        environment.reset(seed=seed)
    actions = np.random.default_rng(0).integers(0, 2, (decisions, seeds))

    def other() -> None:
        for row in actions:
            for environment, action in zip(bare, row, strict=True):
                if any(environment.step(int(action))[2:4]):
                    environment.reset()

    name = f"CartPole-v1, learning ÷ bare environments, {seeds} seeds"
    return in_turn(name, "decisions/s", decisions * seeds, lambda: learner.advance(decisions), other, pairs=pairs)


def shared_row(name: str, task: HostTask, envs: int, decisions: int, pairs: int) -> Row:
    """Decisions per second of one learner fed by several environments, against as many learners, each with its own."""
    agent = natural(task, envs * decisions)
    shared = stepper_for(task, agent, [0], envs=envs)
    single = stepper_for(task, agent, range(envs))
    for stepper, each in ((shared, envs * decisions), (single, decisions)):
        stepper.advance(each)  # compiles
    name = f"{name}, one natural learner of {envs} environments ÷ {envs} learners of one"
    amount = envs * decisions
    return in_turn(
        name, "decisions/s", amount, lambda: shared.advance(amount), lambda: single.advance(decisions), pairs=pairs
    )


HEIGHT = 0.3  # metres


SETTINGS: tuple[tuple[Literal["landing", "apex"], float], ...] = (("landing", 0.98), ("apex", 0.98), ("landing", 0.995))
"""What is rewarded, and the decay of the trace: the thesis's decay twice, and the task's own learner."""


def learning_rows(seeds: int, seconds: float) -> Iterator[Row]:
    """Time until the median seed's apex, averaged over 25 s windows, exceeds 0.3 m; and the final apex. The other
    column has the figures of an independent model with the same numbers, rewarded at the first apex with a decay of
    0.98: 315 s (270 to 450) and 0.72 m at 1,500 s, 8 seeds."""
    for reward_type, decay in SETTINGS:
        start = time.perf_counter()
        task = Hopper(reward_type=reward_type)
        decisions, window = (round(each / task.period) for each in (seconds, 25))
        run = train(task, agent_for(task, decay=decay), decisions, seeds, window=window, progress=False)
        wall = time.perf_counter() - start
        decision, apex = run.curve("apex")
        each = np.array([next(iter(decision[row > HEIGHT]), np.inf) for row in apex]) * task.period
        simulated = float(np.median(each))
        last = run.final("apex", min(1.0, 8 / apex.shape[1]))
        name = f"hopper rewarded at {reward_type}, decay {decay}, {seeds} seeds"
        yield Row(f"{name}: apex > {HEIGHT} m", simulated, 315.0, "simulated s", None, (each.min(), each.max()))
        yield Row("   the same in wall time, all seeds together", wall * simulated / seconds, None, "s")
        yield Row(f"   apex at {seconds:.0f} s", float(np.median(last)), 0.72, "m", None, (last.min(), last.max()))
