"""Films of a run as it goes on."""

import re
import subprocess
import time

import imageio_ffmpeg
import numpy as np
import pytest

from motorgrad.cli import main
from patience import until
from timsim import Viewpoint
from timsim.live import Compare, Edit, Session, setup_of
from timsim.panels import FilmRecorder, Overlay, SlowFilmRecorder, _film_recorder

needs_gl = pytest.mark.needs("OpenGL")


def read(path):
    """Every frame of a film, and its frames a second."""
    ffmpeg = imageio_ffmpeg.get_ffmpeg_exe()
    command = [ffmpeg, "-hide_banner", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    run = subprocess.run(command, capture_output=True, check=True)
    about = run.stderr.decode().split("Stream mapping")[0]
    width, height = (int(number) for number in re.search(r" (\d{2,})x(\d{2,})", about).groups())
    fps = float(re.search(r"([\d.]+) fps", about)[1])
    return np.frombuffer(run.stdout, np.uint8).reshape(-1, height, width, 3), fps


@pytest.mark.ci
@needs_gl
def test_a_film_shows_the_run_in_the_time_of_the_clock(hopping, tmp_path):
    film = FilmRecorder(hopping, tmp_path / "new" / "run.mp4", width=160, height=120)
    assert until(lambda: film.frames > 0)
    begin = last = time.monotonic()
    first = made = film.frames
    longest = 0.0  # seconds in which one picture was painted
    while last - begin < 1.5:
        assert until(lambda made=made: film.frames > made), "no more frames come"
        made, now = film.frames, time.monotonic()
        longest, last = max(longest, now - last), now
    made, lasted = made - first, last - begin
    film.stop()
    film.stop()  # which does nothing
    assert not film.running
    assert abs(made / 30 - lasted) < longest + 0.1  # as many frames as the time that passed, not as pictures painted
    frames, fps = read(film.path)
    assert fps == 30
    assert frames.shape == (film.frames, 120, 160, 3)
    assert np.abs(frames[0].astype(int) - frames[-1]).max() > 20  # it moved
    assert [path.name for path in film.path.parent.iterdir()] == ["run.mp4"]


VIEW = Viewpoint((0.0, -4.0, 0.6), (0.0, 0.0, 0.6), 45.0)


def blue_at(frame, x, z):
    """Whether a place of the plane y = -2 m, half way between camera and target, is blue in a frame of `VIEW`."""
    scale = len(frame) / 2 / np.tan(np.pi / 8) / 2  # pixels of a metre
    row, column = round(len(frame) / 2 - scale * (z - 0.6)), round(frame.shape[1] / 2 + scale * x)
    red, green, blue = frame[row - 1 : row + 2, column - 1 : column + 2].reshape(-1, 3).mean(0)
    return blue > 100 + max(red, green)


def written(frame):
    """How many pixels are dark below the clock, before the sky."""
    return int(np.sum(frame[30:55, 200:].max(axis=2) < 100))


@pytest.mark.ci
@needs_gl
def test_films_show_what_programs_add(hopping, tmp_path):
    """Text, and an arrow where it is in the scene, in real time and in slow motion."""
    overlay = Overlay()
    settings = {"width": 320, "height": 240, "camera": VIEW, "annotations": overlay.annotations}
    film = FilmRecorder(hopping, tmp_path / "run.mp4", **settings)
    assert until(lambda: film.painted > 2)
    begin, painted = hopping.snapshot().seconds, film.painted

    def along(moment):  # an arrow that goes to the right by 0.1 m in a simulated second
        return (min(0.1 * (moment.seconds - begin) - 0.6, 0.9), -2, 0.4), (0, 0, 0.4)

    overlay("along", arrow=along, colour="#0000ff")
    overlay("words", text=lambda moment: "the arrow in words")
    slow = SlowFilmRecorder(hopping, tmp_path / "slow.mp4", speed=0.5, fps=10, **settings)
    assert until(lambda: film.painted > painted + 2 and slow.seconds > 1.5)
    overlay("along")
    overlay("words")
    painted = film.painted
    assert until(lambda: film.painted > painted + 2)
    film.stop()
    frames, across = read(film.path)[0], np.arange(-0.6, 1.0, 0.005)
    blue = [any(blue_at(frame, x, 0.55) for x in across) for frame in frames]
    assert any(blue)
    assert not blue[0]
    assert not blue[-1]
    assert written(frames[blue.index(True)]) > 20
    assert written(frames[-1]) == 0

    slow.stop()
    slow.stop()  # which does nothing
    frames, fps = read(slow.path)
    assert fps == 10
    assert abs(len(frames) - 10 * slow.seconds / 0.5) < 2
    assert written(frames[3]) > 20
    places = [[x for x in across if blue_at(frame, x, 0.55)] for frame in frames[:20]]
    middles = [np.mean(each) for each in places if each]
    assert len(middles) > 10
    np.testing.assert_allclose(np.diff(middles), 0.1 * 0.5 / 10, atol=0.006)  # smoothly


@pytest.mark.ci
@needs_gl
def test_both_bodies_are_filmed_side_by_side(hopping, tmp_path):
    hopping.order(Compare(True))
    try:
        assert until(lambda: len(hopping.snapshot().position) == 2)
        film = FilmRecorder(hopping, tmp_path / "two.mp4", width=96, height=96, fps=10)
        assert until(lambda: film.painted >= 2)
        hopping.order(Compare(False))
        assert until(lambda: len(hopping.snapshot().position) == 1)
        painted = film.painted
        assert until(lambda: film.painted >= painted + 2)
        film.stop()
        frames, fps = read(film.path)
        assert fps == 10
        assert frames.shape[1:] == (96, 196, 3)
        there = [np.ptp(frame[:, 104:].astype(int)) > 100 for frame in frames]
        assert there[0]
        assert not there[-1]  # rather than a picture of long ago
    finally:
        hopping.order(Compare(False))


@pytest.mark.ci
@needs_gl
def test_the_seconds_of_a_command_are_those_of_its_film(tmp_path):
    path = tmp_path / "hop.mp4"
    assert main(["sim", "hopper", "--no-browser", "--record", str(path), "--seconds", "0.5"]) == 0
    frames, fps = read(path)
    assert len(frames) / fps >= 0.5  # starting takes far longer


@pytest.mark.ci
@needs_gl
def test_a_film_shows_an_edited_body_and_a_recording_says_that_it_cannot(hopping, tmp_path):
    name = "body.load.radius"
    before = hopping.settings[name]
    slow = SlowFilmRecorder(hopping, tmp_path / "slow.mp4", speed=1.0, width=64, height=64)
    film = FilmRecorder(hopping, tmp_path / "run.mp4", width=160, height=120, camera=VIEW, titles=False)
    assert until(lambda: film.painted >= 2 and slow.seconds > 0.1)
    try:
        hopping.order(Edit(name, 4 * before))
        assert until(lambda: hopping.settings[name] == 4 * before)
        painted = film.painted
        assert until(lambda: film.painted >= painted + 2)
        film.stop()
        frames = read(film.path)[0].astype(int)
        dark = [int(np.sum(frame.max(axis=2) < 100)) for frame in (frames[0], frames[-1])]  # the load, nearly black
        assert dark[1] > 5 * max(dark[0], 10)
        with pytest.warns(UserWarning, match="recording of hopper: sizes were edited meanwhile"):
            slow.stop()
    finally:
        hopping.order(Edit(name, before))


@pytest.mark.ci
@needs_gl
def test_a_film_in_memory_that_is_full_ends_and_says_so(hopping, tmp_path, monkeypatch):
    monkeypatch.setattr(_film_recorder, "ROOM", 3 * 64 * 64 * 3)
    film = FilmRecorder(hopping, tmp_path / "run.gif", width=64, height=64)
    assert until(lambda: not film.running)
    with pytest.warns(UserWarning, match=r"run\.gif: full after 0\.[1-9] s"):
        film.stop()
    film.stop()  # which does nothing


@pytest.mark.ci
@needs_gl
def test_a_film_ends_with_its_run(tmp_path):
    import mujoco

    from timsim.live import Setup

    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
    session = Session(Setup("ball", model=model))
    film = FilmRecorder(session, tmp_path / "ball.mp4", width=64, height=64)
    assert until(lambda: film.painted > 2)
    session.close()
    assert until(lambda: not film.running)
    film.stop()
    assert len(read(film.path)[0]) == film.frames


@pytest.mark.slow
def test_the_plane_of_a_particle_is_filmed_and_what_has_no_picture_is_not(tmp_path):
    with Session(setup_of("particle-navigation", seed=1)) as session:
        film = FilmRecorder(session, tmp_path / "plane.mp4", width=160, height=120)
        assert until(lambda: film.painted >= 2)
        film.stop()
        assert read(film.path)[0].shape[1:] == (120, 160, 3)
    with Session(setup_of("chain")) as session, pytest.raises(ValueError, match="nothing to film"):
        FilmRecorder(session, tmp_path / "chain.mp4")
