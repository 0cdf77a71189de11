"""Settings of a planet, tasks on it, and its part of the page."""

from types import SimpleNamespace

import numpy as np
import pytest
import viser

from motorgrad.bodies import Hexapod, compile_model
from motorgrad.schema import build, table
from motorgrad.tasks import make
from patience import until
from timsim.planet import Detail, OnPlanet, Planet, PlanetBatch, PlanetScene, on_planet
from timsim.planet._tiles import TRIANGLES, Key
from timsim.scene import Pose


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"radii": (3.0, 0.0, 3.0)}, r"radii\[1\] = 0.0: must be in \[1, 1e\+06\], in m"),
        ({"radii": (3.0, 3.0)}, "radii"),
        ({"kind": "hills"}, "unknown kind 'hills'"),
        ({"height": -1.0}, "height = -1.0"),
        ({"height": 1.0}, "height = 1.0: must be at most 0.75 m on these radii"),
        ({"spacing": 0.1}, "spacing = 0.1: must be at least two cells"),
        ({"seed": -1}, "seed = -1"),
        ({"patch": 2.0}, "patch = 2.0: must be from two cells, 0.2 m, to half of the least radius"),
        ({"cell": 0.01}, "cell = 0.01"),
        ({"latitude": 91.0}, "latitude"),
        ({"heading": float("nan")}, "heading"),
        ({"travel": 0.9}, "travel = 0.9"),
        ({"map": "nowhere.npy"}, "map = 'nowhere.npy': No such file"),
        ({"detail": Detail, "triangles": 10}, "triangles = 10: must be an integer of at least 20,000"),
    ],
)
def test_what_cannot_be_is_refused_by_name(wrong, named):
    with pytest.raises(ValueError, match=named):
        (Detail if wrong.pop("detail", None) else Planet)(**wrong)


def test_settings_come_from_a_table_and_go_back():
    given = {"radii": [5, 4, 4.5], "kind": "waves", "detail": {"triangles": 30_000}}
    planet = build(Planet, given, "planet")
    assert planet.radii == (5.0, 4.0, 4.5)
    assert planet.detail.triangles == 30_000
    assert build(Planet, table(planet)) == planet
    with pytest.raises(ValueError, match=r"setting of planet 'radius'.*did you mean 'radii'"):
        build(Planet, {"radius": 3}, "planet")


def test_a_map_is_read_from_a_file(tmp_path):
    heights = 0.1 * np.random.default_rng(0).random((9, 18))
    np.save(tmp_path / "map.npy", heights)
    planet = Planet(map=tmp_path / "map.npy")
    assert planet.elevation.greatest == heights[1:-1].max()
    for name, content, named in (
        ("tall.npy", heights + 9, "heights of at most 0.375 m"),
        ("flat.npy", heights[0], r"map = .*shape \(18,\)"),
        ("text.npy", np.full((3, 3), "a"), "finite numbers"),
    ):
        np.save(tmp_path / name, content)
        with pytest.raises(ValueError, match=named):
            Planet(map=tmp_path / name)
    (tmp_path / "broken.npy").write_text("no numbers")
    with pytest.raises(ValueError, match="must be a NumPy file"):
        Planet(map=tmp_path / "broken.npy")


def test_a_body_stands_on_a_map_however_high_it_is(tmp_path):
    heights = np.full((9, 18), 0.2)
    np.save(tmp_path / "map.npy", heights)
    body = OnPlanet(Hexapod(drive="servos"), Planet(map=tmp_path / "map.npy"))
    assert body.planet.lift == pytest.approx(0.2)
    batch, plain = PlanetBatch(body, substeps=4), compile_model(body.body)
    assert batch._qpos[2] - plain.key_qpos[0, 2] == pytest.approx(0.2)
    for _ in range(100):
        batch.step(np.zeros((1, 12)))
    sensors = batch.unpack(batch.packed).sensors
    assert 0.3 < sensors["position"][0, 2] < 0.4
    assert sensors["upward"][0, 2] > 0.98
    assert Planet(height=0.3, kind="steps").lift == 0.0


def test_a_task_is_put_on_a_planet():
    task = on_planet(make("hexapod"), Planet(height=0.05))
    assert isinstance(task.dynamics, OnPlanet)
    assert isinstance(task, type(make("hexapod")))
    batch = task.batch([0])
    assert isinstance(batch, PlanetBatch)
    assert batch.substeps == task.substeps
    batch.step(np.zeros((1, 24)))
    for name, named in (("three-state", "a task on a body"), ("hopper", "parts of the body that the world holds")):
        with pytest.raises(ValueError, match=named):
            on_planet(make(name), Planet())


@pytest.fixture
def server():
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield server
    server.stop()


def moment(batch):
    """A moment of the run, as far as a pose reads it."""
    zero = np.zeros((1, batch.model.nu))
    position, velocity = batch._qpos[None].copy(), batch._qvel[None].copy()
    return SimpleNamespace(position=position, velocity=velocity, activation=zero[:, :0], control=zero, seconds=0.0)


@pytest.mark.ci
def test_the_part_draws_within_its_budget_and_keeps_the_planet_under_the_body(server):
    detail = Detail(triangles=30_000, changes=5, tolerance=0.2)
    body = OnPlanet(Hexapod(drive="servos"), Planet(height=0.2, kind="waves", detail=detail))
    batch, model, part = PlanetBatch(body), compile_model(body), PlanetScene()
    pose = Pose(model)
    part.build(server, SimpleNamespace(task=SimpleNamespace(dynamics=body), model=model))
    assert part.applies
    triangles, tiles = [], [0]

    def refined():
        pose.place(moment(batch))
        part.update(None, pose)
        triangles.append(part.triangles)
        tiles.append(part.tiles)
        assert part.milliseconds > 0
        return triangles[-1] >= 0.7 * 30_000

    assert until(refined)
    assert max(np.diff(tiles)) <= 5
    assert max(triangles) <= 30_000
    assert triangles[-1] > 0.7 * 30_000
    shown = {key for key, handle in part._handles.items() if handle.visible}
    assert len(shown) * TRIANGLES == triangles[-1]
    assert {key.level for key in shown} != {0}
    assert Key(0, 0, 0, 0) in part._handles
    # a little farther on
    field = model.hfield("patch").data.copy()
    for _ in range(3):
        batch._qpos[0] += 0.4
        batch.recentre()
        batch._batch.forward()
        pose.place(moment(batch))
        part.update(None, pose)
    frame = batch.frame
    np.testing.assert_allclose(part._node.position, frame.shift)
    assert np.abs(model.hfield("patch").data - field).max() > 0.01
    np.testing.assert_array_equal(model.hfield("patch").data, batch.model.hfield("patch").data)


def test_the_part_is_nothing_where_there_is_no_planet(server):
    part = PlanetScene()
    part.build(server, SimpleNamespace(task=None, model=None))
    assert not part.applies
    part.update(None, SimpleNamespace(bodies=[]))
    assert part.triangles == 0
