"""The seam between engines and learners: what every kind of learner promises, and a learner of one's own."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled_learner import decided, refreshed, started

import motorgrad as mg
from families import FAMILIES, compiled
from motorgrad.learning import ActionValueEnsemble as Ensemble
from motorgrad.learning import (
    ActionValueGradient,
    ActionValues,
    Agent,
    Estimator,
    FisherMetric,
    Learner,
    LinearCritic,
    MeanReward,
    Needs,
    PolyakAveraging,
    ProximalPolicyOptimization,
    Replay,
    RootMeanSquare,
    SoftActorCritic,
    SparseLearner,
    check_scores,
    count,
    number,
    register,
)
from motorgrad.policies import (
    Autoregressive,
    GradedHyperplanes,
    Layered,
    LocalGaussians,
    MultilayerPerceptron,
    PrintedGaussians,
    Softmax,
    abilities,
    bounded_hyperplanes,
    finite_state_controller,
    hyperplanes,
    recurrent,
    trainable,
)
from motorgrad.schema import PART_CLASSES, build
from motorgrad.tasks import ThreeState
from motorgrad.training import agent_for, clear_programs, stepper_for

INPUTS = 2
TINY = MultilayerPerceptron((4,), layer_norm=False, sparsity=0.0)
SOFTMAX = Softmax([[1.0, 1.0], [-1.0, -1.0]])
GRADED = GradedHyperplanes([[0.5, -1.0]], [0.2], [-0.5])
POOL = LocalGaussians(np.random.default_rng(0).uniform(0, 1, (6, INPUTS)), np.full((6, INPUTS), -1.0), p_max=0.6)
EVERY = {"update_every": 4}
# name: (a learner, the fields of its state that are learned: by path)
LEARNERS = {
    "online": (
        Agent(SOFTMAX, Estimator(normalization=RootMeanSquare(0.1)), averaging=PolyakAveraging()),
        ("policy", "chain", "steps", "estimator.baseline", "estimator.normalization"),
    ),
    "batches": (
        Agent(SOFTMAX, Estimator(baseline=LinearCritic(), **EVERY), metric=FisherMetric(interval=3)),
        ("policy", "chain", "gradient", "estimator.baseline.weights"),
    ),
    "episodes": (
        Agent(SOFTMAX, Estimator(update_every="episode")),
        ("chain", "estimator.baseline"),  # what was collected before makes the step of the episode
    ),
    "fixed": (
        Agent(SOFTMAX, Estimator(update_every="never")),
        ("policy", "chain", "gradient", "estimator.baseline"),
    ),
    "proximal": (
        ProximalPolicyOptimization(SOFTMAX, normalization=RootMeanSquare(0.1), minibatches=2, **EVERY),
        ("policy", "chain", "baseline", "normalization", "batch.waiting"),
    ),
    "action-value-gradient": (
        ActionValueGradient(GRADED, ActionValues(network=TINY), averaging=PolyakAveraging()),
        ("policy", "chain", "steps", "values.weights", "values.rule"),
    ),
    "soft-actor-critic": (
        SoftActorCritic(GRADED, Ensemble(network=TINY), Replay(40, 4, 3), **EVERY, averaging=PolyakAveraging()),
        ("policy", "chain", "steps", "values", "waiting", "experience.rewards", "experience.decided"),
    ),
    "sparse": (
        SparseLearner(POOL, baseline=MeanReward(), normalization=RootMeanSquare(0.1)),
        ("policy", "baseline", "normalization", "index.sums"),
    ),
}
WAITING = ("batches", "proximal", "soft-actor-critic")
BY_HAND = {type(agent) for agent, _ in LEARNERS.values()}
OF_EPISODES = ("trace", "scaling", "experience", "memory", "decision")
OTHERS = [kind for kind in FAMILIES if Learner.kinds()[kind] not in BY_HAND]
every_learner = pytest.mark.parametrize("name", [*LEARNERS, *OTHERS])


def learner_of(name):
    """A learner, and the fields of its state that are learned; of a kind that is not above, all but those that begin
    anew with an episode."""
    if name in LEARNERS:
        return LEARNERS[name]
    task, settings = compiled(name)
    agent = agent_for(task, settings)
    state = eqx.filter_eval_shape(agent.init, jax.random.key(0))
    return agent, [field for field in state._fields if field not in OF_EPISODES]


def at(state, path):
    for name in path.split("."):
        state = getattr(state, name)
    return state


def same(one, other):
    assert jax.tree.structure(one) == jax.tree.structure(other)
    jax.tree.map(np.testing.assert_array_equal, one, other)


def shapes(state):
    return jax.tree.map(lambda leaf: (jnp.shape(leaf), jnp.result_type(leaf)), state)


class Life:
    """A learner that lives in a world of random numbers, decision by decision."""

    def __init__(self, agent, seed=0):
        self.agent, self.rng, self.made = agent, np.random.default_rng(seed), 0
        self.state: Any = started(agent)
        if isinstance(agent, SparseLearner):  # its table is made outside compiled code
            self.state = refreshed(agent, self.state)
        self.inputs = abilities.marginal(self.state.policy).inputs

    def decide(self, reward=None, after=None, **flags):
        """One decision; `state` is what follows from it."""
        units = self.state.index.table.shape[1] if isinstance(self.agent, SparseLearner) else self.state.policy.uniforms
        look, numbers = self.rng.uniform(size=self.inputs), self.rng.uniform(size=units)
        reward = self.rng.normal() if reward is None else reward
        after = self.rng.uniform(size=self.inputs) if after is None else after
        given = (np.asarray(each, np.float32) for each in (look, numbers, reward, after))
        found = decided(self.agent, self.state, *given, **flags)
        self.state, self.made = found.state, self.made + 1
        return found


def test_every_kind_of_learner_is_tested():
    assert {type(learner_of(name)[0]) for name in (*LEARNERS, *OTHERS)} == set(Learner.kinds().values())


@every_learner
def test_states_keep_their_structure_shapes_and_types(name):
    life = Life(learner_of(name)[0])
    first = shapes(life.state)
    for flags in ({}, {"terminated": True}, {"truncated": True}, {"diverged": True}, {}, {}):
        found = life.decide(**flags)
        assert shapes(found.acted) == first
        assert shapes(found.state) == first
        assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(trainable(found.state.policy)))


@every_learner
def test_an_update_that_need_not_be_made_changes_nothing(name):
    agent, _ = learner_of(name)
    life, waits, moved = Life(agent), [], 0
    until = eqx.filter_jit(agent.decisions_until_due)
    known = isinstance(agent.decisions_until_due(life.state), int)  # while tracing
    if name in LEARNERS:
        assert known == (name not in (*WAITING, "fixed"))
    for _ in range(4):
        waits.append(min(int(until(life.state)), 6))
        for wait in range(waits[-1]):
            found = life.decide(truncated=wait == 1, diverged=wait == 2)
            same(found.observed, found.state)
        before = life.state
        after = life.decide(terminated=waits[-1] == 0).state
        if isinstance(agent, SparseLearner):  # whose policies are up to date only where they are published
            before, after = agent.publish(before), agent.publish(after)
        moved += not eqx.tree_equal(before.policy, after.policy)
    assert (max(waits) > 1) == (not known)
    assert (moved > 0) == (name != "fixed")


@every_learner
@pytest.mark.parametrize("reward", [5.0, np.nan])
def test_what_diverged_teaches_nothing(name, reward):
    agent, learned = learner_of(name)
    life = Life(agent)
    for _ in range(6):
        life.decide()
    state = life.state
    after = life.decide(reward, np.full(life.inputs, np.nan), diverged=True).state
    for path in learned:
        same(at(state, path), at(after, path))
    follows = life.decide().state
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(trainable(agent.final_policy(follows))))


# -- what a learner needs


class Acting(NamedTuple):
    policy: Any


class Quiet(Learner):
    """A learner that learns nothing."""

    def init(self, key):
        return Acting(self.first_policy(key))

    def act(self, state, observation, uniforms):
        return state, state.policy.sample(observation, uniforms)

    def observe(self, state, transition):
        return state

    def update(self, state, goal=None):
        return state


def needing(policy, **asks):
    """A learner that needs what it is told to need."""

    class Needing(Quiet):
        @property
        def needs(self):
            return Needs(**asks)

    return Needing(policy)


@pytest.mark.parametrize(
    ("asks", "policy", "said"),
    [
        ({"actions": "differentiable"}, SOFTMAX, "policy = 'Softmax': must be one with real-valued actions"),
        (
            {"actions": "differentiable"},
            bounded_hyperplanes(2, 2, density="beta"),
            "must be one whose actions JAX can differ",
        ),
        ({"memory": "none"}, Autoregressive(GRADED, 0.5), "and with no memory, for Needing"),
        ({"memory": "none"}, finite_state_controller(2, 2), "and with no memory, for Needing"),
        ({"memory": "noise"}, finite_state_controller(2, 2), "and with no memory but lasting noise, for N"),
        ({"memory": "noise"}, Layered([hyperplanes(2, 2)], SOFTMAX), "and with no memory but lasting noise, for N"),
        ({"memory": "independent"}, recurrent(2, 1), "must be one whose memory does not depend on its parameters"),
        ({"score": True}, Autoregressive(GRADED, 0.5, filtered=False), "must be one with an exact score"),
        ({}, PrintedGaussians([[0.5, 0.5]], [[0.0, 0.0]]), "pair = 'printed': must be exact for Needing, which asks"),
        ({}, lambda key: np.zeros(2), "policy = 'ndarray': must be a function from a key to a Policy"),
    ],
)
def test_a_policy_that_lacks_what_is_needed_is_refused_by_name(asks, policy, said):
    agent = needing(policy, **asks)
    with pytest.raises(ValueError, match=said):
        check_scores(agent, eqx.filter_eval_shape(agent.init, jax.random.key(0)).policy)


@pytest.mark.parametrize(
    ("asks", "policy"),
    [
        ({"actions": "differentiable", "memory": "noise"}, Autoregressive(GRADED, 0.5)),
        ({"memory": "independent"}, finite_state_controller(2, 2)),
        ({"memory": "any"}, recurrent(2, 1)),
        ({"score": True}, PrintedGaussians([[0.5, 0.5]], [[0.0, 0.0]])),
    ],
)
def test_a_policy_that_has_what_is_needed_is_taken(asks, policy):
    eqx.filter_eval_shape(needing(policy, **asks).init, jax.random.key(0))


def test_a_task_that_lacks_what_is_needed_is_refused_by_name():
    task = ThreeState()
    of_episodes = needing(SOFTMAX, episodes=("decay = 1",))
    of_a_goal = needing(SOFTMAX, goal="replay.hindsight")
    for agent, said in (
        (of_episodes, "^decay = 1: needs episodes, but the task 'three-state' has none; give it a time limit"),
        (of_a_goal, r"^replay\.hindsight: needs a goal, but the task 'three-state' has none"),
    ):
        with pytest.raises(ValueError, match=said):
            stepper_for(task, agent, [0])
        stepper_for(task, agent, [0], "sample").advance(3)  # it learns nothing
    stepper_for(ThreeState(time_limit=5), of_episodes, [0]).advance(3)


@pytest.mark.parametrize(
    ("asks", "said"),
    [
        ({"single_stream": "what it keeps"}, "envs = 2: must be 1 for what it keeps"),
        ({}, r"envs = 2: must be 1 for Needing, which has no function restart\(state\)"),
    ],
)
def test_a_learner_of_one_stream_takes_no_several_environments(asks, said):
    policy = mg.policies.hyperplanes(mg.make("hopper"))
    with pytest.raises(ValueError, match=said):
        mg.train("hopper", needing(policy, **asks), 10, envs=2, progress=False)


# -- a learner of one's own


class OwnState(NamedTuple):
    policy: Any
    total: Any
    waiting: Any


class Own(Learner):
    """The likelihood-ratio gradient of single rewards, in batches."""

    rate: float = number(0.1, 0, help="the length of a step")
    batch: int = count(4, 1, help="decisions of a step")

    def init(self, key):
        policy = self.first_policy(key)
        return OwnState(policy, jax.tree.map(jnp.zeros_like, trainable(policy)), jnp.zeros((), jnp.int32))

    def act(self, state, observation, uniforms):
        return state, state.policy.sample(observation, uniforms)

    def observe(self, state, transition):
        score = state.policy.score(transition.observation, transition.action)
        total = jax.tree.map(lambda t, s: t + transition.reward * s, state.total, score)
        after = OwnState(state.policy, total, state.waiting + 1)
        return jax.tree.map(lambda new, old: jnp.where(transition.diverged, old, new), after, state)

    def update(self, state):
        moved = eqx.apply_updates(state.policy, jax.tree.map(lambda t: self.rate / self.batch * t, state.total))
        fresh = OwnState(moved, jax.tree.map(jnp.zeros_like, state.total), jnp.zeros_like(state.waiting))
        return jax.tree.map(lambda new, old: jnp.where(state.waiting >= self.batch, new, old), fresh, state)

    def decisions_until_due(self, state):
        return self.batch - 1 - state.waiting


@pytest.fixture
def own():
    register(Learner, "test-own", Own)
    yield
    del PART_CLASSES[Learner]["test-own"]
    clear_programs()


def test_a_learner_of_ones_own_keeps_the_promises_of_the_seam():
    life = Life(Own(SOFTMAX))
    for number_ in range(9):
        waits = int(life.agent.decisions_until_due(life.state))
        found = life.decide(diverged=number_ == 5)
        if waits:
            same(found.observed, found.state)
    assert not np.array_equal(life.state.policy.weights, SOFTMAX.weights)


@pytest.mark.parametrize("task", ["three-state", "hopper"])
def test_a_learner_of_ones_own_is_trained_resumed_and_evaluated(own, task, tmp_path):
    """`three-state` is a compiled world, the hopper's dynamics run on the host."""
    agent = mg.agent_for(task, kind="test-own", batch=5)
    assert type(agent) is Own
    whole = mg.train(task, agent, 60, 2, tmp_path / "whole", window=20, progress=False)
    mg.train(task, agent, 30, 2, tmp_path / "parts", window=10, progress=False)
    stored = mg.load(tmp_path / "parts")
    assert (stored.config["agent"]["kind"], stored.config["agent"]["batch"]) == ("test-own", 5)
    parts = mg.resume(tmp_path / "parts", 60, progress=False)
    same(parts.policies, whole.policies)
    start = jax.tree.map(np.asarray, trainable(agent.init(jax.random.key(0)).policy))
    assert not eqx.tree_equal(start, jax.tree.map(lambda leaf: leaf[0], trainable(whole.policies)))
    assert np.isfinite(mg.evaluate(tmp_path / "whole", 20).reward).all()
    stepper, again = (stepper_for(mg.make(task), agent, [0, 1]) for _ in range(2))
    stepper.advance(13)
    again.restore(stepper.state)
    for each in (stepper, again):
        each.advance(9)
    same(again.state, stepper.state)


def test_a_learner_of_ones_own_is_swept_and_changed_while_it_runs(own):
    agent = mg.agent_for("three-state", kind="test-own")
    run = mg.train("three-state", agent, 40, 2, sweep={"rate": [0.0, 0.1]}, window=20, progress=False)
    weights = np.asarray(run.policies.weights)
    np.testing.assert_array_equal(weights[:2], np.broadcast_to(agent.init(jax.random.key(0)).policy.weights, (2, 2, 2)))
    alone = mg.train("three-state", mg.agent_for("three-state", kind="test-own", rate=0.1), 40, 2, progress=False)
    np.testing.assert_array_equal(weights[2:], alone.policies.weights)
    stepper = stepper_for(ThreeState(), agent, [0])
    stepper.set_number("rate", 0.0)
    stepper.advance(20)
    np.testing.assert_array_equal(stepper.policies().weights[0], weights[0])


def test_a_learner_of_ones_own_is_refused_by_the_name_of_its_settings(own):
    with pytest.raises(ValueError, match=r"agent\.rate = -1"):
        mg.agent_for("three-state", kind="test-own", rate=-1.0)
    with pytest.raises(ValueError, match="unknown setting of agent 'rates': did you mean 'rate'"):
        mg.agent_for("three-state", kind="test-own", rates=1.0)
    changed = build(Learner, {"kind": "test-own"}, "agent", Agent(SOFTMAX))  # another kind keeps the policy alone
    assert eqx.tree_equal(changed, Own(SOFTMAX))


def test_a_setting_without_a_default_is_given_where_the_kind_is_named():
    class Sized(Quiet):
        size: int = count(help="how many")

    register(Learner, "test-sized", Sized)
    try:
        made = agent_for("three-state", {"kind": "test-sized", "size": 3})
        assert (made.size, type(made.policy).__name__) == (3, type(agent_for("three-state").policy).__name__)
        with pytest.raises(ValueError, match=r"agent\.size: must be given"):
            agent_for("three-state", kind="test-sized")
    finally:
        del PART_CLASSES[Learner]["test-sized"]
