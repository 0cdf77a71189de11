"""Experiments on local policies of a fixed size: numbers, judgements, and end to end."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import motorgrad as mg
from motorgrad.policies import LocalGaussians, tiles
from motorgrad.statistics import moving_mean
from motorgrad.tasks import FallingParticle, region_reward
from motorgrad.worlds import ParticleState
from motorgrad_thesis import EXPERIMENTS, Workspace, reproduce
from motorgrad_thesis.chapter_6._local_study import frozen_reward, late_reward, median_row, outside, visited
from motorgrad_thesis.chapter_6.beyond_6_2_natural import NaturalStep
from motorgrad_thesis.chapter_6.figure_6_2 import Partition, change, fit, parts
from motorgrad_thesis.chapter_6.figure_6_3 import motions
from motorgrad_thesis.chapter_6.figure_6_4 import InitialPolicy
from motorgrad_thesis.chapter_6.figure_6_5 import LocalPolicies
from motorgrad_thesis.chapter_6.figure_6_6 import AnyUnitFires, any_fires, sampled_firing
from motorgrad_thesis.chapter_6.section_6_1_1_forgetting import (
    POLICY_KINDS,
    Forgetting,
    Powers,
    reward_gained,
    reward_lost,
)
from motorgrad_thesis.chapter_6.section_6_3_noise import Noise, decisions_to
from motorgrad_thesis.chapter_6.section_6_5.mixtures import Mixtures
from motorgrad_thesis.chapter_6.section_6_5.pruning import Pruning

CLAIMS = {
    "fig-6.1": 2,
    "sec-6.1.1-forgetting": 5,
    "sec-6.1.2-cmac": 8,
    "fig-6.2": 3,
    "beyond-6.2-natural": 2,
    "sec-6.2.1-covariance": 6,
    "fig-6.3": 2,
    "sec-6.3-noise": 6,
    "fig-6.4": 4,
    "fig-6.5": 22,
    "fig-6.6": 8,
    "sec-6.5.1-period": 10,
    "sec-6.5-mixtures": 9,
    "sec-6.5.2-robustness": 14,
    "sec-6.5.3-greediness": 5,
    "sec-6.5.4-pruning": 3,
}
SEEDED = [name for name in CLAIMS if hasattr(EXPERIMENTS[name](), "seeds")]
rng = np.random.default_rng(0)


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return tmp_path_factory.mktemp("local")


@pytest.fixture
def work(out):
    return Workspace(out / "some", out / "trained", progress=False)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.ci if name in ("fig-6.1", "fig-6.2") else ()) for name in CLAIMS]
)
def test_each_runs_from_end_to_end(name, out):
    found = reproduce(EXPERIMENTS[name].quick(), out, quick=True, progress=False)
    assert len(found.claims) == CLAIMS[name]
    assert {"figure.svg", "figure.png", "record.json", "values.npz"} <= {path.name for path in found.folder.iterdir()}
    assert all(np.isfinite(claim.measured.value) or claim.verdict == "undecided" for claim in found.claims)


def test_they_stand_in_the_order_of_the_source():
    assert [name for name in EXPERIMENTS if name in CLAIMS] == list(CLAIMS)


@pytest.mark.parametrize("name", SEEDED)
def test_they_are_over_enough_seeds(name):
    assert EXPERIMENTS[name]().seeds >= 20


@pytest.mark.parametrize(
    ("name", "setting", "named"),
    [
        ("fig-6.2", {"predictors": 1}, "predictors = 1"),
        ("fig-6.2", {"brake": 9.0}, "brake = 9"),
        ("fig-6.3", {"most": 0}, "most = 0"),
        ("fig-6.4", {"episodes": 1}, "episodes = 1"),
        ("fig-6.5", {"seeds": 1}, "seeds = 1"),
        ("fig-6.5", {"looks": 0}, "looks = 0"),
        ("fig-6.6", {"cells": 3}, "cells = 3"),
        ("sec-6.1.1-forgetting", {"gaps": (0.4, 0.2)}, "gaps = "),
        ("sec-6.1.1-forgetting", {"kinds": ("linear",)}, "kinds = "),
        ("beyond-6.2-natural", {"layouts": ()}, "layouts = "),
        ("beyond-6.2-natural", {"layouts": ("R9",)}, r"unknown layouts\[0\] 'R9'"),
        ("sec-6.1.1-forgetting", {"gaps": (0.8,)}, r"gaps\[0\] = 0.8"),
        ("beyond-6.2-natural", {"decisions": 10}, "decisions = 10"),
        ("sec-6.2.1-covariance", {"units": (2, 8)}, "shown = 4"),
        ("sec-6.3-noise", {"dynamics": ()}, "dynamics = "),
        ("sec-6.3-noise", {"observation": (0.1, 0.1)}, "observation = "),
        ("sec-6.5.1-period", {"speeds": (0.2, 0.1)}, "speeds = "),
        ("sec-6.5.1-period", {"peak": 0.9}, "peak = 0.9"),
        ("sec-6.5.2-robustness", {"again": 10}, "again = 10"),
        ("sec-6.5.3-greediness", {"units": 1}, "units = 1"),
        ("sec-6.5.3-greediness", {"penalties": (0.1, 0.05)}, "penalties = "),
        ("sec-6.5.4-pruning", {"bounds": (0.5, 0.1)}, "bounds = "),
    ],
)
def test_impossible_settings_are_refused_by_name(name, setting, named):
    with pytest.raises(ValueError, match=named):
        EXPERIMENTS[name](**setting)


def held(experiment, values):
    return [claim.holds for claim in experiment.claims(values)]


def judged(experiment, values):
    """The verdicts with one pair of probability and score of an experiment that is done with both."""
    return [claim.holds for claim in experiment.judge(values, "exact")]


# --- what they share ---


@pytest.mark.slow
def test_late_is_the_last_tenth_of_the_episodes():
    task = FallingParticle()
    run = mg.train(task, None, 10_000, 3, progress=False)
    episodes, reward = run.curve("episodes")[1].cumsum(1), run.curve()[1]
    expected = [row[(count > 360) & (count <= 400)].mean() for row, count in zip(reward, episodes, strict=True)]
    np.testing.assert_allclose(late_reward(run, 400), expected, rtol=1e-6)
    assert (
        late_reward(run) == late_reward(run, 10**6)
    ).all()  # of fewer than 2,000 it is the last tenth of those there are


@pytest.mark.ci
def test_policies_are_judged_on_their_own_reward_by_others_numbers(work):
    task = FallingParticle(regions=((1.0, 0.1, 0.2, 0.2, 0.3),))
    wide, far = (jnp.full((8, 2), np.log(s)) for s in (10.0, 0.01))
    side = np.where(np.arange(8)[:, None] % 2 == 0, 1.0, -50.0)  # the units that push to the left are wide, or none
    left = LocalGaussians(jnp.zeros((8, 2)), jnp.where(side > 0, wide, far))
    right = LocalGaussians(jnp.zeros((8, 2)), jnp.where(side > 0, far, wide))
    both = jax.tree.map(lambda a, b: jnp.stack([a, b]), left, right)
    rates = {"centre": 2e-4, "log_width": 8e-4}
    reward = frozen_reward(work, task, both, 1_000, policy="gaussians", learning_rate=rates)
    assert reward[0] > 3 * max(reward[1], 0.01)


def test_the_typical_seed_is_at_the_median():
    assert median_row(np.array([0.3, 0.1, 0.2])) == 2
    assert median_row(np.array([4.0, 1.0, 3.0, 2.0])) == 2


@pytest.mark.ci
def test_outside_and_visited():
    np.testing.assert_array_equal(outside(np.array([[0.5, 0.5], [1.1, 0.5], [0.2, -0.1]])), [False, True, True])
    task = FallingParticle()
    places = visited(task, tiles(task, copies=2), 5)
    assert 100 < len(places) < 150
    assert (places >= 0).all()
    assert (places <= 1).all()


def test_the_moving_mean():
    np.testing.assert_allclose(moving_mean(np.array([[1.0, 3.0, 5.0, 9.0]]), 2), [[2, 4, 7]])


def test_powers_are_those_of_the_place():
    task = Powers(regions=((1.0, 0.5, 0.5, 0.1, 0.1),))
    state = ParticleState(jnp.array([0.75, 0.1]), jnp.zeros(2), jnp.zeros(4, bool))
    np.testing.assert_allclose(task.observe((), state, jnp.zeros(0))[1], [0.5, -0.8, 0.25, -0.4, 0.64], rtol=1e-6)
    assert task.observation_size == len(task.observation_range) == 5


# --- figures 6.2, 6.3, 6.4, 6.6 ---


def test_the_change_seen_is_that_of_moving_straight_ahead():
    bearing, distance, ahead = 0.7, 1.3, 1e-6
    x, y = distance * np.sin(bearing), distance * np.cos(bearing) - ahead
    after = np.array([np.arctan2(x, y), np.hypot(x, y)])
    expected = (after - [bearing, distance]) / ahead
    np.testing.assert_allclose(change(np.array([bearing, distance])), expected, rtol=1e-4)


def test_linear_predictors_find_the_pieces_of_what_is_linear_in_pieces():
    places = np.stack(np.meshgrid(np.linspace(0, 1, 30), np.linspace(0, 1, 30)), axis=-1).reshape(-1, 2)
    wanted = np.where(places[:, :1] < 0.5, [[1.0, 0.0]], [[-1.0, 2.0]]) * places
    weights = fit(places, wanted, 2, seed=3)
    affine = np.concatenate([places, np.ones((900, 1))], axis=1)
    errors = np.abs(np.einsum("pi,nio->pno", affine, weights) - wanted[:, None]).max(-1)
    assert errors.min(1).max() < 1e-9
    np.testing.assert_array_equal(parts(np.array([2, 2, 5, 5, 2])), [2, 5, 2])


def test_claims_of_the_partition():
    eight = np.repeat(np.arange(8), 5)[None].repeat(20, 0)
    some = np.random.default_rng(1).integers(0, 2, 6)
    line = {"distance": np.linspace(0.25, 2, 20), "bearing": np.linspace(-1.5, 1.5, 40)}
    assert held(Partition(), line | {"constant": eight, "linear": np.stack([eight] * 6)}) == [True] * 3
    one = np.zeros_like(eight)
    assert held(Partition(), line | {"constant": one, "linear": np.stack([one + k for k in some])}) == [False] * 3


@pytest.mark.ci
@pytest.mark.representatives("2")
@pytest.mark.parametrize("side", [1, 2, 4])
def test_the_world_makes_few_motions_of_many_patterns(side):
    assert motions(side) == (4**side, 2 * side + 1)


def test_claims_of_the_initial_policy():
    spread = np.full((10, 10), 0.01)
    values = {"lengths": 24 + (rng.random(400) < 0.5), "occupancy": spread, "drop": np.array(0.2838338)}
    values |= {"lengths none": values["lengths"], "lengths left": values["lengths"]}
    assert held(InitialPolicy(), values) == [True] * 4
    skewed = np.zeros((10, 10))
    skewed[:, 0] = 0.1
    values |= {
        "lengths": values["lengths"] + 1,
        "lengths left": values["lengths"] - 1.0,
        "occupancy": skewed,
        "drop": np.array(0.318765),
    }
    assert held(InitialPolicy(), values) == [False] * 4


def test_some_unit_fires_as_often_as_it_is_drawn():
    task = FallingParticle()
    places = np.array([[0.25, 0.3], [0.5, 0.5], [0.9, 0.05]])
    policy = tiles(task, copies=2, p_max=0.6)
    exact = any_fires(policy, places)
    p = np.asarray(jax.vmap(policy.prob)(jnp.asarray(places, jnp.float32)))
    np.testing.assert_allclose(exact, 1 - np.prod(1 - p, axis=1), rtol=1e-5)
    np.testing.assert_allclose(sampled_firing(policy, places), exact, atol=0.06)


def test_claims_of_where_it_acts():
    local = np.full((24, 20, 20), 0.02)
    local[:, :5] = 0.95
    values = {"any": local, "row": np.array(0), "drawn": local[0], "any where it is": np.full(24, 0.6)}
    values["any before learning"] = local[0]
    assert judged(AnyUnitFires(), values) == [True] * 4
    everywhere = np.full((24, 20, 20), 0.5)
    values |= {"any": everywhere, "drawn": np.zeros((20, 20)), "any where it is": np.full(24, 0.1)}
    assert judged(AnyUnitFires(), values) == [False] * 4


# --- what is learned ---


def about(mean, seeds=24, spread=0.01):
    found = np.random.default_rng(seeds).normal(size=seeds)
    return mean + spread * (found - found.mean()) / found.std(ddof=1)


def learned(late_of, sided, junk):
    values = {}
    for layout, before in (("R1", -0.001), ("R2", 0.123)):
        values[f"{layout} untrained"] = about(before, spread=0.002)
        values[f"{layout} late"] = values[f"{layout} late forgetting"] = about(late_of[layout])
        values[f"{layout} firing"] = np.full((24, 8), 0.001 if junk else 3.0)
        values[f"{layout} centre"] = np.full((24, 8, 2), 1.2 if junk else 0.5)
        values[f"{layout} left"] = np.full(24, 0.9 if sided else 0.5)
    return values


def test_claims_of_what_is_learned():
    good = learned({"R1": 0.283, "R2": 0.329}, True, True)
    assert judged(LocalPolicies(), good) == [True] * 13
    poor = judged(LocalPolicies(), learned({"R1": -0.01, "R2": 0.1}, False, False))
    # before learning they pay the same
    assert poor == [False, True, False, False] * 2 + [False] * 5


def test_both_pairs_are_judged_and_statements_by_the_printed_one():
    good, poor = (learned({"R1": late, "R2": late + 0.05}, True, True) for late in (0.283, 0.2))
    values = {f"printed {name}": value for name, value in poor.items()}
    values |= {f"exact {name}": value for name, value in good.items()}
    claims = list(LocalPolicies().claims(values))
    thesis = [claim for claim in claims if claim.kind == "thesis"]
    assert [bool(claim.untested) for claim in thesis] == [False] * 5 + [True] * 5
    assert [claim.of for claim in thesis[:5]] == [claim.of for claim in thesis[5:]]
    assert all("exact pair" in claim.statement for claim in claims if claim.kind == "reference model")
    better = [claim for claim in claims if "learns better" in claim.statement]
    assert [claim.measured.value for claim in better] == pytest.approx([0.083, 0.083])
    assert [claim.verdict for claim in better] == ["holds", "holds"]
    with pytest.raises(ValueError, match="pairs = "):
        LocalPolicies(pairs=())


def course(before, after_a, after_b, seeds=24):
    steps = np.concatenate([np.linspace(before, after_a, 9), np.linspace(after_a, after_b, 9)[1:]])
    return steps[:, None] + about(0.0, seeds, 0.001)


def test_what_is_gained_and_lost():
    values = {"0.2 local A": course(0.1, 0.3, 0.25)}
    np.testing.assert_allclose(reward_gained(values, 0.2, "local"), 0.2)
    np.testing.assert_allclose(reward_lost(values, 0.2, "local"), 0.05)


@pytest.mark.parametrize(("local", "far", "holds"), [(0.299, 0.12, True), (0.12, 0.301, False)])
def test_claims_about_forgetting(local, far, holds):
    values = {}
    for name in POLICY_KINDS:
        values[f"0.2 {name} A"] = course(0.1, 0.3, local if name in ("local", "narrow") else far)
        values[f"0.2 {name} B gain"] = about(0.1)
    judgements = held(Forgetting(gaps=(0.2,)), values)
    assert judgements[:2] == [True, True]
    assert judgements[2:] == [holds] * 10


def test_claims_about_forgetting_need_learners():
    values = {f"0.2 {name} A": course(0.1, 0.3, 0.3) for name in POLICY_KINDS}
    values |= {f"0.2 {name} B gain": about(0.0) for name in POLICY_KINDS}
    values["0.2 quadratic A"] = course(0.1, 0.2, 0.2)
    assert held(Forgetting(gaps=(0.2,)), values)[:2] == [False, False]


def test_a_level_is_reached_once_the_moving_mean_is_there():
    decision = np.arange(1, 31) * 100
    reward = np.stack([np.linspace(0, 1, 30), np.zeros(30)])
    # of the ten records until the nineteenth the mean is that of the middle: 13.5/29
    np.testing.assert_allclose(decisions_to(decision, reward, 13.5 / 29 - 1e-9), [1900, 3000])


def rise(end, pace, seeds=24, records=200):
    curve = end * (1 - np.exp(-np.arange(records) / pace))
    return curve + about(0.0, seeds, 0.001)[:, None]


@pytest.mark.parametrize(("end", "pace", "holds"), [(0.29, 40, [True, True, True]), (0.1, 10, [False, True, False])])
def test_claims_about_noise(end, pace, holds):
    study = Noise(observation=(0.1,), dynamics=(0.2,))
    values = {"decision": np.arange(1, 201) * 250}
    for layout in ("R1", "R2"):
        values |= {f"{layout} none": rise(0.3, 20)}
        values |= {f"{layout} observation 0.1": rise(end, pace), f"{layout} dynamics 0.2": rise(0.3, 15)}
        values |= {f"{layout} {name} unused": about(0.2) for name in ("observation 0.1", "dynamics 0.2")}
    assert held(study, values) == [*holds, True, False, True] * 2


@pytest.mark.parametrize(("pace", "end", "holds"), [(10, 0.31, [True, True]), (60, 0.2, [False, False])])
def test_claims_about_the_natural_step(pace, end, holds):
    values = {"decision": np.arange(1, 201) * 250}
    for layout in ("R1", "R2"):
        values |= {f"{layout} plain": rise(0.3, 20), f"{layout} plain late": about(0.3, spread=0.001)}
        values |= {f"{layout} natural": rise(end, pace), f"{layout} natural late": about(end, spread=0.001)}
    assert held(NaturalStep(), values) == holds * 2


def test_claims_about_pruning():
    values = {"bounds": np.array(Pruning().bounds)}
    for layout in ("R1", "R2"):
        values[f"{layout} firing"] = np.tile([0.01, *[3.0] * 7], (24, 1))
        values[f"{layout} centre"] = np.tile([[1.2, 0.5], *[[0.5, 0.5]] * 7], (24, 1, 1))
        values[f"{layout} reach"] = values[f"{layout} firing"]
        values[f"{layout} reward"] = np.repeat(about(0.3)[:, None], 4, axis=1)
        values[f"{layout} changed"] = np.full((24, 3), 0.005)
    assert held(Pruning(), values) == [True] * 6
    for layout in ("R1", "R2"):
        values[f"{layout} reward"] = values[f"{layout} reward"] - [0, 0.1, 0.1, 0.1]
        values[f"{layout} changed"] = np.full((24, 3), 0.5)
        values[f"{layout} firing"] = np.tile([3.0] * 8, (24, 1))
    assert held(Pruning(), values) == [False] * 6


def test_pruning_pays_what_the_task_pays():
    from motorgrad_thesis.chapter_6.section_6_5.pruning import _reward

    task = FallingParticle(layout="R2")
    path = rng.random((30, 2))
    expected = np.mean([float(region_reward(task.places, jnp.asarray(place))) for place in path[1:]])
    assert _reward(task, [path]) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(("share", "sides", "holds"), [(0.99, 1, [True, True]), (0.4, -1, [False, False])])
def test_claims_about_mixtures(share, sides, holds):
    values = {}
    for layout in ("R1", "R2"):
        values[f"{layout} plain late"] = about(0.3)
        for name in ("mixture", "graded", "plane"):
            values[f"{layout} {name} late"] = about(0.3 * share)
            values[f"{layout} {name} untrained"] = about(0.2)
        values[f"{layout} graded strength"] = np.tile([1.0, sides * -1.0], (24, 4))
        values[f"{layout} plane strength"] = np.tile([1.0, 1.0, sides * -1.0, 1.0], (24, 4))
    assert held(Mixtures(), values) == (holds * 3 + [sides > 0, sides > 0, False]) * 2


@pytest.mark.slow
@pytest.mark.parametrize(("layout", "expected", "deviation"), [("R1", 0.283, 0.024), ("R2", 0.329, 0.008)])
def test_local_units_come_as_far_as_those_of_an_independent_model(layout, expected, deviation):
    task = FallingParticle(layout=layout)
    reward = late_reward(mg.train(task, None, 50_000, 24, progress=False))
    error = np.hypot(reward.std(ddof=1) / np.sqrt(24), deviation / np.sqrt(20))
    assert abs(reward.mean() - expected) < 3.5 * error


@pytest.mark.slow
def test_narrow_units_forget_less_than_quadratic_boundaries(work):
    study = dataclasses.replace(Forgetting(), seeds=20, gaps=(0.4,))
    values = {}
    for name in ("narrow", "quadratic"):
        found = study._learned_in_turn(work, POLICY_KINDS[name], 0.4)
        values |= {f"0.4 {name} {key}": value for key, value in found.items()}
    more = reward_lost(values, 0.4, "quadratic") - reward_lost(values, 0.4, "narrow")
    assert more.mean() > 3 * more.std(ddof=1) / np.sqrt(20)
