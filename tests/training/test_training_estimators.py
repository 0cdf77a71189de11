"""Critics, limits, bonuses and averages in runs: resumed bit for bit, described, read back and evaluated."""

import dataclasses

import jax
import numpy as np
import pytest

from motorgrad.learning import SGD, Agent, Annealed, Features, FisherMetric, LinearCritic, PolyakAveraging, gae
from motorgrad.policies import Softmax, with_interface
from motorgrad.tasks import Chain, ThreeState
from motorgrad.training import RunDirectoryError, agent_for, evaluate, load, stepper_for, train

EVERYTHING = {
    "decay": 0.873,
    "update_every": 40,
    "learning_rate": 1.0,
    "metric": {"kind": "fisher", "rate": 0.01, "kl": {"kind": "annealed", "start": 0.03, "end": 0.0, "steps": 50}},
    "entropy": {"kind": "annealed", "start": 0.02, "end": 0.0, "steps": 50},
    "averaging": {"kind": "polyak", "start": 3},
}
FITS = {"least-squares": {"kind": "least-squares", "interval": 30}, "td": {"kind": "td"}}


def critic_baseline(fit):
    features = {"squares": True, "actions": True}
    return {"kind": "critic", "discount": 0.97, "decay": 0.9, "features": features, "fit": FITS[fit]}


TASKS = {"world": ("three-state", 1_000), "episodes": (Chain(length=4, time_limit=7), 1_000), "body": ("hopper", 130)}


def equal(a, b):
    jax.tree.map(np.testing.assert_array_equal, a, b)


@pytest.mark.ci
@pytest.mark.parametrize("critic", ["least-squares", "td"])
@pytest.mark.parametrize("name", TASKS)
def test_everything_together_is_resumed_bit_for_bit(name, critic, tmp_path):
    task, steps = TASKS[name]
    changes = {**EVERYTHING, "baseline": critic_baseline(critic)}
    whole = train(task, changes, steps=steps, seeds=2)
    train(task, changes, steps=steps // 3 + 1, seeds=2, out=tmp_path / "run")
    parted = train(task, changes, steps=steps, seeds=2, out=tmp_path / "run")
    equal(parted.policies, whole.policies)
    equal(parted.gradient, whole.gradient)
    equal(load(tmp_path / "run").policies, whole.policies)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(whole.policies))
    moved = [np.abs(a - b).max() for a, b in zip(*map(jax.tree.leaves, (whole.policies, whole.initial)), strict=True)]
    assert max(moved) > 1e-3


def test_the_mean_of_no_gradient_samples_is_not_0(tmp_path):
    changes = {"estimator": "gpomdp", "update_every": 100}
    for steps, known in ((150, True), (200, False)):  # after the step at decision 200 there is no sample yet
        run = train("three-state", changes, steps=steps, seeds=2, out=tmp_path / "run", progress=False)
        equal(load(tmp_path / "run").gradient, run.gradient)
        assert np.isfinite(run.gradient.weights).all() == known
        assert np.isnan(run.gradient.weights).all() != known


def test_a_run_gives_the_averaged_policies_away_and_evaluates_them(tmp_path):
    agent = agent_for("three-state", averaging={"kind": "polyak", "start": 10})
    run = train("three-state", agent, steps=2_000, seeds=2, out=tmp_path / "run")
    last = train("three-state", None, steps=2_000, seeds=2)
    assert np.abs(run.policies.weights - last.policies.weights).max() > 1e-3
    equal(load(tmp_path / "run").policies, run.policies)
    stepper = stepper_for(ThreeState(), agent, run.seeds)
    stepper.advance(2_000)
    equal(stepper.policies(), with_interface(run.policies, None))
    equal(stepper.state["cycle"].agent.policy, with_interface(last.policies, None))
    assert len(evaluate(run, 100).reward) == 2


PARTS = {
    "features": {"critic": LinearCritic(Features(squares=True), 0.9)},
    "fit": {"critic": LinearCritic(Features(), 0.9, 0.5)},
    "limit": {"metric": FisherMetric(kl=Annealed(0.1, 0.0, 5))},
    "entropy": {"entropy": 0.1},
    "averaging": {"averaging": PolyakAveraging(3)},
}


def made(critic=None, metric=None, entropy=None, averaging=None):
    estimator = dataclasses.replace(gae(critic or LinearCritic(Features(), 0.9), 0.9, 20), entropy=entropy)
    return Agent(Softmax(np.zeros((2, 2))), estimator, SGD(0.1), metric or FisherMetric(), averaging=averaging)


@pytest.fixture(scope="module")
def run_of_critic(tmp_path_factory):
    """A run with a critic and the natural gradient, in two legs."""
    path = tmp_path_factory.mktemp("critic")
    train(ThreeState(), made(), steps=2_000, seeds=2, out=path, progress=False)
    return train(ThreeState(), made(), steps=3_000, seeds=2, out=path, progress=False)


@pytest.mark.representatives("limit", "averaging")
@pytest.mark.parametrize("part", PARTS)
def test_a_run_is_not_resumed_by_another_learner(part, run_of_critic):
    assert run_of_critic.decision == 3_000
    with pytest.raises(RunDirectoryError):
        train(ThreeState(), made(**PARTS[part]), steps=4_000, seeds=2, out=run_of_critic.path)


def test_the_records_have_the_mean_reward_in_place_of_the_baseline(run_of_critic):
    last = run_of_critic.metrics["baseline"].to_numpy()[-2:]
    assert ((last > 0) & (last < 1)).all()


def test_parts_that_a_learner_lacks_are_described_as_none(run_of_critic):
    from motorgrad.training.store._directory import RunDirectory

    learner = RunDirectory(run_of_critic.path).learner()
    assert {learner[part] for part in ("growth", "averaging")} == {"none"}
    assert {learner["estimator"][part] for part in ("discount", "normalization", "entropy")} == {"none"}
    assert learner["metric"]["kl"] == "none"
