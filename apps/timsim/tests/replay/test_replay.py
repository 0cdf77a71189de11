"""Replays: one small file that plays from the disk alone, and shows the body where it was at each moment."""

import base64
import gzip
import io
import json
import re

import numpy as np
import pytest
from PIL import Image

import timsim
from motorgrad.cli import main
from patience import until
from timsim import Motion, Plot, write_replay
from timsim.film import Annotations, Arrow, Curve
from timsim.replay import _replay


def unpacked(path):
    """The description in a replay, and its arrays as they were before packing."""
    text = re.search(r'<script id="data" type="text/plain">([^<]*)</script>', path.read_text("utf-8"))[1]
    stream = gzip.decompress(base64.b64decode(text))
    size = int.from_bytes(stream[:4], "little")
    about, arrays = json.loads(stream[4 : 4 + size]), {}
    for name, (kind, place, shape) in about["arrays"].items():
        array = np.frombuffer(stream, f"<{kind}", int(np.prod(shape)), 4 + size + place).reshape(shape)
        arrays[name] = np.cumsum(array, 0, dtype=kind) if kind == "i2" else array
    return about, arrays


def silhouette(page):
    """Where the picture shows something other than sky, ground, lines and shadow, which are grey: columns and rows."""
    pixels = np.asarray(Image.open(io.BytesIO(page.locator("#picture").screenshot())).convert("RGB")).astype(int)
    body = np.ptp(pixels, axis=2) > 40  # the muscles, red as they fire
    body[:40] = body[-60:] = False  # words and legend
    rows, columns = np.nonzero(body)
    assert len(rows) > 100
    return columns, rows


def test_postures_and_paths_come_back_within_a_fraction_of_a_millimetre(hop, tmp_path):
    import mujoco

    made = write_replay(hop, tmp_path / "new" / "hop.html", fps=50)
    assert (made.frames, made.fps, made.seconds) == (26, 50, 0.5)
    assert made.size == made.path.stat().st_size < 150_000
    about, arrays = unpacked(made.path)
    told, data = about["motions"][0], mujoco.MjData(hop.model)
    for frame in (0, 13, 25):
        data.qpos[:] = hop.position[frame]
        mujoco.mj_fwdPosition(hop.model, data)
        place = arrays["0.origin"][frame] + told["scale"] * arrays["0.places"][frame]
        parts = [hop.model.body(name).id for name in told["bodies"]]
        np.testing.assert_allclose(place, data.xpos[parts], atol=1e-4)
        turn = arrays["0.turns"][frame] / 32767
        np.testing.assert_allclose(np.abs(np.sum(turn * data.xquat[parts], 1)), 1, atol=1e-4)
        np.testing.assert_allclose(arrays["0.levels"][frame] / 254, hop.activation[frame], atol=3e-3)
    lengths = {each["title"]: each for each in about["plots"]}
    assert list(lengths) == ["activation", "joint angles", "positions"]
    assert [lengths[name]["unit"] for name in lengths] == ["", "°", "m"]


def test_it_plays_from_the_disk_and_the_body_moves_when_scrubbed(hop, browser, tmp_path):
    far = Motion(hop.model, hop.time, hop.position * [0, 6, 1, 1], 0.5 + 0.5 * hop.activation, "jumping")

    def added(time):
        arrow = Arrow("to the right", np.array([(0.2, 0, 0.7), (0.6, 0, 0.7)]), "#0000ff", 0.02)
        return (
            Annotations(["late", Curve("clock (s)", np.ones(1), np.ones(1) * time, "#000000")], [arrow])
            if time > 0.45
            else Annotations()
        )

    plots = [Plot("reward", hop.time, hop.time, unit="N")]
    made = write_replay(far, tmp_path / "hop.html", plots=plots, annotations=added)
    context = browser.new_context(viewport={"width": 900, "height": 600}, offline=True)
    page, asked, faults = context.new_page(), [], []
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("console", lambda message: faults.append(message.text))
    page.goto(f"{made.path.as_uri()}#t=0&camera=Side")
    page.locator("body[data-ready]").wait_for()
    low = silhouette(page)
    highest = float(hop.time[np.argmax(far.position[:, 1])])
    page.locator("#time").fill(str(highest))
    page.locator("#clock", has_text=f"{highest:.2f} s").wait_for()
    high = silhouette(page)
    assert high[1].mean() < low[1].mean() - 40  # higher in the picture by more than 40 pixels
    assert f"reward {highest:.3g}"[:9] in page.locator("#plots").inner_text()
    assert page.locator("#added").inner_text() == ""
    page.locator("#time").fill("0.5")
    page.locator("#added", has_text="late").wait_for()
    assert "clock (s) 0.5" in page.locator("#plots").inner_text()
    pixels = np.asarray(Image.open(io.BytesIO(page.locator("#picture").screenshot())).convert("RGB")).astype(int)
    rows, columns = np.nonzero(pixels[..., 2] - pixels[..., :2].max(axis=2) > 60)
    assert np.ptp(columns) > 2 * np.ptp(rows) > 10  # the arrow, which is level
    page.locator("#time").fill(str(highest))
    page.get_by_role("button", name="Front").click()
    assert np.ptp(silhouette(page)[0]) < np.ptp(high[0])  # a planar leg is narrower from the front
    page.wait_for_function("location.hash.includes('camera=Front')")
    assert f"t={highest:.3f}" in page.url  # the address keeps the moment and the view
    # at each loop the picture stays: no frame is empty
    page.locator("#speed").select_option("8")
    page.get_by_role("button", name="Play").click()
    for _ in range(4):
        silhouette(page)
    page.get_by_role("button", name="Pause").click()
    assert faults == []
    assert [url for url in asked if not url.startswith(("file:", "data:"))] == []
    context.close()


def test_bodies_stand_side_by_side_and_meshes_and_hills_are_taken_along(hop, tmp_path):
    import mujoco

    text = """<mujoco><asset>
      <mesh name="pyramid" vertex="0 0 0  1 0 0  0 1 0  0 0 1"/>
      <hfield name="hill" nrow="3" ncol="2" size="1 2 .5 .1" elevation="0 0 0 1 0 0"/></asset>
      <worldbody><geom type="hfield" hfield="hill"/><body name="stone" pos="0 0 2"><freejoint/>
      <geom type="mesh" mesh="pyramid"/></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    position = np.tile(model.qpos0, (3, 1))
    position[2, 3:] *= -1  # the same turn
    stone = Motion(model, np.arange(3) / 30, position, np.zeros((3, 0)), "a stone")
    about, arrays = unpacked(write_replay([hop, stone], tmp_path / "both.html").path)
    assert [motion["label"] for motion in about["motions"]] == ["hopping", "a stone"]
    assert arrays["1.mesh0.points"].shape == (4, 3)
    assert arrays["1.field0.points"].shape == (6, 3)
    assert arrays["1.field0.points"][:, 2].max() == 0.5
    assert arrays["1.turns"].std(axis=0).max() == 0


def test_what_is_too_large_is_thinned_and_then_refused(hop, tmp_path, monkeypatch):
    whole = write_replay(hop, tmp_path / "hop.html", fps=120)
    monkeypatch.setattr(_replay, "MAX_REPLAY_BYTES", whole.size - 1)
    assert write_replay(hop, tmp_path / "hop.html", fps=120).fps == 60
    monkeypatch.setattr(_replay, "MAX_REPLAY_BYTES", 1000)
    with pytest.raises(ValueError, match="take a shorter motion"):
        write_replay(hop, tmp_path / "hop.html", fps=6)


@pytest.mark.parametrize(
    ("name", "settings", "said"),
    [
        ("hop.mp4", {}, "ending in .html"),
        ("hop.html", {"fps": 0}, "fps = 0"),
        ("hop.html", {"plots": ["reward"]}, r"plots\[0\]"),
    ],
)
def test_what_cannot_be_replayed_is_refused(hop, tmp_path, name, settings, said):
    with pytest.raises(ValueError, match=said):
        write_replay(hop, tmp_path / name, **settings)
    with pytest.raises(ValueError, match=r"values\.shape of 'reward'"):
        Plot("reward", hop.time, hop.time[1:])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.ci
def test_the_seconds_of_a_command_are_those_of_its_replay(tmp_path):
    path = tmp_path / "hop.html"
    assert main(["sim", "hopper", "--no-browser", "--record", str(path), "--seconds", "0.5"]) == 0
    assert unpacked(path)[1]["moments"][-1] == pytest.approx(0.5, abs=0.03)  # starting takes far longer


@pytest.mark.ci
def test_a_live_run_is_recorded_decision_by_decision(tmp_path):
    path = tmp_path / "run.html"
    with timsim.view("hopper", seed=3, speed=4.0, record=path) as page:
        recorder = page._recordings[0]
        assert until(lambda: recorder.seconds >= 1.0)
    about, arrays = unpacked(path)
    assert path.stat().st_size <= 10_000_000
    reward = next(i for i, plot in enumerate(about["plots"]) if plot["title"].startswith("reward"))
    np.testing.assert_allclose(np.diff(arrays[f"plot{reward}.time"]), page.session.period, rtol=1e-3)
    assert np.isfinite(arrays[f"plot{reward}.values"]).all()
    assert arrays["0.origin"].std(axis=0).max() > 1e-3  # it moved
