"""Films and pictures from a camera anywhere: every renderer sees the body where geometry says it is."""

import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from PIL import Image

from timsim import Motion, Plot, Viewpoint, still, write_film

SMALL = {"width": 160, "height": 120}
BACKGROUND = np.array([237, 242, 247])
SVG = "{http://www.w3.org/2000/svg}"


def body(picture, tall=1.0):
    """The box of what is not background or ground, in the middle and upper part: left, top, right, bottom in pixels."""
    apart = np.abs(picture.astype(int) - BACKGROUND).max(axis=2) > 60
    rows, columns = np.nonzero(apart[: round(tall * len(picture))])
    return columns.min(), rows.min(), columns.max(), rows.max()


def test_a_viewpoint_says_what_it_looks_at():
    side = Viewpoint((0.0, -2.0, 0.5), (0.0, 0.0, 0.5), 40.0)
    assert np.allclose(side.axes, [[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    assert (side.distance, side.azimuth, side.elevation) == (2.0, 90.0, 0.0)
    high = Viewpoint((0.0, -1.0, 1.0), (0.0, 0.0, 0.0))
    assert np.isclose(high.elevation, -45.0)
    wide = side.for_aspect(2.0, 1.0)  # a picture half as wide shows as much from left to right
    assert np.isclose(np.tan(np.radians(wide.field_of_view) / 2), 2 * np.tan(np.radians(20.0)))
    assert side.for_aspect(1.0, 2.0) == side


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"target": (0.0, -2.0, 0.5)}, "target"),
        ({"position": (np.nan, 0.0, 0.0)}, "position"),
        ({"up": (0.0, 1.0, 0.0)}, "up"),
        ({"field_of_view": 0.0}, "field_of_view = 0.0"),
    ],
)
def test_an_impossible_viewpoint_is_refused(changed, said):
    with pytest.raises(ValueError, match=said):
        Viewpoint(**{"position": (0.0, -2.0, 0.5), "target": (0.0, 0.0, 0.5), **changed})


def test_the_body_is_where_the_camera_sees_it(hop, renderer):
    """From another side, from twice as far, and from beside it: the picture changes as geometry says."""
    middle = (0.0, 0.0, 0.55)
    look = {"renderer": renderer, "ground": "plain", **SMALL}

    def seen(*position, target=middle):
        return np.array(body(still(hop, 0, camera=Viewpoint(position, target), **look)[20:]))  # below the caption

    near, far = seen(0.0, -2.0, 0.55), seen(0.0, -4.0, 0.55)
    assert 1.8 < (near[3] - near[1]) / (far[3] - far[1]) < 2.2
    aside = seen(0.3, -4.0, 0.55, target=(0.3, 0.0, 0.55))
    moved = 0.3 * 60 / (4.0 * np.tan(np.radians(22.5)))  # pixels to the left
    assert abs((far[0] - aside[0]) - moved) <= 2
    assert abs((far[2] - aside[2]) - moved) <= 2


@pytest.mark.ci
@pytest.mark.representatives("drawn")
def test_a_plain_ground_leaves_nothing_but_body_and_shadow(hop, renderer):
    camera = Viewpoint((0.0, -3.0, 0.8), (0.0, 0.0, 0.5))
    plain = still(hop, 0, camera=camera, renderer=renderer, ground="plain", **SMALL)
    marked = still(hop, 0, camera=camera, renderer=renderer, **SMALL)
    assert np.abs(plain[-10:].astype(int) - BACKGROUND).max() < 6
    assert np.mean(np.abs(marked.astype(int) - plain).max(axis=2) > 8) > 0.02
    with pytest.raises(ValueError, match="ground"):
        still(hop, 0, ground="lawn")


@pytest.mark.ci
@pytest.mark.representatives("drawn")
def test_a_camera_that_moves_plots_beside_and_slow_motion_as_gif(hop, tmp_path, renderer):
    def camera(time):
        return Viewpoint((3 * np.sin(3 * time), -3 * np.cos(3 * time), 0.6), (0.0, 0.0, 0.5))

    height = Plot("height", hop.time, hop.position[:, 1], unit="m")
    made = write_film(
        hop, tmp_path / "a.gif", fps=24, speed=0.5, camera=camera, plots=[height], renderer=renderer, **SMALL
    )
    assert made.frames == 26  # of 0.5 s at half speed, 25 a second: a frame lasts 0.04 s
    with Image.open(made.path) as film:
        assert film.info["duration"] == 40
        frames = []
        for index in range(film.n_frames):
            film.seek(index)
            frames.append(np.asarray(film.convert("RGB")).astype(int))
    assert frames[0].shape[0] == 120
    assert frames[0].shape[1] > 160 + 60
    orange = [np.nonzero(np.abs(frame[:, 164:] - (217, 115, 13)).max(axis=2) < 40) for frame in frames]
    places = [np.median(columns) for _, columns in orange if len(columns)]
    assert len(places) > len(frames) / 2
    assert np.all(np.diff(places) >= 0)  # the line at the present moment moves to the right
    assert np.abs(frames[0][:, :160] - frames[-1][:, :160]).max() > 60


def test_a_pose_as_a_vector_picture(hop, tmp_path):
    camera = Viewpoint((1.5, -2.0, 1.0), (0.0, 0.0, 0.5))
    pixels = still(hop, 12, tmp_path / "pose.svg", camera=camera, **SMALL)
    text = (tmp_path / "pose.svg").read_text()
    root = ElementTree.fromstring(text)
    assert root.tag == f"{SVG}svg"
    assert root.find(f".//{SVG}image") is None  # nothing in pixels
    drawn = root.findall(f".//{SVG}path")
    assert len(drawn) > 10
    colours = {word for path in drawn for word in path.get("style", "").replace(";", " ").split() if word[0] == "#"}
    from timsim.film import muscle_colour

    for red, green, blue in np.round(255 * muscle_colour(hop.activation[12])).astype(int):
        assert any(np.abs(np.array([*bytes.fromhex(each[1:])]) - (red, green, blue)).max() <= 1 for each in colours)
    # the same pose from the same camera as the picture in pixels has
    assert pixels.shape == (120, 160, 3)
    again = still(hop, 12, tmp_path / "again.svg", camera=camera, **SMALL)
    assert np.array_equal(again, pixels)
    assert (tmp_path / "again.svg").read_text() == text


def test_every_muscle_is_a_path_of_its_own_coloured_by_activation(hop, tmp_path):
    rest = np.zeros((1, 4))
    rest[0, 2] = 1.0
    still(Motion(hop.model, hop.time[:1], hop.position[:1], rest), 0, tmp_path / "one.svg", camera=90, **SMALL)
    root = ElementTree.fromstring((tmp_path / "one.svg").read_text())
    styles = [path.get("style") for path in root.findall(f".//{SVG}g[@id='muscles']//{SVG}path")]
    assert len(styles) == hop.model.nu
    silent, firing = ([re.search(r"stroke: (#\w{6})", styles[row])[1] for row in rows] for rows in ([0, 1, 3], [2]))
    assert len({*silent}) == 1
    assert {*silent}.isdisjoint(firing)
