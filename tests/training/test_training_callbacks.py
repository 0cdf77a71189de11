"""Callbacks of a training: what they are told, that they change no number, and that they may end it."""

import numpy as np
import pytest

import motorgrad as mg
from motorgrad.training import EarlyStopping, Report

STEPS, WINDOW = 400, 100


def trained(**settings):
    return mg.train("three-state", steps=STEPS, seeds=2, window=WINDOW, progress=False, **settings)


def without_times(run):
    return run.metrics.drop_columns(["wall_time", "cpu_time"])


def test_a_callback_gets_every_record_once_and_changes_no_number():
    reports = []
    run = trained(callbacks=reports.append)
    assert [report.decision for report in reports] == [100, 200, 300, 400]
    for index, report in enumerate(reports):
        assert (report.task, report.steps, report.seeds, report.path) == ("three-state", STEPS, [0, 1], None)
        for name in ("reward", "baseline"):
            np.testing.assert_array_equal(report.metrics[name], run.curve(name)[1][:, index])
        assert report.means()["reward"] == pytest.approx(run.curve("reward")[1][:, index].mean())
        assert "parameters" not in report.metrics
    assert without_times(run).equals(without_times(trained()))


def test_the_last_record_is_reported_where_it_is_short_and_a_run_that_continues_repeats_none(tmp_path):
    seen = []
    mg.train("three-state", None, 250, 2, tmp_path, window=WINDOW, progress=False, callbacks=seen.append)
    assert [report.decision for report in seen] == [100, 200, 250]
    assert seen[-1].path == tmp_path
    seen.clear()
    mg.train("three-state", None, STEPS, 2, tmp_path, window=WINDOW, progress=False, callbacks=[seen.append])
    assert [report.decision for report in seen] == [300, 400]


def test_a_callback_ends_a_run_which_is_saved_and_continues_bit_for_bit(tmp_path):
    run = trained(out=tmp_path, callbacks=lambda report: report.decision >= 200)
    assert (run.decision, run.complete) == (200, False)
    assert mg.load(tmp_path).decision == 200
    assert without_times(mg.resume(tmp_path, progress=False)).equals(without_times(trained()))


def test_only_true_ends_a_run():
    assert trained(callbacks=[lambda report: 1.0, lambda report: "on"]).complete


def report_of(*values):
    return Report("t", [0, 1], 100, 400, {"reward": np.array(values)})


def test_means_are_over_the_seeds_in_which_something_occurred():
    assert report_of(1.0, np.nan).mean("reward") == 1.0
    assert np.isnan(report_of(np.nan, np.nan).mean("reward"))
    assert report_of(np.nan, np.nan).means() == {}
    with pytest.raises(ValueError, match="did you mean 'reward'"):
        report_of(1.0, 2.0).mean("rewrad")


@pytest.mark.parametrize(
    ("settings", "values", "ends"),
    [
        ({"goal": 2.0}, [1.0, 1.5, 2.0], [False, False, True]),
        ({"goal": 1.0, "larger_is_better": False}, [2.0, 1.5, 1.0], [False, False, True]),
        ({"patience": 2}, [1.0, 2.0, 2.0, 1.0], [False, False, False, True]),
        ({"patience": 2, "larger_is_better": False}, [2.0, 1.0, 1.0, 2.0], [False, False, False, True]),
        ({"patience": 2, "least_gain": 0.5}, [1.0, 1.4, 1.4], [False, False, True]),
        ({"patience": 2}, [1.0, np.nan, np.nan], [False, False, True]),  # no policy is finite
        ({"patience": 1}, [np.nan], [True]),
    ],
)
def test_early_stopping(settings, values, ends):
    stop = EarlyStopping(**settings)
    assert [stop(report_of(value, value)) for value in values] == ends
    assert "reward" in stop.why


def test_early_stopping_skips_records_in_which_a_reading_did_not_occur():
    stop, one = EarlyStopping("apex", patience=1), np.ones(2)
    reports = [Report("t", [0, 1], 100, 400, {"reward": one, "apex": apex * one}) for apex in (1.0, np.nan, 2.0, 1.0)]
    assert [stop(report) for report in reports] == [False, False, False, True]


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({}, "goal, patience = .*: must be at least one of the two"),
        ({"patience": 0}, "patience = 0: must be an integer of at least 1"),
        ({"goal": float("nan")}, "goal = nan: must be a finite number"),
        ({"goal": 1.0, "least_gain": -1.0}, "least_gain = -1.0: must be a finite number of at least 0"),
    ],
)
def test_impossible_stopping_is_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        EarlyStopping(**settings)


def test_what_cannot_be_called_is_refused_before_work():
    with pytest.raises(ValueError, match="callbacks = 'wandb': must be functions"):
        trained(callbacks=["wandb"])
