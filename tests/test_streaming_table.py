"""The page of streaming learners: its tables are those of the stored runs, and what a peer earns is recorded."""

import json
from pathlib import Path

import gymnasium
import numpy as np
import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def tool():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT))
        import tools.streaming

        yield tools.streaming


def test_the_tables_are_those_of_the_stored_runs(tool):
    page = (ROOT / "docs" / "streaming-table.md").read_text(encoding="utf-8")
    assert tool.tables() in page
    assert tool.summary() in page


def test_the_summary_has_the_best_of_ours_and_of_peers(tool):
    (line,) = (line for line in tool.summary().splitlines() if line.startswith("| `Hopper-v5`"))
    ours, peer = (line.split("|")[place].split()[0].strip("`") for place in (3, 5))
    median = {run["learner"]: float(np.median(tool.earned(run))) for run in tool.stored("hopper-v5")}
    assert ours == max((name for name in median if name in tool.OURS), key=median.__getitem__)
    assert peer == max((name for name in median if name in tool.PEERS), key=median.__getitem__)


def test_reported_seeds_are_not_those_on_which_settings_were_chosen(tool):
    for path in tool.DATA.glob("streaming-*.json"):
        run = json.loads(path.read_text(encoding="utf-8"))
        assert max(run["seeds"]) < 100
        assert np.shape(run["curve"]) == (len(run["seeds"]), tool.POINTS)


def test_every_reward_can_be_recorded(tool):
    recorded = tool.Recorded(gymnasium.make("CartPole-v1"), "reward")
    recorded.reset(seed=0)
    for step in range(20):
        _, _, ended, _, _ = recorded.step(step % 2)
        if ended:
            recorded.reset()
    np.testing.assert_array_equal(recorded.curve(20), np.ones(20))


def test_returns_are_recorded_when_episodes_end(tool):
    recorded = tool.Recorded(gymnasium.make("CartPole-v1"), "return")
    recorded.reset(seed=0)
    returns, steps = [], 0
    for step in range(1, 201):
        _, _, ended, _, _ = recorded.step(step % 2)
        if ended:  # CartPole pays 1 for each step
            returns.append(step - steps)
            steps = step
            recorded.reset()
    assert len(returns) > 3
    assert [earned for _, earned in recorded.seen] == returns
    assert np.nanmean(recorded.curve(200)) == pytest.approx(np.mean(returns), rel=0.5)
    assert recorded.curve(200).shape == (tool.POINTS,)
