"""The torture of `make torture`, shorter; and that it would notice."""

import importlib
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from training_examples import NEVER, sign

import motorgrad as mg

ROOT = Path(__file__).parents[2]
SETTINGS = {"steps": 40, "seeds": 2, "window": 20, "checkpoint_every": NEVER, "progress": False}


@pytest.fixture(scope="module")
def torture():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT)
        yield importlib.import_module("tools.torture._training")


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return mg.train("chain", **SETTINGS, out=tmp_path_factory.mktemp("run")).path


@pytest.fixture
def twin(run, tmp_path):
    """A copy of the run, to be altered."""
    return Path(shutil.copytree(run, tmp_path / "twin"))


def alter_metrics(path, name, change):
    (part,) = (path / "metrics").glob("*.parquet")
    table = pq.read_table(part)
    column = change(table[name].to_numpy().copy())
    pq.write_table(table.set_column(table.column_names.index(name), name, [column]), part)
    sign(path)


@pytest.mark.slow
@pytest.mark.parametrize("test", ["kill world", "kill timlab", "kill timsim", "damage world"])
def test_an_attack_passes_and_is_counted(test, compiled_environment, tmp_path):
    record = tmp_path / "record.json"
    command = [sys.executable, "-m", "tools.torture", test, "--count", "3", "--record", str(record)]
    for session in (1, 2):
        done = subprocess.run(command, env=compiled_environment, cwd=ROOT, capture_output=True, text=True, timeout=3600)
        assert done.returncode == 0, done.stdout + done.stderr
        found = json.loads(record.read_text())["tests"][test]
        assert found["failed"] == 0
        assert (found["sessions"], sum(found["outcomes"].values())) == (session, 3 * session)


def test_wall_time_is_no_difference(torture, run, twin):
    assert list(torture.differences(twin, run)) == []
    alter_metrics(twin, "wall_time", lambda values: values + 1)
    assert list(torture.differences(twin, run)) == []


def test_a_difference_in_the_last_bit_of_a_record_is_named(torture, run, twin):
    alter_metrics(
        twin, "reward", lambda values: np.where(np.arange(4) == 2, np.nextafter(values, np.float32(9)), values)
    )
    (said,) = torture.differences(twin, run)
    assert said.startswith("metrics, reward: 1 of 4 numbers, the first at 2: ")


def test_a_lost_record_is_named(torture, run, twin):
    (part,) = (twin / "metrics").glob("*.parquet")
    pq.write_table(pq.read_table(part)[:2], part)
    sign(twin)
    assert "metrics, reward: float32(2,), not float32(4,)" in list(torture.differences(twin, run))


def test_another_learner_is_named(torture, run, tmp_path):
    task = mg.make("chain")
    agent = mg.agent_for(task, learning_rate=0.123)
    said = list(torture.differences(mg.train(task, agent, **SETTINGS, out=tmp_path).path, run))
    assert said[0] == "config.toml"
    assert any(line.startswith("metrics, parameters: ") for line in said)
    assert any(line.startswith("final state, cycle.agent.policy.") for line in said)


def test_a_command_that_fails_is_a_failure(torture, tmp_path):
    torture.log_of(tmp_path / "run").write_text("no such thing")
    child = subprocess.Popen([sys.executable, "-c", "raise SystemExit(3)"])
    with pytest.raises(torture.Failure, match="run: the command ended with 3:\nno such thing"):
        torture.finish(child, tmp_path / "run")


@pytest.mark.parametrize(
    ("left", "place"),
    [
        ([], "before learning"),
        (["provenance.json"], "while learning"),
        (["provenance.json", "metrics/.000000000020-000000000040.parquet.partial"], "during a commit"),
        (["provenance.json", "checkpoint/.000000000020.state.partial"], "during a commit"),
        (["provenance.json", "metrics/000000000020-000000000060.parquet"], "during a commit"),
    ],
)
def test_where_a_kill_fell_is_told_from_what_it_left(left, place, torture, run, twin):
    old = torture.leftovers(twin)
    for name in left:
        sessions = '{"sessions": [1, 2]}'
        (twin / name).write_text(sessions if name == "provenance.json" else "")
    assert torture.where_hit(twin, 1, old) == place
