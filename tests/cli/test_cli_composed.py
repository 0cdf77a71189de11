"""A task in one file, on the command line: train, resume, evaluate, watch."""

import re
import sys
import tomllib

import numpy as np
import pytest

import motorgrad as mg
from motorgrad.cli import main
from motorgrad.schema import PART_CLASSES
from motorgrad.tasks import terms
from timsim._commands.sim import prepared

REACH = """
body = "arm.xml"
actions = "binary"
time_limit = 0.2
targets = ["reach"]
observe = ["joint-positions", "target-error"]
reward = ["distance", { kind = "effort", weight = -0.1 }]
reset = ["random-joints"]
metrics = ["distance"]
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A working folder, with the task in another one beside its model."""
    (tmp_path / "tasks").mkdir()
    (tmp_path / "tasks" / "arm.xml").write_bytes(mg.bodies.BUNDLED["arm6"].read_bytes())
    (tmp_path / "tasks" / "reach.toml").write_text(REACH)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def status(*arguments):
    try:
        return main([str(argument) for argument in arguments])
    except SystemExit as left:
        return left.code


@pytest.mark.ci
def test_a_task_in_a_file_is_trained_resumed_and_evaluated(folder, capsys):
    task = mg.tasks.load("tasks/reach.toml")
    run = ("--seeds", 2, "--agent.decay", 0.8)
    assert status("train", "--task", "tasks/reach.toml", "--steps", 15, *run) == 0
    assert mg.load("runs/reach").task == task
    assert status("train", "--resume", "runs/reach", "--steps", 30) == 0
    whole = mg.train(task, {"decay": 0.8}, steps=30, seeds=2, progress=False)
    np.testing.assert_array_equal(mg.load("runs/reach").policies.pool.weights, whole.policies.pool.weights)
    assert status("evaluate", "runs/reach", "--steps", 20, "--json", "found.json") == 0
    assert "distance: median" in capsys.readouterr().out


def test_options_of_the_task_and_its_learner_go_with_the_file(folder, capsys):
    options = ("--task.time-limit", 1, "--agent.policy", "bounded-hyperplanes", "--task.actions", "continuous")
    assert status("train", "--task=tasks/reach.toml", *options, "--check") == 0
    found = tomllib.loads(capsys.readouterr().out)
    assert found["out"] == "runs/reach"
    assert found["task"]["time_limit"] == 1
    assert found["task"]["actions"] == "continuous"
    assert found["task"]["body"]["source"] == str(folder / "tasks" / "arm.xml")
    assert [term["kind"] for term in found["task"]["rewards"]] == ["distance", "effort"]
    (folder / "all.toml").write_text(
        f'steps = 5\n[task]\nname = "composed"\n{REACH.replace("arm.xml", "tasks/arm.xml")}'
    )
    assert status("train", "--config", "all.toml", "--check") == 0
    assert tomllib.loads(capsys.readouterr().out)["task"]["body"]["source"] == str(folder / "tasks" / "arm.xml")


@pytest.mark.ci  # it compiles the laws of the muscles
def test_hill_muscles_of_a_file_are_those_of_its_model(folder, capsys):
    (folder / "tasks" / "hill.toml").write_text(
        REACH.replace(
            '"arm.xml"',
            '{ source = "arm.xml", muscle_model = "hill", tendon = "rigid", hill = [["elbow*", '
            "{ max_isometric_force = 300, optimal_fiber_length = 0.1, tendon_slack_length = 0.1 }]] }",
        )
    )
    assert status("train", "--task", "tasks/hill.toml", "--check") == 0
    assert tomllib.loads(capsys.readouterr().out)["task"]["body"]["muscle_model"] == "hill"
    body = mg.tasks.load("tasks/hill.toml").body
    assert (len(body.hill), body.model.na) == (1, 8)  # the elbow's two have compliant tendons


@pytest.mark.ci
def test_hill_muscles_are_options_of_bodies(capsys):
    options = {"muscle-model": "hill", "tendon": "rigid", "curves": "millard"}
    flags = [word for name, value in options.items() for word in (f"--task.body.{name}", value)]
    assert status("train", "hopper", *flags, "--check") == 0
    found = tomllib.loads(capsys.readouterr().out)["task"]["body"]
    assert [found[name.replace("-", "_")] for name in options] == [*options.values()]


def test_the_page_of_a_task_has_the_name_of_its_file(folder):
    assert prepared(["--task", "tasks/reach.toml"])[0].name == "reach"
    assert prepared(["hopper"])[0].name == "hopper"


def test_a_module_may_be_imported_after_the_command(folder, monkeypatch, capsys):
    (folder / "my_terms.py").write_text(
        "from motorgrad.tasks import terms\n"
        "terms.register(terms.Quantity, 'none-at-all', lambda scene: lambda now: now.time)\n"
    )
    (folder / "tasks" / "reach.toml").write_text(REACH.replace('metrics = ["', 'metrics = ["none-at-all", "'))
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setitem(PART_CLASSES, terms.Quantity, {**PART_CLASSES[terms.Quantity]})
    assert status("train", "--task", "tasks/reach.toml", "--check") == 2
    assert status("train", "--task", "tasks/reach.toml", "--import", "my_terms", "--check") == 0
    assert "none-at-all" in capsys.readouterr().out
    assert status("train", "--import=nope", "--task", "tasks/reach.toml") == 2
    assert "No module named 'nope'" in capsys.readouterr().err


def test_what_is_wrong_in_the_file_is_one_line(folder, capsys):
    for change, told in (
        (("target-error", "target-eror"), "reach.toml: .*'target-eror': did you mean 'target-error'"),
        (("arm.xml", "leg.xml"), "reach.toml: .*leg.xml.*must be an existing MJCF file"),
        (
            ('"reach"', '{ kind = "reach", at = [0.1, nan, 0.0] }'),
            r"targets\[0\].at\[1\] = nan: must be a finite number",
        ),
        (("time_limit", "time_limt"), "'time_limt': did you mean 'time_limit'"),
    ):
        (folder / "tasks" / "reach.toml").write_text(REACH.replace(*change))
        capsys.readouterr()
        code = status("train", "--task", "tasks/reach.toml", "--check")
        assert code == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        assert re.search(told, error), error
    assert status("train", "hopper", "--task", "tasks/reach.toml") == 2
    assert status("train", "--task", "nowhere.toml") == 2
