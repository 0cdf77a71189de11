"""Elevation files as ground: the heights that a body meets are those of the file, and bad files are refused by name."""

import dataclasses

import mujoco
import numpy as np
import pytest
from PIL import Image

import motorgrad as mg
from motorgrad import bodies
from motorgrad._limits import MAX_ELEVATION_POINTS
from motorgrad.bodies import Hexapod, Hopper, OnTerrain, Terrain
from motorgrad.schema import build, table

HEIGHTS = np.array([[0.0, 0.1, 0.3, 0.2], [0.2, 0.4, 0.1, 0.0], [0.5, 0.2, 0.1, 0.3]])  # m, the first row in the north
SIZE = (3.0, 2.0)  # m, so that the points are 1 m apart

BALL = """<mujoco><worldbody><geom name="ground" type="plane" size="5 5 1" pos="0 0 0.5"/>
<body pos="%s %s 2"><joint name="fall" type="slide" axis="0 0 1"/><geom name="ball" size="0.05"/>
<body><joint name="arm"/><geom size="0.01" contype="0" conaffinity="0"/></body></body></worldbody>
<actuator><motor name="arm" joint="arm" ctrllimited="true" ctrlrange="-1 1"/></actuator></mujoco>"""


def grid(heights, keys="xllcorner 0\nyllcorner 0\ncellsize 1\nNODATA_value -9999\n"):
    rows, columns = heights.shape
    lines = "\n".join(" ".join(map(str, row)) for row in heights)
    return f"ncols {columns}\nnrows {rows}\n{keys}{lines}\n"


@pytest.fixture(params=["png 8", "png 16", "npy", "csv", "asc"])
def mapped(request, tmp_path):
    """The ground of a file of each kind with the heights above."""
    kind, _, bits = request.param.partition(" ")
    path = tmp_path / f"hills.{kind}"
    if kind == "png":
        levels = HEIGHTS / 0.5 * (2 ** int(bits) - 1)
        Image.fromarray(levels.round().astype(f"uint{bits}")).save(path)
    elif kind == "npy":
        np.save(path, HEIGHTS)
    elif kind == "csv":
        np.savetxt(path, HEIGHTS, delimiter=",")
    else:
        path.write_text(grid(HEIGHTS))
    return Terrain(map=path, height=0.5, size=SIZE, clearing=0.0)


def test_heights_are_those_of_the_file_and_linear_between_its_points(mapped):
    (x, y), heights = mapped.axes, mapped.heights()
    middle = np.mean([0.4, 0.1])  # between the two points nearest to the origin
    tolerance = 2e-3 if mapped.map.suffix == ".png" else 1e-12  # half a grey level of 8 bits
    for row, north in enumerate((1.0, 0.0, -1.0)):
        for column, east in enumerate((-1.5, -0.5, 0.5, 1.5)):
            there = heights[abs(y - north).argmin(), abs(x - east).argmin()]
            assert there + middle == pytest.approx(HEIGHTS[row, column], abs=tolerance)
    between = heights[abs(y - 1.0).argmin(), abs(x + 1.2).argmin()] + middle
    assert between == pytest.approx(0.03, abs=tolerance)
    half = dataclasses.replace(mapped, difficulty=0.5)
    np.testing.assert_allclose(half.heights(), heights / 2, atol=1e-15)


def test_a_body_of_ones_own_lands_on_the_height_of_the_file(mapped):
    """The model's only plane is its floor, at whatever height it lies."""
    east, north = 0.5, 1.0
    task = mg.tasks.compose(BALL % (east, north), observe=["joint-positions"], reward=["alive"], terrain=mapped)
    model = bodies.compile_model(task.dynamics)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    which = np.zeros(1, np.int32)
    ground = np.array([1, 0, 0, 0, 0, 0], np.uint8)
    start = np.array((east + 0.2, north - 0.3, 5.0))  # beside the ball
    (x, y), heights = mapped.axes, mapped.heights()
    below = heights[abs(y - start[1]).argmin(), abs(x - start[0]).argmin()]
    distance = mujoco.mj_ray(model, data, start, np.array((0.0, 0.0, -1.0)), ground, 1, -1, which)
    assert model.geom(which[0]).name == "terrain"
    assert 5.0 - distance == pytest.approx(0.5 + below, abs=1e-5)
    for _ in range(1000):
        mujoco.mj_step(model, data)
    assert {model.geom(each).name for each in data.contact.geom.ravel()} == {"terrain", "ball"}
    bottom = data.geom("ball").xpos[2] - 0.05
    peak = 0.3 - np.mean([0.4, 0.1])
    assert bottom == pytest.approx(0.5 + peak, abs=0.02)  # the ball rests on slopes around the point


@pytest.mark.parametrize(("body", "place"), [(Hexapod(), 0.0), (Hopper(), 2.0)])
def test_bodies_stand_where_the_file_says(body, place, tmp_path):
    np.save(tmp_path / "valley.npy", 0.15 * np.abs(np.linspace(-3, 3, 61)) * np.ones((61, 1)))
    valley = Terrain(map=tmp_path / "valley.npy", in_metres=True, size=(6.0, 6.0), clearing=0.0)
    spec = OnTerrain(body, valley).spec()
    spec.worldbody.first_body().pos[0] = place
    model = bodies.compile_model(spec)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qpos[2 if isinstance(body, Hexapod) else 0] += 0.4
    for _ in range(2500):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    assert {model.geom(each.geom1).name for each in data.contact} == {"terrain"}
    assert abs(data.qvel).max() < 5e-2
    where = data.contact.pos
    assert len(where) >= (3 if isinstance(body, Hexapod) else 1)
    np.testing.assert_allclose(where[:, 2], 0.15 * abs(where[:, 0]), atol=0.01)


def test_a_clearing_is_level_at_the_height_where_the_body_starts(mapped):
    clear = dataclasses.replace(mapped, clearing=0.4)
    (x, y), heights = clear.axes, clear.heights()
    far = np.hypot(*np.meshgrid(x, y))
    np.testing.assert_array_equal(heights[far <= 0.4], 0.0)
    bare = mapped.heights()
    np.testing.assert_allclose(heights[far >= 1.4], bare[far >= 1.4], atol=1e-15)


def test_the_file_is_kept_by_its_place_and_its_checksum(mapped, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    named = Terrain(map=mapped.map.name, height=0.5, size=SIZE, clearing=0.0)  # type: ignore[arg-type]
    assert named == mapped
    assert build(Terrain, table(mapped)) == mapped
    kept = table(mapped)
    np.save(tmp_path / "other.npy", HEIGHTS + 1.0)
    mapped.map.write_bytes((tmp_path / "other.npy").read_bytes())
    with pytest.raises(ValueError, match=rf"map = .*{mapped.map.name}.*checksum"):
        build(Terrain, kept)


def test_a_file_of_a_task_names_the_map_beside_it(tmp_path):
    np.save(tmp_path / "hills.npy", HEIGHTS)
    (tmp_path / "task.toml").write_text(
        f"body = '''{BALL % (0, 0)}'''\nobserve = ['joint-positions']\nreward = ['alive']\n"
        "[terrain]\nmap = 'hills.npy'\nin_metres = true\nsize = [3.0, 2.0]\n"
    )
    task = mg.tasks.load(tmp_path / "task.toml")
    assert task.terrain.map == tmp_path / "hills.npy"
    assert bodies.compile_model(task.dynamics).nhfield == 1


def test_what_is_lost_is_told(tmp_path):
    np.save(tmp_path / "fine.npy", np.eye(101))
    with pytest.warns(UserWarning, match=r"fine.npy': its points are 0.05 m apart, those of the ground 0.1 m"):
        Terrain(map=tmp_path / "fine.npy", size=(5.0, 10.0))
    with pytest.warns(UserWarning, match=r"fine.npy': the ground is level, as its difficulty is 0"):
        mg.make("hexapod", terrain={"map": tmp_path / "fine.npy"})


def picture(mode, size=(2, 2)):
    def write(path):
        Image.new(mode, size).save(path)

    return write


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("none.npy", None, "No such file"),
        ("hills.tif", b"", r"unknown kind of elevation file '\.tif'"),
        ("colours.png", picture("RGB"), "colours of the picture = 'RGB': must be grey levels of 8 or 16 bits"),
        ("wide.png", picture("L", (MAX_ELEVATION_POINTS // 4, 5)), "points = 5242880: must be at most 4,194,304"),
        ("text.png", b"no picture", "not a PNG picture"),
        ("pickle.npy", lambda path: np.save(path, np.array([[{}]]), allow_pickle=True), "[Oo]bject arrays"),
        ("line.npy", lambda path: np.save(path, np.zeros(4)), r"shape = \(4,\): must be \(rows, columns\)"),
        ("dates.npy", lambda path: np.save(path, np.zeros((2, 2), "M8[s]")), "must be numbers"),
        ("huge.npy", lambda path: np.save(path, np.zeros((2049, 2048), "u1")), "points = 4196352: must be at most"),
        ("gap.csv", b"1,2\n3,nan\n", "row 2, column 2 = nan: must be a finite number"),
        ("words.csv", b"1,2\n3,high\n", "could not convert string 'high'"),
        ("ragged.csv", b"1,2,3\n4,5\n", "number of columns changed from 3 to 2"),
        ("empty.csv", b"\n", "table = 'empty'"),
        ("latin.csv", b"\xe9,1\n", "not a text in UTF-8"),
        (
            "short.asc",
            b"ncols 3\nnrows 2\ncellsize 1\n1 2 3 4 5\n",
            "numbers of the grid = 5: must be nrows",
        ),
        ("long.asc", b"ncols 2\nnrows 2\n1 2 3 4 5\n", "numbers of the grid = 5: must be nrows × ncols = 4"),
        ("bare.asc", b"1 2\n3 4\n", "ncols = None: must be given"),
        ("much.asc", b"ncols 100000\nnrows 100000\n1", "points = 10000000000: must be at most"),
        ("twice.asc", b"ncols 2\nncols 2\nnrows 2\n1 2 3 4\n", "ncols = '2': must be a number, given once"),
        ("key.asc", b"ncol 2\nnrows 2\n1 2 3 4\n", "unknown key of the grid 'ncol': did you mean 'ncols'"),
        ("holes.asc", b"ncols 2\nnrows 2\nNODATA_value -9\n1 -9 3 4\n", r"points without data \(nodata_value\) = 1"),
    ],
)
def test_a_bad_file_is_refused_by_its_name(name, content, message, tmp_path):
    path = tmp_path / name
    if callable(content):
        content(path)
    elif content is not None:
        path.write_bytes(content)
    with pytest.raises(ValueError, match=rf"(?s)^map = .*{name}': .*{message}") as error:
        Terrain(map=path)
    assert len(str(error.value).splitlines()) == 1


def test_settings_that_do_not_go_together_are_refused(tmp_path):
    Image.new("L", (3, 3)).save(tmp_path / "hills.png")
    with pytest.raises(ValueError, match="in_metres = True: must be false for a picture"):
        Terrain(map=tmp_path / "hills.png", in_metres=True)
    with pytest.raises(ValueError, match="in_metres = True: must be false without a `map`"):
        Terrain(in_metres=True)
    with pytest.raises(ValueError, match="checksum = 'a': must be left out"):
        Terrain(checksum="a")


def test_a_body_with_two_planes_needs_one_that_is_called_floor():
    two = BALL.replace("<body pos", '<geom type="plane" size="1 1 1"/><body pos') % (0, 0)
    with pytest.raises(ValueError, match="a list with 'floor', or with one plane of the world"):
        bodies.compile_model(OnTerrain(bodies.Mjcf(two), Terrain()))
