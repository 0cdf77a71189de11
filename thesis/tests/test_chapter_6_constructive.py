"""Experiments of chapter 6 with growing pools, flow fields, gates and the hopper: numbers, judgements, end to end."""

from typing import get_args

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.policies import Gated, Hyperplanes, LocalGaussians, tiles
from motorgrad.tasks import Hopper, ParticleNavigation
from motorgrad_thesis import EXPERIMENTS, Kind, reproduce
from motorgrad_thesis.appendix_a.figure_a_2 import Circular, force_at, orbit
from motorgrad_thesis.chapter_6.section_6_4._growing_study import after_units, disturbance, grown_policies
from motorgrad_thesis.chapter_6.section_6_4.figure_6_7 import GrowingPolicy, at_own_interval, centre_shifts
from motorgrad_thesis.chapter_6.section_6_4.figure_6_8 import INDEPENDENT, WITHIN, GrowingReward
from motorgrad_thesis.chapter_6.section_6_4.figure_6_9 import Orbits
from motorgrad_thesis.chapter_6.section_6_4.section_6_4_criteria import WAYS, Criteria
from motorgrad_thesis.chapter_6.section_6_4.section_6_4_placement import Placement
from motorgrad_thesis.chapter_6.section_6_5.bodies import BODIES, KINDS, LocalBodies
from motorgrad_thesis.chapter_6.section_6_5.hierarchy import (
    POLICY_LABELS,
    Hierarchy,
    gate_difference,
    gate_maps,
    parameter_count,
)
from motorgrad_thesis.chapter_6.section_6_5.local_hopper import LocalHopper, muscle_activity
from motorgrad_thesis.chapter_6.section_6_5.navigation import Navigation, arrival_shares, flow

CLAIMS = {
    "sec-6.4-criteria": 7,
    "sec-6.4-placement": 3,
    "fig-6.7": 6,
    "fig-6.8": 7,  # the greater targets are not reached with so few units
    "fig-6.9": 10,
    "sec-6.5.4-hierarchy": 6,
    "sec-6.5.4-navigation": 7,
    "sec-6.5.4-hopper": 13,
    "fig-a.2": 5,
}


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return tmp_path_factory.mktemp("constructive")


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.ci if name == "fig-a.2" else ()) for name in CLAIMS]
)
def test_each_runs_from_end_to_end(name, out):
    found = reproduce(EXPERIMENTS[name].quick(), out, progress=False)
    assert len(found.claims) == CLAIMS[name]
    assert {"figure.svg", "figure.png", "record.json", "values.npz"} <= {path.name for path in found.folder.iterdir()}
    assert all(np.isfinite(claim.measured.value) or claim.verdict == "undecided" for claim in found.claims)


def test_they_stand_in_the_order_of_the_source():
    assert [name for name in EXPERIMENTS if name in CLAIMS] == list(CLAIMS)


@pytest.mark.parametrize("name", [name for name in CLAIMS if name != "fig-a.2"])
def test_they_are_over_enough_seeds(name):
    assert EXPERIMENTS[name]().seeds >= 20


@pytest.mark.parametrize(
    ("name", "setting", "named"),
    [
        ("fig-6.7", {"units": 1}, "units = 1"),
        ("fig-6.8", {"seeds": 1}, "seeds = 1"),
        ("sec-6.5.4-navigation", {"watched": 3}, "watched = 3"),
        ("sec-6.5.4-hierarchy", {"decisions": 3}, "decisions = 3"),
        ("sec-6.5.4-hopper", {"seconds": 0.5}, "seconds = 0.5"),
        ("sec-6.5.4-hopper", {"static": 1}, "units = 1"),
        ("sec-6.5.4-hopper", {"grown": 50}, "growth.criterion.interval = 500"),
        ("fig-a.2", {"tangential": 1.0}, "field.radial = 1.0"),
        ("fig-a.2", {"seconds": 0.0}, "seconds = 0.0"),
    ],
)
def test_impossible_settings_are_refused_by_name(name, setting, named):
    with pytest.raises(ValueError, match=named):
        EXPERIMENTS[name](**setting)


# --- growing pools ---


def test_the_reward_after_a_unit_is_that_of_its_learning_phase_and_the_drop_that_at_the_next():
    decision = np.arange(1_000, 30_001, 1_000)
    phase = (decision - 1) // 10_000
    values = np.where((decision - 1) % 10_000 >= 8_000, 1.0 + phase, 0.0)[None]
    np.testing.assert_allclose(after_units(decision, values, 3), [[1, 2, 3]])
    np.testing.assert_allclose(disturbance(decision, values, 3), [[1, 2]])


def test_moves_are_those_of_the_new_unit_and_of_the_others():
    centre = np.zeros((3, 2, 3, 2))
    centre[1, :, 1] = (0.3, 0.4)  # the second unit goes half a box
    centre[2] = centre[1]
    centre[2, :, 0] = (0.2, 0.0)  # then the first goes 0.2, and the third stays
    new, others = centre_shifts(centre)
    np.testing.assert_allclose(new, 0.25)
    np.testing.assert_allclose(others, 0.05)
    np.testing.assert_array_equal(at_own_interval(centre)[:, 1], centre[1, :, 1])


@pytest.mark.slow
def test_grown_pools_leave_off_the_unit_that_was_just_added(out):
    import motorgrad as mg

    study = GrowingPolicy.quick()
    run = mg.train(study.task, study.growing(study.task), study.decisions, 2, progress=False)
    history = grown_policies(run, range(1, study.units + 1))
    np.testing.assert_array_equal(history.active.sum(-1), np.repeat(np.arange(1, 5)[:, None], 2, axis=1))
    np.testing.assert_array_equal(history.pool.centre[-1], run.policies.pool.centre)
    np.testing.assert_array_equal(history.pool.centre[0, :, 1], 0.5)  # where the second unit is going to begin
    np.testing.assert_allclose(np.exp(history.pool.log_width[0, :, 1]), 1.0)


def reward(after, static, drop=0.13):
    """Values of figure 6.8 with these means after each unit."""
    chance = 0.01 * np.random.default_rng(0).standard_normal((24, 1))
    after = np.asarray(after) + chance
    return {
        "grown after": after,
        "right first after": after,
        "grown drop": np.full((24, 19), drop) + chance,
        "decision": np.arange(1_000, 200_001, 1_000),
        "grown reward": np.repeat(after, 10, axis=1),
        "static reward": np.full((24, 200), static) + chance,
        "static like grown reward": np.full((24, 200), static) + chance,
    }


def test_the_claims_of_figure_6_8_can_come_out_either_way():
    usual = np.interp(np.arange(1, 21), list(INDEPENDENT), list(INDEPENDENT.values()))
    holds = [claim.holds for claim in GrowingReward().judge(reward(usual, 0.2), "exact")]
    assert holds == [True] * 7 + [False, True] + [True] * 2
    peaked = usual - 0.02 * np.abs(np.arange(1, 21) - 13)
    assert [claim.holds for claim in GrowingReward().judge(reward(peaked, 0.2), "exact")][7:9] == [True, False]
    off = [claim.holds for claim in GrowingReward().judge(reward(usual + 1.5 * WITHIN, 0.1, drop=0.0), "exact")]
    assert off[:7] == [False] * 7
    assert off[9:] == [False] * 2


def test_the_claims_of_figure_6_7_can_come_out_either_way():
    rng = np.random.default_rng(1)
    rise = np.linspace(0, 0.2, 20) + 0.01 * rng.standard_normal((24, 1))
    finds = np.full((20, 24, 20, 2), 0.5)
    for unit in range(20):  # each goes somewhere in its own interval, and stays
        finds[unit:, :, unit] = 0.5 + 0.2 * (1 + rng.random((24, 2)))
    narrow = np.log(np.full((20, 24, 20, 2), 0.15))
    values = {"centre": finds, "log width": narrow, "reward": rise}
    assert [claim.holds for claim in GrowingPolicy().judge(values, "exact")] == [True] * 3
    wanders = rng.random(finds.shape)
    for unit in range(1, 20):  # the new one stays where it begins, while all others move
        wanders[unit, :, unit] = wanders[unit - 1, :, unit]
    worse = {"centre": wanders, "log width": narrow + 2, "reward": rise[:, ::-1]}
    assert [claim.holds for claim in GrowingPolicy().judge(worse, "exact")] == [False] * 3


def test_the_claims_about_orbits_can_come_out_either_way():
    chance = 0.001 * np.random.default_rng(2).standard_normal((24, 1))
    good = {"wide after": np.linspace(0.35, 0.46, 16) + chance, "narrow after": np.linspace(0.3, 0.18, 16) + chance}
    assert all(claim.holds for claim in Orbits().judge(good, "exact"))
    flat = {name: np.full((24, 16), 1 / 3) + chance for name in good}
    assert not any(claim.holds for claim in Orbits().judge(flat, "exact"))


# --- criteria and placement ---


def criteria(plateau, naive, stops):
    chance = 0.01 * np.random.default_rng(3).standard_normal((24, 1))
    decision = np.arange(1_000, 200_001, 1_000)
    values = {"decision": decision}
    for layout in Criteria().layouts:
        for way in WAYS:
            level = {"clock": 0.2, "first": naive}.get(way, plateau)
            values[f"{layout} {way} reward"] = np.full((24, 200), level) + chance
            most = 5 if stops and way != "clock" else 20
            units = np.minimum(1 + decision // 10_000, most)
            values[f"{layout} {way} units"] = np.broadcast_to(units, (24, 200))
    return values


def test_the_claims_about_criteria_can_come_out_either_way():
    assert all(claim.holds for claim in Criteria().claims(criteria(0.21, 0.1, stops=True)))
    assert not any(claim.holds for claim in Criteria().claims(criteria(0.15, 0.2, stops=False)))


@pytest.mark.parametrize("better", [True, False])
def test_the_claims_about_placement_can_come_out_either_way(better):
    rng, values = np.random.default_rng(4), {}
    for layout in ("R3", "R1"):
        for place in ("centre", "visited"):
            gain = 0.05 * (better if place == "visited" else not better)
            chance = 0.01 * rng.standard_normal((24, 1))
            values |= {
                f"{layout} {place} after": np.full((24, 20), 0.1 + gain) + chance,
                f"{layout} {place} reward": np.full((24, 200), 0.1 + gain) + chance,
                f"{layout} {place} starts": np.zeros((24, 19, 2)),
                f"{layout} {place} ends": 0.3 - 2 * gain + 0.01 * rng.random((24, 19, 2)),
            }
    assert [claim.holds for claim in Placement().claims(values)] == [better] * 6


# --- navigation ---


def test_the_flow_is_the_expected_force():
    task = ParticleNavigation(units=4)
    policy = LocalGaussians(np.full((4, 2), 0.5), np.zeros((4, 2)), p_max=jnp.array([0.5, 0.4, 0.1, 0.0001]))
    at = np.array([[0.5, 0.5], [5.0, 5.0]])
    np.testing.assert_allclose(flow(policy, task, at)[0], [0.4 * (0.5 - 0.1), 0.4 * (0.4 - 0.0001)], atol=1e-6)
    np.testing.assert_allclose(flow(policy, task, at)[1], 0, atol=1e-6)


def test_shares_of_arrivals_are_those_of_episodes_that_ended():
    import pyarrow as pa

    metrics = pa.table({"episodes": [2, 0, 0, 4, 5, 0], "arrival_count": [1, 0, 0, 4, 0, 0]})
    np.testing.assert_allclose(arrival_shares(metrics, 2), [[0.5, 0.5, 0.0], [np.nan, 1.0, 1.0]])


def navigation(share, cost, arrival):
    chance = 0.01 * np.random.default_rng(5).random(24)
    values = {"before share": 0.4 + chance, "before cost": 0.1 + chance, "before arrival": 100 + chance}
    values["before cost per episode"] = values["before cost"]
    for name in ("own", "half"):
        values |= {f"{name} share": share - chance, f"{name} cost": cost + chance[::-1]}
        values |= {f"{name} cost per episode": cost + chance, f"{name} arrival": arrival + chance}
    return values


def test_the_claims_about_navigation_can_come_out_either_way():
    assert all(claim.holds for claim in Navigation().claims(navigation(1.0, 0.05, 20)))
    assert not any(claim.holds for claim in Navigation().claims(navigation(0.4, 0.2, 110)))


# --- hierarchy ---


def test_flat_pools_have_as_many_parameters():
    study = Hierarchy()
    counts = {name: parameter_count(study.learner(name)) for name in POLICY_LABELS}
    assert counts == {"ungated": 6, "gated": 20, "flat gated": 20, "deep": 48, "flat deep": 48}


def test_gates_push_nowhere_and_what_is_behind_them_does():
    task, agent = Hierarchy().learner("deep")
    policy = agent.policy(jax.random.key(0))
    forces = np.asarray(task.dynamics.forces)
    leads = np.asarray(policy.sample(jnp.full(2, 0.5), jnp.zeros(policy.uniforms)))  # all that can fire does
    assert leads.all()
    gates = [0, 1, 2, 3, 8, 9]
    np.testing.assert_array_equal(forces[gates], 0)
    assert (np.delete(forces, gates, axis=0)[:, 0] != 0).all()


def test_a_pool_is_as_open_as_all_its_gates_together():
    near = LocalGaussians([[0.5, 0.5]], [[0.0, 0.0]], p_max=jnp.asarray(0.5))
    pushes = Hyperplanes(jnp.zeros((2, 2)), jnp.array([-50.0, 50.0]))  # never to the left, always to the right
    shown = gate_maps(Gated(near, [Gated(near, [pushes])]))
    assert shown["open"].shape == (1, 61, 61)
    assert shown["open"][0, 30, 30] == pytest.approx(0.25)
    np.testing.assert_allclose(shown["push"], 1.0)
    np.testing.assert_array_equal(shown["level"], [0, 1])


def test_pools_that_push_alike_are_not_apart():
    gates = tiles(2, 2)
    left, right = (Hyperplanes(jnp.zeros((2, 2)), jnp.array([sign, -sign])) for sign in (50.0, -50.0))
    alike, unlike = Gated(gates, [left, left]), Gated(gates, [left, right])
    seeds = jax.tree.map(lambda *leaves: jnp.stack(leaves), alike, unlike)
    np.testing.assert_allclose(gate_difference(seeds), [0.0, 2.0], atol=1e-6)


def hierarchy(gain, learned):
    chance = 0.001 * np.random.default_rng(6).random(24)
    levels = {"ungated": 0.0, "gated": gain, "deep": 2 * gain, "flat gated": 0.0, "flat deep": 0.0}
    values = {f"{name} end": 0.2 + level + chance for name, level in levels.items()}
    return values | {
        "parameters": np.array([6, 20, 20, 48, 48]),
        "gated moved": learned + chance,
        "turned": learned + chance,
    }


def test_the_claims_about_hierarchies_can_come_out_either_way():
    assert all(claim.holds for claim in Hierarchy().claims(hierarchy(0.05, 0.3)))
    assert not any(claim.holds for claim in Hierarchy().claims(hierarchy(-0.05, 0.01)))


# --- hopper ---


def test_muscles_are_active_where_any_of_their_units_fires():
    task = Hopper(units=4)
    middle = [np.mean(ends) for ends in task.observation_range]
    centre = np.array([[1.0, *middle[1:]]] * 2 + [[-1.0, *middle[1:]]] * 2)
    policy = LocalGaussians(centre, np.full((4, 3), -1.0), p_max=jnp.array([0.5, 0.25, 0.5, 0.25]))
    found = muscle_activity(policy, task)
    near = np.exp(-0.5 * (2 / np.exp(-1.0)) ** 2)  # of a unit of the other contact
    expected = [1 - (1 - p) * (1 - p * near) for p in (0.5, 0.25)]
    np.testing.assert_allclose(found[0, 29:31, 29:31].mean((0, 1)), expected, rtol=0.02)
    np.testing.assert_allclose(found[0], found[1], atol=1e-6)  # the same on the ground and in the air


def test_without_contact_muscles_are_active_alike_on_the_ground_and_in_the_air():
    task = Hopper(units=2, observe_contact=False)
    policy = LocalGaussians([[-0.3, 0.2], [0.3, -0.2]], np.full((2, 2), -1.0), p_max=0.5)
    found = muscle_activity(policy, task)
    np.testing.assert_allclose(found[0], found[1])
    assert found.max() > 0.49


def hoppers(static, grown_policies):
    chance = 0.01 * np.random.default_rng(7).random((20, 1))
    ends = {"planes": 0.8, "static": static, "grown": grown_policies}
    ends |= {f"knee {name}": end for name, end in ends.items()}
    values = {f"{name} heights": np.linspace(0.1, end, 100) + chance for name, end in ends.items()}
    return values | {"time": np.arange(100)}


def test_the_claims_about_hoppers_can_come_out_either_way():
    assert all(claim.holds for claim in LocalHopper().claims(hoppers(0.85, 0.9)))
    holds = [claim.holds for claim in LocalHopper().claims(hoppers(0.09, 0.02))]
    assert holds == [False] * 13


# --- arm and hexapod ---


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", BODIES)
def test_every_unit_drives_one_action_and_every_action_has_units(name, kind):
    task, learner = LocalBodies(grown=12).learner(name, kind)
    units = {"planes": BODIES[name].actions, "tiled": BODIES[name].actions * 2 ** BODIES[name].inputs, "grown": 12}[
        kind
    ]
    assert (task.observation_size, task.action_size) == (BODIES[name].inputs, units)
    assert learner.first_policy(jax.random.key(0)).outputs == units


def bodies(planes, tiled, grown):
    """The arm's distances and the hexapod's speeds where both do equally well, starting from nothing."""
    chance = 0.01 * np.random.default_rng(7).random((20, 1))
    found = {"decision": np.linspace(300, 30_000, 100)}
    for kind, end in {"planes": planes, "tiled": tiled, "grown": grown}.items():
        does = np.linspace(0, end, 100) + chance
        found |= {f"arm {kind}": 1 - does, f"hexapod {kind}": does}
    return found


def test_the_claims_about_an_arm_and_a_hexapod_can_come_out_either_way():
    assert all(claim.holds for claim in LocalBodies().claims(bodies(0.3, 0.4, 0.5)))
    assert not any(claim.holds for claim in LocalBodies().claims(bodies(0.3, -0.1, -0.2)))


# --- figure A.2 ---


@pytest.mark.ci
def test_the_claims_about_the_field_fail_where_it_turns_the_other_way(out):
    done = reproduce(Circular(), out / "whole", progress=False)
    assert all(claim.holds for claim in done.claims)
    with np.load(done.folder / "values.npz") as stored:
        values = dict(stored)
    other = values | {"force": -values["force"], "turning": -values["turning"], "measured": 1.1 * values["measured"]}
    assert [claim.holds for claim in Circular().claims(other)] == [False] * 4 + [True]


def test_the_orbit_of_a_field_without_a_turn_is_its_radius():
    physics = Circular().physics(0.0, 1.0)
    radius, turning = orbit(physics, (0.9, 0.5), 60.0)
    assert radius == pytest.approx(0.25, rel=1e-4)
    assert turning == pytest.approx(0.0, abs=1e-4)
    np.testing.assert_allclose(force_at(physics.field, np.array([[0.85, 0.5]])), [[-0.1, 0.0]], atol=1e-6)


# --- at full length ---


@pytest.mark.slow
def test_grown_pools_come_to_the_rewards_of_an_independent_model(tmp_path):
    found = reproduce(GrowingReward(pairs=("exact",)), tmp_path, progress=False)
    # the first unit pushes to the left here, to the right in the independent model, by all appearances
    assert [claim.holds for claim in found.claims] == [False] + [True] * 6 + [False, True] + [True] * 2


@pytest.mark.slow
def test_orbits_widen_and_narrow_as_much_as_in_an_independent_model(tmp_path):
    claims = reproduce(Orbits(pairs=("exact",)), tmp_path, progress=False).claims
    verdicts = {kind: {claim.verdict for claim in claims if claim.kind == kind} for kind in get_args(Kind)}
    assert verdicts["thesis"] == verdicts["extension"] == {"holds"}
    assert "refuted" not in verdicts["reference model"]
