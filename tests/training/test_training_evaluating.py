"""Evaluation by episodes, also while training, and the best policies: right, resumable, no change to training."""

import signal
import subprocess
import sys

import numpy as np
import pytest

import motorgrad as mg
from motorgrad.training import EvaluationCallback, KeepBest

STEPS, WINDOW, EVERY, EPISODES = 600, 50, 100, 3
TASK = "particle-navigation"
HOW = {"seeds": 2, "window": WINDOW, "progress": False}


def trained(steps=STEPS, **settings):
    return mg.train(TASK, steps=steps, **{**HOW, **settings})


def keeping():
    return KeepBest(every=EVERY, episodes=EPISODES)


@pytest.fixture(scope="module")
def plain():
    return trained()


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    return trained(callbacks=keeping(), out=tmp_path_factory.mktemp("kept"))


def same_records(one, other):
    assert one.metrics.column_names == other.metrics.column_names
    for name in set(one.metrics.column_names) - {"wall_time", "cpu_time"}:
        np.testing.assert_array_equal(*(np.array(run.metrics[name].to_pylist()) for run in (one, other)), name)


def same(one, other):
    assert one._evaluations.keys() == other._evaluations.keys()
    for name, array in one._evaluations.items():
        np.testing.assert_array_equal(array, other._evaluations[name], err_msg=name)


def test_evaluation_changes_no_record(plain, kept):
    same_records(kept, plain)


def test_evaluations_are_those_of_the_policies_at_their_time(kept):
    decisions, returns = kept.evaluated()
    assert decisions.tolist() == [100, 200, 300, 400, 500, 600]
    last = mg.evaluate(kept, episodes=EPISODES, seed=1)  # the callback's own seed
    np.testing.assert_array_equal(last.means(), returns[:, -1])
    assert kept.evaluations.num_rows == 2 * 6 * EPISODES
    table = kept.evaluations.filter(np.asarray(kept.evaluations["decision"]) == 600)
    np.testing.assert_array_equal(table["return"], last.returns.ravel())


def test_the_best_is_the_first_policy_with_the_largest_mean(kept):
    decisions, returns = kept.evaluated()
    np.testing.assert_array_equal(kept.best_at, decisions[returns.argmax(axis=1)])
    np.testing.assert_array_equal(kept.best_value, returns.max(axis=1))
    again = mg.evaluate(kept.best(), episodes=EPISODES, seed=1)
    np.testing.assert_array_equal(again.means(), kept.best_value)


def test_what_was_kept_is_loaded(kept):
    loaded = mg.load(kept.path)
    same(kept, loaded)
    np.testing.assert_array_equal(loaded.best_at, kept.best_at)
    assert mg.evaluate(loaded.best(), episodes=EPISODES, seed=1).means().tolist() == kept.best_value.tolist()


@pytest.mark.parametrize("again", [keeping, tuple])
def test_a_stopped_run_goes_on_evaluating_even_if_not_told_again(kept, tmp_path, again):
    def stop(report):
        return report.decision >= 250

    trained(callbacks=[keeping(), stop], out=tmp_path)
    same(trained(callbacks=again(), out=tmp_path), kept)


@pytest.mark.ci
def test_more_steps_keep_the_interval(kept, tmp_path):
    first = trained(steps=320, callbacks=KeepBest(episodes=EPISODES), out=tmp_path, window=16)
    assert first.config["run"]["evaluate_every"] == 16
    more = trained(callbacks=KeepBest(episodes=EPISODES), out=tmp_path, window=16)
    assert more.config["run"]["evaluate_every"] == 16
    assert more.evaluated()[0].tolist() == list(range(16, STEPS, 16))


KILLED = """
import os, signal, sys, motorgrad as mg
def die(report):
    if report.decision >= 350:
        os.kill(os.getpid(), signal.SIGKILL)
mg.train("particle-navigation", steps=600, seeds=2, window=50, progress=False, out=sys.argv[1], checkpoint_every=0,
         callbacks=[mg.training.KeepBest(every=100, episodes=3), die])
"""


@pytest.mark.ci
def test_a_killed_run_has_the_same_evaluations_and_the_same_best(kept, tmp_path, compiled_environment):
    done = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path / "run")], env=compiled_environment)
    assert done.returncode == -signal.SIGKILL
    assert 0 < mg.load(tmp_path / "run").decision < 350
    resumed = mg.resume(tmp_path / "run", progress=False)
    same(resumed, kept)
    same(mg.load(tmp_path / "run"), kept)
    same_records(resumed, kept)


def test_another_evaluation_of_the_same_run_is_refused_by_name(kept):
    with pytest.raises(mg.training.RunDirectoryError, match=r"run\.evaluate_episodes was 3 and is now 4"):
        trained(callbacks=KeepBest(every=EVERY, episodes=4), out=kept.path)
    with pytest.raises(mg.training.RunDirectoryError, match=r"run\.keep_best was 'return' and is now None"):
        trained(callbacks=EvaluationCallback(every=EVERY, episodes=EPISODES), out=kept.path)


def test_a_run_may_begin_to_be_evaluated_later(tmp_path, plain):
    trained(steps=300, out=tmp_path)
    run = trained(callbacks=keeping(), out=tmp_path)
    assert run.evaluated()[0].tolist() == [350, 400, 500, 600]  # at once, as none was made before
    same_records(run, plain)


def test_any_callback_gets_the_present_policies(plain):
    seen = []
    trained(callbacks=lambda report: seen.append(report.policy(1)))
    np.testing.assert_array_equal(seen[-1].centre, plain.policy(1).centre)
    assert not np.array_equal(seen[0].centre, seen[-1].centre)


@pytest.mark.ci
def test_a_sweep_keeps_the_best_of_each_setting_and_splits():
    sweep = {"estimator.trace.decay": [0.5, 0.9]}
    run = trained(steps=200, callbacks=keeping(), sweep=sweep)
    parts = run.split()
    np.testing.assert_array_equal(np.concatenate([part.best_at for part in parts]), run.best_at)
    np.testing.assert_array_equal(np.concatenate([part.evaluated()[1] for part in parts]), run.evaluated()[1])
    assert set(run.evaluations["setting"].to_pylist()) == {0, 1}
    with pytest.raises(ValueError, match="run of one setting"):
        mg.evaluate(run, episodes=2).over_seeds()


def test_several_evaluations_and_tasks_without_episodes_are_refused():
    with pytest.raises(ValueError, match="one EvaluationCallback at most"):
        trained(callbacks=[keeping(), keeping()])
    with pytest.raises(ValueError, match="has no episodes"):
        mg.train("three-state", steps=100, callbacks=keeping(), progress=False)
    with pytest.raises(ValueError, match="unknown of 'height'"):
        trained(callbacks=KeepBest(of="height"))


def test_a_run_without_evaluations_says_when_the_first_is_due(plain):
    with pytest.raises(ValueError, match=r"no evaluations: callbacks=mg\.training\.EvaluationCallback"):
        plain.evaluated()
    with pytest.raises(ValueError, match=r"first is due at 1,000 decisions, and 100 were made"):
        trained(steps=100, callbacks=KeepBest(every=1_000)).best()
