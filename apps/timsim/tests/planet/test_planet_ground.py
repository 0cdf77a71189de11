"""The ground of a planet: ellipsoid, elevation, tree of tiles."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from planet_tiles import tile_of

from timsim.planet import Planet
from timsim.planet._elevation import MapElevation
from timsim.planet._geometry import Ellipsoid, normal_at, unit
from timsim.planet._tiles import ROOTS, Key, caps, directions, places, quarters

RADII = st.tuples(*[st.floats(1.0, 5.0)] * 3)
KINDS = ("bumps", "steps", "waves", "fractal")


def ways(seed, count=300):
    return unit(np.random.default_rng(seed).normal(size=(count, 3)))


@settings(deadline=None, max_examples=30)
@given(radii=RADII, seed=st.integers(0, 99), share=st.floats(-0.3, 3.0))
def test_foot_is_the_nearest_point(radii, seed, share):
    ellipsoid, way = Ellipsoid(radii), ways(seed)
    height = share * ellipsoid.tightest  # from further within, another point may be nearer
    found = ellipsoid.foot(ellipsoid.points(way) + height * ellipsoid.normals(way))
    np.testing.assert_allclose(found, way, atol=1e-9)


def test_foot_of_points_on_the_axes():
    ellipsoid = Ellipsoid((3.0, 2.0, 1.0))
    points = np.concatenate([np.eye(3), -np.eye(3)]) * 7.0
    np.testing.assert_allclose(ellipsoid.foot(points), points / 7.0, atol=1e-12)


def test_tangent_inverts_normals():
    ellipsoid, way = Ellipsoid((3.0, 2.0, 5.0)), ways(0)
    np.testing.assert_allclose(ellipsoid.tangent(ellipsoid.normals(way)), way, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_seeded_ground_has_its_range_and_its_seed(kind):
    planet = Planet(kind=kind, height=0.4, seed=3)
    way = ways(1, 4000)
    heights = planet.surface.heights(way)
    elevation = planet.elevation
    assert elevation.greatest - elevation.least == pytest.approx(0.4)
    assert elevation.least <= heights.min()
    assert heights.max() <= elevation.greatest
    assert np.ptp(heights) > 0.15
    np.testing.assert_array_equal(heights, Planet(kind=kind, height=0.4, seed=3).surface.heights(way))
    assert np.abs(heights - Planet(kind=kind, height=0.4, seed=4).surface.heights(way)).max() > 0.05


@pytest.mark.parametrize("kind", KINDS)
def test_seeded_ground_has_no_tears(kind):
    surface = Planet(kind=kind, height=0.4, clearing=0.0).surface
    way = ways(2, 5000)
    beside = unit(way + 1e-6 * ways(3, 5000))
    assert np.abs(surface.heights(way) - surface.heights(beside)).max() < 1e-4


def test_the_body_starts_on_level_ground():
    planet = Planet(height=0.5, clearing=0.6, latitude=40.0, longitude=-70.0)
    start = planet.ellipsoid.tangent(normal_at(40.0, -70.0))
    around = unit(start + 0.15 * ways(5))
    near = np.linalg.norm(planet.ellipsoid.points(around) - planet.ellipsoid.points(start), axis=1) < 0.6
    assert near.sum() > 50
    assert not planet.surface.heights(around[near]).any()
    assert planet.surface.heights(-around).any()
    # also where it is not cleared, and around the clearing there is no pit
    assert dataclasses.replace(planet, clearing=0.0).surface.heights(start[None])[0] == 0.0
    wide = dataclasses.replace(planet, spacing=40.0)
    assert np.abs(wide.surface.heights(around)).max() < 0.1


def test_a_map_is_read_where_its_points_are_and_goes_around():
    heights = np.random.default_rng(0).random((7, 12))
    elevation = MapElevation(heights)
    for row, latitude in enumerate(np.linspace(90, -90, 7)[1:-1], 1):
        for column, longitude in enumerate(np.linspace(-180, 180, 12, endpoint=False)):
            at = normal_at(latitude, longitude)
            assert elevation(at, at) == pytest.approx(heights[row, column])
    between = normal_at(60.0, 165.0)  # in the middle between the last column and the first
    assert elevation(between, between) == pytest.approx((heights[1, -1] + heights[1, 0]) / 2)
    for pole, row in ((normal_at(90, 0), 0), (normal_at(-90, 123), -1)):
        assert elevation(pole, pole) == pytest.approx(heights[row].mean())
    assert (elevation.least, elevation.greatest) == (elevation.heights.min(), elevation.heights.max())


def test_tiles_of_a_level_part_the_sphere():
    way = ways(4, 2000)
    coarse, fine = tile_of(2, way), tile_of(3, way)
    np.testing.assert_array_equal(fine[:, 0], coarse[:, 0])
    np.testing.assert_array_equal(fine[:, 1:] // 2, coarse[:, 1:])
    parts = quarters(ROOTS)
    assert len(np.unique(parts, axis=0)) == 24
    assert {tuple(tile) for tile in tile_of(1, way)} == {tuple(tile) for tile in parts}


def test_faces_are_right_handed_and_places_belong_to_their_tile():
    edge = np.array([0.01, 0.99, 0.5])
    for level in (0, 1, 3):
        tiles = ROOTS * 1
        if level:
            tiles[:, 1:] = 2**level - 1
        found = places(level, tiles, edge, edge[::-1].copy())
        for n, tile in enumerate(tiles):
            np.testing.assert_array_equal(tile_of(level, found[n]), np.broadcast_to(tile, (3, 3)))
    faces, zero, bit = np.arange(6), np.zeros(6), np.full(6, 0.1)
    out = directions(faces, zero, zero)
    across, up = directions(faces, bit, zero) - out, directions(faces, zero, bit) - out
    assert (np.sum(np.cross(across, up) * out, axis=1) > 0).all()


@pytest.mark.parametrize("level", [0, 1, 4])
def test_caps_hold_their_tiles(level):
    way = ways(6, 3000)
    tiles = tile_of(level, way)
    middle, angle = caps(level, tiles)
    assert (np.arccos(np.clip(np.sum(middle * way, axis=1), -1, 1)) <= angle + 1e-9).all()


def test_ancestors_of_a_tile():
    key = Key(3, 4, 5, 6)
    assert key.parent == Key(2, 4, 2, 3)
    assert key.ancestors == (Key(2, 4, 2, 3), Key(1, 4, 1, 1), Key(0, 4, 0, 0))
