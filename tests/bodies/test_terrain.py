"""Uneven ground: its heights, its field in MuJoCo, and bodies on it."""

import dataclasses

import mujoco
import numpy as np
import pytest

from motorgrad import bodies
from motorgrad.bodies import Arm, BodyBatch, Hexapod, Hopper, OnTerrain, Terrain

KINDS = ("bumps", "slopes", "steps", "waves")


@pytest.fixture(params=KINDS)
def kind(request):
    return request.param


def test_heights_keep_to_their_height_and_grow_with_the_difficulty(kind):
    full = Terrain(kind, height=0.2, clearing=0.0).heights()
    assert 0.05 < np.ptp(full) <= 0.2
    half = Terrain(kind, height=0.2, clearing=0.0, difficulty=0.5).heights()
    np.testing.assert_allclose(half, full / 2, atol=1e-15)
    np.testing.assert_array_equal(Terrain(kind, difficulty=0.0).heights(), 0.0)


def test_the_origin_is_at_0_and_the_clearing_level(kind):
    for clearing in (0.0, 0.8):
        terrain = Terrain(kind, clearing=clearing)
        (x, y), heights = terrain.axes, terrain.heights()
        assert heights.shape == (len(y), len(x)) == (121, 241)
        far = np.hypot(*np.meshgrid(x, y))
        np.testing.assert_array_equal(heights[far <= max(clearing, 1e-9)], 0.0)
        assert np.ptp(heights[far > clearing + 1.0]) > 0.02


def test_seeds_differ_and_repeat(kind):
    one, again, other = (Terrain(kind, seed=seed).heights() for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, again)
    assert abs(one - other).max() > 0.02


def test_bumps_are_even_over_their_range():
    heights = Terrain("bumps", height=1.0, clearing=0.0).heights()
    shares, _ = np.histogram(heights - heights.min(), bins=10, range=(0, 1))
    np.testing.assert_allclose(shares / heights.size, 0.1, atol=0.01)


def test_slopes_rise_and_fall_along_x_at_their_gradient():
    terrain = Terrain("slopes", height=0.3, spacing=4.0, clearing=0.0)
    heights = terrain.heights()
    assert np.ptp(heights, axis=0).max() == 0.0  # nothing changes along y
    gradient = np.diff(heights[0]) / terrain.cell
    inside = abs(abs(gradient) - 0.15) < 0.05  # .3 m in 2 m, give or take a quarter
    assert inside.mean() > 0.8  # the rest are the ridges and valleys
    middle = len(gradient) // 2
    assert gradient[middle] > 0 > gradient[middle - 1]  # uphill from the origin on both sides


def test_steps_are_level_plateaus_with_risers_of_one_cell():
    terrain = Terrain("steps", height=0.3, spacing=1.0, clearing=0.0)
    rises = np.diff(terrain.heights(), axis=1)
    assert (rises == 0.0).mean() == pytest.approx(1 - 1 / 5, abs=0.02)  # plateaus of .5 m, cells of .1 m


def test_waves_have_their_length():
    terrain = Terrain("waves", spacing=2.0, clearing=0.0, size=(24.0, 24.0))
    heights = terrain.heights()
    power = abs(np.fft.fft2((heights - heights.mean()) * np.outer(*[np.hanning(len(heights))] * 2))) ** 2
    wave = np.fft.fftfreq(len(heights), terrain.cell)
    number = np.hypot(*np.meshgrid(wave, wave))
    assert power[abs(number - 0.5) < 0.1].sum() / power.sum() > 0.95


def test_the_field_in_mujoco_has_these_heights(kind):
    terrain = Terrain(kind, height=0.2, seed=3)
    model = bodies.compile_model(OnTerrain(Hexapod(), terrain))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    group = np.array([1, 0, 0, 0, 0, 0], np.uint8)
    x, y = terrain.axes
    heights, which = terrain.heights(), np.zeros(1, np.int32)
    rng = np.random.default_rng(0)
    for row, column in zip(rng.integers(1, len(y) - 1, 50), rng.integers(1, len(x) - 1, 50), strict=True):
        if np.hypot(x[column], y[row]) < 0.8:
            continue  # there the body stands in the way
        start = np.array((x[column] + 1e-7, y[row] + 1e-7, 5.0))
        distance = mujoco.mj_ray(model, data, start, np.array((0.0, 0.0, -1.0)), group, 1, -1, which)
        assert model.geom(which[0]).name == "terrain"
        assert 5.0 - distance == pytest.approx(heights[row, column], abs=1e-5)


@pytest.mark.ci
def test_level_ground_carries_as_the_floor_does():
    level = Terrain(difficulty=0.0)
    for body, contact, weight in (
        (Hopper(), "foot_contact", 2.8 * 9.81),
        (Hexapod(), "belly_middle", None),
    ):
        model = bodies.compile_model(OnTerrain(body, level))
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        for _ in range(2500):
            mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)
        assert {model.geom(c.geom1).name for c in data.contact} == {"terrain"}
        assert abs(data.qvel).max() < 2e-2
        assert data.sensor(contact).data[0] > 1.0
        if weight is not None:
            assert data.sensor(contact).data[0] == pytest.approx(weight, rel=2e-3)


def test_a_hopper_lands_on_the_height_below_it():
    """Dropped on a plateau's edge it stands there, not on the floor; the plane around is lower than all ground."""
    terrain = Terrain("steps", height=0.3, clearing=0.0, seed=1)
    spec = OnTerrain(Hopper(), terrain).spec()
    heights, (x, y) = terrain.heights(), terrain.axes
    row, column = np.unravel_index(heights.argmax(), heights.shape)
    spec.body("load").pos[:2] = x[column], y[row]
    model = bodies.compile_model(spec)
    assert model.geom("floor").pos[2] < heights.min()
    data = mujoco.MjData(model)
    data.qpos[0] = heights.max() + 0.1
    for _ in range(2500):
        mujoco.mj_step(model, data)
    assert data.sensor("foot_height").data[2] == pytest.approx(heights.max(), abs=3e-3)


def test_an_arm_hangs_over_it_as_before():
    bare, over = (BodyBatch(body, 1) for body in (Arm(), OnTerrain(Arm(), Terrain())))
    for batch in (bare, over):
        for _ in range(30):
            batch.step([[1.0]])
    np.testing.assert_array_equal(bare.packed, over.packed)


def test_a_body_is_the_same_on_it():
    body = Hexapod(drive="servos")
    placed = OnTerrain(body, Terrain())
    for name in ("muscles", "servos", "groups", "sensor_components"):
        assert getattr(placed, name) == getattr(body, name)
    assert OnTerrain(Hopper()).servos == ()
    assert hash(placed) == hash(OnTerrain(body, Terrain()))


def test_each_seed_has_its_own_ground_and_its_own_bits():
    grounds = [OnTerrain(Hexapod(), Terrain("bumps", height=0.2, seed=seed, clearing=0.0)) for seed in (0, 1, 0)]
    actions = np.random.default_rng(0).random((30, 1, 24)).round()

    def run(batch):
        for action in actions:
            batch.step(np.repeat(action, batch.seeds, 0))
        return batch.packed.copy()

    batch = BodyBatch(grounds, 3, substeps=8)
    assert batch.models[0] is batch.models[2] is not batch.models[1]
    start, saved = batch.packed.copy(), batch.snapshot()
    together = run(batch)
    np.testing.assert_array_equal(together[0], together[2])
    assert abs(together[0] - together[1]).max() > 1e-3
    for row, ground in enumerate(grounds):
        np.testing.assert_array_equal(run(BodyBatch(ground, 1, substeps=8))[0], together[row])
    np.testing.assert_array_equal(run(BodyBatch(grounds, 3, substeps=8, threads=1)), together)
    batch.restore(saved)
    np.testing.assert_array_equal(run(batch), together)
    batch.reset([1])
    np.testing.assert_array_equal(batch.packed[1], start[1])


def test_bodies_that_differ_in_more_than_numbers_are_refused():
    with pytest.raises(ValueError, match="body = '2 bodies': must be one, or one for each of 3 seeds"):
        BodyBatch([Hopper(), Hopper()], 3)
    with pytest.raises(ValueError, match="groups of a body of the batch"):
        BodyBatch([Hexapod(), Hexapod(drive="servos")], 2)
    with pytest.raises(ValueError, match=r"timestep of a body of the batch = 0\.001"):
        BodyBatch([Hexapod(), Hexapod(timestep=0.001)], 2)


def test_bodies_of_different_numbers_go_together():
    light, heavy = Hopper(), Hopper(load_mass=3.0)
    batch = BodyBatch([light, heavy], 2)
    for _ in range(30):
        batch.step(np.tile([0.0, 1.0], (2, 1)))
    for row, body in enumerate((light, heavy)):
        alone = BodyBatch(body, 1)
        for _ in range(30):
            alone.step([[0.0, 1.0]])
        np.testing.assert_array_equal(alone.packed[0], batch.packed[row])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"kind": "bump"}, "unknown kind 'bump': did you mean 'bumps'"),
        ({"cell": 0.05}, "cell = 0.05: must be a finite number of at least 0.1, in m"),
        ({"height": 0.0}, "height = 0.0"),
        ({"difficulty": 1.1}, r"difficulty = 1.1: must be in \[0, 1\]"),
        ({"spacing": 0.1}, "spacing = 0.1: must be at least two cells"),
        ({"size": (10.0, 0.1)}, "size = "),
        ({"size": (1e4, 1e4)}, "size = .*at most 4000000 points"),
        ({"seed": -1}, "seed = -1"),
        ({"clearing": -0.1}, "clearing = -0.1"),
    ],
)
def test_bad_numbers_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        Terrain(**changes)


def test_a_body_without_a_floor_is_refused():
    class Floating:
        muscles = groups = ()
        sensor_components: dict = dataclasses.field(default_factory=dict)

        def spec(self):
            return mujoco.MjSpec()

    with pytest.raises(ValueError, match="geoms of the body"):
        OnTerrain(Floating(), Terrain()).spec()  # type: ignore[arg-type]


def test_a_body_that_cannot_be_hashed_is_still_a_body():
    class Unhashable:
        __hash__ = None  # type: ignore[assignment]
        muscles, groups, sensor_components = Hopper().muscles, Hopper().groups, Hopper().sensor_components

        def spec(self):
            return Hopper().spec()

    one, other = BodyBatch(Unhashable(), 2), BodyBatch(Hopper(), 2)
    for batch in (one, other):
        batch.step(np.ones((2, 2)))
    np.testing.assert_array_equal(one.packed, other.packed)


def test_the_callback_is_watched_if_any_of_the_bodies_needs_it():
    batch = BodyBatch([Hopper(muscle_model="native"), Hopper()], 2)
    batch.step(np.ones((2, 2)))
    mujoco.set_mjcb_act_gain(None)
    with pytest.raises(RuntimeError, match="callback"):
        batch.step(np.ones((2, 2)))
