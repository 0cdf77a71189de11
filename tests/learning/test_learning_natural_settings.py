"""The natural gradient by settings: runs that go on, what the settings make, which are refused."""

import jax
import numpy as np
import pytest

import motorgrad as mg
from motorgrad.learning import Agent, FisherMetric
from motorgrad.policies import Softmax
from motorgrad.training import agent_for, load

POINT = Softmax([[1.0, 1.0], [-1.0, -1.0]])  # Baxter & Bartlett's test point


@pytest.mark.representatives("1-call-admission")
@pytest.mark.parametrize("task", ["call-admission", pytest.param("hopper", marks=pytest.mark.slow)])
@pytest.mark.parametrize("improve", [1, 7])
def test_a_run_that_was_stopped_goes_on_bit_for_bit(task, improve, tmp_path):
    asked = {"task": task, "agent": agent_for(mg.make(task), metric="fisher", damping=0.1, improve=improve)}
    whole = mg.train(**asked, steps=600, seeds=3, out=tmp_path / "whole", window=100, progress=False)
    mg.train(**asked, steps=300, seeds=3, out=tmp_path / "parts", window=100, progress=False)
    parts = mg.train(**asked, steps=600, seeds=3, out=tmp_path / "parts", window=100, progress=False)
    assert jax.tree.all(jax.tree.map(np.array_equal, parts.policies, whole.policies))
    assert load(tmp_path / "parts").config["agent"]["metric"]["damping"] == 0.1
    plain = mg.train(task, agent_for(mg.make(task), improve=improve), 600, 3, progress=False)
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
