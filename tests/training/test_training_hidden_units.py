"""Policies with hidden units and with a memory in every engine, in stored runs and on the command line."""

import gymnasium
import jax
import numpy as np
import pytest
from training_examples import PLAIN

import motorgrad as mg
from motorgrad.cli import main
from motorgrad.learning import FisherMetric, LeastSquares, LinearCritic, gae
from motorgrad.policies import abilities
from motorgrad.tasks import from_gymnasium
from motorgrad.training import agent_for, evaluate, stepper_for
from motorgrad.training._agents import agent_from_table, agent_table

KINDS = {
    "layered": {"kind": "layered", "hidden": (3,)},
    "finite-state-controller": {"kind": "finite-state-controller", "states": 3},
    "recurrent": {"kind": "recurrent", "hidden": 2},
}
MEMORY = ("finite-state-controller", "recurrent")


class Signal(gymnasium.Env):
    """Random inputs, and episodes of three steps."""

    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (2,))
    action_space = gymnasium.spaces.MultiBinary(2)
    time = 0

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.time = 0
        return self.np_random.normal(size=2), {}

    def step(self, action):
        self.time += 1
        return self.np_random.normal(size=2), float(action[0]), self.time == 3, False, {}


@pytest.fixture(scope="module")
def signal():
    gymnasium.register("Signal-v0", Signal, disable_env_checker=True)
    yield from_gymnasium("Signal-v0", code="each")
    del gymnasium.registry["Signal-v0"]


WORLD = mg.make("load-unload", time_limit=20)
PARTS = {  # of learners: with a critic and the natural gradient in the world, as light as can be elsewhere
    "world": {
        "estimator": gae(LinearCritic(fit=LeastSquares(interval=50)), update_every=50),
        "metric": FisherMetric(interval=10, kl=0.01),
    },
    "host": PLAIN,
    "body": {"learning_rate": 0.01, "decay": 0.9},
}


def agent_of(engine, kind, signal):
    """A task and a learner."""
    task = {"world": WORLD, "host": signal, "body": mg.make("hopper")}[engine]
    return task, agent_for(task, {**PARTS[engine], "policy": KINDS[kind]})


def same(one, other):
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.ci
@pytest.mark.representatives("world-finite-state-controller")
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("engine", ["world", "host", "body"])
def test_a_restored_learner_continues_bit_for_bit(engine, kind, signal):
    task, agent = agent_of(engine, kind, signal)
    stepper = stepper_for(task, agent, [3, 8])
    stepper.advance(45)
    state = stepper.state
    memory = state["cycle"].agent.memory
    assert (memory is not None) == (kind in MEMORY)
    stepper.advance(15)
    after = stepper.state
    stepper.restore(state)
    stepper.advance(15)
    same(after, stepper.state)
    if kind == "recurrent":
        assert not np.array_equal(memory[0], memory[1])  # each seed has its own


@pytest.mark.ci
@pytest.mark.parametrize("mode", ["learn", "sample", "mode"])
def test_memory_starts_anew_with_every_episode_on_the_host(mode, signal):
    """After an episode's end, the units' view is that of a first decision."""
    agent = agent_for(signal, {**PLAIN, "policy": KINDS["recurrent"], "learning_rate": 0.0})
    stepper = stepper_for(signal, agent, [3, 8], mode)
    first_view = jax.jit(
        lambda policy, seen: abilities.observation_with_memory(policy, abilities.initial_memory(policy), seen)
    )
    for decision in range(1, 8):
        stepper.advance(1)
        cycle = stepper.state["cycle"]
        for seed in range(2):
            policy = jax.tree.map(lambda leaf, seed=seed: leaf[seed], cycle.agent.policy)
            fresh = first_view(policy, cycle.observation[seed])
            is_first = np.allclose(cycle.agent.decision.observation[seed], fresh, atol=1e-6)
            assert is_first == (decision % 3 == 0)


@pytest.mark.ci
def test_environments_of_one_learner_have_memories_of_their_own(signal):
    agent = agent_for(signal, policy=KINDS["recurrent"], learning_rate=0.01, decay=0.9)
    stepper = stepper_for(signal, agent, [0], envs=2)
    stepper.advance(8)
    memory = stepper.state["cycle"].agent.memory
    assert memory.shape[:2] == (1, 2)
    assert not np.array_equal(memory[0, 0], memory[0, 1])


@pytest.mark.representatives("finite-state-controller")
@pytest.mark.parametrize("kind", KINDS)
def test_a_critic_and_the_natural_gradient_work_with_what_units_see(kind):
    stepper = stepper_for(*agent_of("world", kind, None), [0, 1])
    stepper.advance(400)
    before, after = stepper._initial, stepper.policies()
    assert before is None
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(after))
    seen = {"layered": 3, "finite-state-controller": 3 + 3, "recurrent": 3 + 2}[kind]
    assert stepper.state["cycle"].agent.estimator.baseline.weights.shape == (2, seen + 1)


@pytest.mark.ci
@pytest.mark.representatives(*(f"world-{kind}" for kind in KINDS))
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("engine", ["world", "host", "body"])
def test_a_table_keeps_hidden_units(engine, kind, signal):
    task, agent = agent_of(engine, kind, signal)
    assert agent_from_table(task, agent_table(agent)).policy == agent.policy


@pytest.mark.ci
@pytest.mark.parametrize("kind", KINDS)
def test_a_stored_run_has_the_learner_and_its_policies(kind, tmp_path):
    task, agent = agent_of("world", kind, None)
    run = mg.train(task, agent, 300, 2, tmp_path / "run", progress=False)
    loaded = mg.load(tmp_path / "run")
    same(run.policies, loaded.policies)
    assert agent_from_table(task, loaded.config["agent"]).policy == agent.policy
    found = evaluate(loaded, steps=50)
    assert found.reward.shape[-1] >= 1


@pytest.mark.ci
def test_the_command_line_sets_hidden_units_and_states(tmp_path):
    out = tmp_path / "run"
    given = ["--agent.policy.states", "3", "--agent.policy.links", "2"]
    assert main(["train", "load-unload", "--steps", "200", "--out", str(out), *given]) == 0
    assert mg.load(out).policy().states == 3
    given = ["--agent.policy.hidden", "4", "3", "--agent.policy.skip"]
    assert main(["train", "parity", "--steps", "200", "--out", str(tmp_path / "other"), *given]) == 0
    assert [pool.outputs for pool in mg.load(tmp_path / "other").policy().pools] == [4, 3, 1]
