"""Drawing in the plane of a particle: reward, units, paths, occupancy; and where the paths come from."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from motorgrad.plane import (
    draw_occupancy,
    draw_paths,
    draw_regions,
    draw_reward,
    draw_units,
    occupancy,
    shapes_of,
    trajectories,
)
from motorgrad.policies import (
    Factored,
    FreeGaussians,
    Gated,
    LocalGaussians,
    Masked,
    OrientedBoxes,
    OrientedGaussians,
    SoftBoxes,
    SoftSpheres,
    hyperplanes,
    motoneurons,
    tiles,
)
from motorgrad.tasks import LAYOUTS, FallingParticle, ParticleNavigation, ParticleOrbit, ThreeState, region_reward
from motorgrad.worlds import ParticlePhysics, ParticleStart, Walls

LEFT, RIGHT = (-0.4, 0.0), (0.4, 0.0)


@pytest.fixture
def axes():
    """Axes that fill a picture of 200 × 200 pixels."""
    return Figure(figsize=(2, 2), dpi=100).add_axes((0, 0, 1, 1))


def picture(axes):
    """What is on them, rows from the bottom."""
    canvas = FigureCanvasAgg(axes.figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[::-1, :, :3].astype(int)


def at(axes, x, y):
    pixels = picture(axes)
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    return pixels[int((y - y0) / (y1 - y0) * 199), int((x - x0) / (x1 - x0) * 199)]


def extent(path):
    """Width and height of an outline."""
    return np.ptp(path.vertices, axis=0)


# reward


def test_regions_are_green_where_they_pay_and_red_where_they_cost(axes):
    regions = LAYOUTS["R1"]
    draw_regions(axes, regions)
    assert (axes.get_xlim(), axes.get_ylim(), axes.get_aspect()) == ((0, 1), (0, 1), 1)
    assert len(axes.get_xticks()) == len(axes.get_yticks()) == 0
    pixels = picture(axes)
    places = np.random.default_rng(0).uniform(0.05, 0.95, (200, 2))
    worths = np.asarray(jax.jit(jax.vmap(lambda place: region_reward(regions, place)))(places))
    for (x, y), worth in zip(places, worths, strict=True):
        red, green, _ = pixels[int(y * 199), int(x * 199)]
        if abs(worth) > 0.3:
            assert (green - red > 20) == (worth > 0)
            assert (red - green > 20) == (worth < 0)


def test_a_box_of_other_sides_and_an_open_one(axes):
    draw_regions(axes, (), Walls(left=-1.0, top=3.0, open=("top",)))
    assert (axes.get_xlim(), axes.get_ylim()) == ((-1, 1), (0, 3))
    assert [axes.spines[side].get_linestyle() for side in ("top", "left")] == [":", "-"]


def test_the_reward_of_every_task_on_a_particle(axes):
    draw_reward(axes, ParticleOrbit(wanted="narrow"))
    middle, corner = at(axes, 0.5, 0.5), at(axes, 0.05, 0.05)
    assert (middle > 245).all()  # no reward, white
    assert corner[0] - corner[1] > 50  # far off is penalised, red


def test_a_goal_is_a_disc_and_an_obstacle_a_region(axes):
    task = ParticleNavigation()
    draw_reward(axes, task)
    goal, obstacle, elsewhere = at(axes, 0.9, 0.5), at(axes, 0.5, 0.5), at(axes, 0.1, 0.1)
    assert goal[1] - goal[0] > 50
    assert obstacle[0] - obstacle[1] > 50
    assert (elsewhere > 245).all()


# units


def test_an_ellipse_is_a_deviation_about_the_centre(axes):
    axes.set(xlim=(0, 1), ylim=(0, 1))
    pool = LocalGaussians([[0.3, 0.6], [0.7, 0.2]], np.log([[0.1, 0.2], [0.05, 0.04]]), p_max=0.5)
    drawn = draw_units(axes, pool, [LEFT, RIGHT])
    outlines, arrows = drawn.artists
    first, second = outlines.get_paths()
    np.testing.assert_allclose(extent(first), [0.2, 0.4], rtol=5e-3)
    np.testing.assert_allclose(first.vertices[:-2].mean(0), [0.3, 0.6], atol=0.01)
    np.testing.assert_allclose(extent(second), [0.1, 0.08], rtol=5e-3)
    # arrows begin at the centre, and go where the force goes
    left, right = (path.vertices for path in arrows.get_paths())
    np.testing.assert_allclose([left[:, 0].max(), left[:, 0].min()], [0.3, 0.24], atol=1e-6)
    np.testing.assert_allclose([right[:, 0].min(), right[:, 0].max()], [0.7, 0.76], atol=1e-6)
    # a colour for each direction; fainter lines for units that fire less surely
    colours = outlines.get_edgecolor()
    np.testing.assert_allclose(colours[0, :3], to_rgb("#0061B0"), atol=0.01)
    np.testing.assert_allclose(colours[1, :3], to_rgb("#A0307A"), atol=0.01)
    np.testing.assert_allclose(colours[:, 3], 0.6, atol=1e-5)


def test_directions_have_different_colours_and_no_force_is_grey(axes):
    turns = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    forces = [*np.stack([np.cos(turns), np.sin(turns)], axis=1), (0.0, 0.0)]
    outlines, arrows = draw_units(axes, tiles(2, 9), forces).artists
    colours = outlines.get_edgecolor()[:, :3]
    apart = np.abs(colours[:, None] - colours).sum(-1) + 9 * np.eye(9)
    assert apart.min() > 0.15
    assert np.ptp(colours[8]) == 0
    assert len(arrows.get_paths()) == 8  # none for the unit without a force


@pytest.mark.ci
def test_spheres_boxes_and_mixed_pools(axes):
    spheres = SoftSpheres([[0.2, 0.2]], np.log([0.15]), np.log([20.0]))
    boxes = SoftBoxes([[0.7, 0.7]], np.log([[0.1, 0.3]]), np.log([20.0]))
    free = FreeGaussians([[0.5, 0.5]], np.log([[0.1, 0.1]]), [-30.0])
    outlines, _ = draw_units(axes, Factored([spheres, boxes, free]), [LEFT, RIGHT, LEFT]).artists
    sphere, box, _ = outlines.get_paths()
    np.testing.assert_allclose(extent(sphere), [0.3, 0.3], rtol=5e-3)
    np.testing.assert_allclose(extent(box), [0.2, 0.6], rtol=1e-6)
    assert len(box.vertices) < len(sphere.vertices)
    assert outlines.get_edgecolor()[2, 3] < 0.21  # it hardly ever fires, whatever its width


def test_oriented_units_are_drawn_as_they_lie(axes):
    """Deviations along the diagonal and across it, and a box that turned by 45°; of four inputs, their shadows."""
    along = np.array([[1.0, 1.0], [-1.0, 1.0]]) / np.sqrt(2)
    covariance = along.T @ np.diag([0.3**2, 0.1**2]) @ along
    slope = covariance[1, 0] / covariance[0, 0]
    widths = np.sqrt([covariance[0, 0], covariance[1, 1] - slope * covariance[0, 1]])
    gaussian = OrientedGaussians([[0.5, 0.5]], np.log([widths]), [[-slope]])
    box = OrientedBoxes([[0.5, 0.5]], np.log([[0.3, 0.1]]), [0.0], [[np.tan(np.pi / 8)]])
    outlines, _ = draw_units(axes, Factored([gaussian, box]), [LEFT, RIGHT]).artists
    ellipse, rectangle = (path.vertices[:-1] - 0.5 for path in outlines.get_paths())
    for outline, furthest in ((ellipse, (0.3, 0.1)), (rectangle, (0.3, 0.1))):
        np.testing.assert_allclose(np.abs(outline @ along.T).max(0), furthest, rtol=5e-3)
    half, angle = shapes_of(gaussian).ellipses()
    np.testing.assert_allclose(half[0], [0.3, 0.1], rtol=1e-4)
    assert np.tan(angle[0]) == pytest.approx(1, rel=1e-4)
    turn = np.random.default_rng(0).normal(size=(1, 6))
    box = OrientedBoxes(np.full((1, 4), 0.5), np.log([[0.3, 0.1, 0.2, 0.4]]), [0.0], turn)
    shadow = draw_units(axes, box, [LEFT]).artists[0].get_paths()[0].vertices[:-1] - 0.5
    corners = np.array(list(itertools.product((-1, 1), repeat=4))) @ shapes_of(box).axes[0].T
    ways = np.stack([np.cos(np.arange(60.0)), np.sin(np.arange(60.0))])
    np.testing.assert_allclose((shadow @ ways).max(0), (corners @ ways).max(0), rtol=1e-5)


def test_gates_come_first(axes):
    gate, branch = tiles(2, 1), LocalGaussians([[0.1, 0.9], [0.9, 0.9]], np.full((2, 2), -2.0), p_max=0.5)
    outlines, _ = draw_units(axes, Gated(gate, [branch]), [(0, 0), LEFT, RIGHT]).artists
    middles = [(path.vertices.min(0) + path.vertices.max(0)) / 2 for path in outlines.get_paths()]
    np.testing.assert_allclose(middles, [[0.5, 0.5], [0.1, 0.9], [0.9, 0.9]], atol=0.01)


def test_units_that_are_off_are_left_out_and_an_update_moves_the_rest(axes):
    pool = tiles(2, 4)
    drawn = draw_units(axes, Masked(pool, [True, False, True, True]), [LEFT] * 4, active=[True, True, True, False])
    outlines, arrows = drawn.artists
    assert len(outlines.get_paths()) == len(arrows.get_paths()) == 2
    moved = LocalGaussians(pool.centre + 0.1, pool.log_width)
    before = outlines.get_paths()[0].vertices
    drawn.update(moved)
    assert len(outlines.get_paths()) == 4
    np.testing.assert_allclose(outlines.get_paths()[0].vertices, before + 0.1, atol=1e-6)


def test_what_has_no_place_in_the_plane_is_refused(axes):
    for policy in (hyperplanes(2, 2), motoneurons(1, 2)(jax.random.key(0)), Factored([tiles(2, 1), hyperplanes(2, 1)])):
        with pytest.raises(ValueError, match=r"policy = '\w+': must be made of local units, which have a centre"):
            draw_units(axes, policy, [LEFT, RIGHT])
    with pytest.raises(ValueError, match="forces = 3: must be as many as there are units, 4"):
        draw_units(axes, tiles(2, 4), [LEFT] * 3)
    with pytest.raises(ValueError, match=r"forces = \(2,\): must be of shape \(units, 2\)"):
        draw_units(axes, tiles(2, 4), LEFT)
    with pytest.raises(ValueError, match=r"active = \(3,\): must be true or false for each unit, \(4,\)"):
        draw_units(axes, tiles(2, 4), [LEFT] * 4, active=[True] * 3)


# paths


def test_a_dash_for_each_decision_and_a_dot_at_the_start(axes):
    paths = [np.array([[0.1, 0.9], [0.2, 0.8], [0.2, 0.5]]), np.array([[0.5, 0.5]])]
    drawn = draw_paths(axes, paths)
    dashes, starts = drawn.artists
    segments = np.array(dashes.get_segments())
    np.testing.assert_allclose(segments[:, 0], paths[0][:2])
    np.testing.assert_allclose(segments[:, 1] - segments[:, 0], 0.62 * np.diff(paths[0], axis=0))
    np.testing.assert_allclose(starts.get_xydata(), [[0.1, 0.9], [0.5, 0.5]])
    drawn.update([])
    assert len(dashes.get_segments()) == len(starts.get_xydata()) == 0
    with pytest.raises(ValueError, match=r"paths = \(3, 3\): must be positions of two numbers"):
        drawn.update([np.zeros((3, 3))])


@pytest.mark.ci
def test_trajectories_are_those_of_the_world():
    """Without chance in the actions or the start they can be followed by hand."""
    task = FallingParticle(units=1, forces=(RIGHT,), start=ParticleStart(x=(0.2, 0.2), y=(0.95, 0.95)))
    always = LocalGaussians([[0.5, 0.5]], [[9.0, 9.0]])  # so wide that it fires everywhere
    first, second = trajectories(task, always, 2)
    state, places = task.dynamics.reset(jnp.zeros(0)), [(0.2, 0.95)]
    while not state.reached[1]:
        state = task.dynamics.step(state, jnp.ones(1), jnp.zeros(0))
        places.append(np.asarray(state.position))
    np.testing.assert_allclose(first, np.array(places), atol=1e-5)
    np.testing.assert_allclose(first, second)
    assert (first[-1][1], first[-2][1] > 0) == (0.0, True)


def test_trajectories_start_by_the_seed_and_not_by_the_policy():
    task = FallingParticle()
    one, other = (trajectories(task, tiles(task, copies=2, p_max=p), 5, seed=3) for p in (1.0, 0.2))
    starts = np.array([path[0] for path in one])
    np.testing.assert_array_equal(starts, [path[0] for path in other])
    assert len(np.unique(starts, axis=0)) == 5
    assert not np.array_equal(starts, [path[0] for path in trajectories(task, tiles(task), 5, seed=4)])
    assert any(len(a) != len(b) or not np.array_equal(a, b) for a, b in zip(one, other, strict=True))


@pytest.mark.ci
def test_where_episodes_end():
    orbit = ParticleOrbit()
    assert [len(path) for path in trajectories(orbit, tiles(orbit), 3, decisions=30)] == [31] * 3
    short = FallingParticle(time_limit=7)
    assert [len(path) for path in trajectories(short, tiles(short, copies=2), 3)] == [8] * 3
    task = ParticleNavigation()
    ended = [path for path in trajectories(task, tiles(task, copies=4), 20, decisions=300) if len(path) < 201]
    assert ended
    goal = np.array(task.goal_region[1:3])
    for path in ended:
        away = np.linalg.norm(path - goal, axis=1) / task.goal_region[3]
        assert away[-1] <= 1 < away[:-1].min()


@pytest.mark.slow
def test_noise_of_the_world_and_of_the_senses_is_drawn():
    quiet = FallingParticle(start=ParticleStart(x=(0.5, 0.5), y=(0.95, 0.95)), units=1, forces=(RIGHT,))
    always = LocalGaussians([[0.5, 0.5]], [[9.0, 9.0]])
    noisy = FallingParticle(start=quiet.start, units=1, forces=(RIGHT,), physics=ParticlePhysics(noise=0.3))
    assert len({path[3].tobytes() for path in trajectories(quiet, always, 4)}) == 1
    assert len({path[3].tobytes() for path in trajectories(noisy, always, 4)}) == 4
    narrow = LocalGaussians([[0.5, 0.5]], [[-1.0, -1.0]])
    blind = FallingParticle(start=quiet.start, units=1, forces=(RIGHT,), observation_noise=0.8)
    ends = [np.mean([path[-1][0] for path in trajectories(task, narrow, 200)]) for task in (quiet, blind)]
    assert ends[0] - ends[1] > 0.05  # a unit that does not see where it is fires less


@pytest.mark.parametrize(("change", "words"), [
    ({"task": ThreeState()}, "task = ThreeState.*: must be a ParticleTask"),
    ({"policy": tiles(2, 3)}, r"policy = \(2, 3\): must be of 2 inputs and 8 units"),
    ({"episodes": 0}, "episodes = 0: must be a positive integer"),
    ({"decisions": 0}, "decisions = 0: must be a positive integer"),
])  # fmt: skip
def test_trajectories_refuse(change, words):
    task = FallingParticle()
    with pytest.raises(ValueError, match=words):
        trajectories(**{"task": task, "policy": tiles(task, copies=2), "episodes": 2, **change})


# occupancy


@pytest.mark.slow
def test_occupancy_is_that_of_many_transitions():
    """Against a count by hand, on a coarse grid on which the blur is the same for both."""
    from scipy.ndimage import gaussian_filter

    task = FallingParticle()
    policy = tiles(task, copies=2)
    found = occupancy(task, policy, 50, seed=2, cells=20)
    counts = np.zeros((20, 20))
    for path in trajectories(task, policy, 50, seed=2):
        for before, after in itertools.pairwise(path):
            for share in (np.arange(400) + 0.5) / 400:
                column, row = np.minimum((before + share * (after - before)) * 20, 19).astype(int)
                counts[row, column] += 1 / 400
    blurred = gaussian_filter(counts, 1.0, mode="reflect")
    assert np.abs(found - blurred / blurred.sum()).max() < 0.03 * found.max()
    assert found.sum() == pytest.approx(1)
    assert found.shape == (20, 20)


@pytest.mark.ci
def test_a_particle_that_falls_straight_is_where_it_falls(axes):
    """Of a column the width is that of the blur: a variance of one cell."""
    task = FallingParticle(units=1, forces=((0.0, 0.0),), start=ParticleStart(x=(0.305, 0.305)))
    found = occupancy(task, tiles(task), 200)
    columns = found.sum(0)
    centre = (columns * (np.arange(100) + 0.5)).sum()
    variance = (columns * (np.arange(100) + 0.5 - centre) ** 2).sum()
    assert centre == pytest.approx(30.5, abs=0.01)
    assert variance == pytest.approx(1, abs=0.05)
    draw_occupancy(axes, found)
    shade = at(axes, 0.305, 0.3)
    assert (shade < 60).all()
    assert (at(axes, 0.7, 0.3) > 250).all()


def test_an_occupancy_is_a_grid(axes):
    with pytest.raises(ValueError, match=r"occupancy = \(3,\): must be a grid"):
        draw_occupancy(axes, np.zeros(3))
    with pytest.raises(ValueError, match="cells = 0: must be from 1 to 10,000"):
        occupancy(FallingParticle(), tiles(FallingParticle(), copies=2), 2, cells=0)
