"""Running studies in this process: what is in the folder, how a study continues, and what becomes of failures."""

import json
import threading

import jax
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from study_examples import assert_same_study, small

import motorgrad as mg
from motorgrad._errors import counted
from motorgrad.cli import main
from motorgrad.studies import Study, _driver, _partition, run_study
from motorgrad.studies._folder import StudyFolder
from motorgrad.studies._page import write_page
from motorgrad.training import RunDirectoryError, RunWarning, final_metrics
from motorgrad.training.store import warn_of_reading


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A study that has run here without a break."""
    return small().run(tmp_path_factory.mktemp("done") / "study", progress=False)


def test_every_job_is_the_run_that_train_would_make(done):
    assert done.complete
    for job in done.study.jobs:
        wanted = mg.train("three-state", job.agent, 400, 2, sweep=job.sweep, window=100, progress=False)
        expected = final_metrics(wanted)["reward"].reshape(-1, 2)
        np.testing.assert_array_equal(done.values("reward")[list(job.points)], expected)
        for point, part in zip(job.points, wanted.split(), strict=True):
            found = done.run(point)
            jax.tree.map(np.testing.assert_array_equal, found.policies, part.policies)
            assert found.config["agent"]["estimator"]["baseline"] == part.config["agent"]["estimator"]["baseline"]


def test_the_table_has_a_row_for_every_setting_and_seed(done):
    table = done.table
    assert table.num_rows == 8 * 2
    assert set(table["status"].to_pylist()) == {"done"}
    assert set(table["decision"].to_pylist()) == {400}
    for row in table.to_pylist():
        setting = done.study.settings[row["point"]]
        assert {path: row[path] for path in setting} == setting
    assert done.metrics == ["reward"]
    with pytest.raises(ValueError, match="did you mean 'reward'"):
        done.values("rewrd")


def test_the_index_is_made_again_from_the_run_directories(done):
    file = done.path / "index.parquet"
    before = file.read_bytes()
    for content in (None, b"damaged"):
        file.unlink() if content is None else file.write_bytes(content)
        assert Study.load(done.path).table.equals(done.table)
    run_study(done.study, done.path, progress=False)
    assert file.read_bytes() == before
    assert Study.load(done.path).table.equals(done.table)


STRANGE = {
    "no columns": lambda table: pa.table({"a": [1]}),
    "no rows": lambda table: table.slice(0, 0),
    "few rows": lambda table: table.slice(0, 1),
    "no status": lambda table: table.drop_columns("status"),
    "words": lambda table: table.drop_columns("reward").append_column("reward", table["job"].cast(pa.string())),
    "twice": lambda table: table.append_column("reward", table["reward"]),
}


@pytest.mark.parametrize("change", STRANGE.values(), ids=STRANGE)
@pytest.mark.parametrize("marks", [None, [1], "x"])
def test_an_index_that_somebody_else_made_is_made_again(change, marks, done):
    file = done.path / "index.parquet"
    before = file.read_bytes()
    table = pq.read_table(file)
    kept = table.schema.metadata[b"marks"] if marks is None else json.dumps(marks)
    pq.write_table(change(table).replace_schema_metadata({"marks": kept}), file)
    try:
        assert Study.load(done.path).table.equals(done.table)
    finally:
        file.write_bytes(before)


@pytest.mark.parametrize(
    "content", ["[1]", '"x"', "{}", '{"job": ["a"], "attempts": 1, "message": "", "traceback": ""}']
)
def test_a_record_of_a_failure_that_says_nothing_is_refused_by_name(content, done):
    file = done.path / "failures" / "zz.json"
    file.write_text(content)
    try:
        with pytest.raises(ValueError, match=r"zz.json: damaged: must say which job failed, how often and why"):
            _ = done.failures
    finally:
        file.unlink()


def test_the_page_shows_words_that_are_no_text(done):
    """As those of a file whose name is not UTF-8."""
    file = done.path / "failures" / "zz.json"
    file.write_text(json.dumps({"job": "zz", "attempts": 1, "message": "\udcff", "traceback": ""}))
    page = (done.path / "index.html").read_bytes()
    try:
        write_page(StudyFolder(done.path), "reward", None)
        assert rb"\udcff" in (done.path / "index.html").read_bytes()
    finally:
        file.unlink()
        (done.path / "index.html").write_bytes(page)


def test_a_study_that_has_run_is_not_run_again(done, monkeypatch):
    monkeypatch.setattr(_partition, "train", None)
    assert run_study(done.study, done.path, progress=False).complete


def test_the_best_are_reported_over_seeds_that_did_not_choose_them(tmp_path):
    study = small(agent={"learning_rate": [0.001, 0.2]}, seeds=4)
    results = study.run(tmp_path / "study", progress=False)
    values = results.values("reward")
    first, second = results.best("reward")
    assert first.chosen_by.value >= second.chosen_by.value
    assert first.value.value == pytest.approx(values[first.point, 1::2].mean())
    assert first.chosen_by.value == pytest.approx(values[first.point, ::2].mean())
    assert first.settings == study.settings[first.point]
    (worst,) = results.best("reward", 1, direction="minimize", held_out=False, statistic="median")
    assert worst.value.value == pytest.approx(np.median(values, axis=1).min())


def test_settings_that_break_rank_last_and_it_is_said(tmp_path, capsys):
    text = """
    steps = 400
    seeds = 4
    window = 100
    [task]
    name = "linear-recruitment"
    [agent]
    learning_rate = [3e38, 0.001]
    """
    (tmp_path / "rates.toml").write_text(text)
    out = tmp_path / "study"
    with pytest.warns(RunWarning, match=r"of learning_rate = 3e\+38: parameters not finite"):
        assert main(["sweep", str(tmp_path / "rates.toml"), "--out", str(out), "--json", "-"]) == 0
    listed = json.loads(capsys.readouterr().out)["best"]
    results = Study.load(out)
    (count,) = results.broken.values()
    assert list(results.broken) == [0]
    assert [each["broken"] for each in listed] == [0, count]
    assert listed[1]["value"]["value"] is None
    for metric in ("reward", "error_count_total"):  # what is counted is known of them, too
        for direction in ("maximize", "minimize"):
            sound, broken = results.best(metric, direction=direction)
            assert (sound.point, sound.broken) == (1, 0)
            assert (broken.point, broken.broken) == (0, count)
            assert np.isnan(broken.value.value)
    page = (out / "index.html").read_text()
    assert f"1 of 2 settings rank last, with seeds whose parameters are not finite: {count}." in page
    assert f"{count} of 4 seeds not finite" in page
    assert main(["sweep", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert f"  unknown, mean of none: learning_rate = 3e+38 ({counted(count, 'seed')} not finite)" in said


@pytest.mark.ci
def test_a_report_beside_the_jobs_takes_no_warning_from_them(tmp_path, monkeypatch):
    """The page is being written, by a thread that gives no warnings, while a job gives one."""
    write, train, writing, warned = _driver.write_page, _partition.train, threading.Event(), threading.Event()

    def write_while_a_job_warns(*arguments):
        warn_of_reading("the page has read this")
        writing.set()
        assert warned.wait(60)
        write(*arguments)

    def train_and_warn(*arguments, **options):
        assert writing.wait(60)
        warn_of_reading("the job has read this")
        warned.set()
        return train(*arguments, **options)

    monkeypatch.setattr(_driver, "PAUSE", 0.01)
    monkeypatch.setattr(_driver, "write_page", write_while_a_job_warns)
    monkeypatch.setattr(_partition, "train", train_and_warn)
    with pytest.warns(RunWarning) as given:
        assert small().run(tmp_path / "study", progress=False).complete
    assert {str(each.message) for each in given} == {"the job has read this"}


def failing(monkeypatch, times, which="0001-three-state"):
    """Lets the training of one job fail a number of times."""
    train, calls = _partition.train, []

    def train_or_fail(*arguments, **options):
        if arguments[4].name == which:
            calls.append(which)
            if len(calls) <= times:
                raise RuntimeError(f"the disk is on fire, for the time number {len(calls)}")
        return train(*arguments, **options)

    monkeypatch.setattr(_partition, "train", train_or_fail)
    return calls


@pytest.mark.ci
def test_a_job_that_fails_is_tried_again(done, tmp_path, monkeypatch):
    calls = failing(monkeypatch, 2)
    results = small().run(tmp_path / "study", progress=False)
    assert len(calls) == 3
    assert not results.failures
    assert_same_study(results.path, done.path)


def test_a_job_that_fails_always_is_set_aside_and_the_others_go_on(done, tmp_path, monkeypatch):
    calls = failing(monkeypatch, 5)
    results = small().run(tmp_path / "study", progress=False, attempts=2)
    assert len(calls) == 2
    assert not results.complete
    (failure,) = results.failures
    assert failure["job"] == "0001-three-state"
    assert failure["attempts"] == 2
    assert failure["message"] == "RuntimeError: the disk is on fire, for the time number 2"
    assert "train_or_fail" in failure["traceback"]
    (file,) = (results.path / "failures").iterdir()
    assert json.loads(file.read_text()) == failure
    assert failure["settings"] == [results.study.settings[point] for point in failure["points"]]
    status = dict(zip(results.table["job"].to_pylist(), results.table["status"].to_pylist(), strict=True))
    assert sorted(status.values()) == ["done", "done", "done", "failed"]
    assert np.isnan(results.values("reward")).sum() == 4
    assert results.best("reward")
    # the same call tries it again
    monkeypatch.undo()
    results = small().run(tmp_path / "study", progress=False)
    assert not results.failures
    assert_same_study(results.path, done.path)


def test_a_folder_has_one_driver(tmp_path):
    with (
        StudyFolder(tmp_path / "study", small()),
        pytest.raises(RunDirectoryError, match="in use by another process, which drives this study"),
    ):
        small().run(tmp_path / "study", progress=False)


def test_a_folder_of_something_else_is_refused(done, tmp_path):
    with pytest.raises(RunDirectoryError, match="steps was 400 and is now 500; choose another folder"):
        small(steps=500).run(done.path, progress=False)
    (tmp_path / "letter.txt").write_text("dear")
    with pytest.raises(RunDirectoryError, match="holds other files and no study"):
        small().run(tmp_path, progress=False)
    with pytest.raises(RunDirectoryError, match="not the folder of a study"):
        Study.load(tmp_path)


def test_unknown_places_are_refused(tmp_path):
    with pytest.raises(ValueError, match="did you mean 'processes'"):
        small().run(tmp_path / "study", on="process")


def test_a_study_from_elsewhere_imports_nothing_unasked(tmp_path):
    study = tmp_path / "study.toml"
    study.write_text('[task]\nname = "gymnasium"\nenv_id = "a_module_of_nobody:Env-v0"\n')
    with pytest.raises(mg.training.NotTrusted, match="a_module_of_nobody"):
        Study.read(study)
    with pytest.raises(mg.training.NotTrusted, match="a_module_of_nobody"):
        Study.load(tmp_path)
