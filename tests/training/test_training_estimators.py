"""Critics, limits, bonuses and averages in runs: resumed bit for bit, described, read back and evaluated."""

import dataclasses

import jax
import numpy as np
import pytest

import motorgrad as mg
from motorgrad.learning import Agent, Annealed, Features, FisherMetric, Gae, LinearCritic, WeightAverage, sgd
from motorgrad.policies import Softmax
from motorgrad.tasks import Chain, ThreeState
from motorgrad.training import RunDirectoryError, evaluate, load, settings_for, stepper_of, train

EVERYTHING = {
    "critic": "least-squares",
    "critic_discount": 0.97,
    "critic_squares": True,
    "critic_actions": True,
    "critic_interval": 30,
    "decay": 0.873,
    "improve": 40,
    "rate": 1.0,
    "metric": "fisher",
    "metric_rate": 0.01,
    "metric_kl": 0.03,
    "metric_kl_end": 0.0,
    "metric_kl_steps": 50,
    "entropy": 0.02,
    "entropy_end": 0.0,
    "entropy_steps": 50,
    "average": True,
    "average_start": 3,
}
TASKS = {"world": ("three-state", 1_000), "episodes": (Chain(length=4, time_limit=7), 1_000), "body": ("hopper", 130)}


def equal(a, b):
    jax.tree.map(np.testing.assert_array_equal, a, b)


@pytest.mark.representatives("body-least-squares")
@pytest.mark.parametrize("critic", ["least-squares", "td"])
@pytest.mark.parametrize("name", TASKS)
def test_everything_together_is_resumed_bit_for_bit(name, critic, tmp_path):
    task, steps = TASKS[name]
    settings = settings_for(task, **{**EVERYTHING, "critic": critic})
    whole = train(task, settings, steps=steps, seeds=2)
    train(task, settings, steps=steps // 3 + 1, seeds=2, out=tmp_path / "run")
    parted = train(task, settings, steps=steps, seeds=2, out=tmp_path / "run")
    equal(parted.policies, whole.policies)
    equal(parted.gradient, whole.gradient)
    equal(load(tmp_path / "run").policies, whole.policies)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(whole.policies))
    moved = [np.abs(a - b).max() for a, b in zip(*map(jax.tree.leaves, (whole.policies, whole.initial)), strict=True)]
    assert max(moved) > 1e-3


def test_a_run_gives_the_averaged_policies_away_and_evaluates_them(tmp_path):
    settings = settings_for("three-state", average=True, average_start=10)
    run = train("three-state", settings, steps=2_000, seeds=2, out=tmp_path / "run")
    last = train("three-state", settings_for("three-state"), steps=2_000, seeds=2)
    assert np.abs(run.policies.weights - last.policies.weights).max() > 1e-3
    equal(load(tmp_path / "run").policies, run.policies)
    stepper = stepper_of(ThreeState(), settings.agent(ThreeState()), run.seeds)
    stepper.advance(2_000)
    equal(stepper.policies(), run.policies)
    equal(stepper.state["cycle"].agent.policy, last.policies)
    assert len(evaluate(run, 100).reward) == 2


PARTS = {
    "features": {"critic": LinearCritic(Features(squares=True), 0.9)},
    "fit": {"critic": LinearCritic(Features(), 0.9, 0.5)},
    "limit": {"metric": FisherMetric(kl=Annealed(0.1, 0.0, 5))},
    "entropy": {"entropy": 0.1},
    "average": {"average": WeightAverage(3)},
}


def made(critic=None, metric=None, entropy=0.0, average=None):
    estimator = dataclasses.replace(Gae(critic or LinearCritic(Features(), 0.9), 0.9, 20), entropy=entropy)
    return Agent(Softmax(np.zeros((2, 2))), estimator, sgd(0.1), metric or FisherMetric(), average=average)


@pytest.mark.representatives("limit", "average")
@pytest.mark.parametrize("part", PARTS)
def test_a_run_is_not_resumed_by_another_learner(part, tmp_path):
    train(ThreeState(), made(), steps=50, seeds=1, out=tmp_path)
    train(ThreeState(), made(), steps=60, seeds=1, out=tmp_path)
    with pytest.raises(RunDirectoryError):
        train(ThreeState(), made(**PARTS[part]), steps=100, seeds=1, out=tmp_path)


def test_the_records_have_the_mean_reward_in_place_of_the_baseline():
    run = mg.train("three-state", settings_for("three-state", critic="td", improve=10), steps=3_000, seeds=2)
    last = run.metrics["baseline"].to_numpy()[-2:]
    assert ((last > 0) & (last < 1)).all()


def test_learners_that_use_none_of_it_are_described_as_before(tmp_path):
    from motorgrad.training._directory import RunDirectory

    train("three-state", settings_for("three-state", metric="fisher"), steps=50, seeds=1, out=tmp_path)
    learner = RunDirectory(tmp_path).learner()
    assert set(learner) == {"policy", "estimator", "ascent", "metric", "initial"}
    assert set(learner["estimator"]) == {"trace", "baseline", "improve", "batch"}
    assert set(learner["metric"]) == {"kind", "rate", "damping", "initial"}
