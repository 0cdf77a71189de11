"""Finite MDPs as tasks: what they show and pay, their time limits, and the engine's mean reward against the oracle."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.learning import Agent, gpomdp
from motorgrad.policies import Hyperplanes, Softmax
from motorgrad.tasks import TASKS, CallAdmission, Chain, FiniteTask, ThreeState, make
from motorgrad.training import stepper_for
from motorgrad.worlds import oracle

FINITE = {name: task() for name, task in TASKS.items() if issubclass(task, FiniteTask)}


def still(task):
    """A policy of zero weights that fits the task, at fixed parameters."""
    inputs, actions = task.observation_size, task.action_size
    if task.actions == "discrete":
        return Softmax(jnp.zeros((actions, inputs)))
    return Hyperplanes(jnp.zeros((actions, inputs)), jnp.zeros(actions))


def test_the_registry_holds_the_finite_tasks():
    assert set(FINITE) == {"call-admission", "chain", "load-unload", "parity", "t-maze", "three-state"}


@pytest.mark.parametrize("name", FINITE)
def test_the_observation_is_the_mdps(name):
    task = FINITE[name]
    for state in (0, task.dynamics.states - 1):
        _, seen = task.observe(task.init(jnp.zeros(0)), jnp.asarray(state), jnp.zeros(0))
        np.testing.assert_array_equal(seen, task.dynamics.observations[state].astype(np.float32))
        assert seen.shape == (task.observation_size,)


def test_an_admission_is_paid_for_the_state_in_which_it_was_decided():
    task = CallAdmission()
    mdp = task.dynamics
    asking = int(np.flatnonzero(mdp.rewards[1] == 4)[0])
    memory, _ = task.observe(task.init(jnp.zeros(0)), jnp.asarray(asking), jnp.zeros(0))
    for action, pay in ((0.0, 0), (1.0, 4)):
        _, reward, terminated = task.reward(memory, jnp.asarray(mdp.start), jnp.asarray([action]))
        assert float(reward) == pay
        assert terminated is False


@pytest.mark.representatives("call-admission")
@pytest.mark.parametrize("name", FINITE)
def test_the_mean_reward_in_the_engine_is_the_oracles(name):
    task, runs, decisions, settle = FINITE[name], 200, 4_000, 400
    stepper = stepper_for(task, Agent(still(task), gpomdp(0.0)), range(runs))
    stepper.advance(settle)  # forget the start
    stepper.harvest()
    stepper.advance(decisions)
    per_seed = np.asarray(stepper.harvest()["reward"], float) / decisions
    error = per_seed.std() / np.sqrt(runs)
    exact = oracle.average_reward(task.dynamics, still(task))
    assert error < 0.02 * exact
    assert per_seed.mean() == pytest.approx(exact, abs=4 * error)


@pytest.mark.ci
@pytest.mark.parametrize("variant", ["walk", "reset"])
def test_a_chain_cut_after_one_decision_less_than_its_length_pays_once_in_thirty_two_episodes(variant):
    task, runs, episodes = Chain(length=6, variant=variant, time_limit=5), 200, 300
    stepper = stepper_for(task, Agent(still(task), gpomdp(0.0)), range(runs))
    stepper.advance(5 * episodes)
    record = stepper.harvest()
    np.testing.assert_array_equal(record["episodes"], episodes)
    share, chance = np.sum(record["reward"]) / (runs * episodes), 2.0**-5
    # four standard deviations of a binomial share
    assert share == pytest.approx(chance, abs=4 * np.sqrt(chance * (1 - chance) / (runs * episodes)))


def test_a_continuing_task_has_no_episodes():
    stepper = stepper_for(ThreeState(), Agent(still(ThreeState()), gpomdp(0.0)), range(2))
    assert "episodes" not in stepper.harvest()


def test_a_truncated_episode_begins_anew_with_an_empty_trace():
    task = Chain(length=6, time_limit=3)
    stepper = stepper_for(task, Agent(still(task), gpomdp(0.9)), range(4))
    stepper.advance(6)
    state = stepper.state
    np.testing.assert_array_equal(state["world"], task.dynamics.start)
    np.testing.assert_array_equal(state["cycle"].elapsed, 0)
    np.testing.assert_array_equal(state["cycle"].observation, np.eye(6)[[0] * 4])
    for leaf in jax.tree.leaves(state["cycle"].agent.estimator.trace):
        np.testing.assert_array_equal(leaf, 0)


@pytest.mark.parametrize(
    ("name", "settings", "names"),
    [
        ("three-state", {"time_limit": 0}, "time_limit = 0"),
        ("chain", {"length": 1}, "length = 1"),
        ("chain", {"variant": "walks"}, "variant 'walks': did you mean 'walk'"),
        ("call-admission", {"capacity": 0}, "capacity = 0"),
        ("chain", {"lenght": 5}, "'lenght': did you mean 'length'"),
    ],
)
def test_impossible_settings_are_refused_by_name(name, settings, names):
    with pytest.raises(ValueError, match=names):
        make(name, **settings)
