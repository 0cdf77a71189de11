"""The natural gradient by settings: runs that go on, decisions taken in together, what is made and what is refused."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled_learner import decided, decision, started

import motorgrad as mg
from motorgrad.learning import SGD, Agent, Estimator, Exponential, FisherMetric
from motorgrad.policies import BoundedHyperplanes, Hyperplanes, Softmax, trainable
from motorgrad.training import agent_for, load
from motorgrad.worlds import oracle

POINT = Softmax([[1.0, 1.0], [-1.0, -1.0]])  # Baxter & Bartlett's test point


@pytest.mark.slow
@pytest.mark.parametrize("task", [pytest.param("call-admission", marks=pytest.mark.ci), "hopper"])
@pytest.mark.parametrize("update_every", [1, 7])
def test_a_run_that_was_stopped_goes_on_bit_for_bit(task, update_every, tmp_path):
    asked = {"task": task, "agent": agent_for(mg.make(task), metric="fisher", damping=0.1, update_every=update_every)}
    whole = mg.train(**asked, steps=600, seeds=3, out=tmp_path / "whole", window=100, progress=False)
    mg.train(**asked, steps=300, seeds=3, out=tmp_path / "parts", window=100, progress=False)
    parts = mg.train(**asked, steps=600, seeds=3, out=tmp_path / "parts", window=100, progress=False)
    assert jax.tree.all(jax.tree.map(np.array_equal, parts.policies, whole.policies))
    assert load(tmp_path / "parts").config["agent"]["metric"]["damping"] == 0.1
    plain = mg.train(task, agent_for(mg.make(task), update_every=update_every), 600, 3, progress=False)
    assert not jax.tree.all(jax.tree.map(np.array_equal, plain.policies, whole.policies))


def test_settings_make_the_metric_and_the_plain_learner_has_none():
    task = mg.make("call-admission")
    assert agent_for(task).metric is None
    found = agent_for(task, metric={"kind": "fisher", "rate": 3e-4, "initial": 2.0}, damping={"bias": 0.05})
    assert found.metric == FisherMetric(3e-4, {"bias": 0.05}, 2.0)
    assert agent_for(task, metric="fisher", damping=0.5).metric == FisherMetric(1e-3, 0.5, 1.0)


@pytest.mark.parametrize(
    ("make", "names"),
    [
        (lambda: FisherMetric(0.0), r"rate = 0.0: must be in \(0, 1\]"),
        (lambda: FisherMetric(float("nan")), "rate = nan"),
        (lambda: FisherMetric(0.1, -1.0), "damping = -1.0: must be a finite number of at least 0"),
        (lambda: FisherMetric(0.1, {"bias": float("inf")}), "damping.bias = inf"),
        (lambda: FisherMetric(0.1, 0.1, -1.0), "initial = -1.0"),
        (lambda: Agent(POINT, metric=0.1), "metric = 0.1: must be None or a Metric"),
        (
            lambda: Agent(POINT, metric=FisherMetric(0.1, {"wieghts": 0.1})).init(jax.random.key(0)),
            "group of parameters in the dampings: 'wieghts': did you mean 'weights'",
        ),
        (
            lambda: Agent(POINT, metric=FisherMetric(0.1, {"weights": [0.1] * 5})).init(jax.random.key(0)),
            r"damping weights = \(5,\): must be one number or of a shape that broadcasts to \(2, 2\)",
        ),
        (lambda: agent_for(mg.make("chain"), metric="fischer"), "'fischer': did you mean 'fisher'"),
        (lambda: agent_for(mg.make("chain"), metric={"kind": "fisher", "rate": 2.0}), "agent.metric.rate = 2.0"),
        (lambda: agent_for(mg.make("chain"), metric="fisher", damping=-0.1), "damping = -0.1"),
    ],
)
def test_impossible_settings_are_refused_by_name(make, names):
    with pytest.raises(ValueError, match=names):
        make()


def check_together(interval, update_every, tolerance):
    """A learner whose matrix takes in decisions together goes as one whose matrix takes in each by itself."""
    policy = BoundedHyperplanes([[0.5], [0.1]], [0.0, 0.2], [-1.0, -0.5])
    rng = np.random.default_rng(0)
    looks, chances = rng.normal(size=(14, 1)), rng.random((13, 2))
    found = []
    for together in (1, interval):
        agent = Agent(
            policy,
            Estimator(Exponential(0.5), update_every=update_every),
            SGD(0.1),
            FisherMetric(0.1, interval=together),
        )

        @eqx.filter_jit
        def decide(state, look, uniforms, following, agent=agent):
            found = decision(agent, state, look, uniforms, jnp.sum, following)
            return agent.decisions_until_due(state), found.observed, found.state

        state = started(agent)
        for number in range(13):
            waits, after, state = decide(state, looks[number], chances[number], looks[number + 1])
            if together > 1 and waits > 0:
                jax.tree.map(np.testing.assert_array_equal, state.chain[0].blocks, after.chain[0].blocks)
        found.append(state)
    one, other = found
    assert int(other.chain[0].waiting) == 13 % update_every % interval  # a step leaves none waiting
    np.testing.assert_allclose(oracle.flat(trainable(one.policy)), oracle.flat(trainable(other.policy)), rtol=tolerance)
    if update_every < 13:
        return
    last = FisherMetric(0.1, interval=interval).solve(other.chain[0], other.policy, True)
    assert int(last.waiting) == 0
    np.testing.assert_allclose(last.blocks[0], one.chain[0][0], rtol=1e-5, atol=1e-6)


@pytest.mark.ci
def test_decisions_taken_in_together_make_the_same_matrix():
    check_together(5, 1000, 0)


@pytest.mark.ci
@pytest.mark.representatives("4")
@pytest.mark.parametrize("interval", [4, 50])
def test_a_step_of_a_batch_learner_takes_in_the_decisions_that_wait(interval):
    check_together(interval, 6, 1e-4)


@pytest.mark.ci
@pytest.mark.representatives("4-3")
@pytest.mark.parametrize("interval", [1, 3])
@pytest.mark.parametrize("update_every", [1, 4])
def test_a_diverged_decision_leaves_the_matrix_and_the_parameters(update_every, interval):
    metric = FisherMetric(0.1, interval=interval)
    agent = Agent(Hyperplanes([[0.5]], [0.0]), Estimator(update_every=update_every), SGD(0.1), metric)
    state = decided(agent, started(agent), [0.7], [0.3], 1.0).state
    for broken in (np.nan, 0.7):
        after = decided(agent, state, [broken], [0.3], np.nan, diverged=True).state
        jax.tree.map(np.testing.assert_array_equal, (after.policy, after.chain), (state.policy, state.chain))
