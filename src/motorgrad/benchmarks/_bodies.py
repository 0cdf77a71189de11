"""Bodies and environments: learning beside bare physics, and how long the hopper takes to learn."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)

import dataclasses
import functools
import math
from typing import Any, Literal

import gymnasium
import mujoco
import numpy as np
from mujoco.batch import Batch

import motorgrad  # noqa: F401 (registers the ids)
from motorgrad._extras import require
from motorgrad.benchmarks._measure import Figures, in_turn, timed
from motorgrad.bodies import BodyBatch, Mjcf, compile_model, group_places
from motorgrad.bodies import Hopper as HopperBody
from motorgrad.learning import SGD, Adam, Agent, Learner, olgarb, olpomdp
from motorgrad.policies import bounded_hyperplanes, hyperplanes, softmax
from motorgrad.presets import natural
from motorgrad.tasks import BodyTask, Hopper, HostTask, from_gymnasium
from motorgrad.training import BodyStepper, Run, SideBySide, agent_for, stepper_for, train, training_stepper_for


def body(
    task: BodyTask, seeds: int, decisions: int, pairs: int = 5, agent: Learner | None = None, before: int = 0
) -> Figures:
    """Physics steps per second while learning, by default with the task's own agent, against `mujoco.batch` alone on
    the actions of the learner; both after `decisions`, or those `before`, that do not count."""

    def make() -> BodyStepper | SideBySide:
        found = training_stepper_for(task, agent or agent_for(task), range(seeds))
        assert isinstance(found, BodyStepper | SideBySide)
        return found

    twin = make()
    learner = make()
    learner.advance(before or decisions)  # compiles
    for _ in range(before or decisions):
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
    found = in_turn("physics steps/s", steps, lambda: learner.advance(decisions), replay, pairs=pairs)
    simulated = found.ours * task.period / task.substeps
    return dataclasses.replace(found, also=f"{simulated:,.3g} simulated s/s, all seeds together")


def composed(task: BodyTask, learner: str, seeds: int, decisions: int, pairs: int) -> Figures:
    """Learning in a composed task, by OLGARB with linear units or by the preset `natural`."""
    if learner == "natural":
        return body(task, seeds, decisions, pairs, natural(task))
    units = hyperplanes if task.actions == "binary" else bounded_hyperplanes
    return body(task, seeds, decisions, pairs, Agent(units(task), olgarb(0.9), SGD(1e-3)))


SUITE = ("this row needs", "myosuite", "myosuite")
"""What `require` is given before anything of MyoSuite is measured."""


SLOW_BODY = 20
"""How many times fewer decisions of the hand are measured, whose steps take longer."""


def tendons(name: str, first: str, second: str, decisions: int, pairs: int) -> Figures:
    """Physics steps per second of a body with muscles of one kind, against another, at random activations. Of Hill-type
    muscles, the kinds are on tendons that stretch (`compliant`) or not (`rigid`), with the curves of De Groote et al.
    or of Millard et al. (`millard`, `rigid millard`); those of another type are `plain`."""
    if name == "myohand_r":
        require(*SUITE)
        decisions = math.ceil(decisions / SLOW_BODY)
    plain: Any = HopperBody() if name == "hopper" else Mjcf(f"myosuite:{name}" if name == "myohand_r" else name)
    compliant = dataclasses.replace(plain, muscle_model="hill")
    rigid = {"tendon": "rigid"}
    millard = {"curves": "millard"}
    changes = {"compliant": {}, "rigid": rigid, "millard": millard, "rigid millard": {**rigid, **millard}}
    kinds = {"plain": plain} | {kind: dataclasses.replace(compliant, **each) for kind, each in changes.items()}
    actions = np.random.default_rng(0).uniform(size=(decisions, 1, len(plain.groups)))
    one, two = (functools.partial(_stepped, BodyBatch(kinds[kind], 1), actions) for kind in (first, second))
    return in_turn("physics steps/s", decisions * 10, one, two, pairs=pairs)


def _stepped(batch: BodyBatch, actions: np.ndarray) -> None:
    for action in actions:
        batch.step(action)


HOPPER = "motorgrad/Hopper-v0"


def vector(copies: int, decisions: int, pairs: int) -> Figures:
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
    return in_turn("decisions/s", decisions * copies, ours, other, pairs=pairs)


def single(decisions: int, pairs: int) -> Figures:
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
    return in_turn("decisions/s", decisions, ours, other, pairs=pairs)


def foreign(seeds: int, decisions: int, pairs: int) -> Figures:
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

    return in_turn("decisions/s", decisions * seeds, lambda: learner.advance(decisions), other, pairs=pairs)


def shared(task: HostTask, envs: int, decisions: int, pairs: int) -> Figures:
    """Decisions per second of one learner fed by several environments, against as many learners, each with its own."""
    agent = natural(task, envs * decisions)
    one = stepper_for(task, agent, [0], envs=envs)
    many = stepper_for(task, agent, range(envs))
    amount = envs * decisions
    for stepper, each in ((one, amount), (many, decisions)):
        stepper.advance(each)  # compiles
    return in_turn("decisions/s", amount, lambda: one.advance(amount), lambda: many.advance(decisions), pairs=pairs)


HEIGHT = 0.3  # metres


Rewarded = Literal["landing", "apex"]
SETTINGS: tuple[tuple[Rewarded, float], ...] = (("landing", 0.98), ("apex", 0.98), ("landing", 0.995))
"""What is rewarded, and the decay of the trace: the thesis's decay twice, and the task's own learner."""
INDEPENDENT = 315.0
"""Simulated seconds of an independent model with the same numbers, rewarded at the first apex with a decay of 0.98: the
median of 8 seeds, from 270 to 450; its apex at 1,500 s was 0.72 m."""


def learned_heights(reward_type: Rewarded, decay: float, seeds: int, seconds: float) -> Figures:
    """Simulated seconds until the median seed's apex, averaged over 25 s windows, exceeds 0.3 m, and the final apex."""
    task = Hopper(reward_type=reward_type)
    decisions, window = (round(each / task.period) for each in (seconds, 25))
    learned: list[Run] = []

    def learn() -> None:
        learned.append(train(task, agent_for(task, decay=decay), decisions, seeds, window=window, progress=False))

    took = timed(learn, decisions * seeds)
    (run,) = learned
    decision, apex = run.curve("apex")
    each = np.array([next(iter(decision[row > HEIGHT]), np.inf) for row in apex]) * task.period
    simulated = float(np.median(each))
    last = run.final("apex", min(1.0, 8 / apex.shape[1]))
    also = [
        f"{each.min():,.0f} … {each.max():,.0f} s over seeds",
        f"{took.wall * simulated / seconds:.3g} s of wall time, all seeds together",
        f"apex at {seconds:,.0f} s {np.median(last):.2f} m [{last.min():.2f} … {last.max():.2f}]",
        "other: an independent model, 0.72 m at 1,500 s",
    ]
    return Figures(simulated, INDEPENDENT, "simulated s", pairs=((took, None),), also="; ".join(also))
