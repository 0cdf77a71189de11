"""Episodes: cut by a time limit or ended by the task, they begin anew, and the learner with them."""

import dataclasses
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from training_examples import assert_same, learner

import motorgrad as mg
from motorgrad.learning import Estimator, MeanReward
from motorgrad.tasks import Chain, Hopper
from motorgrad.training import agent_for, stepper_for

SEEDS = [0, 1, 2, 3]
SHORT = Hopper(time_limit=0.1)  # ten decisions


@dataclasses.dataclass(frozen=True)
class EndedChain(Chain):
    """A chain whose last state ends the episode."""

    name: ClassVar[str] = "ended-chain"
    episodic: ClassVar[bool] = True

    def reward(self, memory, state, action):
        memory, reward, _ = super().reward(memory, state, action)
        return memory, reward, state == self.length - 1


@dataclasses.dataclass(frozen=True)
class OneHop(Hopper):
    """A hopper whose episode ends with its first landing; what it observes tells how old its memory is."""

    name: ClassVar[str] = "one-hop"
    episodic: ClassVar[bool] = True

    def reward(self, memory, state, action):
        memory, reward, _ = super().reward(memory, state, action)
        return memory, reward, memory.landed > 0


def test_a_chain_is_cut_and_begins_anew():
    stepper = learner(Chain(length=9, time_limit=7), SEEDS)
    for end in (7, 14):
        stepper.advance(6)
        within = stepper.state
        assert (within["cycle"].elapsed == 6).all()
        assert all(np.abs(leaf).max() > 0 for leaf in jax.tree.leaves(within["cycle"].agent.estimator.trace))
        stepper.advance(1)
        state = stepper.state
        assert stepper.decision == end
        np.testing.assert_array_equal(state["world"], 0)
        np.testing.assert_array_equal(state["cycle"].elapsed, 0)
        np.testing.assert_array_equal(state["cycle"].observation, np.eye(9)[[0] * len(SEEDS)])
        for leaf in jax.tree.leaves(state["cycle"].agent.estimator.trace):
            np.testing.assert_array_equal(leaf, 0)
    np.testing.assert_array_equal(stepper.harvest()["episodes"], 2)


def test_the_last_reward_of_an_episode_is_learned_from():
    # The chain's only reward is its end's, where the episode is over: without it nothing would be learned.
    task = EndedChain(length=3)
    stepper = learner(task, SEEDS)
    first = stepper.policies()
    stepper.advance(40)
    record = stepper.harvest()
    assert record["episodes"].min() >= 1
    np.testing.assert_array_equal(record["reward"], record["episodes"])
    assert (np.abs(stepper.policies().weights - first.weights).max(axis=(1, 2)) > 0).all()


@pytest.mark.representatives("None")
@pytest.mark.parametrize("limit", [None, 5])
def test_a_task_that_ends_its_episode_begins_anew(limit):
    task = EndedChain(length=3, time_limit=limit)
    stepper = learner(task, SEEDS)
    longest = 0
    states, elapsed = np.zeros(len(SEEDS), int), np.zeros(len(SEEDS), int)
    for _ in range(60):
        stepper.advance(1)
        after, episodes = stepper.state, stepper.harvest()["episodes"]
        elapsed += 1
        # two moves to the right, or the limit; the chain is at its start only after a move to the left or an end
        cut = np.full(len(SEEDS), False) if limit is None else elapsed == limit
        ended = episodes == 1
        assert ((states == 1) | cut)[ended].all()
        assert ended[cut].all()
        assert (after["world"][ended] == 0).all()
        assert (after["world"] < 2).all()
        for leaf in jax.tree.leaves(after["cycle"].agent.estimator.trace):
            assert (leaf[ended] == 0).all()
            assert (np.abs(leaf[~ended]).max(axis=(1, 2), initial=0) > 0).all()
        longest = max(longest, elapsed.max())
        elapsed[ended] = 0
        states = after["world"]
        if limit is not None:
            np.testing.assert_array_equal(after["cycle"].elapsed, elapsed)
    assert longest == limit if limit else longest > 5


def test_a_task_that_ends_its_episodes_must_say_so():
    @dataclasses.dataclass(frozen=True)
    class Silent(EndedChain):
        episodic: ClassVar[bool] = False

    stepper = learner(Silent(length=3), SEEDS)
    with pytest.raises(TypeError, match="reports `terminated`, so its class must say `episodic = True`"):
        stepper.advance(1)


@pytest.mark.parametrize(
    ("method", "result", "said"),
    [
        ("observe", lambda chain: jnp.zeros(chain.observation_size), "observe must return \\(memory, observation\\)"),
        ("observe", lambda chain: ((), jnp.zeros(7)), "observe returns an observation of shape \\(7,\\), not"),
        ("reward", lambda chain: ((), 0.0), "reward must return \\(memory, reward, terminated\\)"),
    ],
)
def test_a_task_that_returns_something_else_is_told_what(method, result, said):
    wrong = type("Wrong", (Chain,), {method: lambda self, *_: result(self)})
    with pytest.raises((TypeError, ValueError), match=f"task 'chain': {said}"):
        learner(wrong(length=3), SEEDS).advance(1)


def test_a_body_does_not_start_with_a_period_of_broken_steps():
    @dataclasses.dataclass(frozen=True)
    class Careless(Hopper):
        def __post_init__(self):
            """Check nothing."""

    with pytest.raises(ValueError, match=r"action_period = 0.0105: must be a positive multiple of the time step"):
        learner(Careless(action_period=0.0105), SEEDS)


def test_a_baseline_that_returns_something_else_is_told_what():
    class Wrong(MeanReward):
        def update(self, state, policy, transition):
            return (transition.reward, transition.reward), state

    agent = dataclasses.replace(agent_for("chain"), estimator=Estimator(baseline=Wrong()))
    with pytest.raises(TypeError, match=r"baseline Wrong: update must return \(Advantage, state\)"):
        stepper_for(Chain(), agent, SEEDS).advance(1)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"trace": "episodic"}, r"trace.kind = 'episodic'"),
        ({"update_every": "episode"}, "update_every = 'episode'"),
        ({"discount": 0.9}, "discount = 0.9"),
    ],
)
def test_a_learner_that_waits_for_the_end_is_refused_where_there_is_none(changes, named):
    with pytest.raises(ValueError, match=f"{named}: needs episodes, but the task 'chain' has none"):
        learner(Chain(), SEEDS, **changes)
    for task in (Chain(time_limit=5), EndedChain()):
        assert learner(task, SEEDS, **changes).decision == 0


def test_a_hopper_is_cut_and_begins_anew():
    stepper = learner(SHORT, SEEDS)
    fresh = stepper.state
    stepper.advance(9)
    assert (stepper.state["cycle"].elapsed == 9).all()
    assert (np.abs(stepper.state["physics"]["packed"] - fresh["physics"]["packed"]).max(axis=1) > 0).all()
    stepper.advance(1)
    state = stepper.state
    np.testing.assert_array_equal(state["physics"]["packed"], fresh["physics"]["packed"])
    np.testing.assert_array_equal(state["physics"]["state"], fresh["physics"]["state"])
    assert_same(state["cycle"].memory, fresh["cycle"].memory)
    np.testing.assert_array_equal(state["cycle"].observation, fresh["cycle"].observation)
    np.testing.assert_array_equal(state["cycle"].elapsed, 0)
    record = stepper.harvest()
    np.testing.assert_array_equal(record["episodes"], 1)
    np.testing.assert_array_equal(record["diverged"], 0)
    np.testing.assert_array_equal(state["physics"]["diverged"], 0)


def test_the_action_after_a_cut_answers_the_fresh_start():
    stepper = learner(SHORT, SEEDS)
    stepper.advance(10)
    cycle = stepper.state["cycle"]
    score = jax.vmap(lambda policy, seen, action: policy.score(seen, action))(
        jax.tree.map(jnp.asarray, cycle.agent.policy), cycle.observation, cycle.action
    )
    # the trace holds the score of that one action
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-6), cycle.agent.estimator.trace, score)
    np.testing.assert_array_equal(stepper.control, cycle.action)


def test_a_hopper_whose_task_ends_begins_anew_alone():
    stepper = learner(OneHop(), SEEDS)
    fresh = stepper.state["physics"]["packed"]
    ended = np.zeros(len(SEEDS), int)
    for _ in range(300):
        stepper.advance(1)
        packed, record = stepper.state["physics"]["packed"], stepper.harvest()
        now = record["episodes"] == 1
        ended += now
        np.testing.assert_array_equal(now, record["apex_count"] == 1)
        np.testing.assert_array_equal((packed == fresh).all(axis=1), now)
    assert ended.min() >= 1
    assert len(set(ended)) > 1  # not all at once


def test_a_run_with_episodes_goes_on_exactly(tmp_path):
    for name, legs in (("parts", (43, 110)), ("whole", (110,))):
        for steps in legs:
            run = mg.train(SHORT, steps=steps, seeds=SEEDS, out=tmp_path / name, window=11, threads=1, progress=False)
    parts = mg.load(tmp_path / "parts")
    assert_same(parts.policies, run.policies)
    np.testing.assert_array_equal(run.curve("episodes")[1].sum(axis=1), 110 // 10)
    assert parts.task.time_limit == 0.1
