"""Hidden units and internal states in the engine: their gradients against the oracle's, and what they learn.

Seeds are fixed, so that a result is always the same on one machine; tolerances are those of independent runs. Settings
of learners were chosen on seeds from 1,000 on.
"""

import jax
import numpy as np
import pytest

from motorgrad.learning import Agent, FisherMetric, gpomdp
from motorgrad.policies import FiniteStateController, Hyperplanes, Layered, Softmax, abilities
from motorgrad.tasks import LoadUnload, Parity, ThreeState, TMaze
from motorgrad.training import agent_for, stepper_for
from motorgrad.worlds import oracle

RNG = np.random.default_rng(0)
HIDDEN = Layered([Hyperplanes(RNG.normal(size=(2, 2)), RNG.normal(size=2))], Softmax(RNG.normal(size=(2, 3))))
_SHOWN = 2 + 2  # to layers above the first, with `skip`: the observation and what the layer below has drawn
DEEP = Layered(
    [Hyperplanes(RNG.normal(size=(2, count)), RNG.normal(size=2)) for count in (2, _SHOWN)],
    Softmax(RNG.normal(size=(2, _SHOWN + 1))),
    skip=True,
)
CONTROLLER = FiniteStateController(Softmax(RNG.normal(size=(2, 6))), Softmax(RNG.normal(size=(2, 6))))
POINTS = {
    "hidden units": (ThreeState(), HIDDEN),
    "two layers that see the observation": (ThreeState(), DEEP),
    "internal states": (LoadUnload(length=3), CONTROLLER),
}
RECURRENT = {"policy": {"kind": "recurrent", "longest": 10.0}, "learning_rate": 0.003, "entropy": 0.003}


def per_seed(mean):
    """The estimates of all seeds, (seeds, parameters)."""
    return np.concatenate([np.asarray(leaf, float).reshape(len(leaf), -1) for leaf in jax.tree.leaves(mean)], axis=1)


def exact_on(task, policy):
    """The MDP on which the oracle has the policy's gradient, memory included."""
    return oracle.joint(task.dynamics, policy) if abilities.has_memory(policy) else task.dynamics


def earned(task, policies, count):
    """The exact average reward of each seed's policy."""
    each = [jax.tree.map(lambda leaf, i=i: leaf[i], policies) for i in range(count)]
    return np.array([oracle.average_reward(exact_on(task, policy), policy) for policy in each])


@pytest.mark.ci
@pytest.mark.representatives("internal states")
@pytest.mark.parametrize("name", POINTS)
def test_the_mean_estimate_over_seeds_is_the_exact_gradient(name):
    task, policy = POINTS[name]
    exact = oracle.flat(oracle.biased_gradient(exact_on(task, policy), policy, 0.8))
    stepper = stepper_for(task, Agent(policy, gpomdp(0.8)), range(200))
    stepper.advance(4_800)
    found = per_seed(stepper.state["cycle"].agent.gradient.mean)
    error = found.std(0) / np.sqrt(len(found))
    assert np.linalg.norm(error) < 0.1 * np.linalg.norm(exact)  # sharp enough for a bias to show
    # Four standard errors, and the 1e-3 of the past that the start leaves out.
    np.testing.assert_array_less(np.abs(found.mean(0) - exact), 4 * error + 2e-3 * np.linalg.norm(exact))


@pytest.mark.ci
def test_the_running_fisher_matrices_are_those_of_what_all_pools_draw():
    task, policy = POINTS["hidden units"]
    stepper = stepper_for(task, Agent(policy, gpomdp(0.5), metric=FisherMetric(rate=1e-3, initial=0.0)), range(50))
    stepper.advance(8_000)  # 8 times the memory: 3e-4 of the start is left
    blocks = stepper.state["cycle"].agent.chain[0]
    exact = oracle.fisher(oracle.joint(task.dynamics, policy), policy)
    hidden, output = (np.asarray(block, float) for block in blocks)
    order = [[0, 1, 4], [2, 3, 5]]  # of each hidden unit: its weights, then its bias
    for unit, own in enumerate(order):
        np.testing.assert_allclose(hidden[:, unit].mean(0), exact[np.ix_(own, own)], atol=0.01)
    np.testing.assert_allclose(output[:, 0].mean(0), exact[6:, 6:], atol=0.01)
    np.testing.assert_allclose(exact[:6, 6:], 0, atol=1e-15)  # no cross terms between pools


def mean_reward(stepper, decisions):
    stepper.harvest()
    stepper.advance(decisions)
    return np.asarray(stepper.harvest()["reward"], float) / decisions


@pytest.mark.ci
def test_hidden_units_learn_what_one_layer_cannot():
    task = Parity()
    single = stepper_for(task, agent_for(task, policy="hyperplanes"), range(20))
    layers = stepper_for(task, agent_for(task), range(20))
    for stepper in (single, layers):
        stepper.advance(60_000)
    # of the four patterns, a soft boundary gets three right at best
    assert earned(task, single.policies(), 20).max() < 0.75
    assert (mean_reward(layers, 5_000) > 0.95).sum() >= 16


@pytest.mark.ci
@pytest.mark.parametrize(("task", "changes"), [(LoadUnload(), {}), (TMaze(), {}), (LoadUnload(), RECURRENT)])
def test_a_memory_earns_more_than_any_policy_without_one(task, changes):
    stepper = stepper_for(task, agent_for(task, **changes), range(20))
    stepper.advance(300_000)
    rewards = mean_reward(stepper, 20_000)
    _, without = oracle.best_memoryless(task.dynamics, 4)
    best = oracle.optimal_policy(task.dynamics)[1]
    assert np.median(rewards) > 0.93 * best
    assert (rewards > 1.5 * without).sum() >= 16


@pytest.mark.ci
def test_a_controller_starts_each_episode_in_its_first_state():
    """With one decision per episode, nothing is ever remembered."""
    task = LoadUnload(time_limit=1)
    for mode in ("learn", "sample", "mode"):
        stepper = stepper_for(task, Agent(CONTROLLER, gpomdp(0.5)), range(5), mode)
        stepper.advance(50)
        np.testing.assert_array_equal(stepper.state["cycle"].agent.memory, np.tile([1.0, 0.0], (5, 1)))
