"""What is drawn of a planet: culling, level of detail, seams, and what a browser is sent."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from planet_tiles import tile_of

from timsim.planet import Planet
from timsim.planet._detail import Camera, Cover, above_horizon, in_frustum, select_tiles, spheres
from timsim.planet._geometry import unit
from timsim.planet._tiles import (
    CELLS,
    HEM,
    ROOTS,
    SIDE,
    TRIANGLES,
    Key,
    caps,
    keys,
    make_tile,
    mesh_errors,
    quarters,
)

PLANETS = [
    Planet(height=0.4, kind="waves"),
    Planet((6.0, 4.0, 4.5), height=0.3, kind="bumps", patch=1.0),
    Planet((200.0, 200.0, 180.0), height=20.0, kind="fractal", spacing=60.0),
]
SEEDS = st.integers(0, 2**32 - 1)
ERRORS = [1.5 * mesh_errors(planet.surface, 5) for planet in PLANETS]


def camera_at(noise, planet):
    """Anywhere from just above the ground to far away, looking roughly at the planet or along its ground."""
    surface = planet.surface
    way = unit(noise.normal(size=3))
    above = surface.ellipsoid.least * 10 ** noise.uniform(-2, 0.7)
    place = surface.points(way) + above * surface.ellipsoid.normals(way)
    horizon = np.arccos(surface.ellipsoid.least / (surface.ellipsoid.least + above))
    aim = surface.points(unit(way + noise.uniform(0.0, 1.0) * horizon * noise.normal(size=3)))
    ahead = unit(unit(aim - place) + 0.2 * noise.normal(size=3))
    right = unit(np.cross(ahead, noise.normal(size=3)))
    turn = np.stack([right, np.cross(ahead, right), ahead], axis=1)
    return Camera(place, turn, noise.uniform(0.3, 1.6), noise.uniform(0.6, 2.2), 720)


def seen_from(camera, surface, noise, count=400):
    """Directions of places on the ground that are in the picture with nothing between: found by walking along rays."""
    horizon = np.arccos(min(0.999, surface.ellipsoid.least / np.linalg.norm(camera.position)))
    spread = noise.uniform(0.0, 1.5, (count, 1)) * horizon
    way = unit(surface.ellipsoid.foot(camera.position) + spread * noise.normal(size=(count, 3)))
    place = surface.points(way)
    right, down, ahead = ((place - camera.position) @ camera.rotation).T
    up = np.tan(camera.fov / 2)
    inside = (ahead > 0) & (np.abs(right) < up * camera.aspect * ahead) & (np.abs(down) < up * ahead)
    way, place = way[inside], place[inside]
    share = np.linspace(0.0, 0.999, 200)[:, None, None]
    ray = camera.position + share * (place - camera.position)
    foot = surface.ellipsoid.foot(ray)
    above = np.sum((ray - surface.ellipsoid.points(foot)) * surface.ellipsoid.normals(foot), axis=-1)
    return way[(above >= surface.heights(foot)).all(axis=0)]


@pytest.mark.ci
@settings(deadline=None, max_examples=15)
@given(seed=SEEDS, which=st.integers(0, 2))
def test_culling_never_removes_what_is_seen(seed, which):
    noise, planet = np.random.default_rng(seed), PLANETS[which]
    camera = camera_at(noise, planet)
    seen = seen_from(camera, planet.surface, noise)
    for level in range(5):
        tiles = tile_of(level, seen)
        assert in_frustum(camera, spheres(planet.surface, level, tiles)).all()
        assert above_horizon(camera, planet.surface, level, tiles, 0.0).all()


@pytest.mark.ci
def test_there_is_something_to_be_seen_in_the_test_above():
    noise = np.random.default_rng(0)
    counts = [len(seen_from(camera_at(noise, planet), planet.surface, noise)) for planet in PLANETS for _ in range(4)]
    assert np.mean(np.array(counts) > 5) > 0.5


@pytest.mark.parametrize("height", [0.01, 0.5, 3.0, 30.0])
def test_the_horizon_of_a_smooth_sphere_is_the_closed_form(height):
    surface = Planet(height=0.0).surface
    level, far = 4, 3.0 + height
    way = unit(np.random.default_rng(0).normal(size=(4000, 3)))
    tiles = np.unique(tile_of(level, way), axis=0)
    camera = Camera(np.array([0.0, 0.0, far]), np.eye(3), 1.0, 1.0, 720)
    middle, angle = caps(level, tiles)
    nearest = np.arccos(middle[:, 2]) - angle
    expected = nearest <= np.arccos(3.0 / far)
    np.testing.assert_array_equal(above_horizon(camera, surface, level, tiles, 0.0), expected)
    assert 0 < expected.sum() < len(tiles)


def test_nothing_is_hidden_from_within():
    camera = Camera(np.zeros(3), np.eye(3), 1.0, 1.0, 720)
    assert above_horizon(camera, PLANETS[0].surface, 0, ROOTS, 0.0).all()


LOOKS = {"seed": SEEDS, "which": st.integers(0, 2), "most": st.integers(6, 200), "cameras": st.integers(1, 3)}


@settings(deadline=None, max_examples=10)
@given(**LOOKS)
def test_the_budget_holds_and_what_is_seen_is_covered_once(seed, which, most, cameras):
    check_cover(seed, which, most, cameras)


@pytest.mark.ci
@settings(deadline=None, max_examples=40)
@given(**LOOKS)
def test_the_budget_holds_wherever_cameras_look(seed, which, most, cameras):
    check_cover(seed, which, most, cameras)


def check_cover(seed, which, most, cameras):
    noise, planet = np.random.default_rng(seed), PLANETS[which]
    looking = [camera_at(noise, planet) for _ in range(cameras)]
    chosen = select_tiles(planet.surface, ERRORS[which], looking, 2.0, most)
    assert len(chosen) <= most
    assert len(set(chosen)) == len(chosen)
    seen = seen_from(looking[0], planet.surface, noise, 150)
    found = [{Key(level, *map(int, tile_of(level, way[None])[0])) for level in range(6)} for way in seen[:40]]
    assert all(len(chain.intersection(chosen)) == 1 for chain in found)


def test_tiles_are_as_fine_as_the_tolerance_asks_and_no_finer():
    planet, error = PLANETS[0], ERRORS[0]
    camera = Camera(np.array([0.0, 0.0, 4.0]), np.diag([1.0, -1.0, -1.0]), 1.5, 1.0, 1000)
    scale = camera.pixels / (2 * np.tan(camera.fov / 2))

    def pixels(key):
        centre, radius = spheres(planet.surface, key.level, np.array([key[1:]]))
        return error[key.level] * scale / (np.linalg.norm(centre[0] - camera.position) - radius[0])

    chosen = select_tiles(planet.surface, error, [camera], 3.0, 10_000)
    assert all(pixels(key) <= 3.0 for key in chosen)
    assert all(pixels(key.parent) > 3.0 for key in chosen if key.level)
    assert len({key.level for key in chosen}) > 1
    assert len(select_tiles(planet.surface, error, [camera], 1.0, 10_000)) > len(chosen)


def test_near_ground_is_finer():
    planet = PLANETS[2]
    camera = Camera(np.array([0.0, 0.0, 195.0]), np.diag([1.0, -1.0, -1.0]), 1.2, 1.0, 720)
    chosen = select_tiles(planet.surface, ERRORS[2], [camera], 2.0, 60)
    centres = [spheres(planet.surface, key.level, np.array([key[1:]]))[0][0] for key in chosen]
    away = np.linalg.norm(np.array(centres) - camera.position, axis=1)
    level = np.array([key.level for key in chosen])
    assert away[level == level.max()].mean() < 0.5 * away[level == level.min()].mean()


@pytest.mark.parametrize("which", [0, 1, 2])
def test_meshes_are_as_near_to_the_ground_as_their_level_says(which):
    surface, error = PLANETS[which].surface, ERRORS[which]
    assert (np.diff(error) <= 0).all()
    noise = np.random.default_rng(1)
    for level in (1, 3):
        key = Key(level, int(noise.integers(6)), *map(int, noise.integers(0, 2**level, 2)))
        tile = make_tile(surface, key, float(error[level]), 1.0)
        grid = np.arange((SIDE + 1) ** 2).reshape(SIDE + 1, SIDE + 1)[HEM:-HEM, HEM:-HEM]
        corner = tile.vertices.astype(float) + tile.centre
        middles = (corner[grid[:-1, :-1]] + corner[grid[1:, 1:]]).reshape(-1, 3) / 2
        off = surface.altitude(middles) - surface.heights(surface.ellipsoid.foot(middles))
        assert np.abs(off).max() <= error[level]
        np.testing.assert_allclose(
            surface.altitude(corner[grid.ravel()]),
            surface.heights(surface.ellipsoid.foot(corner[grid.ravel()])),
            atol=1e-4,
        )


def test_a_tile_faces_outwards_and_has_the_triangles_that_are_counted():
    surface = PLANETS[1].surface
    for face in range(6):
        tile = make_tile(surface, Key(1, face, 1, 0), 0.01, 0.1)
        assert len(tile.faces) == TRIANGLES
        assert len(tile.vertices) == len(tile.colours) == tile.faces.max() + 1
        one, two, three = (tile.vertices[tile.faces[:, n]].astype(float) for n in range(3))
        normals = np.cross(two - one, three - one)
        place = (one + two + three) / 3
        ground = slice(0, 2 * SIDE * SIDE)
        assert (np.sum(normals[ground] * (place[ground] + tile.centre), axis=1) > 0).all()
        # skirts look away from the tile
        skirts = slice(2 * SIDE * SIDE, None)
        middle = surface.points(unit(tile.centre[None]))[0] - tile.centre
        assert (np.sum(normals[skirts] * (place[skirts] - middle), axis=1) > 0).all()
    assert CELLS + 2 * HEM == SIDE


def hits(start, way, tile):
    """Whether a ray meets the front of some triangle of a tile (Möller and Trumbore)."""
    one, two, three = (tile.vertices[tile.faces[:, n]].astype(float) + tile.centre for n in range(3))
    u, v = two - one, three - one
    p = np.cross(way, v)
    det = np.sum(u * p, axis=1)
    front = det > 1e-14
    safe = np.where(front, det, 1.0)
    t = start - one
    q = np.cross(t, u)
    a, b, far = np.sum(t * p, axis=1) / safe, q @ way / safe, np.sum(v * q, axis=1) / safe
    edge = 1e-7  # a ray through a corner that two triangles share meets one of them
    return bool((front & (a >= -edge) & (b >= -edge) & (a + b <= 1 + edge) & (far > 0)).any())


def bared(tile):
    """A tile without its hem and skirts."""
    inner = np.arange((SIDE + 1) ** 2).reshape(SIDE + 1, SIDE + 1)[HEM:-HEM, HEM:-HEM]
    return tile._replace(faces=tile.faces[np.isin(tile.faces, inner).all(axis=1)])


def falls_through(seed, which, change=lambda tile: tile, rays=60):
    """How many of rays at seams of a tree divided at random meet no ground, but the hollow planet."""
    noise, planet = np.random.default_rng(seed), PLANETS[which]
    surface, error = planet.surface, ERRORS[which]
    cut, leaves = ROOTS, []
    for level in range(4):
        divided = noise.random(len(cut)) < (0.6 if level < 3 else 0.0)
        leaves += keys(level, cut[~divided])
        cut = quarters(cut[divided])
    sunk = [float(error[max(0, key.level - 1)] + error[key.level]) for key in leaves]
    deep = [float(error[0])] * len(leaves)
    made = [change(make_tile(surface, *each)) for each in zip(leaves, sunk, deep, strict=True)]
    centres = np.array([tile.centre for tile in made])
    radii = np.array([np.linalg.norm(tile.vertices, axis=1).max() for tile in made])
    grid, lost = np.arange((SIDE + 1) ** 2).reshape(SIDE + 1, SIDE + 1)[HEM:-HEM, HEM:-HEM], 0
    for _ in range(rays):
        tile = made[noise.integers(len(leaves))]
        side = (grid[0], grid[-1], grid[:, 0], grid[:, -1])[noise.integers(4)]
        one, two = tile.vertices[side[(n := noise.integers(CELLS)) : n + 2]]
        seam = tile.centre + one + noise.random() * (two - one)
        up = surface.ellipsoid.normals(unit(seam / surface.ellipsoid.radii))
        aim = seam + noise.uniform(-0.3, 0.3) * error[0] * up  # between the sides that two tiles have there
        flat = unit(np.cross(up, noise.normal(size=3)))
        way = unit(noise.uniform(0.7, 1.3) * flat - up)  # steep, so that it does not pass by the planet
        start = aim - 20.0 * way
        along = np.clip((centres - start) @ way, 0, None)
        near = np.linalg.norm(start + along[:, None] * way - centres, axis=1) <= radii
        lost += not any(hits(start, way, made[m]) for m in np.flatnonzero(near))
    return lost


@pytest.mark.ci
@settings(deadline=None, max_examples=12)
@given(seed=SEEDS, which=st.integers(0, 1))
def test_seams_between_tiles_of_any_levels_are_closed(seed, which):
    assert falls_through(seed, which) == 0


@pytest.mark.ci
def test_seams_would_be_open_without_skirts():
    assert sum(falls_through(seed, 0, bared) for seed in range(8)) > 1


@settings(deadline=None, max_examples=4)
@given(seed=SEEDS, changes=st.integers(1, 6))
def test_a_browser_never_shows_holes_or_overlaps_or_more_than_is_wanted(seed, changes):
    check_shown(seed, changes)


@pytest.mark.ci
@settings(deadline=None, max_examples=10)
@given(seed=SEEDS, changes=st.integers(1, 6))
def test_a_browser_that_goes_far_never_shows_holes_either(seed, changes):
    check_shown(seed, changes)


def check_shown(seed, changes):
    noise, planet, cover = np.random.default_rng(seed), PLANETS[0], Cover(cache=10, settle=0.05)
    now, sent = 0.0, {}
    for _ in range(4):
        wanted = select_tiles(planet.surface, ERRORS[0], [camera_at(noise, planet)], 2.0, 60)
        for _ in range(200):
            now += 0.03
            plan = cover.plan(wanted, now)
            new = plan.send[:changes]
            assert all(key.level == 0 or key.parent in sent or key.parent in new for key in new)
            assert not plan.show.intersection(plan.drop)
            assert plan.show <= set(sent)
            assert len(plan.show) <= len(wanted)
            assert not any(plan.show.intersection(key.ancestors) for key in plan.show)
            covered = [plan.show.intersection((key, *key.ancestors)) for key in wanted]
            assert all(len(each) <= 1 for each in covered)  # nothing twice
            holes = [key for key, each in zip(wanted, covered, strict=True) if not each]
            assert all(now - sent.get(Key(0, key.face, 0, 0), now) < 0.05 for key in holes)
            cover.note(new, plan.drop, now)
            sent |= dict.fromkeys(new, now)
            sent = {key: when for key, when in sent.items() if key not in plan.drop}
            assert cover.sent == set(sent)
            if not plan.send and plan.show == set(wanted):
                break
        assert plan.show == set(wanted)
        needed = {each for key in wanted for each in (key, *key.ancestors)}
        assert len(cover.plan(wanted, now).drop) == 0
        assert len(sent) <= len(needed) + 10


def test_neighbouring_tiles_are_lit_and_textured_alike_along_their_seam():
    surface = PLANETS[0].surface
    one, other = (make_tile(surface, key, 0.01, 0.1) for key in (Key(4, 0, 3, 3), Key(4, 0, 4, 3)))
    rows = np.arange(HEM, HEM + CELLS + 1)
    end, begin = rows * (SIDE + 1) + HEM + CELLS, rows * (SIDE + 1) + HEM  # the seam in each of the two grids
    places = [tile.centre + tile.vertices[at] for tile, at in ((one, end), (other, begin))]
    np.testing.assert_allclose(*places, atol=1e-5)
    np.testing.assert_allclose(one.normals[end], other.normals[begin], atol=1e-9)
    # under the neighbour, where the meshes cross, the light is the neighbour's too
    np.testing.assert_allclose(one.normals[end + 1], other.normals[begin + 1], atol=0.02)
    apart = one.uv[end] - other.uv[begin]
    np.testing.assert_allclose(apart, np.round(apart), atol=1e-4)  # whole repeats
    out = np.sum(one.normals * (one.centre + one.vertices), axis=1)
    assert (out > 0).all()
