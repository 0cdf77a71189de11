"""`motorgrad plot`: its options, its numbers for machines, its event files."""

import json
import re
from pathlib import Path

import pytest

import motorgrad as mg
from motorgrad.cli import main
from motorgrad.training import learning_curves


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Two runs in folders of the same name, and one of another task."""
    path = tmp_path_factory.mktemp("runs")
    for name, penalty in (("a", 0.1), ("b", 0.3)):
        task = mg.make("hopper", penalty=penalty)
        mg.train(task, steps=120, seeds=2, window=20, out=path / name / "demo", progress=False)
    mg.train("chain", steps=60, seeds=2, window=20, out=path / "chain", progress=False)
    return path


def status(*arguments):
    """The exit status of `motorgrad plot`, however it leaves."""
    try:
        return main(["plot", *map(str, arguments)])
    except SystemExit as left:
        return left.code


def texts(path):
    return re.findall(r"<text[^>]*>([^<]*)</text>", Path(path).read_text())


@pytest.mark.ci
def test_the_options_are_those_of_the_library(runs, tmp_path):
    both = [runs / name / "demo" for name in "ab"]
    options = ["--quantity", "reward", "apex", "--x", "decisions", "--smooth", 40, "--labels", "before", "after"]
    assert status(*both, *options, "--out", "c", "--format", "svg") == 0
    learning_curves(
        [mg.load(path) for path in both],
        ["reward", "apex"],
        "library.svg",
        x="decisions",
        smooth=40,
        labels=["before", "after"],
    )
    assert Path("c.svg").read_bytes() == Path("library.svg").read_bytes()
    assert {"before", "after", "decisions"} <= set(texts("c.svg"))


def test_runs_are_told_apart_by_what_differs(runs):
    assert status(runs / "a" / "demo", runs / "b" / "demo", "--out", "c.svg") == 0
    assert {"penalty 0.1", "penalty 0.3", "simulated time (s)"} <= set(texts("c.svg"))


@pytest.mark.ci
def test_the_figure_goes_into_the_first_run_by_default(runs, capsys):
    assert status(runs / "b" / "demo", runs / "chain", "--quantity", "baseline", "--format", "pdf") == 0
    file = runs / "b" / "demo" / "figures" / "baseline.pdf"
    assert file.read_bytes().startswith(b"%PDF")
    assert f"drawn to {file}" in capsys.readouterr().out


def test_the_numbers_drawn_for_machines(runs, capsys):
    assert status(runs / "a" / "demo", "--quantity", "reward", "apex", "--smooth", 0.4, "--json", "-") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["figure"] == str(runs / "a" / "demo" / "figures" / "reward-apex.png")
    assert found["runs"] == [str(runs / "a" / "demo")]
    assert (found["x"], found["smooth"]) == ("simulated", 0.4)
    figure = learning_curves([mg.load(runs / "a" / "demo")], ["reward", "apex"], smooth=0.4)
    assert found["curves"] == [curve.table() for curve in figure.curves]
    first = found["curves"][0]
    assert (first["label"], first["quantity"], first["window"], first["seeds"]) == ("demo", "reward", 20, 2)
    assert first["x"] == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0, 1.2])
    low, median, high = figure.curves[0].quartiles
    assert [first[k] for k in ("lower_quartile", "median", "upper_quartile")] == [list(low), list(median), list(high)]


@pytest.mark.parametrize("folder", [pytest.param(None, marks=pytest.mark.ci), "events"])
def test_event_files_are_written_into_each_run_or_together(folder, runs, capsys):
    pytest.importorskip("tensorboard", reason="needs the extra motorgrad[tensorboard]")
    both = [runs / "a" / "demo", runs / "b" / "demo"]
    assert status(*both, "--out", "c.png", "--json", "j.json", "--tensorboard", *([folder] if folder else [])) == 0
    where = [Path("events/a/demo"), Path("events/b/demo")] if folder else [path / "tensorboard" for path in both]
    for path in where:
        assert sorted(file.parent.name for file in path.rglob("*tfevents*")) == ["seed-0", "seed-1"]
    assert json.loads(Path("j.json").read_text())["tensorboard"] == [str(path) for path in where]
    assert f"event files in {where[1]}" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (["--x", "simulated"], "the task chain has no simulated time"),
        (["--x", "days"], "unknown x 'days': known are cpu, decisions, simulated, wall"),
        (["--smooth", 20], "smooth = 20.0: must be more than a record, which is 20 decisions"),
        (["--smooth", "nan"], "smooth = nan"),
        (["--labels", "a", "b"], "labels = ('a', 'b'): must be 1 different words"),
        (["--format", "gif"], "unknown format 'gif': known are pdf, png, svg"),
        (["--out", "c.png", "--format", "svg"], "format = 'svg': must be 'png'"),
        (["--tensorboard", "a", "b"], "must be one folder, or none"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_a_line(options, named, runs, tmp_path, capsys):
    assert status(runs / "chain", *options) == 2
    said = capsys.readouterr()
    assert named in said.out + said.err
    assert not list(tmp_path.iterdir())


def test_a_missing_tensorboard_is_said_before_anything_is_drawn(runs, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert status(runs / "chain", "--out", "c.png", "--tensorboard") == 2
    assert "motorgrad plot: event files need the package tensorboard: pip install" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
