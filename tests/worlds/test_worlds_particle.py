"""The particle: against closed forms, and what must be conserved, lost, or the same in a mirror."""

import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motorgrad.worlds import CircularField, Particle, ParticlePhysics, ParticleStart, ParticleState, Walls
from motorgrad.worlds._world import runge_kutta

OPEN = Walls(open=("left", "bottom", "right", "top"))
RIGHT, UP = (1.0, 0.0), (0.0, 1.0)


@pytest.fixture(autouse=True)
def _double():
    with jax.enable_x64(True):
        yield


def at(x, y, vx=0.0, vy=0.0):
    return ParticleState(np.array([x, y], float), np.array([vx, vy], float), np.zeros(4, bool))


def path(world, state, decisions, action=None, seed=0):
    """Every state after so many decisions of one action."""
    action = np.zeros(len(world.forces)) if action is None else np.asarray(action, float)
    numbers = np.random.default_rng(seed).random((decisions, world.uniforms))
    return jax.tree.map(np.asarray, _paths(world)(state, action, numbers))


@functools.cache
def _paths(world):
    def decide(carry, uniforms):
        state, action = carry
        state = world.step(state, action, uniforms)
        return (state, action), state

    return jax.jit(lambda state, action, numbers: jax.lax.scan(decide, (state, action), numbers)[1])


def free(drag=0.0, gravity=(0.0, 0.0), walls=OPEN, **other):
    return Particle((RIGHT, UP), ParticlePhysics(drag=drag, gravity=gravity, walls=walls, **other))


def test_free_fall_drops_as_far_as_the_reading_says():
    world = Particle((RIGHT,))
    fallen = path(world, at(0.5, 1.0), 10)  # 2 s
    assert 1 - float(fallen.position[-1, 1]) == pytest.approx(0.283834, abs=5e-7)
    exact = 0.25 * (2 - (1 - math.exp(-2)))
    assert 1 - float(fallen.position[-1, 1]) == pytest.approx(exact, abs=2e-6)
    assert (fallen.position[:, 0] == 0.5).all()


def test_free_fall_is_the_same_in_single_precision():
    with jax.enable_x64(False):
        state = ParticleState(jnp.array([0.5, 1.0]), jnp.zeros(2), jnp.zeros(4, bool))
        step = jax.jit(Particle((RIGHT,)).step)
        for _ in range(10):
            state = step(state, jnp.zeros(1), jnp.zeros(0))
        assert state.position.dtype == jnp.float32
        assert 1 - float(state.position[1]) == pytest.approx(0.283834, abs=1e-6)


@pytest.mark.ci
@pytest.mark.representatives("2.0-0.5--1.0")
@pytest.mark.parametrize(("mass", "drag", "gravity"), [(1.0, 1.0, -0.25), (2.0, 0.5, -1.0), (0.5, 3.0, 0.7)])
def test_terminal_velocity(mass, drag, gravity):
    world = free(mass=mass, drag=drag, gravity=(0.0, gravity))
    assert path(world, at(0.5, 0.5), 500).velocity[-1, 1] == pytest.approx(mass * gravity / drag, rel=1e-9)


def test_a_force_moves_as_newton_says_and_actions_grade_it():
    world = free(mass=2.0)
    for action in ([1.0, 0.0], [0.0, 1.0], [0.5, -0.25]):
        moved = path(world, at(0.0, 0.0), 5, action)  # 1 s without drag: exact
        np.testing.assert_allclose(moved.position[-1], 0.5 * np.array(action) / 2.0, atol=1e-12)
        np.testing.assert_allclose(moved.velocity[-1], np.array(action) / 2.0, atol=1e-12)


def test_several_forces_add_up():
    world = Particle(((0.1, 0.0), (0.2, 0.3), (-0.5, 0.1)), ParticlePhysics(drag=0.0, gravity=(0.0, 0.0), walls=OPEN))
    moved = path(world, at(0.0, 0.0), 5, [1.0, 1.0, 0.0])
    np.testing.assert_allclose(moved.velocity[-1], [0.3, 0.3], atol=1e-12)


def test_the_integration_is_of_fourth_order():
    def error(steps):
        state = (jnp.array(1.0), jnp.array(0.0))
        for _ in range(steps):
            state = runge_kutta(lambda s: (s[1], -s[0]), state, 2.0 / steps)
        return math.hypot(float(state[0]) - math.cos(2.0), float(state[1]) + math.sin(2.0))

    orders = [math.log2(error(steps) / error(2 * steps)) for steps in (8, 16, 32)]
    assert all(3.8 < order < 4.2 for order in orders)


@pytest.mark.ci
@pytest.mark.parametrize("timestep", [0.2, 0.1, 0.05])
def test_the_particle_converges_to_fourth_order(timestep):
    def drop(h):
        world = free(drag=1.0, gravity=(0.0, -0.25), timestep=h, substeps=round(2 / h))
        return -float(path(world, at(0.0, 0.0), 1).position[-1, 1]) - 0.25 * (1 + math.exp(-2))

    assert 3.7 < math.log2(abs(drop(timestep) / drop(timestep / 2))) < 4.3


@pytest.mark.ci
@pytest.mark.representatives("2.0-0.8-0.2-1.0-0.3")
@pytest.mark.parametrize(
    ("mass", "drag", "tangential", "radial", "radius"),
    [(1.0, 1.0, 0.5, 1.0, 0.25), (1.0, 1.0, -0.3, 2.0, 0.2), (2.0, 0.8, 0.2, 1.0, 0.3), (1.0, 1.0, 0.0, 1.0, 0.25)],
)
def test_the_unforced_orbit_has_the_radius_of_the_closed_form(mass, drag, tangential, radial, radius):
    field = CircularField(tangential, radial, radius)
    world = free(mass=mass, drag=drag, field=field)
    expected = radial * radius / (radial - mass * (tangential / drag) ** 2)
    assert world.physics.orbit_radius == pytest.approx(expected)
    end = jax.tree.map(lambda leaf: leaf[-1], path(world, at(0.6, 0.8), 2000))
    assert float(field.distance(*end.position)) == pytest.approx(expected, rel=1e-6)
    away = np.asarray(end.position) - 0.5
    turning = away[0] * float(end.velocity[1]) - away[1] * float(end.velocity[0])
    assert np.sign(round(turning, 6)) == -np.sign(tangential)  # clockwise, y pointing up
    assert math.hypot(*map(float, end.velocity)) == pytest.approx(abs(tangential) * expected / drag, abs=1e-6)


def test_the_circular_field_is_that_of_the_appendix_with_its_slips_mended():
    field = CircularField(0.5, 1.0, 0.25, (0.4, 0.6))
    for x, y in ((0.9, 0.6), (0.4, 0.1), (0.1, 0.9), (0.35, 0.55)):
        angle, r = math.atan2(y - 0.6, x - 0.4), math.hypot(x - 0.4, y - 0.6)
        first = r * math.sin(angle), -r * math.cos(angle)
        second = 0.25 * math.cos(angle) + 0.4 - x, 0.25 * math.sin(angle) + 0.6 - y
        found = field.force(jnp.array(x), jnp.array(y))
        np.testing.assert_allclose(found, [0.5 * a + 1.0 * b for a, b in zip(first, second, strict=True)], atol=1e-12)
    np.testing.assert_allclose(field.force(jnp.array(0.4), jnp.array(0.6)), [0.25, 0.0])  # atan2(0, 0) = 0


def test_without_drag_gravity_and_loss_energy_is_kept():
    world = free(walls=Walls(restitution=1.0))
    moved = path(world, at(0.3, 0.6, 0.37, -0.53), 2000)
    np.testing.assert_allclose(np.hypot(*moved.velocity.T), math.hypot(0.37, 0.53), rtol=1e-12)
    np.testing.assert_allclose(np.abs(moved.velocity), np.broadcast_to([0.37, 0.53], (2000, 2)), rtol=1e-12)
    assert moved.reached.any(0).all()
    assert ((moved.position >= 0) & (moved.position <= 1)).all()


@pytest.mark.ci
@pytest.mark.representatives("0.5")
@pytest.mark.parametrize("restitution", [0.0, 0.3, 0.5, 1.0])
def test_a_bounce_leaves_the_square_of_the_restitution_of_the_energy(restitution):
    world = free(walls=Walls(restitution=restitution))
    before, along = 0.4, 0.1
    moved = path(world, at(0.9, 0.2, before, along), 3)
    assert bool(moved.reached[-2:, 2].any())
    assert float(moved.velocity[-1, 0]) == pytest.approx(-restitution * before)
    assert float(moved.velocity[-1, 1]) == pytest.approx(along)  # no force presses: nothing rubs
    lost = before**2 - float(moved.velocity[-1, 0]) ** 2
    assert lost == pytest.approx((1 - restitution**2) * before**2)


def test_the_time_of_a_collision_is_found_by_halving():
    """A ball dropped without drag: the integration is exact between collisions, so its closed form is that of all."""
    walls = Walls(restitution=0.5)
    found, put = (
        path(free(gravity=(0.0, -0.25), walls=walls, collisions=kind, substeps=1), at(0.5, 0.9), 40)
        for kind in ("bisection", "reposition")
    )
    time = 0.1 * np.arange(1, 41)
    hit = math.sqrt(2 * 0.9 / 0.25)  # 2.68 s
    since = time - hit
    height = np.where(since < 0, 0.9 - 0.125 * time**2, 0.5 * 0.25 * hit * since - 0.125 * since**2)
    speed = np.where(since < 0, -0.25 * time, 0.5 * 0.25 * hit - 0.25 * since)
    np.testing.assert_allclose(found.position[:, 1], height, atol=1e-6)
    np.testing.assert_allclose(found.velocity[:, 1], speed, atol=1e-6)
    np.testing.assert_array_equal(np.flatnonzero(found.reached[:, 1]), [26])  # in the step from 2.6 to 2.7 s
    assert abs(put.position[:, 1] - height).max() > 1e-3
    np.testing.assert_allclose(put.position[:26], found.position[:26], atol=1e-12)


def test_two_walls_in_one_step_and_rest_on_one_are_found_too():
    walls = Walls(restitution=1.0)
    world = free(walls=walls, collisions="bisection", substeps=1)
    moved = path(world, at(0.98, 0.97, 1.0, 1.0), 1)  # 0.1 s, with 0.08 and 0.07 left after the walls
    np.testing.assert_allclose(moved.position[0], [0.92, 0.93], atol=1e-6)
    np.testing.assert_allclose(moved.velocity[0], [-1.0, -1.0], atol=1e-6)
    assert moved.reached[0].tolist() == [False, False, True, True]
    rest = path(free(gravity=(0.0, -0.25), walls=Walls(restitution=0.0), collisions="bisection"), at(0.5, 0.1), 20)
    np.testing.assert_array_equal(rest.position[10:, 1], 0.0)
    np.testing.assert_array_equal(rest.velocity[10:, 1], 0.0)


def test_a_particle_that_moves_inwards_is_not_thrown_back():
    walls = Walls()
    _, (vx, vy), _ = walls.collide(
        (jnp.array(-0.01), jnp.array(1.2)), (jnp.array(0.3), jnp.array(-0.1)), (jnp.array(0.0), jnp.array(0.0))
    )
    assert (float(vx), float(vy)) == (0.3, -0.1)


@pytest.mark.ci
@pytest.mark.representatives("left")
@pytest.mark.parametrize("side", ["left", "bottom", "right", "top"])
def test_an_open_side_lets_through_and_says_so(side):
    place = ("left", "bottom", "right", "top").index(side)
    speed = [(-1.0, 0.0), (0.0, -1.0), (1.0, 0.0), (0.0, 1.0)][place]
    world = free(walls=Walls(open=(side,)))
    moved = path(world, at(0.5, 0.5, *speed), 10)
    np.testing.assert_allclose(moved.position[-1], 0.5 + 2.0 * np.array(speed))
    assert bool(moved.reached[-1, place])
    assert not moved.reached[:, [n for n in range(4) if n != place]].any()
    shut = path(free(), at(0.5, 0.5, *speed), 10)
    assert shut.position[-1] == pytest.approx(0.5 + 2.0 * np.array(speed))
    walled = path(free(walls=Walls()), at(0.5, 0.5, *speed), 10)
    assert ((walled.position >= 0) & (walled.position <= 1)).all()


def test_a_side_that_was_reached_within_the_decision_is_told_once():
    world = Particle((RIGHT,), ParticlePhysics(gravity=(0.0, 0.0), drag=0.0, walls=Walls(restitution=1.0)))
    moved = path(world, at(0.5, 0.05, 0.0, -1.0), 3)
    np.testing.assert_array_equal(moved.reached[:, 1], [True, False, False])
    assert float(moved.position[0, 1]) > 0  # it was there, and is away again


@pytest.mark.ci
@pytest.mark.representatives("0.5-0.05")
@pytest.mark.parametrize("push", [0.05, 0.4, 3.0])
@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_what_is_pressed_against_a_wall_comes_to_rest_and_does_not_sink(push, restitution):
    world = Particle(((push, 0.0),), ParticlePhysics(gravity=(0.0, 0.0), walls=Walls(restitution=restitution)))
    moved = path(world, at(0.5, 0.5, 0.0, 0.3), 400, [1.0])
    assert (moved.position <= 1).all()
    np.testing.assert_array_equal(moved.position[-100:, 0], 1.0)
    np.testing.assert_array_equal(moved.velocity[-100:, 0], 0.0)
    away = path(world, jax.tree.map(lambda leaf: leaf[-1], moved), 400, [-1.0])
    assert float(away.position[0, 0]) < 1.0  # it is not glued


@pytest.mark.ci
def test_a_corner_bears_both_ways():
    world = Particle(((1.0, 0.0),))
    moved = path(world, at(0.9, 0.1), 200, [1.0])
    np.testing.assert_array_equal(moved.position[-1], [1.0, 0.0])
    np.testing.assert_array_equal(moved.velocity[-1], [0.0, 0.0])


@pytest.mark.ci
@pytest.mark.representatives("0.5")
@pytest.mark.parametrize("friction", [0.0, 0.1, 0.5])
def test_friction_is_proportional_to_the_pressing_force_and_the_speed(friction):
    world = Particle(
        ((2.0, 0.0),), ParticlePhysics(gravity=(0.0, 0.0), drag=0.0, mass=0.5, walls=Walls(friction=friction))
    )
    moved = path(world, at(1.0, 0.2, 0.0, 0.1), 10, [1.0])
    times = 0.2 * np.arange(1, 11)
    np.testing.assert_allclose(moved.velocity[:, 1], 0.1 * np.exp(-friction * 2.0 / 0.5 * times), rtol=1e-3)
    if not friction:  # momentum along a smooth wall is kept
        np.testing.assert_array_equal(moved.velocity[:, 1], 0.1)


@pytest.mark.ci
def test_nothing_rubs_away_from_the_walls_or_where_nothing_presses():
    world = free(walls=Walls(friction=5.0))
    np.testing.assert_array_equal(path(world, at(0.5, 0.2, 0.0, 0.1), 5, [0.0, 0.0]).velocity[:, 1], 0.1)
    np.testing.assert_array_equal(path(world, at(1.0, 0.2, 0.0, 0.1), 5, [0.0, 0.0]).velocity[:, 1], 0.1)


unit, speed, force = st.floats(-1, 1), st.floats(-2, 2), st.floats(-3, 3)


BOX = ParticlePhysics(gravity=(0.0, 0.0), drag=0.0, walls=Walls(-1.0, -1.0))


@jax.jit
def borne(motion, force):
    """What is left of a force that presses against walls."""
    return BOX.walls.bear(force, motion[1], BOX.walls.resting(*motion))


@jax.jit
def stepped(motion, force):
    return BOX.step(motion, force)


@settings(deadline=None, max_examples=60)
@given(x=unit, y=unit, vx=speed, vy=speed, fx=force, fy=force)
def test_walls_never_add_energy_and_are_the_same_in_mirrors(x, y, vx, vy, fx, fy):
    # about zero, so that a mirror image is exact
    motion = ((x, y), (vx, vy))
    bx, by = borne(motion, (fx, fy))
    assert float(bx) * vx + float(by) * vy <= fx * vx + fy * vy + 1e-12
    (position, velocity), reached = jax.tree.map(np.asarray, stepped(motion, (fx, fy)))
    assert all(-1 <= float(part) <= 1 for part in position)
    turned = stepped(((-x, y), (-vx, vy)), (-fx, fy))
    np.testing.assert_allclose(turned[0][0], (-position[0], position[1]), atol=1e-9)
    np.testing.assert_allclose(turned[0][1], (-velocity[0], velocity[1]), atol=1e-9)
    # the axes are alike
    swapped = stepped(((y, x), (vy, vx)), (fy, fx))
    np.testing.assert_allclose(swapped[0][0], position[::-1], atol=1e-9)
    np.testing.assert_allclose(swapped[0][1], velocity[::-1], atol=1e-9)
    assert [bool(flag) for pair in swapped[1][::-1] for flag in pair] == [
        bool(flag) for pair in reached for flag in pair
    ]


def test_noise_is_a_random_force_of_its_deviation():
    still = ParticlePhysics(gravity=(0.0, 0.0), drag=0.0, walls=OPEN, substeps=1)
    noisy = Particle((RIGHT,), ParticlePhysics(gravity=(0.0, 0.0), drag=0.0, walls=OPEN, substeps=1, noise=0.3))
    assert (Particle((RIGHT,), still).uniforms, noisy.uniforms) == (0, 2)
    kicks = np.diff(np.asarray(path(noisy, at(0.5, 0.5), 20_000).velocity), axis=0) / 0.1
    np.testing.assert_allclose(kicks.std(0), 0.3, rtol=0.02)
    np.testing.assert_allclose(kicks.mean(0), 0.0, atol=0.01)
    assert abs(np.corrcoef(kicks.T)[0, 1]) < 0.03
    assert abs(np.corrcoef(kicks[1:, 0], kicks[:-1, 0])[0, 1]) < 0.03
    edge = jax.jit(noisy.step)(at(0.5, 0.5), np.zeros(1), np.zeros(2))
    assert np.isfinite(np.asarray(edge.velocity)).all()


@pytest.mark.representatives("1")
@pytest.mark.parametrize("substeps", [1, 4, 7])  # unrolled, and in a loop
def test_an_action_is_held_for_its_time_steps(substeps):
    world = Particle((RIGHT,), ParticlePhysics(substeps=substeps))
    single = Particle((RIGHT,), ParticlePhysics(substeps=1))
    together = jax.jit(world.step)(at(0.2, 0.9, 0.1, 0.0), np.ones(1), np.zeros(0))
    apart = path(single, at(0.2, 0.9, 0.1, 0.0), substeps, [1.0])
    np.testing.assert_allclose(together.position, apart.position[-1], atol=1e-12)
    np.testing.assert_allclose(together.velocity, apart.velocity[-1], atol=1e-12)
    assert world.physics.period == pytest.approx(0.1 * substeps)


def test_the_start_is_drawn_from_its_box():
    world = Particle((RIGHT,), start=ParticleStart((0.2, 0.6), (0.9, 0.9), (0.0, 0.0), (-1.0, 1.0)))
    assert world.reset_uniforms == 2
    for numbers, x, vy in (((0.0, 0.0), 0.2, -1.0), ((0.5, 0.75), 0.4, 0.5)):
        state = world.reset(jnp.array(numbers))
        np.testing.assert_allclose(state.position, [x, 0.9])
        np.testing.assert_allclose(state.velocity, [0.0, vy])
    fixed = Particle((RIGHT,), start=ParticleStart((0.5, 0.5), (0.5, 0.5)))
    assert fixed.reset_uniforms == 0
    np.testing.assert_array_equal(fixed.reset(jnp.zeros(0)).position, 0.5)


nan, inf = math.nan, math.inf
REFUSED = [
    (lambda: Walls(left=1.0), "left, bottom, right, top"),
    (lambda: Walls(top=nan), "top = nan: must be a finite number"),
    (lambda: Walls(open=("up",)), "unknown open[0] 'up': known are bottom"),
    (lambda: Walls(restitution=1.1), "restitution = 1.1: must be in [0, 1]"),
    (lambda: Walls(friction=-0.1), "friction = -0.1"),
    (lambda: CircularField(radius=0.0), "radius = 0.0: must be in (0, 1e+06)"),
    (lambda: CircularField(radial=-1.0), "radial = -1.0"),
    (lambda: CircularField(tangential=inf), "tangential = inf"),
    (lambda: CircularField(centre=(nan, 0.0)), "centre[0] = nan"),
    (lambda: ParticlePhysics(mass=0.0), "mass = 0.0"),
    (lambda: ParticlePhysics(drag=-1.0), "drag = -1.0"),
    (lambda: ParticlePhysics(noise=-0.1), "noise = -0.1"),
    (lambda: ParticlePhysics(gravity=(0.0, nan)), "gravity[1] = nan"),
    (lambda: ParticlePhysics(gravity=(0.0, 1e6)), "gravity[1] = 1000000.0: must be in (-1e+06, 1e+06)"),
    (lambda: ParticlePhysics(substeps=0), "substeps = 0: must be an integer from 1"),
    (lambda: ParticlePhysics(timestep=3.0), "timestep = 3.0: must be below 2.78"),
    (lambda: ParticlePhysics(field=CircularField(0.5, 0.25)), "field.radial = 0.25: must be above mass"),
    (lambda: ParticlePhysics(drag=0.0, field=CircularField(0.5, 1.0)), "field.radial = 1.0: must be above mass"),
    (lambda: ParticlePhysics().orbit_radius, "field.radial = 0.0: must be positive"),
    (lambda: ParticleStart(x=(0.5, 0.2)), "x = (0.5, 0.2): must be low <= high"),
    (lambda: Particle(()), "number of forces = 0"),
    (lambda: Particle(((nan, 0.0),)), "forces[0][0] = nan"),
    (lambda: Particle((RIGHT,), start=ParticleStart(x=(-0.1, 0.5))), "start.x = (-0.1, 0.5): must be within the box"),
]


@pytest.mark.parametrize(("build", "words"), REFUSED, ids=[words[:40] for _, words in REFUSED])
def test_what_cannot_be_is_refused_by_name(build, words):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        build()
    assert words in str(error.value)


VARIED = ParticleStart(
    x=(0.5, 0.5), y=(0.9, 0.9), mass=(0.5, 2.0), gravity=(0.8, 1.2), drag=(1.0, 3.0), force=(0.5, 1.5)
)


def drawn_factors(uniforms):
    return Particle(((0.4, 0.0),), start=VARIED).reset(jnp.asarray(uniforms)).factors


def test_the_factors_of_an_episode_are_drawn_within_their_bounds_and_kept():
    world = Particle(((0.4, 0.0),), start=VARIED)
    assert world.reset_uniforms == 4
    np.testing.assert_allclose(drawn_factors([0.0, 0.5, 1.0, 0.25]), [0.5, 1.0, 3.0, 0.75])
    state = world.reset(jnp.full(4, 0.25))
    after = world.step(state, jnp.ones(1), jnp.zeros(0))
    np.testing.assert_array_equal(after.factors, state.factors)


def test_a_particle_with_factors_moves_as_one_whose_physics_have_these_numbers():
    """Mass, gravity and drag of the physics, and the forces, each multiplied beforehand."""
    uniforms = jnp.array([0.1, 0.7, 0.4, 0.9])
    mass, gravity, drag, force = (float(each) for each in drawn_factors(uniforms))
    usual = ParticlePhysics()
    same = ParticlePhysics(
        mass=mass * usual.mass, gravity=(0.0, gravity * usual.gravity[1]), drag=drag * usual.drag, noise=0.1
    )
    varied = Particle(((0.4, 0.0),), ParticlePhysics(noise=0.1), VARIED)
    plain = Particle(((0.4 * force, 0.0),), same, ParticleStart(x=(0.5, 0.5), y=(0.9, 0.9)))
    one, other = varied.reset(uniforms), plain.reset(jnp.zeros(0))
    assert other.factors is None
    gusts = jnp.linspace(0.1, 0.9, varied.uniforms)
    move, expected = jax.jit(varied.step), jax.jit(plain.step)
    for _ in range(5):
        one = move(one, jnp.ones(1), gusts)
        other = expected(other, jnp.ones(1), gusts)
    np.testing.assert_allclose(one.position, other.position, rtol=1e-5)
    np.testing.assert_allclose(one.velocity, other.velocity, rtol=1e-4)


def test_factors_for_which_drag_is_not_integrated_stably_are_refused():
    with pytest.raises(ValueError, match=r"timestep = 0\.1: must be below"):
        Particle(((0.4, 0.0),), start=ParticleStart(mass=(0.05, 1.0), drag=(1.0, 2.0)))
    with pytest.raises(ValueError, match=r"mass = \(2.0, 1.0\): must be low <= high"):
        ParticleStart(mass=(2.0, 1.0))
