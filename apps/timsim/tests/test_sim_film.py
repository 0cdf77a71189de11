"""Films and stills: what is written, what is seen, what is refused."""

import dataclasses
import os
import re
import subprocess
import sys

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

from motorgrad.bodies import read_model
from timsim import Motion, gl_problem, still, write_film
from timsim.film._motion import resample


def decode(path) -> tuple[str, np.ndarray]:
    """What ffmpeg says of a film, and its frames `(frames, height, width, 3)`."""
    ffmpeg = imageio_ffmpeg.get_ffmpeg_exe()
    command = [ffmpeg, "-hide_banner", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    run = subprocess.run(command, capture_output=True, check=True)
    about = run.stderr.decode().split("Stream mapping")[0]
    width, height = (int(number) for number in re.search(r" (\d{2,})x(\d{2,})", about).groups())
    return about, np.frombuffer(run.stdout, np.uint8).reshape(-1, height, width, 3)


def test_a_model_does_not_choose_how_finely_it_is_drawn(renderer):
    finest = 'numquads="1000000" numslices="1000000" numstacks="1000000" shadowsize="1000000"'
    xml = f"<mujoco><visual><quality {finest}/></visual><worldbody><geom size='0.1'/></worldbody></mujoco>"
    motion = Motion(read_model(xml), np.zeros(1), np.zeros((1, 0)), np.zeros((1, 0)))
    assert still(motion, 0, width=64, height=64, renderer=renderer).shape == (64, 64, 3)


@pytest.mark.ci
@pytest.mark.representatives("drawn")
def test_a_film_decodes_to_its_frames(hop, renderer, tmp_path):
    done = []
    made = write_film(
        hop, tmp_path / "new" / "hop.mp4", width=320, height=240, renderer=renderer, progress=lambda *n: done.append(n)
    )
    about, frames = decode(made.path)
    assert made.frames == len(frames) == 26
    assert (made.renderer, made.seconds) == (renderer, 26 / 50)
    assert frames.shape[1:] == (240, 320, 3)
    assert "50 fps" in about
    assert "h264" in about
    assert "yuv420p" in about
    assert done == [(n, 26) for n in range(1, 27)]
    assert bool(made.note) == (renderer == "drawn")
    # the pictures of the film are those of the stills, but for the loss of compression
    picture = still(hop, 12, width=320, height=240, renderer=renderer)
    assert np.abs(frames[12].astype(int) - picture).mean() < 4
    # faststart: the index stands before the pictures
    content = made.path.read_bytes()
    assert content.index(b"moov") < content.index(b"mdat")
    assert list(made.path.parent.iterdir()) == [made.path]


def test_before_and_after_side_by_side(hop, tmp_path):
    quiet = Motion(hop.model, hop.time[:11], hop.position[:11] * 0.5, hop.activation[:11] * 0, "before learning")
    made = write_film([quiet, hop], tmp_path / "both.mp4", width=160, height=120, renderer="drawn", fps=25, speed=0.5)
    _, frames = decode(made.path)
    assert len(frames) == made.frames == 26  # half a second at half speed
    assert frames.shape[1:] == (120, 324, 3)
    left = frames[:, 30:, :156].astype(int)
    assert np.abs(left[5] - left[0]).max() > 60
    assert np.abs(left[-1] - left[12]).mean() < 1  # the shorter one stands still at its end


@pytest.mark.ci
@pytest.mark.representatives("drawn")
def test_marks_are_seen_and_framed(hop, renderer):
    marks = np.zeros((26, 1, 4))
    marks[:, 0] = (2.0, 0.0, 0.5, 0.15)  # beside the leg
    marks[13:, 0, 0] = -1.0  # another episode, another target
    motion = dataclasses.replace(hop, marks=marks)
    columns = []
    for frame in (12, 13):
        picture = still(motion, frame, width=320, height=240, renderer=renderer).astype(int)
        green = picture[..., 1] > picture[..., [0, 2]].max(-1) + 15
        assert green.sum() > 50
        columns.append(np.flatnonzero(green.any(0)).mean())
    assert columns[0] > 240
    assert columns[1] < 80
    np.testing.assert_array_equal(resample(motion, np.array([0.245]))[3], marks[12:13])  # a target does not glide
    with pytest.raises(ValueError, match=re.escape("marks.shape = (3, 1, 4): must be (26, marks, 4)")):
        dataclasses.replace(hop, marks=marks[:3])


def test_a_firing_muscle_is_seen(leg, renderer):
    position = np.tile([0, 0, 0.5, -0.9], (2, 1))
    activation = np.array([[0.0, 0, 0, 0], [0, 0, 1, 0]])
    motion = Motion(leg, [0, 1], position, activation)
    silent, firing = (still(motion, k, renderer=renderer)[60:].astype(int) for k in (0, 1))
    red = [((p[..., 0] > 120) & (p[..., 0] - p[..., 1:].max(-1) > 90)).sum() for p in (silent, firing)]
    assert red[0] == 0
    assert red[1] > 300
    # nothing but the muscle and its shadow changed
    assert (np.abs(firing - silent).max(-1) > 8).mean() < 0.05


@pytest.mark.ci
@pytest.mark.representatives("drawn")
def test_nothing_leaves_the_frame(hop, renderer):
    """A body's pixels never touch the sides, wherever it goes; a long path is followed."""
    travel = hop.position.copy()
    for distance in (0.0, 1.0, 30.0):
        travel[:, 0] = np.linspace(-distance / 2, distance / 2, len(travel))
        leg = hop.model
        leg.geom_rgba[1:] = (0.0, 0.9, 0.0, 1)  # all but the ground: green
        motion = Motion(leg, hop.time, travel, hop.activation)
        for frame in (0, 13, 25):
            picture = still(motion, frame, width=320, height=240, renderer=renderer).astype(int)
            green = picture[..., 1] - picture[..., [0, 2]].max(-1) > 40
            rows, columns = np.flatnonzero(green.any(1)), np.flatnonzero(green.any(0))
            assert green.sum() > 300
            assert rows[0] > 20
            assert rows[-1] < 236
            assert columns[0] > 3
            assert columns[-1] < 316


def test_speed_and_rate_interpolate_rotations(tmp_path):
    import mujoco

    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body><freejoint/><geom size=".1 .2 .3" type="box"/></body></worldbody></mujoco>'
    )
    turned = [0, 0, 2, np.cos(0.5), 0, 0, np.sin(0.5)]
    motion = Motion(model, [0, 2], [[0, 0, 0, 1, 0, 0, 0], turned], np.zeros((2, 0)))
    _, position, *_ = resample(motion, np.array([0, 1, 2, 9]))
    np.testing.assert_allclose(position[1], [0, 0, 1, np.cos(0.25), 0, 0, np.sin(0.25)], atol=1e-12)
    np.testing.assert_allclose(position[2:], [turned, turned], atol=1e-12)


def test_without_gl_the_film_is_drawn_and_says_why(hop, tmp_path, monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "off")
    made = write_film(hop, tmp_path / "hop.mp4", width=64, height=64, fps=10)
    assert made.renderer == "drawn"
    assert "MUJOCO_GL" in made.note
    assert "libegl1" in made.note
    with pytest.raises(RuntimeError, match="libegl1"):
        write_film(hop, tmp_path / "hop.mp4", renderer="gl")


def test_a_broken_driver_is_a_reason_and_not_a_crash(monkeypatch):
    from timsim.film import _gl

    monkeypatch.setattr(_gl, "_PROBE", "import os; os.abort()")
    assert "failed" in _gl._problem.__wrapped__("glfw")


def test_an_animated_webp_has_every_frame_and_repeats(hop, tmp_path):
    made = write_film(hop, tmp_path / "hop.webp", width=64, height=64, fps=10, renderer="drawn")
    with Image.open(made.path) as film:
        assert (film.n_frames, film.size, film.info["loop"]) == (made.frames, (64, 64), 0)
        film.seek(1)
        film.load()
        assert film.info["duration"] == 100


def test_an_interrupted_film_leaves_nothing(hop, tmp_path):
    def stop(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_film(hop, tmp_path / "hop.mp4", width=64, height=64, renderer="drawn", progress=stop)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"fps": 0}, "fps = 0: must be a number above 0"),
        ({"fps": float("nan")}, "fps = nan"),
        ({"speed": -1}, "speed = -1"),
        ({"width": 321}, "width = 321: must be an even"),
        ({"height": 10}, "height = 10"),
        ({"renderer": "drwan"}, "did you mean 'drawn'"),
        ({"camera": "sid"}, "did you mean 'side'"),
        ({"camera": float("inf")}, "camera = inf"),
        ({"path": "hop.avi"}, r"path = 'hop.avi': must be a file name ending in \.mp4 or \.webp"),
        ({"motions": []}, "motions = "),
        ({"motions": [3]}, r"motions\[0\] = 3"),
    ],
)
def test_bad_settings_are_refused_before_work(hop, tmp_path, settings, message):
    import mujoco

    xml = '<mujoco><worldbody><camera name="side"/><body><joint/><geom size=".1"/></body></worldbody></mujoco>'
    motion = Motion(mujoco.MjModel.from_xml_string(xml), [0], [[0]], np.zeros((1, 0)))
    arguments = {"motions": motion, "path": tmp_path / "new" / "hop.mp4", **settings}
    with pytest.raises(ValueError, match=message):
        write_film(**arguments)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"time": [], "position": np.zeros((0, 4)), "activation": np.zeros((0, 4))}, "at least one frame"),
        ({"position": np.zeros((26, 3))}, r"position.shape = \(26, 3\): must be \(26, 4\)"),
        ({"activation": np.zeros((25, 4))}, r"activation.shape = \(25, 4\)"),
        ({"activation": np.full((26, 4), 2.0)}, "activation = 2.0: must be in"),
        ({"position": np.full((26, 4), np.nan)}, r"position\[0, 0\] = nan"),
        ({"time": np.zeros(26)}, r"time\[1\] = 0.0: must be later"),
    ],
)
def test_bad_motions_are_refused(hop, change, message):
    given = {"model": hop.model, "time": hop.time, "position": hop.position, "activation": hop.activation, **change}
    with pytest.raises(ValueError, match=message):
        Motion(**given)


def test_stills_refuse_frames_that_are_not_there(hop, tmp_path):
    with pytest.raises(ValueError, match=r"frame = 26: must be in \[-26, 26\)"):
        still(hop, 26)
    last = still(hop, -1, tmp_path / "new" / "last.png", width=64, height=64, renderer="drawn")
    assert (tmp_path / "new" / "last.png").stat().st_size > 0
    np.testing.assert_array_equal(last, still(hop, 25, width=64, height=64, renderer="drawn"))


def test_the_import_is_light():
    code = "import sys, timsim; print([m for m in ('mujoco', 'matplotlib', 'imageio_ffmpeg') if m in sys.modules])"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=os.environ)
    assert run.stdout.strip() == "[]"


def test_gl_problem_is_told_in_one_line():
    assert "\n" not in gl_problem()
