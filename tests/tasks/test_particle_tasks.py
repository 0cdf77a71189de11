"""The tasks on a particle: what is seen, done and paid, when it ends; noise; and that the default learners learn."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import motorgrad as mg
from motorgrad.tasks import FallingParticle, ParticleNavigation, ParticleOrbit, around, make, region_reward
from motorgrad.tasks._particle import LAYOUTS
from motorgrad.training import agent_for, stepper_for, train
from motorgrad.worlds import ParticleState

NAMES = ("particle", "particle-navigation", "particle-orbit")


def at(x, y, vx=0.0, vy=0.0, reached=()):
    sides = jnp.array([n in reached for n in range(4)])
    return ParticleState(jnp.array([x, y], jnp.float32), jnp.array([vx, vy], jnp.float32), sides)


def pays(task, state):
    """What a decision that led to a state pays, and whether it ends the episode."""
    memory = task.init(jnp.zeros(0))
    _, reward, terminated = task.reward(memory, state, jnp.zeros(task.units))
    return float(reward), bool(terminated)


def stepped(task, decisions, seeds=3, **changes):
    stepper = stepper_for(task, agent_for(task, **changes), range(seeds))
    stepper.advance(decisions)
    return stepper


def first_policy(task):
    return agent_for(task).init(jax.random.key(0)).policy


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize(("x", "y"), [(0.25, 0.55), (0.5, 0.3), (0.9, 0.1), (0.0, 1.0)])
def test_the_reward_is_the_sum_of_the_regions(layout, x, y):
    expected = sum(
        a * math.exp(-0.5 * (((x - cx) / wx) ** 2 + ((y - cy) / wy) ** 2)) for a, cx, cy, wx, wy in LAYOUTS[layout]
    )
    assert pays(make("particle", layout=layout), at(x, y))[0] == pytest.approx(expected, abs=1e-6)


def test_regions_of_ones_own_take_the_layouts_place():
    task = make("particle", regions=[[2.0, 0.5, 0.5, 0.1, 0.2]])
    assert pays(task, at(0.6, 0.7))[0] == pytest.approx(2 * math.exp(-1.0))
    assert task.places == ((2.0, 0.5, 0.5, 0.1, 0.2),)
    assert float(region_reward(task.places, jnp.array([0.5, 0.5]))) == 2.0


def test_a_penalty_is_paid_for_every_unit_that_fires():
    task = FallingParticle(penalty=0.25, units=4)
    memory = task.init(jnp.zeros(0))
    paid = [task.reward(memory, at(0.9, 0.1), jnp.array(units))[1] for units in ([0.0] * 4, [1.0, 0, 1.0, 0])]
    assert float(paid[0] - paid[1]) == pytest.approx(0.5)
    assert float(paid[0]) == pays(FallingParticle(), at(0.9, 0.1))[0]


def test_the_floor_ends_an_episode_and_nothing_else_does():
    task = FallingParticle()
    assert [pays(task, at(0.5, 0.5, reached=[side]))[1] for side in range(4)] == [False, True, False, False]


@pytest.mark.ci
def test_an_episode_that_the_floor_ended_is_followed_by_another():
    task = FallingParticle()
    stepper = stepper_for(task, agent_for(task), range(3))
    heights, ended = [], 0
    for _ in range(80):
        stepper.advance(1)
        episodes = int(stepper.harvest()["episodes"][0])
        heights.append(float(stepper.state["world"].position[0, 1]))
        if episodes:  # the state is already the next episode's
            assert heights[-1] >= 0.9
            assert 0 <= heights[-2] < 0.1
            np.testing.assert_array_equal(stepper.state["world"].velocity[0], 0.0)
        ended += episodes
    assert ended == 3
    assert stepper.harvest()["reward"].shape == (3,)


@pytest.mark.ci
def test_the_position_is_observed_and_the_velocity_if_asked_for():
    state = at(0.1, 0.2, 0.3, 0.4)
    np.testing.assert_allclose(make("particle").observe((), state, jnp.zeros(0))[1], [0.1, 0.2])
    task = make("particle", observe_velocity=True)
    np.testing.assert_allclose(task.observe((), state, jnp.zeros(0))[1], [0.1, 0.2, 0.3, 0.4])
    assert (task.observation_size, len(task.observation_range)) == (4, 4)
    stepped(task, 50)


def test_units_push_in_turn():
    forces = np.array(make("particle", units=5).dynamics.forces)
    np.testing.assert_array_equal(forces, [[-0.4, 0], [0.4, 0], [-0.4, 0], [0.4, 0], [-0.4, 0]])
    eight = np.array(make("particle-orbit").dynamics.forces)
    assert eight.shape == (16, 2)
    np.testing.assert_allclose(np.hypot(*eight.T), 0.1)
    np.testing.assert_allclose(np.unwrap(np.arctan2(*eight.T[::-1])), np.arange(16) * math.pi / 4)
    assert around(2.0, 4) == ((2.0, 0.0), (0.0, 2.0), (-2.0, 0.0), (0.0, -2.0))
    task = make("particle", units=2, forces=[[0.0, 1.0]], physics={"mass": 2.0, "drag": 0.0, "gravity": [0.0, 0.0]})
    moved = task.dynamics.step(at(0.5, 0.1), jnp.ones(2), jnp.zeros(0))
    np.testing.assert_allclose(moved.velocity, [0.0, 0.2], rtol=1e-6)
    assert task.period == pytest.approx(0.2)


def test_the_orbit_pays_its_radius_or_minus_that():
    for wanted, sign in (("wide", 1), ("narrow", -1)):
        task = make("particle-orbit", wanted=wanted, physics={"field": {"centre": [0.4, 0.5]}})
        assert pays(task, at(0.7, 0.9)) == (pytest.approx(sign * 0.5), False)
        assert float(task.metrics((), at(0.7, 0.9))["radius"][0]) == pytest.approx(0.5)
    assert not ParticleOrbit().has_episodes
    assert ParticleOrbit(time_limit=5).has_episodes


@pytest.mark.ci
def test_an_orbit_without_pushes_has_the_radius_of_the_closed_form():
    task = make("particle-orbit", forces=[[0.0, 0.0]])
    run = train(task, steps=400, seeds=4, window=200, progress=False)
    np.testing.assert_allclose(run.curve("radius")[1][:, -1], 1 / 3, atol=1e-4)
    assert task.physics.orbit_radius == pytest.approx(1 / 3)


def test_the_goal_pays_once_and_ends_the_episode_and_obstacles_cost():
    task = make("particle-navigation", goal_region=[5.0, 0.8, 0.5, 0.1, 0.05], obstacles=[[-2.0, 0.4, 0.5, 0.1, 0.1]])
    assert pays(task, at(0.8, 0.54)) == (pytest.approx(5.0 - 2 * math.exp(-8.08), abs=1e-5), True)
    assert pays(task, at(0.8, 0.56))[1] is False
    assert pays(task, at(0.4, 0.5)) == (pytest.approx(-2.0), False)
    memory, _, _ = task.reward(jnp.int32(11), at(0.8, 0.5), jnp.zeros(64))
    metrics = task.metrics(memory, at(0.8, 0.5))
    assert (float(metrics["arrival"][0]), bool(metrics["arrival"][1])) == (12.0, True)
    assert float(task.metrics(memory, at(0.4, 0.5))["cost"][0]) == pytest.approx(2.0)
    assert not bool(task.metrics(memory, at(0.4, 0.5))["arrival"][1])


@pytest.mark.ci
def test_navigation_without_obstacles_or_limits():
    task = make("particle-navigation", obstacles=[], time_limit=0)
    assert pays(task, at(0.5, 0.5)) == (0.0, False)
    assert task.episode_limit is None
    assert ParticleNavigation().episode_limit == 200
    record = stepped(make("particle-navigation", time_limit=7, forces=[[0.0, 0.0]]), 21).harvest()
    np.testing.assert_array_equal(record["episodes"], 3)
    np.testing.assert_array_equal(record["arrival_count"], 0)


def test_noise_on_observations_has_its_deviation():
    task = make("particle", observation_noise=0.1)
    assert (make("particle").uniforms, task.uniforms) == (0, 2)
    uniforms = np.random.default_rng(0).random((20_000, 2), np.float32)
    seen = np.asarray(jax.jit(jax.vmap(lambda u: task.observe((), at(0.3, 0.6), u)[1]))(uniforms))
    np.testing.assert_allclose(seen.mean(0), [0.3, 0.6], atol=0.003)
    np.testing.assert_allclose(seen.std(0), 0.1, rtol=0.03)


@pytest.mark.parametrize("changes", [{}, {"observation_noise": 0.1}, {"physics": {"noise": 0.1}}])
def test_noise_is_compiled_only_where_there_is_some(changes):
    task = make("particle", **changes)
    world = task.dynamics

    def decision(state, action, step, look):
        state = world.step(state, action, step)
        return task.observe((), state, look)

    numbers = jnp.zeros(world.uniforms), jnp.zeros(task.uniforms)
    program = jax.jit(decision).lower(at(0.5, 0.5), jnp.zeros(8), *numbers).as_text()
    assert ("cosine" in program) == bool(changes)


@pytest.mark.ci
@pytest.mark.parametrize("changes", [{"observation_noise": 0.05}, {"physics": {"noise": 0.2}}])
@pytest.mark.parametrize("name", NAMES)
def test_noise_changes_what_happens_and_nothing_breaks(name, changes):
    noisy, clear = (stepped(make(name, **more), 120).harvest() for more in (changes, {}))
    assert np.isfinite(noisy["parameters"]).all()
    assert (noisy["parameters"] != clear["parameters"]).any()


@pytest.mark.representatives("particle")
@pytest.mark.parametrize("name", NAMES)
def test_a_run_goes_on_where_it_was_put_back(name):
    stepper = stepped(make(name), 70)
    kept = stepper.state
    stepper.advance(30)
    first = stepper.policies()
    stepper.restore(kept)
    stepper.advance(30)
    np.testing.assert_array_equal(stepper.policies().centre, first.centre)


def test_the_first_policy_tiles_the_box_with_both_directions_at_each_place():
    task = FallingParticle()
    policy = first_policy(task)
    places = [(0.25, 0.25), (0.25, 0.75), (0.75, 0.25), (0.75, 0.75)]
    np.testing.assert_allclose(policy.centre, np.repeat(places, 2, axis=0))
    np.testing.assert_allclose(np.exp(policy.log_width), 0.16, rtol=1e-6)
    wide = make("particle", physics={"walls": {"left": -1.0, "right": 3.0}}, start={"x": [-1.0, 3.0]})
    policy = first_policy(wide)
    assert sorted(set(map(float, policy.centre[:, 0]))) == [0.0, 2.0]
    np.testing.assert_allclose(np.exp(policy.log_width[0]), [0.64, 0.16], rtol=1e-6)


@pytest.mark.ci
@pytest.mark.parametrize("change", [{"learning_rate": {"centre": 2e-4, "log_width": 10.0}}, {"update_every": 7}])
def test_learning_keeps_widths_within_their_limits(change):
    limits = {"copies": 2, "least_log_width": -1.9, "most_log_width": -1.8}
    rates = {"centre": 0.0, "log_width": 10.0}
    stepper = stepped(make("particle"), 500, policy=limits, **{"learning_rate": rates, **change})
    widths = stepper.policies().log_width
    assert widths.min() == np.float32(-1.9)
    assert widths.max() == np.float32(-1.8)


REFUSED = [
    ("particle", {"units": 0}, "units = 0: must be an integer from 1 to 10,000"),
    ("particle", {"forces": []}, "forces = (): must be at least one"),
    ("particle", {"forces": [[1.0]]}, "forces[0] = [1.0]: must be a list of 2 entries"),
    ("particle", {"layout": "R4"}, "'R4'"),
    ("particle", {"regions": []}, "regions = (): must be None or at least one region"),
    ("particle", {"regions": [[1, 0.5, 0.5, 0.1]]}, "regions[0] = [1, 0.5, 0.5, 0.1]: must be a list of 5 entries"),
    ("particle", {"regions": [[1, 0.5, 0.5, 0.1, 0.1], [1, 0.5, 1.2, 0.1, 0.1]]}, "regions[1] centre = (0.5, 1.2)"),
    ("particle", {"regions": [[1, 0.5, 0.5, 0.0, 0.1]]}, "regions[0] widths = (0.0, 0.1): must be positive"),
    ("particle", {"regions": [[1, 0.5, 0.5, 0.1, -0.1]]}, "regions[0] widths = (0.1, -0.1)"),
    ("particle", {"observation_noise": -0.1}, "observation_noise = -0.1"),
    ("particle", {"time_limit": -1}, "time_limit = -1"),
    ("particle", {"start": {"y": [0.9, 1.1]}}, "start.y = (0.9, 1.1): must be within the box, 0 … 1"),
    ("particle", {"physics": {"mass": -1.0}}, "mass = -1.0"),
    ("particle", {"physics": {"walls": {"open": ["roof"]}}}, "physics.walls.open[0] 'roof'"),
    ("particle-orbit", {"wanted": "big"}, "'big'"),
    ("particle-orbit", {"physics": {"field": {"radial": 0.2}}}, "field.radial = 0.2: must be above mass"),
    (
        "particle-navigation",
        {"goal_region": [1.0, 1.5, 0.5, 0.1, 0.1]},
        "goal_region centre = (1.5, 0.5): must be within the box",
    ),
    (
        "particle-navigation",
        {"goal_region": [0.0, 0.5, 0.5, 0.1, 0.1]},
        "goal_region amplitude = 0.0: must be positive",
    ),
    ("particle-navigation", {"obstacles": [[1.0, 0.5, 0.5, 0.1, 0.1]]}, "obstacles[0] amplitude = 1.0: must be neg"),
    ("particle-navigation", {"obstacles": [[-1.0, 0.5, 0.5, 0.1, 0.0]]}, "obstacles[0] widths = (0.1, 0.0)"),
]


@pytest.mark.parametrize(("name", "changes", "words"), REFUSED, ids=[words[:40] for *_, words in REFUSED])
def test_what_cannot_be_is_refused_by_name(name, changes, words):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        make(name, **changes)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.ci
def test_untrained_rewards_and_the_length_of_episodes_are_those_of_the_reading():
    still = {"learning_rate": {"centre": 0.0, "log_width": 0.0}}
    for layout, expected in (("R1", -0.001), ("R2", 0.123)):
        task = make("particle", layout=layout)
        record = stepped(task, 5_000, 20, **still).harvest()
        assert record["reward"].mean() / 5_000 == pytest.approx(expected, abs=0.006)
        assert 5_000 / record["episodes"].mean() == pytest.approx(24.5, abs=0.2)


@pytest.mark.ci
@pytest.mark.parametrize(("layout", "least"), [("R1", 0.18), ("R2", 0.27)])
def test_the_default_learner_gets_better(layout, least):
    rewards = train(make("particle", layout=layout), steps=16_000, seeds=8, window=2_000, progress=False).curve()[1]
    assert rewards[:, -1].mean() > least


@pytest.mark.slow
def test_orbits_widen_or_narrow():
    for wanted, low, high in (("wide", 0.42, 0.6), ("narrow", 0.0, 0.26)):
        task = make("particle-orbit", wanted=wanted)
        radius = train(task, steps=16_000, seeds=8, window=4_000, progress=False).curve("radius")[1][:, -1]
        assert low < radius.mean() < high


@pytest.mark.ci
def test_the_flow_leads_to_the_goal():
    run = train(make("particle-navigation"), steps=24_000, seeds=8, window=6_000, progress=False)
    share = (run.curve("arrival_count")[1] / run.curve("episodes")[1]).mean(0)
    assert share[-1] > share[0] + 0.1
    arrival = np.nanmean(run.curve("arrival")[1], axis=0)
    assert arrival[-1] < 0.85 * arrival[0]
    assert run.curve()[1].mean(0)[-1] > run.curve()[1].mean(0)[0] + 0.05


@pytest.mark.slow
@pytest.mark.parametrize(("layout", "expected"), [("R1", 0.283), ("R2", 0.329)])
def test_two_thousand_episodes_reach_what_the_reading_says(layout, expected):
    run = mg.train(make("particle", layout=layout), steps=49_000, seeds=20, window=4_900, progress=False)
    assert run.curve()[1][:, -1].mean() == pytest.approx(expected, abs=0.02)  # the last 200 episodes
