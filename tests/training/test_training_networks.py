"""Networks on the command line, in tables, on disk and in sweeps."""

import equinox as eqx
import jax
import numpy as np
import pytest

import motorgrad as mg
from motorgrad.cli import main
from motorgrad.policies import MultilayerPerceptron, Network
from motorgrad.schema import table

SMALL = {"hidden": [6, 5]}
LEARNER = {
    "policy.network": SMALL,
    "baseline": {"kind": "network-critic", "discount": 0.9, "network": SMALL},
    "estimator.bound": {"kind": "overshooting", "scaling": 3.0},
    "learning_rate": 1.0,
}


def leaves(run):
    return jax.tree.leaves(run.policies)


def test_tables_name_the_hidden_layers_of_policy_and_critic():
    task = mg.make("hopper")
    agent = mg.agent_for(task, LEARNER)
    assert agent.policy.network == MultilayerPerceptron((6, 5))
    assert agent.estimator.baseline.network == MultilayerPerceptron((6, 5))
    changed = mg.agent_for(task, {**LEARNER, "policy.network.activation": "tanh"}).policy
    assert changed.network == MultilayerPerceptron((6, 5), "tanh")
    assert mg.agent_for(task, policy=table(changed)).policy == changed
    assert mg.agent_for(task, policy={**table(changed), "network": "none"}).policy.network is None
    for bad, told in {
        "hiden": "did you mean 'hidden'",
        "hidden": r"hidden\[0\] = -1: must be an integer from 1 to 100,000",
        "sparsity": "in",
    }.items():
        with pytest.raises(ValueError, match=told):
            mg.agent_for(task, {"policy.network": {bad: [-1] if bad == "hidden" else -1}})
    with pytest.raises(ValueError, match=r"unknown .*'preceptron': did you mean 'perceptron'"):
        mg.agent_for(task, {"policy.network": "preceptron"})


@pytest.mark.ci
def test_a_module_of_equinox_trains_as_it_is():
    task = mg.make("chain", length=3)

    def policy(key):
        layers = eqx.nn.MLP(task.observation_size, 4, 5, 1, key=key)
        return Network(mg.policies.softmax(4, task.action_size), layers, task.observation_size)

    agent = mg.Agent(policy, mg.learning.olgarb(decay=0.5), mg.learning.SGD(0.1))
    run = mg.train(task, agent, steps=32, seeds=2, progress=False)
    before, after = (jax.tree.leaves(eqx.filter(each.module, eqx.is_array)) for each in (run.initial, run.policies))
    assert len(after) == 4  # weights and biases of two layers
    for one, other in zip(before, after, strict=True):
        assert np.all(np.isfinite(other))
        assert np.any(one != other, axis=tuple(range(1, other.ndim))).all()  # in each seed
    assert run.policy(seed=1).mode([0.0, 1.0, 0.0]).shape == ()


def test_returns_are_fitted_in_one_environment_alone():
    agent = mg.agent_for("hopper", baseline={"kind": "network-critic", "fit": "fitted-returns", "discount": 0.9})
    with pytest.raises(ValueError, match="envs = 4: must be 1 for a critic fitted by FittedReturns"):
        mg.train("hopper", agent, steps=64, seeds=1, envs=4)


@pytest.mark.slow
@pytest.mark.ci
def test_a_run_of_networks_is_stored_continued_and_evaluated_bit_for_bit(tmp_path):
    options = ["--agent.policy.network", "perceptron", "--agent.policy.network.hidden", "6", "5"]
    options += ["--agent.baseline", "network-critic", "--agent.estimator.baseline.discount", "0.9"]
    options += ["--agent.estimator.bound", "overshooting", "--agent.learning-rate", "1.0", "--seeds", "2"]
    for name, steps in (("whole", 96), ("half", 48)):
        assert main(["train", "hopper", *options, "--steps", str(steps), "--out", str(tmp_path / name)]) == 0
    run = mg.load(tmp_path / "whole")
    assert isinstance(run.policies, Network)
    again = mg.resume(tmp_path / "half", 96, progress=False)
    assert again.decision == 96
    for one, other in zip(leaves(again), leaves(run), strict=True):
        np.testing.assert_array_equal(one, other)
    assert main(["evaluate", str(tmp_path / "half"), "--steps", "32", "--no-film"]) in (0, 2)


@pytest.mark.slow
def test_a_sweep_of_numbers_is_as_the_runs_alone():
    task = mg.make("chain")
    settings = {**LEARNER, "policy": {"kind": "softmax", "network": SMALL}}
    del settings["policy.network"]
    swept = mg.train(
        task, mg.agent_for(task, settings), steps=64, seeds=2, sweep={"estimator.bound.scaling": [3.0, 6.0]}
    )
    alone = mg.train(
        task,
        mg.agent_for(task, {**settings, "estimator.bound": {"kind": "overshooting", "scaling": 6.0}}),
        steps=64,
        seeds=2,
    )
    for one, other in zip(leaves(swept), leaves(alone), strict=True):
        np.testing.assert_allclose(np.asarray(one)[2:], other, rtol=1e-5, atol=1e-6)
