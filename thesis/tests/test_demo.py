"""The demonstration and what it is made of."""

import json
import subprocess

import imageio_ffmpeg
import numpy as np
import pytest

import motorgrad as mg
from motorgrad.cli import main
from motorgrad.training import evaluate
from motorgrad_thesis import demo
from motorgrad_thesis.chapter_5.figure_5_3 import behaviour_figure
from timsim import motion_of


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def run():
    return mg.train("hopper", steps=100, seeds=[4, 1], progress=False)


@pytest.fixture(scope="module")
def outcome(run):
    return evaluate(run, 120)


def test_a_motion_is_what_was_recorded(run, outcome):
    motion = motion_of(run, outcome, 1, "a label", seconds=0.5)
    assert motion.label == "a label"
    np.testing.assert_allclose(motion.time, 0.01 * np.arange(1, 51))
    np.testing.assert_array_equal(motion.position, outcome.position[1, :50])
    flexors, extensors = outcome.control[1, :50].T
    np.testing.assert_array_equal(motion.activation.T, [flexors, extensors, flexors, extensors])
    assert 0 < motion.activation.mean() < 1


def test_a_motion_is_no_longer_than_what_was_recorded(run, outcome):
    assert len(motion_of(run, outcome, 4, seconds=100.0).time) == 120


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan"), float("inf")])
def test_an_impossible_length_is_refused_by_name(seconds, run, outcome):
    with pytest.raises(ValueError, match=f"seconds = {seconds}"):
        motion_of(run, outcome, 4, seconds=seconds)


def test_a_task_without_a_body_cannot_be_filmed(outcome):
    run = mg.train("chain", steps=20, seeds=2, progress=False)
    with pytest.raises(ValueError, match="task 'chain' has no body to film"):
        motion_of(run, outcome, 0)


def test_an_evaluation_is_frozen_fresh_and_repeatable(run, outcome):
    again = evaluate(run, 120)
    np.testing.assert_array_equal(again.position, outcome.position)
    np.testing.assert_array_equal(again.reward, outcome.reward)
    assert outcome.position.shape[:2] == (2, 120)
    assert outcome.control.shape == (2, 120, 2)
    assert {sensor.shape for sensor in outcome.sensors.values()} == {(2, 120)}
    # the knee at 90 degrees, standing: the start has moved by one decision only
    assert np.abs(outcome.sensors["knee_angle"][:, 0]).max() < 0.5


@pytest.mark.ci
def test_an_evaluation_in_mode_takes_the_most_probable_action(run):
    outcome = evaluate(run, 50, mode="mode")
    contact = outcome.sensors["foot_contact"][:, :-1, None] > 0
    angle, velocity = (outcome.sensors[name][:, :-1, None] for name in ("knee_angle", "knee_velocity"))
    seen = np.concatenate([np.where(contact, 1.0, -1.0), angle, 0.02 * velocity], axis=2)
    potential = np.einsum("sti,sui->stu", seen, run.policies.weights) + run.policies.bias[:, None]
    clear = np.abs(potential) > 1e-5
    np.testing.assert_array_equal(outcome.control[:, 1:][clear], (potential > 0)[clear])
    assert clear.mean() > 0.9


def test_the_untrained_policies_are_judged_on_request(run, outcome):
    before = evaluate(run, 120, untrained=True)
    assert not np.array_equal(before.position, outcome.position)


@pytest.mark.parametrize(("options", "named"), [({"steps": 0}, "steps = 0"), ({"mode": "best"}, "unknown mode 'best'")])
def test_an_impossible_evaluation_is_refused_by_name(options, named, run):
    with pytest.raises(ValueError, match=named):
        evaluate(run, **options)


@pytest.mark.ci
def test_the_behaviour_figure_shows_both_columns(run, outcome, tmp_path):
    figure = behaviour_figure(
        run, evaluate(run, 120, untrained=True), outcome, 1, tmp_path / "new" / "b.png", seconds=1
    )
    assert (tmp_path / "new" / "b.png").read_bytes().startswith(b"\x89PNG")
    assert [axes.get_title() for axes in figure.axes[:2]] == ["before learning", "after learning"]
    (line,) = figure.axes[1].lines
    shown = 90 + np.rad2deg(outcome.sensors["knee_angle"][1, -99:])
    np.testing.assert_allclose(line.get_ydata()[-99:], shown, rtol=1e-5)


@pytest.mark.slow
@pytest.mark.ci
def test_the_demonstration_makes_all_that_it_names(tmp_path, capsys):
    command = ["demo", "--seconds", "20", "--seeds", "2", "--film-seconds", "0.5", "--out", "shown", "--json", "d.json"]
    assert main(command) == 0
    said = capsys.readouterr().out
    assert "2 hoppers practised for 20 simulated seconds each" in said
    found = json.loads((tmp_path / "d.json").read_text())
    assert len(found["files"]) == 3
    for path in found["files"].values():
        assert path in said
        assert (tmp_path / path).stat().st_size > 5_000
    film = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-i", found["files"]["film before and after"]]
    assert subprocess.run([*film, "-f", "null", "-"], capture_output=True, check=True).stderr == b""
    run = mg.load("shown")
    assert (run.decision, run.seeds) == (2000, [0, 1])
    for when in ("before", "after"):
        assert 0.03 < found["apex"][when]["median"] < 2
    # a second look finds the run complete
    shown = demo.demonstrate("shown", 20.0, 2, film_seconds=0.2)
    assert shown.run.decision == 2000
    np.testing.assert_array_equal(shown.after.metrics["apex"], found["apex"]["after"]["per_seed"])
