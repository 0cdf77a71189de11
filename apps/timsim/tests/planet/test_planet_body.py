"""A body on a planet: the local frame, the patch, and walking right around."""

import dataclasses

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motorgrad.bodies import LEGS, Hexapod, Hopper, OnTerrain, TripodController, compile_model, read_hexapod
from timsim.planet import Frame, OnPlanet, Planet, PlanetBatch
from timsim.planet._geometry import Ellipsoid, frame_at

WALKER = Hexapod(drive="servos")
PLACES = st.tuples(st.floats(-90, 90), st.floats(-180, 180), st.floats(0, 360))


@settings(deadline=None, max_examples=40)
@given(place=PLACES, x=st.floats(-0.5, 0.5), y=st.floats(-0.5, 0.5), z=st.floats(-0.2, 0.5))
def test_a_levelled_frame_is_level_and_leaves_everything_where_it_was(place, x, y, z):
    ellipsoid, point = Ellipsoid((3.0, 4.0, 3.5)), np.array([x, y, z])
    frame = frame_at(ellipsoid, *place)
    np.testing.assert_allclose(frame.foot(ellipsoid), 0.0, atol=1e-12)
    new = frame.levelled(ellipsoid, point)
    np.testing.assert_allclose(new.rotation @ new.rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(new.rotation) == pytest.approx(1.0)
    moved = new.to_local(frame.to_planet(point))
    np.testing.assert_allclose(moved[:2], (x, y), atol=1e-12)
    np.testing.assert_allclose(new.up(ellipsoid, moved), (0, 0, 1), atol=1e-9)
    turn, shift = frame.move_to(new)
    np.testing.assert_allclose(turn @ point + shift, moved, atol=1e-12)
    # the least rotation: about an axis in the plane
    np.testing.assert_allclose(turn[0, 1] - turn[1, 0], 0.0, atol=1e-9)
    again = Frame.of_pose(new.pose)
    np.testing.assert_allclose(again.to_planet(moved), new.to_planet(moved), atol=1e-12)


def test_headings_at_the_start():
    ellipsoid = Ellipsoid((3.0, 3.0, 3.0))
    for heading, way in ((0, (0, 0, 1)), (90, (0, 1, 0)), (180, (0, 0, -1)), (270, (0, -1, 0))):
        np.testing.assert_allclose(frame_at(ellipsoid, 0, 0, heading).rotation[0], way, atol=1e-12)
    np.testing.assert_allclose(frame_at(ellipsoid, 90, 0, 0).rotation[0], (-1, 0, 0), atol=1e-12)


def test_the_patch_of_a_smooth_sphere_is_the_sphere():
    planet = Planet(height=0.0)
    heights = planet.ground.heights(planet.start.levelled(planet.ellipsoid, np.array([0.4, -0.7, 0.0])))
    x, y = np.meshgrid(planet.ground.axis, planet.ground.axis)
    np.testing.assert_allclose(heights, np.sqrt(9.0 - x**2 - y**2) - 3.0, atol=1e-12)


@pytest.mark.parametrize("kind", ["bumps", "waves", "fractal"])
def test_the_patch_lies_on_the_ground(kind):
    planet = Planet((3.0, 4.0, 3.5), kind=kind, height=0.3, clearing=0.0, patch=1.1)
    frame = frame_at(planet.ellipsoid, 30.0, 50.0, 20.0)
    heights, foot = planet.ground.heights(frame), frame.foot(planet.ellipsoid)
    x, y = np.meshgrid(planet.ground.axis, planet.ground.axis)
    points = frame.to_planet(np.stack([x + foot[0], y + foot[1], heights], axis=-1))
    off = planet.surface.altitude(points) - planet.surface.heights(planet.ellipsoid.foot(points))
    assert np.abs(off).max() < 1e-3
    low, high = planet.ground.bounds
    assert low < heights.min()
    assert heights.max() < high


def test_the_model_has_the_ground_and_the_planet():
    body = OnPlanet(WALKER, Planet(height=0.2, latitude=30.0))
    batch, plain = PlanetBatch(body), compile_model(WALKER)
    model = batch.model
    assert model.nq == plain.nq + 7
    assert "floor" not in [model.geom(i).name for i in range(model.ngeom)]
    assert model.stat.extent == plain.stat.extent
    np.testing.assert_allclose(batch.frame.pose, body.planet.start.pose, atol=1e-12)
    low, high = body.planet.ground.bounds
    field = low + (high - low) * model.hfield("patch").data.reshape(31, 31)
    np.testing.assert_allclose(field, body.planet.ground.heights(body.planet.start), atol=1e-6)


def test_bodies_that_cannot_go_are_refused():
    with pytest.raises(ValueError, match=r"parts of the body that the world holds.*free joint"):
        OnPlanet(Hopper(), Planet()).spec()
    with pytest.raises(ValueError, match="height fields of the body = 1"):
        OnPlanet(OnTerrain(WALKER), Planet()).spec()
    with pytest.raises(ValueError, match="seeds = 2: must be 1"):
        PlanetBatch(OnPlanet(WALKER), 2)


class Walking:
    """The fixed controller on a planet."""

    def __init__(self, planet):
        self.batch = PlanetBatch(OnPlanet(WALKER, planet), substeps=4)
        self.controller, self.reading = TripodController(), read_hexapod(self.batch.unpack(self.batch.packed))
        self.lowest = np.array([[self.batch.model.joint(f"vertical_{leg}").range[0] for leg in LEGS]])
        self.states = self.controller.begin(self.reading)

    def go(self, seconds):
        for _ in range(round(seconds / self.batch.period)):
            self.states = self.controller.decide(self.states, self.reading, self.lowest)
            self.batch.step(self.controller.velocities(self.states))
            self.reading = read_hexapod(self.batch.unpack(self.batch.packed))
            yield self.batch.place


def energy(batch):
    """Kinetic energy of the body (J), its potential over the ellipsoid (J), its centre of mass on the planet (m), and
    its deepest contact (m)."""
    model, data = batch.model, batch._batch.get_data(0)
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    speed = data.qvel[:-6]
    trunk = model.body("middle").id
    centre = batch.frame.to_planet(data.subtree_com[trunk])
    potential = 9.81 * model.body_subtreemass[trunk] * batch.body.planet.surface.altitude(centre[None])[0]
    deepest = min((float(each.dist) for each in data.contact), default=0.0)
    return 0.5 * speed @ mass[:-6, :-6] @ speed, potential, centre, deepest


def test_motion_goes_on_where_the_patch_is_laid_anew():
    walking = Walking(Planet(height=0.1, travel=0.1, clearing=0.0))
    batch, found = walking.batch, []
    for _ in walking.go(3.2):
        before, laid, frame = energy(batch), batch.patch_updates, batch.frame
        trunk = frame.rotation.T @ batch._qvel[:3]
        batch.recentre()
        if batch.patch_updates > laid:
            after = energy(batch)
            np.testing.assert_allclose(batch.frame.rotation.T @ batch._qvel[:3], trunk, atol=1e-12)
            np.testing.assert_allclose(after[2], before[2], atol=1e-12)
            assert after[:2] == pytest.approx(before[:2], rel=1e-9)
            found.append(after[3] - before[3])
    assert len(found) > 8
    assert np.abs(found).max() < 0.004  # m; the ground between the points of the grid
    assert np.median(np.abs(found)) < 0.001


def test_gravity_points_to_the_ground_under_the_body():
    walking = Walking(Planet((3.0, 4.0, 3.5), height=0.0, patch=1.0, travel=0.3))
    for _ in walking.go(1.0):
        walking.batch.recentre()
        down = walking.batch.frame.rotation.T @ walking.batch.model.opt.gravity
        planet = walking.batch.body.planet.ellipsoid
        np.testing.assert_allclose(down, -9.81 * planet.normals(planet.foot(walking.batch.place)), atol=1e-9)


def test_what_follows_a_snapshot_is_the_same_to_the_last_bit():
    walking = Walking(Planet(height=0.1))
    list(walking.go(1.5))
    batch = walking.batch
    snapshot, laid = batch.snapshot(), batch.patch_updates
    action = walking.controller.velocities(walking.states)

    def onwards():
        for _ in range(60):
            batch.step(action)
        return batch.packed.copy(), batch.place

    first = onwards()
    list(walking.go(1.0))
    batch.reset()
    np.testing.assert_allclose(batch.frame.pose, batch.body.planet.start.pose, atol=1e-12)
    batch.restore(snapshot)
    second = onwards()
    np.testing.assert_array_equal(first[0], second[0])
    np.testing.assert_array_equal(first[1], second[1])
    assert batch.patch_updates > laid


@pytest.mark.ci
def test_local_coordinates_go_on():
    walking = Walking(Planet(height=0.0))
    positions = [walking.reading.position[0].copy() for _ in walking.go(3.0)]
    step = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    assert step.max() < 0.03
    assert positions[-1][0] - positions[0][0] > 1.0


@pytest.mark.slow
@pytest.mark.ci
def test_a_hexapod_walks_right_around():
    planet = dataclasses.replace(Planet(height=0.0), radii=(2.5, 2.5, 2.5), patch=1.2)
    walking = Walking(planet)
    start = walking.batch.place
    path = np.array(list(walking.go(36.0)))
    east = np.degrees(np.unwrap(np.arctan2(path[:, 1], path[:, 0])))
    assert east[-1] > 360.0
    assert not walking.batch.diverged.any()
    # it never leaves the ground: hips 18 cm above it where it stands
    height = np.linalg.norm(path, axis=1) - 2.5
    assert height.min() > 0.12
    assert height.max() < 0.26
    back = np.linalg.norm(path[east > 300] - start, axis=1).min()
    assert back < 0.6  # nobody steers it
    # and goes around once in about as many seconds as it would need on a plane
    around = np.argmax(east > 360.0) * walking.batch.period
    assert around == pytest.approx(2 * np.pi * 2.69 / 0.53, rel=0.15)


def test_the_ground_weighs_nothing_and_is_not_where_a_camera_looks():
    plain, model = compile_model(WALKER), compile_model(OnPlanet(WALKER, Planet()))
    assert model.body_mass.sum() == pytest.approx(plain.body_mass.sum(), rel=1e-5)
    centres = []
    for each in (plain, model):
        data = mujoco.MjData(each)
        mujoco.mj_resetDataKeyframe(each, data, 0)
        mujoco.mj_forward(each, data)
        centres.append(data.subtree_com[0].copy())
    np.testing.assert_allclose(*centres, atol=1e-4)
