"""A learner in a file of a user has the rights of one in the library: the file is that of the page on learners of one's
own, copied to a folder in which nothing else is."""

import importlib
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import motorgrad as mg
from motorgrad.cli import main
from motorgrad.learning import Learner
from motorgrad.schema import PART_CLASSES

PAGE = Path(__file__).parents[1] / "docs" / "write-your-own-learner.md"
CODE = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)[0]
SETTINGS = {"kind": "cross-entropy", "population": 6, "window": 10}
KIND = ("--agent.kind", "cross-entropy", "--agent.population", "6", "--agent.window", "10")
IMPORTING = ("--import", "cross_entropy")


@pytest.fixture(autouse=True)
def _file(tmp_path, monkeypatch):
    """A folder with the file alone, which is imported anew, and leaves nothing behind."""
    (tmp_path / "cross_entropy.py").write_text(CODE, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.delitem(sys.modules, "cross_entropy", raising=False)
    known = dict(PART_CLASSES[Learner])
    yield
    PART_CLASSES[Learner].clear()
    PART_CLASSES[Learner].update(known)
    sys.modules.pop("cross_entropy", None)


def same(found, wanted):
    assert found.complete
    for name in set(wanted.metrics.column_names) - {"wall_time", "cpu_time"}:
        column, other = (run.metrics[name].to_numpy() for run in (found, wanted))
        np.testing.assert_array_equal(np.stack(column), np.stack(other), err_msg=name)
    np.testing.assert_array_equal(weights(found.policies), weights(wanted.policies))


def weights(policies: Any) -> np.ndarray:
    return np.asarray(policies.weights)


def imported():
    sys.path.append(str(Path.cwd()))
    importlib.import_module("cross_entropy")


def test_it_is_short():
    assert len([line for line in CODE.splitlines() if line.strip()]) <= 60


def test_it_is_listed_and_its_settings_are_options(capsys):
    assert main([*IMPORTING, "list"]) == 0
    assert "cross-entropy " in capsys.readouterr().out
    with pytest.raises(SystemExit, match="0"):
        main([*IMPORTING, "train", "three-state", *KIND, "--help-all"])
    assert "--agent.population INT" in capsys.readouterr().out
    for words, said in (
        (("--agent.population", "1"), "agent.population = 1: must be an integer of at least 2"),
        (("--agent.elit", "0.5"), "unknown setting of agent 'elit': did you mean 'elite'?"),
        (("--envs", "2"), "envs = 2: must be 1"),
    ):
        assert main([*IMPORTING, "train", "three-state", "--agent.kind", "cross-entropy", *words]) == 2
        assert said in capsys.readouterr().err


def test_a_policy_with_a_memory_is_refused_by_its_name():
    imported()
    with pytest.raises(ValueError, match="for CrossEntropySearch"):
        mg.agent_for("t-maze", SETTINGS)


def test_options_and_a_file_train_the_same_and_the_run_is_evaluated_without_the_file(capsys):
    words = ("--steps", "200", "--seeds", "2", "--out", "by-words")
    assert main([*IMPORTING, "train", "three-state", *KIND, *words]) == 0
    Path("ce.toml").write_text(
        'steps = 200\nseeds = 2\nout = "by-file"\n[task]\nname = "three-state"\n'
        '[agent]\nkind = "cross-entropy"\npopulation = 6\nwindow = 10\n',
        encoding="utf-8",
    )
    assert main([*IMPORTING, "train", "--config", "ce.toml"]) == 0
    same(mg.load("by-file"), mg.load("by-words"))
    assert mg.load("by-words").config["agent"]["population"] == 6
    del PART_CLASSES[Learner]["cross-entropy"]
    assert main(["evaluate", "by-words", "--steps", "10"]) == 0
    capsys.readouterr()
    assert main(["train", "--resume", "by-words", "--steps", "300"]) == 2
    assert "import the module that registers your own first" in capsys.readouterr().err


def test_its_numbers_are_swept_in_one_call():
    imported()
    swept = mg.train("three-state", SETTINGS, steps=300, seeds=2, sweep={"rate": [0.0, 0.7]}, progress=False)
    still, moved = swept.split()
    alone = mg.train("three-state", {**SETTINGS, "rate": 0.7}, steps=300, seeds=2, progress=False)
    np.testing.assert_allclose(weights(moved.policies), weights(alone.policies), rtol=1e-5)
    np.testing.assert_array_equal(weights(still.policies), weights(still.initial))


KILLED = """
import os, signal, sys
import cross_entropy
import motorgrad as mg

def die(report):
    if report.decision >= 350:
        os.kill(os.getpid(), signal.SIGKILL)

agent = {"kind": "cross-entropy", "population": 6, "window": 10}
about = {"steps": 600, "seeds": 2, "window": 50, "progress": False}
mg.train(sys.argv[1], agent, out="killed", checkpoint_every=0, callbacks=die, **about)
"""


@pytest.mark.ci
@pytest.mark.parametrize("task", ["three-state", "hopper"])  # a compiled world, and physics on the host
def test_a_killed_run_goes_on_bit_for_bit(task, compiled_environment):
    python = [str(Path.cwd()), os.environ.get("PYTHONPATH", "")]
    environment = compiled_environment | {"PYTHONPATH": os.pathsep.join(filter(None, python))}
    done = subprocess.run([sys.executable, "-c", KILLED, task], env=environment)
    assert done.returncode == -signal.SIGKILL
    assert 0 < mg.load("killed").decision < 350
    imported()
    whole = mg.train(task, SETTINGS, steps=600, seeds=2, window=50, progress=False)
    same(mg.resume("killed", progress=False), whole)


def test_policies_that_are_given_are_where_it_starts():
    imported()
    first = mg.train("three-state", SETTINGS, steps=300, seeds=2, progress=False)
    settings = {**SETTINGS, "rate": 0.0}  # so that the mean stays
    again = mg.train("three-state", settings, steps=300, initial=first, progress=False)
    np.testing.assert_array_equal(weights(again.policies), weights(first.policies))


def test_timsim_shows_it_and_moves_its_numbers():
    live = pytest.importorskip("timsim.live")
    imported()
    stepper = mg.training.stepper_for(mg.make("hopper"), mg.agent_for("hopper", SETTINGS), seeds=[0])
    stepper.advance(30)
    stepper.set_number("elite", 0.5)
    stepper.advance(100)
    assert np.isfinite(weights(stepper.policies())).all()
    assert live.setup_of("hopper", agent=mg.agent_for("hopper", SETTINGS)) is not None


@pytest.mark.ci
def test_it_learns():
    imported()
    settings = {"kind": "cross-entropy", "population": 20, "window": 50}
    run = mg.train("three-state", settings, steps=20_000, seeds=20, progress=False)
    _, rewards = run.curve("reward")
    tenth = rewards.shape[1] // 10
    # the page says 0.53 and 0.72 [0.69 … 0.73]
    assert np.median(rewards[:, :tenth].mean(axis=1)) < 0.6
    assert np.quantile(rewards[:, -tenth:].mean(axis=1), 0.25) > 0.66
