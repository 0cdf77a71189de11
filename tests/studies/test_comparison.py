"""A comparison runs, resumes bit for bit after a kill, and says what its runs say."""

import json
import os
import signal
import subprocess
import sys

import numpy as np
import pytest
import tomli_w
from study_examples import assert_same_study, checkpoints, wait_for
from test_comparison_settings import TABLE, made
from test_studies_page import text_of

import motorgrad as mg
from motorgrad.cli import main
from motorgrad.statistics import distribution_scores, interquartile_mean, percentile_range
from motorgrad.studies import Comparison, Study
from motorgrad.training import RunDirectoryError, RunWarning

pytestmark = [pytest.mark.slow, pytest.mark.ci]


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A comparison that has run here without a break."""
    return made().run(tmp_path_factory.mktemp("done") / "it", progress=False)


def test_settings_are_chosen_on_some_seeds_and_judged_on_others(done):
    tuning, judging = (Study.load(done.path / name) for name in ("tuning", "judging"))
    assert (tuning.study.seed_list, judging.study.seed_list) == ([0, 1], [2, 3, 4])
    for pair, chosen in done.chosen.items():
        tried = done.tried(pair)
        assert chosen["tuned"] == tried.mean(axis=1).argmax()
        np.testing.assert_array_equal(tried, tuning.values("reward")[done.points("tuning", pair)])
        agent = done.comparison.settings(*pair)[chosen["tuned"]]
        task = done.comparison.tasks[pair[1]]
        run = mg.train(task.made, agent, done.steps[pair], [2, 3, 4], window=100, progress=False)
        np.testing.assert_allclose(done.earned(pair), run.final("reward", 0.1), rtol=1e-6)
        np.testing.assert_allclose(done.curve(pair)[1], run.curve("reward")[1], rtol=1e-6)


def test_one_setting_for_all_tasks_is_the_best_by_its_mean_score(done):
    for method in done.methods:
        means, shares = [], []
        for task in done.comparison.tasks:
            tried, pool = done.tried((method, task)), done.pools[task]
            low, high = (0.5, 0.8) if task == "three-state" else percentile_range(pool.mean(axis=1))
            means.append((tried.mean(axis=1) - low) / (high - low))
            shares.append(distribution_scores(tried, pool).mean(axis=1))
        assert done.chosen[method, "short"]["shared"] == np.mean(means, axis=0).argmax()
        assert done.chosen[method, "short"]["benchmark"] == np.mean(shares, axis=0).argmax()


def test_the_tables_say_what_the_scores_say(done):
    tables = {name: table.to_pylist() for name, table in done.tables.items()}
    for row in tables["summary"]:
        if row["statistic"] == "interquartile mean":
            scores = done.scores(row["method"], row["scored"], row["chosen"])
            assert row["value"] == pytest.approx(interquartile_mean(scores))
            assert row["low"] <= row["value"] <= row["high"]
    assert {row["scored"] for row in tables["summary"]} == {"final", "online", "frozen", "frozen-mode"}
    (cost,) = (row for row in tables["cost"] if row["method"] == "tuned trace")
    assert (cost["settings"], cost["tuning_runs"], cost["tuning_decisions"]) == (4, 16, 4 * 2 * (400 + 200))
    assert cost["tuning_cpu_seconds"] > 0
    one, other = (row["probability"] for row in tables["improvement"])
    assert one + other == pytest.approx(1)
    curve = [row for row in tables["curves"] if (row["method"], row["task"]) == ("OLGARB", "short")]
    assert [row["decision"] for row in curve] == [100, 200]
    assert all(row["cpu_time"] > 0 and row["simulated_time"] is None for row in curve)
    assert all((done.path / "tables" / f"{name}.csv").is_file() for name in tables)


def test_the_page_has_every_method_and_number(done):
    words = text_of(done.path / "index.html")
    assert "2 methods on 2 tasks, 200 to 400 decisions a run. 2 seeds chose the settings" in words
    for method in TABLE["methods"]:
        assert method in words
    row = next(row for row in done.summary.to_pylist() if row["chosen"] == "tuned")
    assert f"{row['value']:.3f}".replace("-", "−") in words or f"{row['value']:.3g}".replace("-", "−") in words
    content = (done.path / "index.html").read_text()
    assert "#0a0b" not in content
    assert "#010203" not in content
    assert "<script" not in content
    assert "http-equiv" not in content


def test_a_figure_stands_alone(done):
    from xml.etree import ElementTree

    figures = done.figures
    assert {"ranking", "profiles", "plane", "tuning", "dimension", "curves-short"} <= set(figures)
    for svg in figures.values():
        words = "".join(ElementTree.fromstring(svg).itertext())
        assert all(method in words for method in TABLE["methods"])
        assert "--c0: #" in words
        assert "#0a0b" not in svg


def test_the_command_prints_the_ranking(done, tmp_path, capsys):
    file = tmp_path / "it.toml"
    file.write_text(tomli_w.dumps(TABLE))
    assert main(["compare", str(file), "--out", str(done.path)]) == 0
    assert "interquartile means of normalized scores" in capsys.readouterr().out
    assert main(["compare", "--out", str(done.path), "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["complete"]
    assert {row["method"] for row in found["ranking"]} == set(TABLE["methods"])
    with pytest.raises(RunDirectoryError, match="evaluate was 50 and is now 60"):
        made(evaluate=60).run(done.path)


def test_a_method_that_breaks_has_no_score_and_ranks_last(tmp_path, capsys):
    tables = {"tasks": {"call-admission": {}}, "agent": {}, "steps": 200, "window": 100}
    methods = {"bursts": {"learning_rate": 3e38}, "learns": {"learning_rate": 0.01}}
    file = tmp_path / "it.toml"
    file.write_text(tomli_w.dumps({**TABLE, **tables, "methods": methods}))
    out = tmp_path / "it"
    with pytest.warns(RunWarning, match="not finite"):
        assert main(["compare", str(file), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "  unknown: bursts (3 of 3 runs not finite: last)" in said
    assert main(["compare", "--out", str(out), "--json", "-"]) == 0
    rows = json.loads(capsys.readouterr().out)["ranking"]
    assert [(row["method"], row["broken"], row["value"] is None) for row in rows] == [
        ("learns", 0, False),
        ("bursts", 3, True),
    ]
    assert "bursts 3 of 3 runs not finite unknown" in text_of(out / "index.html")
    methods["learns"] = {"learning_rate": 3e38, "decay": 0.1}
    with (
        pytest.warns(RunWarning, match="not finite"),
        pytest.raises(ValueError, match=r"tasks\.call-admission: no setting of any method has a finite reward"),
    ):
        made(**tables, methods=methods).run(tmp_path / "none", progress=False)


def test_a_budget_in_seconds_becomes_decisions_that_are_kept(tmp_path):
    tasks = {"three-state": {}}
    settings = {"steps": None, "seconds": 1e-3, "tasks": tasks, "methods": ["olgarb"], "agent": {"decay": 0.5}}
    found = made(**settings).run(tmp_path / "it", progress=False)
    (steps,) = found.steps.values()
    assert steps >= 10
    assert found.stages["judging"].study.points[0]["steps"] == steps
    assert Comparison.load(found.path).steps == found.steps
    assert made(**settings).run(tmp_path / "it", progress=False).steps == found.steps


def test_a_killed_comparison_continues_bit_for_bit(done, tmp_path, compiled_environment):
    file, folder = tmp_path / "it.toml", tmp_path / "it"
    file.write_text(tomli_w.dumps(TABLE))
    command = [sys.executable, "-m", "motorgrad", "compare", str(file), "--out", str(folder)]
    for stage in ("tuning", "judging"):
        driver = subprocess.Popen(command, env=compiled_environment, stderr=subprocess.DEVNULL)
        wait_for(lambda stage=stage: checkpoints(folder / stage))
        os.kill(driver.pid, signal.SIGKILL)
        driver.wait()
        assert not (folder / "tables").exists()
    again = made().run(folder, progress=False)
    for stage in ("tuning", "judging"):
        assert_same_study(folder / stage, done.path / stage)
    assert again.summary.equals(done.summary)
    assert again.chosen == done.chosen
