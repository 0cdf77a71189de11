"""Means over records count what occurred in them: closed forms on records that were written by hand."""

import dataclasses

import numpy as np
import pyarrow as pa
import pytest

import motorgrad as mg
from motorgrad.training import final_metrics

WINDOWS = np.array([100, 100, 100, 50])  # the last is short
APEX = np.array([[1.0, np.nan, 2.0, 5.0], [np.nan, np.nan, np.nan, np.nan]])
COUNTS = np.array([[1, 0, 3, 1], [0, 0, 0, 0]])
REWARD = np.array([[0.0, 1.0, 2.0, 4.0], [1.0, 1.0, 1.0, 1.0]])
DIVERGED = np.array([[0, 0, 50, 0], [0, 0, 0, 0]])


@pytest.fixture(scope="module")
def run():
    made = mg.train("three-state", steps=350, seeds=2, window=100, progress=False)
    columns = {"apex": APEX, "apex_count": COUNTS, "reward": REWARD, "diverged": DIVERGED}
    table = {"seed": np.tile([0, 1], 4), "decision": np.repeat(np.cumsum(WINDOWS), 2)}
    times = {name: np.zeros(8) for name in ("simulated_time", "wall_time", "cpu_time")}
    written = {name: values.T.ravel() for name, values in columns.items()}
    return dataclasses.replace(made, metrics=pa.table({**table, **times, **written}))


def test_a_reading_counts_as_often_as_it_occurred(run):
    np.testing.assert_allclose(run.final("apex", 1.0), [(1 + 3 * 2 + 5) / 5, np.nan])
    np.testing.assert_allclose(run.final("apex", 0.5), [(3 * 2 + 5) / 4, np.nan])
    np.testing.assert_allclose(final_metrics(run, 0.5)["apex"], [(3 * 2 + 5) / 4, np.nan])


def test_a_reward_counts_for_its_decisions_without_those_that_diverged(run):
    expected = (100 * 1.0 + 50 * 2.0 + 50 * 4.0) / (100 + 100 + 50 + 50)
    np.testing.assert_allclose(run.final("reward", 1.0), [expected, 1.0])
    np.testing.assert_allclose(final_metrics(run, 1.0)["reward"], [expected, 1.0])


def test_the_best_setting_is_that_of_all_its_episodes():
    # one record has one episode of return 10, the other nine of 0: a mean over records would say 5, and rank it first
    lucky, steady = np.array([10.0, 0.0]), np.array([2.0, 2.0])
    made = mg.train("three-state", steps=20, window=10, progress=False, sweep={"learning_rate": [0.1, 0.2]})
    table = {"setting": [0, 1, 0, 1], "seed": [0] * 4, "decision": [10, 10, 20, 20]}
    columns = {"return": np.stack([lucky, steady], 1).ravel(), "return_count": [1, 5, 9, 5]}
    swept = dataclasses.replace(made, metrics=pa.table({**table, **columns}))
    best = swept.ranked("return", share=1.0)[0]
    np.testing.assert_allclose(best.final("return", 1.0), [2.0])


@pytest.mark.ci  # it compiles a large learner
def test_the_final_return_of_pendulum_is_that_of_the_episodes_that_ended():
    run = mg.train("Pendulum-v1", steps=600, window=20, progress=False)  # episodes of 200 decisions
    returns = run.curve("return")[1][0]
    ended = returns[np.isfinite(returns)]
    assert len(ended) == 3
    np.testing.assert_allclose(run.final("return"), ended[-1])
    np.testing.assert_allclose(run.final("return", 1.0), ended.mean(), rtol=1e-6)
