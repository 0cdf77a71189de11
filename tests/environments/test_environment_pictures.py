"""Pictures: on request, on the screen, as films; and clear words where there can be none."""

import subprocess
import sys

import gymnasium
import mujoco
import numpy as np
import pytest
from environment_examples import HOPPER, hopping

from motorgrad.environments import TaskEnv
from motorgrad.tasks import HexapodSynergy, Hopper

SMALL = {"width": 96, "height": 64}

WINDOW = """
import time
import matplotlib
import numpy as np
from motorgrad.environments import TaskEnv
shown = TaskEnv("hopper", render_mode="human", width=96, height=64)
asked = TaskEnv("hopper", render_mode="rgb_array", width=96, height=64)
assert shown.metadata["render_modes"] == ["human", "rgb_array"]
assert matplotlib.get_backend().lower() == "webagg"
import matplotlib.pyplot as plt
begun = time.perf_counter()  # the clock starts with the episode
shown.reset(seed=0), asked.reset(seed=0)  # a beginning is always drawn
(number,) = plt.get_fignums()
canvas = plt.figure(number).canvas
picture = np.asarray(canvas.buffer_rgba())[..., :3].astype(int)
assert picture.shape == (64, 96, 3), picture.shape
assert np.abs(picture - asked.render()).max() <= 2
for _ in range(40):
    action = np.array([0, 1])
    shown.step(action)
    assert shown.render() is None
assert time.perf_counter() - begun > 0.39  # not faster than its clock
assert (np.asarray(canvas.buffer_rgba())[..., :3] != picture).any()
plt.close(number)  # as a user may
shown.step([0, 0])
shown.close()
assert not plt.get_fignums()
"""


def test_a_picture_shows_what_is_now():
    environment = gymnasium.make(HOPPER, render_mode="rgb_array", **SMALL)
    environment.reset(seed=0)
    still = environment.render()
    assert (still.shape, still.dtype) == ((64, 96, 3), np.uint8)
    kept = still.copy()
    for decision in range(40):
        environment.step(hopping(decision))
    moved = environment.render()
    assert (moved != still).any()
    np.testing.assert_array_equal(still, kept)
    environment.reset()
    np.testing.assert_array_equal(environment.render(), kept)
    environment.close()


def test_pictures_are_made_by_one_renderer_that_stays_open():
    environment = gymnasium.make(HOPPER, render_mode="rgb_array", **SMALL)
    environment.reset(seed=0)
    environment.render()
    backend = environment.unwrapped._picture._painter._backend
    for decision in range(4):
        environment.step(hopping(decision))
        environment.render()
    assert environment.unwrapped._picture._painter._backend is backend
    environment.close()
    with pytest.raises(gymnasium.error.ClosedEnvironmentError):
        environment.render()


def test_every_row_has_its_picture():
    vector = gymnasium.make_vec(HOPPER, num_envs=2, render_mode="rgb_array", **SMALL)
    vector.reset(seed=0)
    one, other = vector.render()
    np.testing.assert_array_equal(one, other)
    for decision in range(40):
        vector.step(np.stack([hopping(decision), [0, 0]]))
    one, other = vector.render()
    assert (one != other).any()
    assert vector.metadata["render_fps"] == 100
    vector.close()


@pytest.mark.ci
def test_the_muscles_that_a_unit_drives_are_seen_to_fire():
    for task in (Hopper(units=5), HexapodSynergy()):
        environment = TaskEnv(task, render_mode="rgb_array", **SMALL)
        environment.reset(seed=0)
        pictures = []
        for unit in (0, 1):
            environment.reset(seed=0)
            silent = environment.render()
            environment.step(np.arange(task.action_size) == unit)
            np.testing.assert_array_equal(environment._picture._action[0], np.asarray(task.drives)[unit])
            assert (environment.render() != silent).any()
            pictures.append(environment.render().copy())
        assert (pictures[0] != pictures[1]).any()
        environment.close()


@pytest.mark.ci
def test_a_list_of_pictures_is_gymnasiums_own():
    environment = gymnasium.make(HOPPER, render_mode="rgb_array_list", **SMALL)
    environment.reset(seed=0)
    environment.step([0, 1])
    assert len(environment.render()) == 2
    environment.close()


def test_a_task_without_a_body_has_no_picture():
    for render_mode in ("human", "rgb_array"):
        with pytest.raises(ValueError, match=f"render_mode = '{render_mode}': must be None, as task 'chain' has no"):
            gymnasium.make("motorgrad/Chain-v0", render_mode=render_mode)
    assert TaskEnv("chain").metadata["render_modes"] == []
    assert TaskEnv("chain").render() is None


@pytest.mark.parametrize("reason", ["display", "backend"])
def test_no_screen_is_an_error_with_a_reason(monkeypatch, reason):
    if reason == "backend":
        monkeypatch.setenv("MPLBACKEND", "agg")
    else:
        if not sys.platform.startswith("linux"):
            pytest.skip("a display cannot be taken away here")
        for name in ("MPLBACKEND", "DISPLAY", "WAYLAND_DISPLAY"):
            monkeypatch.delenv(name, raising=False)
    assert TaskEnv("hopper").metadata["render_modes"] == ["rgb_array"]
    with pytest.raises(RuntimeError, match=f"render_mode = 'human': no window can be opened.*{reason}"):
        gymnasium.make(HOPPER, render_mode="human")


@pytest.mark.ci
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="there may be a screen")
def test_a_toolkit_without_its_screen_is_an_error_with_a_reason(process_environment):
    code = "from motorgrad.environments import TaskEnv\nTaskEnv('hopper', render_mode='human')"
    environment = {**process_environment, "MPLBACKEND": "tkagg"} | {"DISPLAY": "", "WAYLAND_DISPLAY": ""}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, timeout=600)
    assert done.returncode == 1
    assert "RuntimeError: render_mode = 'human': no window can be opened" in done.stderr.splitlines()[-1]


@pytest.mark.ci
def test_the_window_shows_the_pictures_at_the_pace_of_the_clock(process_environment):
    """In a browser's window, the one of matplotlib that needs no display."""
    pytest.importorskip("tornado", reason="matplotlib's window in a browser needs tornado")
    environment = {**process_environment, "MPLBACKEND": "webagg"}
    done = subprocess.run([sys.executable, "-c", WINDOW], capture_output=True, text=True, env=environment, timeout=600)
    assert done.returncode == 0, done.stderr


def test_a_film_is_recorded(tmp_path):
    pytest.importorskip("moviepy", reason="Gymnasium's RecordVideo needs moviepy")
    environment = gymnasium.make(HOPPER, render_mode="rgb_array", time_limit=0.1, **SMALL)
    environment = gymnasium.wrappers.RecordVideo(environment, str(tmp_path / "films"), episode_trigger=lambda _: True)
    environment.reset(seed=0)
    while not environment.step([0, 1])[3]:
        pass
    environment.close()
    (film,) = (tmp_path / "films").glob("*.mp4")
    assert film.stat().st_size > 0


@pytest.mark.ci
@pytest.mark.needs("OpenGL")
def test_a_picture_costs_no_new_renderer(monkeypatch):
    made, make = [], mujoco.MjrContext
    monkeypatch.setattr(mujoco, "MjrContext", lambda *about: made.append(about) or make(*about))
    environment = gymnasium.make(HOPPER, render_mode="rgb_array", **SMALL)
    environment.reset(seed=0)
    for _ in range(5):
        environment.render()
        environment.step([0, 1])
    assert len(made) == 1
    environment.close()
