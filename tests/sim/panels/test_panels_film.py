"""Films of a run as it goes on."""

import re
import subprocess
import time

import imageio_ffmpeg
import numpy as np
import pytest
from panel_studio import until

from motorgrad.sim import gl_problem
from motorgrad.sim.live import Compare, Session, setup_of
from motorgrad.sim.panels import FilmRecorder

needs_gl = pytest.mark.skipif(bool(gl_problem()), reason=f"no OpenGL here: {gl_problem()}")


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
        assert time.monotonic() - last < 30, "no more frames come"
        time.sleep(0.01)
        if film.frames > made:
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


@pytest.mark.ci
@needs_gl
def test_both_bodies_are_filmed_side_by_side(hopping, tmp_path):
    hopping.order(Compare(True))
    try:
        assert until(lambda: len(hopping.snapshot().position) == 2, 60)
        film = FilmRecorder(hopping, tmp_path / "two.mp4", width=96, height=96, fps=10)
        assert until(lambda: film.painted >= 2)
        film.stop()
        frames, fps = read(film.path)
        assert fps == 10
        assert frames.shape[1:] == (96, 196, 3)
    finally:
        hopping.order(Compare(False))


@pytest.mark.ci
@needs_gl
def test_a_film_ends_with_its_run(tmp_path):
    import mujoco

    from motorgrad.sim.live import Setup

    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
    session = Session(Setup("ball", model=model))
    film = FilmRecorder(session, tmp_path / "ball.mp4", width=64, height=64)
    assert until(lambda: film.painted > 2)
    session.close()
    assert until(lambda: not film.running)
    film.stop()
    assert len(read(film.path)[0]) == film.frames


@pytest.mark.parametrize(
    ("name", "settings", "said"),
    [
        ("run.avi", {}, "ending in .mp4"),
        ("run.mp4", {"fps": 0}, "fps = 0"),
        ("run.mp4", {"fps": float("nan")}, "fps = nan"),
        ("run.mp4", {"width": 63}, "width = 63"),
        ("run.mp4", {"height": "high"}, "height = 'high'"),
    ],
)
def test_what_cannot_be_filmed_is_refused_before_it_begins(hopping, tmp_path, name, settings, said):
    with pytest.raises(ValueError, match=said):
        FilmRecorder(hopping, tmp_path / name, **settings)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_the_plane_of_a_particle_is_filmed_and_what_has_no_picture_is_not(tmp_path):
    with Session(setup_of("particle-navigation", seed=1)) as session:
        film = FilmRecorder(session, tmp_path / "plane.mp4", width=160, height=120)
        assert until(lambda: film.painted >= 2)
        film.stop()
        assert read(film.path)[0].shape[1:] == (120, 160, 3)
    with Session(setup_of("chain")) as session, pytest.raises(ValueError, match="nothing to film"):
        FilmRecorder(session, tmp_path / "chain.mp4")
