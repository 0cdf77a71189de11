"""`motorgrad sweep`."""

import json
import subprocess
import sys

import pytest

from motorgrad.cli import main
from motorgrad.studies import Search, Study

TEXT = """
steps = 400
seeds = 4
window = 100

[task]
name = ["three-state", "chain"]

[agent]
learning_rate = [0.001, 0.2]
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "rates.toml"
    path.write_text(TEXT)
    return path


@pytest.mark.ci
def test_a_study_runs_and_its_best_settings_are_printed(file, tmp_path, capsys):
    assert main(["sweep", str(file)]) == 0
    folder = tmp_path / "runs" / "rates"
    out, err = capsys.readouterr()
    assert "4 settings × 4 seeds × 400 decisions in 2 compiled calls" in err
    results = Study.load(folder)
    for task in results.tasks:
        best = results.best(where=task)[0]
        assert f"{best.value.words()}: learning_rate = {best.settings['agent.learning_rate']:g}" in out
    # the folder knows its study
    assert main(["sweep", "--out", str(folder), "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["complete"]
    assert [each["settings"]["task.name"] for each in found["best"]] == ["three-state"] * 2 + ["chain"] * 2


def test_check_says_what_would_run_and_runs_nothing(file, tmp_path, capsys):
    with pytest.raises(SystemExit):
        main(["sweep", str(file), "--check"])
    out, err = capsys.readouterr()
    assert "in 2 compiled calls" in err
    copy = tmp_path / "copy.toml"
    copy.write_text(out)
    assert Study.read(copy) == Study.read(file)
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "--out the folder of one"),
        (["FILE", "--on", "rey"], "did you mean 'ray'"),
        (["FILE", "--address", "auto"], "address = 'auto': must be left out, unless --on ray"),
        (["FILE", "--slurm", "partition=cpu"], "must be left out, unless --on slurm"),
        pytest.param(
            ["FILE", "--on", "slurm", "--slurm", "partition"],
            "must be a name and a value",
            marks=pytest.mark.needs("motorgrad[slurm]"),
        ),
        (["nowhere.toml"], "nowhere.toml: cannot be read"),
        (["FILE", "--attempts", "0"], "attempts = 0"),
    ],
)
def test_impossible_options_are_refused(file, words, said, capsys):
    assert main(["sweep", *(str(file) if word == "FILE" else word for word in words)]) == 2
    assert said in capsys.readouterr().err


def test_an_impossible_setting_is_refused_with_the_file(file, tmp_path, capsys):
    file.write_text(TEXT.replace("learning_rate", "learning_rat"))
    assert main(["sweep", str(file)]) == 2
    said = capsys.readouterr().err
    assert str(file) in said
    assert "did you mean 'learning_rate'" in said
    assert not (tmp_path / "runs").exists()


def test_a_file_with_a_search_is_searched(file, tmp_path, capsys):
    pytest.importorskip("optuna", reason="searches need motorgrad[search]")
    text = TEXT.replace('["three-state", "chain"]', '"three-state"').replace(
        "[0.001, 0.2]", "{low = 0.001, high = 0.2}"
    )
    file.write_text(text + "\n[search]\ntrials = 2\nbatch = 2\n")
    assert main(["sweep", str(file), "--out", "found"]) == 0
    out, err = capsys.readouterr()
    assert "a search of 2 trials, 2 at a time, × 4 seeds × 400 decisions" in err
    best = Search.load("found").best()
    assert [f"{each.value.words()}: learning_rate" in out for each in best] == [True, True]
    file.write_text(text + "\n[search]\ntrails = 2\n")
    assert main(["sweep", str(file)]) == 2
    assert "did you mean 'trials'" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.ci
def test_workers_know_the_modules_of_import(file, tmp_path, compiled_environment):
    (tmp_path / "mine.py").write_text(
        "from motorgrad.tasks import TASKS, ThreeState\n\n\n"
        "class Mine(ThreeState):\n    name = 'mine'\n\n\nTASKS['mine'] = Mine\n"
    )
    file.write_text(TEXT.replace('["three-state", "chain"]', '"mine"'))
    command = [sys.executable, "-m", "motorgrad", "--import", "mine", "sweep", str(file), "--on", "processes"]
    done = subprocess.run(
        [*command, "--workers", "1"], cwd=tmp_path, env=compiled_environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr + done.stdout
    assert "done" in done.stdout
