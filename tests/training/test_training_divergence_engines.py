"""Some of many seeds go wrong under every engine: in physics, in an environment, or in what they have learned. The
others stay the same in every bit."""

import functools

import gymnasium
import jax
import numpy as np
import pytest
from gymnasium import spaces
from training_examples import PLAIN, assert_same

import motorgrad as mg
from motorgrad.learning.sparse import SparseState
from motorgrad.tasks import from_gymnasium
from motorgrad.training import BodyStepper, HostStepper, SideBySide, WorldStepper, agent_for
from motorgrad.training.engines import SparseStepper
from motorgrad.training.engines import training_stepper_for as engine_for

SEEDS, HURT = list(range(30, 42)), [1, 4, 11]
FEW, HURT_OF_FEW = SEEDS[:5], [0, 3]
SPARSE = {
    "kind": "sparse",
    "policy.width": 0.1,
    "learning_rate": {"centre": 1e-3, "log_width": 4e-3},
    "index.neglect": 0.01,
}


class Unstable(gymnasium.Env):
    """It follows its actions with noise. If its seed is to be hurt, it breaks after some steps, of one `kind`."""

    kind = "well"  # of those that are made now

    observation_space, action_space = spaces.Box(-9, 9, (3,)), spaces.Box(-1, 1, (2,))

    def __init__(self):
        self.kind, self.steps, self.hurt = Unstable.kind, 0, False

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.hurt = self.hurt if seed is None else seed - SEEDS[0] in HURT
        self.time, self.place = 0, self.np_random.normal(size=3).astype(np.float32)
        return self.place, {}

    def step(self, action):
        self.steps, self.time = self.steps + 1, self.time + 1
        self.place = np.float32(0.9 * self.place + 0.1 * action.sum() + 0.1 * self.np_random.normal(size=3))
        seen, reward = self.place, -float(np.abs(self.place).sum())
        if self.hurt and self.steps > 60:
            if self.kind == "observation":
                seen = self.place = self.place * np.nan
            elif self.kind == "at times" and self.steps % 7 == 0:
                seen = seen + np.inf
            elif self.kind == "huge":
                seen = np.array([1e300, 0.0, 0.0])
            elif self.kind == "reward":
                reward = np.nan
        return seen, reward, False, self.time >= 40, {}


KINDS = ["observation", "at times", "huge", "reward"]


@functools.cache
def environment():  # one task whatever breaks, so one program
    gymnasium.register(id="Unstable-v0", entry_point=Unstable, disable_env_checker=True)
    return from_gymnasium("Unstable-v0")


CASES = {  # engine, task, learner, seeds, those that are hurt
    "world": (WorldStepper, lambda: mg.make("particle"), {}, SEEDS, HURT),
    "sparse": (SparseStepper, lambda: mg.make("particle", units=64), SPARSE, SEEDS, HURT),
    "body": (BodyStepper, lambda: mg.make("hopper"), {}, FEW, HURT_OF_FEW),
    "side by side": (SideBySide, lambda: mg.make("hopper"), {}, SEEDS, HURT),
    "environments": (HostStepper, environment, PLAIN, SEEDS, HURT),
    "preset of environments": (HostStepper, environment, {}, SEEDS, HURT),
}
SLOW = [pytest.mark.slow, pytest.mark.ci]
# bodies and environments have the same engine beside their physics
PARAMETERS = [pytest.param(name, marks=[] if name in ("world", "body") else SLOW) for name in CASES]


@pytest.fixture(scope="module", params=PARAMETERS)
def case(request):
    """An engine after some decisions, its state then, and what the state is and the tallies are later."""
    kind, task, changes, seeds, hurt = CASES[request.param]
    task = task()
    stepper = engine_for(task, agent_for(task, changes), seeds, threads=2)
    assert type(stepper) is kind
    stepper.advance(70)
    stepper.restore(stepper.state)  # an environment is unpickled as it will be where it is hurt
    before = stepper.state
    return stepper, before, later(stepper), hurt


def later(stepper):
    """What is after 20 more decisions, and after 60."""
    found = []
    for decisions in (20, 40):
        stepper.advance(decisions)
        found.append((stepper.policies(), stepper.state, stepper.harvest()))
    return found


def set_rows(tree, rows, value):
    def changed(leaf):
        leaf = np.array(leaf)
        if leaf.dtype.kind == "f":
            leaf[rows] = value
        return leaf

    return jax.tree.map(changed, tree)


def hurt_physics(state, rows, value):
    """Put a number into the dynamics of some seeds: of a body, into its first position."""
    if "world" in state:
        return {**state, "world": set_rows(state["world"], rows, value)}
    physics = {name: np.array(part) for name, part in state["physics"].items()}
    physics["state"][rows, 1] = value
    return {**state, "physics": physics}


def hurt_learner(*parts):
    """Put a number into those of the parts that a learner has."""

    def hurt(state, rows, value):
        cycle = state["cycle"]
        own = {part: getattr(cycle.agent, part) for part in parts if part in cycle.agent._fields}
        agent = cycle.agent._replace(**set_rows(own, rows, value))
        return {**state, "cycle": cycle._replace(agent=agent)}

    return hurt


def hurt_numbers(state, rows, value):
    cycle = state["cycle"]
    return {**state, "cycle": cycle._replace(numbers=set_rows(cycle.numbers, rows, value))}


def of_others(found, hurt):
    """What the seeds that were not hurt have. How much room a sparse learner's tables have is one number for all."""
    policies, state, tallies = found
    agent = state["cycle"].agent
    if isinstance(agent, SparseState):
        state = {**state, "cycle": state["cycle"]._replace(agent=agent._replace(index=agent.index._replace(room=())))}
    state = {name: part for name, part in state.items() if name != "decision"}
    return jax.tree.map(lambda leaf: np.delete(leaf, hurt, 0), (policies, state, tallies))


ATTACKS = {
    "physics": hurt_physics,
    "policy": hurt_learner("policy"),
    "estimator": hurt_learner("estimator", "trace", "baseline"),
    "optimizer": hurt_learner("chain"),
    "numbers": hurt_numbers,
}


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30])
@pytest.mark.parametrize("attack", ATTACKS)
def test_what_breaks_in_some_seeds_changes_no_bit_of_the_others(case, attack, value):
    stepper, before, well, hurt = case
    if attack == "physics" and type(stepper) is HostStepper:
        pytest.skip("environments break by themselves, below")
    stepper.restore(ATTACKS[attack](before, hurt, value))
    for found, wanted in zip(later(stepper), well, strict=True):
        assert_same(of_others(found, hurt), of_others(wanted, hurt))


def test_a_body_that_breaks_again_and_again_is_counted_and_begins_anew(case):
    stepper, before, _, hurt = case
    if not isinstance(stepper, BodyStepper | SideBySide):
        pytest.skip("no body")
    stepper.restore(before)
    stepper.harvest()
    for _ in range(20):
        stepper.restore(hurt_physics(stepper.state, hurt, np.nan))
        stepper.advance(1)
    wanted = np.zeros(len(stepper.seeds), int)
    wanted[hurt] = 20
    np.testing.assert_array_equal(stepper.harvest()["diverged"], wanted)
    learners = jax.tree.leaves(stepper.state["cycle"].agent)
    assert all(np.isfinite(leaf).all() for leaf in learners)


@pytest.mark.ci
@pytest.mark.representatives("plain-observation")
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("changes", [PLAIN, {}], ids=["plain", "preset"])
def test_environments_that_break_change_no_bit_of_the_others(changes, kind, monkeypatch):
    found = []
    for each in ("well", kind):
        monkeypatch.setattr(Unstable, "kind", each)
        task = environment()
        stepper = engine_for(task, agent_for(task, changes), SEEDS)
        stepper.advance(200)
        found.append((stepper.policies(), stepper.state["cycle"], stepper.batch.packed.copy(), stepper.harvest()))
    well, broken = (jax.tree.map(lambda leaf: np.delete(leaf, HURT, 0), each) for each in found)
    assert_same(broken, well)
    assert (found[1][-1]["diverged"][HURT] >= 20).all()
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(found[1][0]))
