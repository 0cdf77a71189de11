"""Films of learning: what is recorded, what is seen, what is refused, and how `reproduce` and `plot` make them."""

import dataclasses
import json
import re
import subprocess

import imageio_ffmpeg
import jax
import numpy as np
import pytest
from PIL import Image

import motorgrad as mg
from motorgrad.cli import main
from motorgrad.policies import Masked, tiles
from motorgrad.tasks import FallingParticle, ParticleOrbit
from motorgrad.training import agent_for, train
from motorgrad_thesis import (
    EXPERIMENTS,
    Experiment,
    reproduce,
    write_report,
)
from motorgrad_thesis._commands import reproduce as command
from timsim import Course, animate, course_of, film_learning

GROWING = {
    "policy": "growing",
    "growth": {"kind": "clock", "criterion": {"interval": 400}, "shrink": 0.99},
    "learning_rate": {"centre": 1e-4, "log_width": 5e-4},
}


def frames_of(path):
    """Every third pixel of a film's frames, `(frames, height, width, 3)`, and what ffmpeg says of it."""
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-hide_banner", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24"]
    done = subprocess.run([*command, "-"], capture_output=True, check=True)
    about = done.stderr.decode().split("Stream mapping")[0]
    width, height = (int(number) for number in re.search(r" (\d{2,})x(\d{2,})", about).groups())
    frames = np.frombuffer(done.stdout, np.uint8).reshape(-1, height, width, 3)
    return frames[:, ::3, ::3].astype(np.int16), about


@pytest.fixture(scope="module")
def falling(tmp_path_factory):
    """Two learners of the falling particle, ten records."""
    path = tmp_path_factory.mktemp("falling") / "run"
    return train(FallingParticle(), None, 4_000, 2, path, window=400, progress=False)


@pytest.fixture(scope="module")
def growing(tmp_path_factory):
    """Two learners that get a unit every 400 decisions, seven records."""
    task, path = ParticleOrbit(units=5), tmp_path_factory.mktemp("growing") / "run"
    return train(task, GROWING, 1_750, [4, 7], path, window=250, progress=False)


# what is recorded


@pytest.mark.slow
def test_the_last_record_is_the_policy_that_was_learned(falling, growing):
    for run in (falling, growing):
        last = run.policies_at([-1])
        for stored, learned in zip(jax.tree.leaves(last), jax.tree.leaves(run.policies), strict=True):
            np.testing.assert_array_equal(stored[0], np.asarray(learned))


@pytest.mark.ci
def test_records_in_between_are_those_of_shorter_runs(growing):
    task = growing.task
    shorter = train(task, GROWING, 1_000, [4, 7], window=250, progress=False)
    found = growing.policies_at([0, 3], seed=7)
    for stored, learned in zip(jax.tree.leaves(found), jax.tree.leaves(shorter.policy(7)), strict=True):
        np.testing.assert_allclose(stored[1], learned, atol=1e-6)
    assert found.active.sum(-1).tolist() == [1, 3]


@pytest.mark.slow
def test_units_are_switched_on_after_those_that_were_there():
    """Of a pool of which a unit in the middle is there from the start, the others come from the first on."""
    from motorgrad.learning import SGD, Agent, Clock, Growth, olgarb

    task = ParticleOrbit(units=4)
    pool = Masked(tiles(task), [False, False, True, False])
    growth = Growth(Clock(400), shrink=0.99)
    agent = Agent(pool, olgarb(0.9), SGD(1e-4), growth=growth)
    run = train(task, agent, 1_000, 1, window=100, progress=False)
    found = run.policies_at([0, 4, 9], seed=0)
    assert found.active.astype(int).tolist() == [[1, 0, 1, 0], [1, 1, 1, 0], [1, 1, 1, 1]]
    np.testing.assert_array_equal(found.active[-1], run.policy().active)


@pytest.mark.ci
def test_a_loaded_run_has_the_same_course(growing):
    here, there = (course_of(run, 7) for run in (growing, mg.load(growing.path)))
    for one, other in zip(jax.tree.leaves(here.policies), jax.tree.leaves(there.policies), strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(here.reward, there.reward)


@pytest.mark.ci
def test_a_course_begins_before_the_first_decision(falling, growing):
    course = course_of(falling, 1)
    np.testing.assert_array_equal(course.decision, np.arange(0, 4_001, 400))
    np.testing.assert_array_equal(course.policy(0).centre, np.asarray(falling.initial.centre)[1])
    assert np.isnan(course.reward[:, 0]).all()
    np.testing.assert_array_equal(course.reward[:, 1:], falling.curve()[1])
    assert (course.shown, course.units) == (1, None)
    grown = course_of(growing)
    np.testing.assert_array_equal(grown.units[0], np.r_[1, growing.curve("units")[1][0]])
    for moment in range(8):
        assert grown.policy(moment).active.sum() == grown.units[grown.shown, moment]


def test_the_seed_shown_is_the_one_in_the_middle(falling):
    late = falling.curve()[1][:, -2:].mean(1)  # a quarter of ten records
    assert course_of(falling).shown == np.argsort(late)[1]
    assert course_of(falling).label == f"seed {falling.seeds[np.argsort(late)[1]]}"


# what is seen


@pytest.mark.ci
def test_a_film_of_learning(falling, tmp_path, capsys):
    made = animate(falling, tmp_path / "new" / "a.mp4", seed=1, seconds=2)
    frames, about = frames_of(made.path)
    assert len(frames) == made.frames == 50 + 25  # and a second in which the last stays
    assert made.seconds == 3
    assert all(word in about for word in ("h264", "1280x720", "25 fps"))
    plane, curve = frames[:, 27:213, 14:200], frames[:, 24:210, 254:]
    # what is learned is seen in the plane, and the mark runs along the curve
    assert np.abs(plane[0] - plane[-1]).max(-1).mean() > 2
    assert (np.abs(curve[0] - curve[-1]).max(-1) > 60).any()
    assert np.abs(frames[50] - frames[-1]).mean() < 0.5
    # eleven moments, each for about five frames
    changes = np.abs(np.diff(plane, axis=0)).max(-1).mean((1, 2)) > 0.5
    assert changes.sum() == 10
    assert capsys.readouterr().err.startswith("filming a.mp4")


@pytest.mark.slow
def test_nothing_touches_the_edge_of_the_picture(falling, growing, tmp_path):
    courses = [course_of(run) for run in (falling, growing)]
    courses += [dataclasses.replace(courses[0], decision=courses[0].decision * 2_500)]  # ten million decisions
    for number, course in enumerate(courses):
        frames, _ = frames_of(film_learning(course, tmp_path / f"{number}.mp4", seconds=0.2).path)
        for edge in (frames[:, :2], frames[:, -2:], frames[:, :, :2], frames[:, :, -2:]):
            assert edge.min() > 245


@pytest.mark.ci
def test_units_that_are_added_are_seen(growing, tmp_path):
    """Drawn without paths, by the pixels that are neither grey nor green, as field and box are: those of units."""
    course = course_of(growing, 4)
    made = film_learning(course, tmp_path / "a.mp4", seconds=8 / 25, paths=0)
    frames, _ = frames_of(made.path)
    plane = frames[:8, 27:213, 14:200]
    coloured = (plane.max(-1) - plane[..., 1] > 25).sum((1, 2))
    assert course.units[0].tolist() == [1, 1, 2, 2, 3, 4, 4, 5]
    assert coloured[-1] > 2 * coloured[0] > 0


@pytest.mark.ci
def test_the_same_run_gives_the_same_frames(falling, tmp_path):
    one, two = (frames_of(animate(falling, tmp_path / f"{n}.mp4", seconds=0.4, progress=False).path)[0] for n in "ab")
    np.testing.assert_array_equal(one, two)


@pytest.mark.ci
def test_a_gif(falling, tmp_path):
    made = animate(falling, tmp_path / "a.GIF", seconds=0.48, progress=False)
    with Image.open(made.path) as gif:
        assert (gif.format, gif.size, gif.info["loop"]) == ("GIF", (800, 450), 0)
        shown = 0
        for frame in range(gif.n_frames):
            gif.seek(frame)
            shown += gif.info["duration"]
    assert shown == 1_480 == 1_000 * made.seconds
    assert gif.n_frames == 11  # the moments: a picture that stays is stored once
    assert list(tmp_path.iterdir()) == [made.path]


@pytest.mark.ci
def test_a_film_goes_into_the_run_by_default(falling):
    assert animate(falling, seconds=0.1, progress=False).path == falling.path / "figures" / "learning.mp4"


# what is refused


@pytest.mark.parametrize(("change", "words"), [
    ({"path": "film.avi"}, "path = .*film.avi': must be a file name ending in .mp4 or .gif"),
    ({"seed": 5}, "seed = 5: must be one of the run's seeds, 0, 1"),
    ({"seconds": 0}, "seconds = 0: must be above 0, up to 600 s"),
])  # fmt: skip
def test_what_cannot_be_filmed(falling, tmp_path, change, words):
    change["path"] = tmp_path / change.get("path", "a.mp4")
    with pytest.raises(ValueError, match=words):
        animate(falling, **change, progress=False)
    assert not list(tmp_path.iterdir())


@pytest.mark.ci
def test_runs_that_cannot_be_filmed(tmp_path):
    chain = train("chain", steps=40, window=20, progress=False)
    known = "particle, particle-navigation, particle-orbit"
    with pytest.raises(ValueError, match=f"task 'chain' cannot be filmed: it must be a task on a particle: {known}$"):
        animate(chain, tmp_path / "a.mp4")
    plain = train("particle", {"policy": "hyperplanes", "learning_rate": 1e-3}, 40, window=20, progress=False)
    with pytest.raises(ValueError, match="policy = 'Hyperplanes': must be made of local units"):
        animate(plain, tmp_path / "a.mp4")
    done = train("particle", None, 40, window=20, progress=False)
    with pytest.raises(ValueError, match="no records yet"):
        animate(dataclasses.replace(done, decision=3, metrics=done.metrics.slice(0, 0)), tmp_path / "a.mp4")
    with pytest.raises(ValueError, match="path = None: must be a file, for a run in memory"):
        animate(done)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("change", "words"), [
    ({"decision": np.array([0, 400, 300])}, "decision = .*: must be increasing"),
    ({"reward": np.zeros((2, 4))}, r"reward = \(2, 4\): must be of shape \(learners, 3\)"),
    ({"units": np.zeros((1, 3))}, r"units = \(1, 3\): must be the reward's, \(2, 3\)"),
    ({"shown": 2}, "shown = 2: must be a row of the reward, from 0 to 1"),
])  # fmt: skip
def test_a_course_fits_together(falling, change, words):
    course = course_of(falling, 0)
    policies = jax.tree.map(lambda leaf: leaf[:3], course.policies)
    parts = {"task": course.task, "decision": course.decision[:3], "policies": policies, "reward": course.reward[:, :3]}
    Course(**parts)
    with pytest.raises(ValueError, match=words):
        Course(**{**parts, **change})


def test_records_that_are_not_there(falling):
    with pytest.raises(ValueError, match=r"records = \[10\]: must be among the 10 records of the run"):
        falling.policies_at([10])


# motorgrad plot


@pytest.fixture
def status(monkeypatch, tmp_path):
    """The exit status of `motorgrad`, however it leaves."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")

    def left(*arguments):
        try:
            return main([str(argument) for argument in arguments])
        except SystemExit as error:
            return error.code

    return left


@pytest.mark.ci
def test_plot_films_a_run(status, falling, capsys):
    options = ("--seed", 1, "--seconds", 0.2, "--out", "c.svg", "--json", "-")
    assert status("plot", falling.path, "--animate", "mine.gif", *options) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["film"] == {"path": "mine.gif", "frames": 30, "seconds": 1.2}
    with Image.open("mine.gif") as gif:
        assert gif.size == (800, 450)


@pytest.mark.ci
def test_plot_films_into_the_run_by_default(status, falling, capsys):
    assert status("plot", falling.path, "--animate", "--seconds", 0.2) == 0
    assert f"filmed to {falling.path / 'figures' / 'learning.mp4'}" in capsys.readouterr().out


@pytest.mark.parametrize(("arguments", "words"), [
    (("--animate", "a.avi"), "animate = 'a.avi': must be a file ending in .mp4 or .gif"),
    (("--animate", "a.mp4", "b.mp4"), "must be one file, or none"),
    (("--animate", "--seed", 9), "seed = 9: must be one of the run's seeds, 0, 1"),
    (("--seed", 1), "seed = 1: must be given with --animate"),
    (("--animate", "--seconds", -1), r"seconds = -1.0: must be in \(0, 600\]"),
    (("AGAIN", "--animate"), "runs = .*: must be a single one, to be filmed"),
])  # fmt: skip
def test_plot_refuses(status, falling, tmp_path, capsys, arguments, words):
    arguments = [falling.path if word == "AGAIN" else word for word in arguments]
    assert status("plot", falling.path, *arguments, "--out", "c.svg") in (1, 2)
    said = capsys.readouterr().err.strip()
    assert re.search(words, said)
    assert len(said.splitlines()) == 1
    assert not list(tmp_path.iterdir())  # nothing was drawn either


# motorgrad reproduce


@dataclasses.dataclass(frozen=True)
class Falling(Experiment):
    """A particle learns where to fall."""

    name = "falling"
    title = "where to fall"
    source = "figure 9.8"
    decisions: int = 2_000

    def learned(self, work):
        return work.train(FallingParticle(), agent_for("particle"), self.decisions, 2)

    def run(self, work):
        return {"reward": self.learned(work).curve()[1]}

    def films(self, work):
        return {"animation": self.learned(work)}

    def figure(self, values):
        from matplotlib.figure import Figure

        figure = Figure()
        figure.subplots().plot(values["reward"].T)
        return figure


@pytest.fixture
def quick_films(monkeypatch):
    """Films of a moment: how they look is seen above."""
    monkeypatch.setattr("timsim.plane._of_runs.SECONDS", 0.2)


@pytest.mark.slow
def test_reproduce_films_what_an_experiment_shows(tmp_path, quick_films):
    first = reproduce(Falling(), tmp_path, progress=False)
    assert (first.films, first.record()["films"]) == ([], [])
    done = reproduce(Falling(), tmp_path, progress=False, films=True)
    film = tmp_path / "falling" / "animation.mp4"
    assert done.films == [film]
    assert json.loads((tmp_path / "falling" / "record.json").read_text())["films"] == [str(film)]
    assert len(frames_of(film)[0]) == 30
    made = film.stat().st_mtime_ns
    again = reproduce(Falling(), tmp_path, progress=False, films=True)
    assert (again.films, film.stat().st_mtime_ns) == ([film], made)  # what is finished is not done again
    page = write_report(tmp_path, []).read_text()
    assert 'src="falling/animation.mp4"' in page
    assert 'href="falling/animation.mp4"' in page


@dataclasses.dataclass(frozen=True)
class Still(Falling):
    """Nothing learns, and nothing is filmed."""

    def run(self, work):
        return {"reward": np.zeros((1, 2))}

    def films(self, work):
        return Experiment.films(self, work)


def test_an_experiment_without_learners_in_a_plane_says_so(status, quick_films, monkeypatch, capsys):
    monkeypatch.setattr(command, "EXPERIMENTS", {"falling": Still})
    assert status("reproduce", "falling", "--quick", "--animate", "--out", "out") == 0
    assert "falling: nothing to film" in capsys.readouterr().err


@pytest.mark.ci
def test_the_command_films(status, quick_films, monkeypatch, capsys):
    monkeypatch.setitem(EXPERIMENTS, "falling", Falling)
    assert status("reproduce", "falling", "--animate", "--out", "out", "--json", "out.json") == 0
    with open("out.json") as file:
        assert json.load(file)["experiments"][0]["films"] == ["out/falling/animation.mp4"]
    assert "filmed: out/falling/animation.mp4" in capsys.readouterr().out
