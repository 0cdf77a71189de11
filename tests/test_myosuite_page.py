"""The page on MyoSuite: its table is that of the stored runs, and the tool that makes them works."""

import json
from pathlib import Path

import numpy as np
import pytest

import motorgrad as mg

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def tool():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT))
        import tools.myosuite

        yield tools.myosuite


def test_the_table_is_that_of_the_stored_runs(tool):
    page = (ROOT / "docs" / "myosuite.md").read_text(encoding="utf-8")
    assert tool.with_table(page) == page
    assert "\n| elbow | `natural` | 20,000 | " in page


def test_reported_seeds_are_not_those_on_which_settings_were_chosen(tool):
    for run in tool.stored():
        assert max(run["seeds"]) < 100
        assert run["episodes"] >= 100
        assert all(
            len(values) == len(run["seeds"]) for mode in tool.MODES for values in run["evaluated"][mode].values()
        )


def test_runs_of_the_same_learner_are_one_row(tool, tmp_path, monkeypatch):
    run = json.loads((tool.DATA / "myosuite-hand-ppo-short-horizon-independent-9000000.json").read_text())
    (tmp_path / "myosuite-hand.json").write_text(json.dumps(run))
    (tmp_path / "myosuite-hand-from-7.json").write_text(json.dumps(run | {"seeds": [7]}))
    (tmp_path / "myosuite-hand-longer.json").write_text(json.dumps(run | {"steps": 2 * run["steps"]}))
    monkeypatch.setattr(tool, "DATA", tmp_path)
    joined, longer = tool.stored()
    assert (joined["seeds"], longer["seeds"]) == ([7, *run["seeds"]], run["seeds"])
    assert len(joined["curves"]["success"]) == len(joined["evaluated"]["mode"]["solved"]) == 1 + len(run["seeds"])
    assert joined["took"]["cpu"] == 2 * run["took"]["cpu"]


def test_targets_within_reach_are_those_of_the_sum_over_fingertips(tool):
    targets = np.zeros((4, 5, 3))
    targets[1, :, 0] = 0.027  # a root of summed squares of 0.0604 m: within 0.0625
    targets[2, :, 0] = 0.029  # 0.0648 m
    targets[3, 2] = 0.04  # 0.0693 m, by one fingertip
    assert tool.within_reach(targets, np.zeros((5, 3))) == 0.5
    assert tool.within_reach(targets, targets) == 1


@pytest.mark.slow
@pytest.mark.needs("motorgrad[myosuite]")
def test_fingertips_of_a_hand_are_compared_with_their_targets(tool, tmp_path):
    agent = {"policy": {"kind": "bounded-hyperplanes", "deviation": 0.1}}
    mg.train(mg.tasks.myosuite(tool.TASKS["hand"][0]), agent, 100, [0], tmp_path / "run", progress=False)
    table = tool.follow_table(tmp_path / "run", episodes=3)
    tips = [line.split()[1] for line in table.splitlines()[2:7]]
    assert tips == ["THtip_r", "IFtip_r", "MFtip_r", "RFtip_r", "LFtip_r"]
    assert "Within reach: 0%" in table
    mg.train(mg.make("linear-recruitment", units=2), steps=10, out=tmp_path / "other", progress=False)
    with pytest.raises(SystemExit, match="other has 2 actions: it must be a run that learned the hand"):
        tool.follow_table(tmp_path / "other")


@pytest.mark.slow
@pytest.mark.ci
@pytest.mark.needs("motorgrad[myosuite]")
@pytest.mark.parametrize(
    "learner", ["natural-network", pytest.param("ppo", marks=pytest.mark.needs("motorgrad[peers]"))]
)
def test_a_learner_learns_and_is_stored(tool, tmp_path, monkeypatch, learner):
    monkeypatch.setattr(tool, "EPISODES", 2)
    given = ["--steps", "400", "--seeds", "1", "--run", str(tmp_path / "run"), "--out", str(tmp_path)]
    tool.main(["learn", "finger", "--learner", learner, *given])
    found = json.loads((tmp_path / f"myosuite-finger-{learner}-400.json").read_text())
    assert found["learner"] == learner
    assert 0 <= found["evaluated"]["mode"]["solved"][0] <= 1
    assert len(found["curves"]["success"]) == 1
    assert found["took"]["cpu"] > 0
