"""Evaluation by whole episodes: right values from environments whose returns are known, in every engine."""

import dataclasses
import json

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from pyarrow import parquet

import motorgrad as mg
from motorgrad.cli import main
from motorgrad.training import RunWarning

EPISODES = 40


class Coin(gymnasium.Env):
    """An episode is 1 or 9 decisions long, by a coin; decision k pays k, whatever is done."""

    observation_space = spaces.Box(-1.0, 1.0, (1,), np.float32)
    action_space = spaces.Discrete(2)

    def __init__(self, endless=False):
        self.endless = endless

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.length, self.made = (9 if self.np_random.random() < 0.5 else 1), 0
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.made += 1
        return np.zeros(1, np.float32), float(self.made), not self.endless and self.made == self.length, False, {}


def learner(task):
    return mg.Agent(mg.policies.softmax(task), mg.learning.olgarb(decay=0.9), mg.learning.SGD(1e-3))


@pytest.fixture(scope="module")
def coin():
    task = mg.tasks.from_gymnasium(Coin)
    return mg.train(task, learner(task), steps=20, seeds=3, progress=False)


@pytest.fixture(scope="module")
def found(coin):
    return mg.evaluate(coin, episodes=EPISODES)


def test_every_episode_has_its_return_and_its_length(found):
    assert found.returns.shape == found.lengths.shape == (3, EPISODES)
    assert set(np.unique(found.lengths)) == {1, 9}
    np.testing.assert_array_equal(found.returns, found.lengths * (found.lengths + 1) / 2)
    assert not found.cut.any()
    assert not found.diverged.any()
    np.testing.assert_array_equal(found.metrics["return"], found.returns)  # which the task reads, too


def test_short_episodes_count_as_often_as_they_begin(found):
    # of a number of decisions nine tenths would be in long episodes; of episodes, half are long
    share = (found.lengths == 9).mean()
    assert abs(share - 0.5) < 4 * np.sqrt(0.25 / found.lengths.size)


def test_policies_and_evaluations_meet_different_episodes_and_the_same_seed_the_same(coin, found):
    assert len({tuple(row) for row in found.lengths}) == 3
    np.testing.assert_array_equal(mg.evaluate(coin, episodes=EPISODES).lengths, found.lengths)
    assert (mg.evaluate(coin, episodes=EPISODES, seed=1).lengths != found.lengths).any()


@pytest.mark.ci
def test_more_episodes_begin_with_the_same_whatever_is_evaluated_at_once(coin, found, monkeypatch):
    monkeypatch.setattr("motorgrad.training._episodes.TOGETHER", 32)
    np.testing.assert_array_equal(mg.evaluate(coin, episodes=EPISODES).lengths, found.lengths)
    np.testing.assert_array_equal(mg.evaluate(coin, episodes=5).lengths, found.lengths[:, :5])


def test_intervals_are_over_seeds_and_those_of_a_policy_over_its_episodes(found):
    from scipy import stats

    means = found.returns.mean(axis=1)
    half = stats.t.ppf(0.975, 2) * means.std(ddof=1) / np.sqrt(3)
    over = found.over_seeds()
    assert (over.value, over.low, over.high, over.count) == pytest.approx(
        (means.mean(), means.mean() - half, means.mean() + half, 3)
    )
    assert [each.count for each in found.over_episodes("length")] == [EPISODES] * 3
    assert found.over_episodes()[1].value == pytest.approx(means[1])
    assert "mean of 3 seeds" in repr(found)


def test_of_one_seed_the_interval_is_of_the_policy_alone_and_says_so(coin):
    single = dataclasses.replace(coin, config={**coin.config, "run": {**coin.config["run"], "seeds": [0]}})
    single = dataclasses.replace(single, policies=_first(coin.policies), _memory=_first(dict(coin._memory)))
    found = mg.evaluate(single, episodes=EPISODES)
    assert found.over_seeds().high == np.inf
    assert f"mean of {EPISODES} episodes (of one policy: it says nothing of other seeds)" in repr(found)


def _first(tree):
    import jax

    return jax.tree.map(lambda leaf: leaf[:1], tree)


@pytest.mark.ci
def test_an_episode_that_does_not_end_is_cut_and_said():
    task = mg.tasks.from_gymnasium(Coin, endless=True)
    run = mg.train(task, learner(task), steps=20, progress=False)
    with pytest.warns(RunWarning, match="3 of 3 episodes were not over after 7 decisions"):
        found = mg.evaluate(run, 7, episodes=3)
    assert found.cut.all()
    assert found.lengths.tolist() == [[7, 7, 7]]
    assert found.returns.tolist() == [[28.0] * 3]


def test_a_table_has_a_row_for_each_episode(found):
    table = found.table.to_pandas()
    assert list(table.columns) == ["seed", "episode", "return", "length", "diverged", "cut"]
    assert table.groupby("seed")["return"].mean().tolist() == pytest.approx(found.means().tolist())


@pytest.mark.parametrize(
    "task",
    ["particle-navigation", pytest.param(mg.make("hopper", time_limit=0.5), marks=pytest.mark.ci)],
    ids=["world", "body"],
)
def test_other_engines_count_what_their_records_do(task):
    run = mg.train(task, steps=100, seeds=2, progress=False)
    found = mg.evaluate(run, episodes=4)
    limit = run.task.episode_limit
    assert (found.lengths <= limit).all()
    assert np.isfinite(found.returns).all()
    longest = found.lengths == limit
    assert longest.any()
    if task == "particle-navigation":  # every decision costs, and the goal pays
        arrived = np.isfinite(found.metrics["arrival"])
        np.testing.assert_allclose(found.returns, 10.0 * arrived - found.metrics["cost"] * found.lengths, atol=1e-4)


def test_a_task_without_episodes_and_impossible_numbers_are_refused(coin):
    run = mg.train("three-state", steps=10, progress=False)
    with pytest.raises(ValueError, match="episodes = 5: must be None for the task 'three-state', which has none"):
        mg.evaluate(run, episodes=5)
    with pytest.raises(ValueError, match="episodes = 0: must be an integer from 1"):
        mg.evaluate(coin, episodes=0)


def test_the_seed_changes_an_evaluation_by_decisions_and_0_is_what_it_always_was(coin):
    first, again, other = (mg.evaluate(coin, 200, seed=seed).reward for seed in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    np.testing.assert_array_equal(mg.evaluate(coin, 200).reward, first)
    assert (other != first).any()


@pytest.mark.ci
def test_the_command_evaluates_episodes_trains_with_evaluations_and_takes_the_best(tmp_path, capsys):
    out = str(tmp_path / "run")
    command = ["train", "particle-navigation", "--steps", "400", "--seeds", "2", "--window", "100", "--out", out]
    assert main([*command, "--evaluate-every", "100", "--evaluate-episodes", "2", "--keep-best", "return"]) == 0
    run = mg.load(out)
    assert run.evaluated()[0].tolist() == [100, 200, 300, 400]
    capsys.readouterr()
    for more, policies in (([], run), (["--best"], run.best())):
        command = ["evaluate", out, "--episodes", "3", "--random-seed", "2", "--no-film", "--json", "-"]
        assert main([*command, *more]) == 0
        said = json.loads(capsys.readouterr().out)
        expected = mg.evaluate(policies, episodes=3, seed=2)
        np.testing.assert_allclose(said["return"]["episodes"], expected.returns)
        assert said["return"]["mean"] == pytest.approx(expected.over_seeds().value)
    table = str(tmp_path / "episodes.parquet")
    assert main(["evaluate", out, "--episodes", "3", "--random-seed", "2", "--no-film", "--table", table]) == 0
    whole = parquet.read_table(table).to_pydict()
    for seed, returns in zip(run.seeds, mg.evaluate(run, episodes=3, seed=2).returns, strict=True):
        for episode, expected in enumerate(returns):
            rows = zip(whole["seed"], whole["episode"], whole["reward"], strict=True)
            found = [reward for own, number, reward in rows if (own, number) == (seed, episode)]
            assert np.nansum(found) == pytest.approx(expected, rel=1e-5)
    assert main(["train", "--resume", out, "--steps", "500"]) == 0  # its own file has the options
    assert mg.load(out).evaluated()[0].tolist() == [100, 200, 300, 400, 500]
