"""Experiments with pools that grow, loads that are asked for, and graded units: numbers, judgements, and end to end."""

import jax
import numpy as np
import pytest

import motorgrad as mg
from motorgrad.policies import Motoneurons
from motorgrad.tasks import LinearRecruitment
from motorgrad_thesis import EXPERIMENTS, reproduce
from motorgrad_thesis.chapter_4._pools import (
    NATURAL,
    NORMAL,
    firing_probability,
    force_error,
    least_error,
    with_new_unit,
)
from motorgrad_thesis.chapter_4.section_4_4.active_learning import ActiveLearning
from motorgrad_thesis.chapter_4.section_4_4.figure_4_10 import LocalEffect, spread
from motorgrad_thesis.chapter_4.section_4_4.growth import Growth, ideal_move, new_thresholds
from motorgrad_thesis.chapter_4.section_4_4.rate_modulation import DAMPING, RateModulation

NAMES = ["sec-4.4-growth", "fig-4.10", "sec-4.4.1-active-learning", "sec-4.4.1-rate-modulation"]
CLAIMS = {"sec-4.4-growth": 14, "fig-4.10": 5, "sec-4.4.1-active-learning": 4, "sec-4.4.1-rate-modulation": 9}


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return tmp_path_factory.mktemp("growth")


@pytest.fixture(scope="module")
def done(out):
    made = {}

    def of(name):
        if name not in made:
            made[name] = reproduce(EXPERIMENTS[name].quick(), out, progress=False)
        return made[name]

    return of


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.ci if n == "fig-4.10" else ()) for n in NAMES])
def test_each_runs_from_end_to_end(name, done):
    found = done(name)
    assert len(found.claims) == CLAIMS[name]
    assert {"figure.svg", "figure.png", "record.json", "values.npz"} <= {path.name for path in found.folder.iterdir()}
    assert all(np.isfinite(claim.measured.value) or claim.verdict == "undecided" for claim in found.claims)


def test_they_stand_in_the_order_of_the_source():
    assert [name for name in EXPERIMENTS if name in NAMES] == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_they_are_over_enough_seeds(name):
    assert EXPERIMENTS[name]().seeds >= 20


@pytest.mark.parametrize(
    ("name", "setting", "named"),
    [
        ("fig-4.10", {"gains": (1.0, 2.0)}, "gains = "),
        ("fig-4.10", {"gains": (0.0, 3.0, 2.0)}, "gains = "),
        ("fig-4.10", {"threshold": 1.5}, "threshold = 1.5"),
        ("fig-4.10", {"seeds": 1}, "seeds = 1"),
        ("sec-4.4-growth", {"units": 2}, "units = 2"),
        ("sec-4.4-growth", {"plain_phase": 10}, "plain_phase = 10"),
        ("sec-4.4.1-active-learning", {"explore": 1.1}, "explore = 1.1"),
        ("sec-4.4.1-active-learning", {"cells": 1}, "cells = 1"),
        ("sec-4.4.1-active-learning", {"natural_units": 1}, "natural_units = 1"),
        ("sec-4.4.1-rate-modulation", {"units": (2, 1)}, "units = "),
        ("sec-4.4.1-rate-modulation", {"floor": 0.4}, "floor = 0.4: must be less than deviation, 0.3"),
    ],
)
def test_impossible_settings_are_refused_by_name(name, setting, named):
    with pytest.raises(ValueError, match=named):
        EXPERIMENTS[name](**setting)


# --- figure 4.10 ---


def test_a_new_unit_of_gain_nought_pulls_every_activation_to_one_half():
    rng = np.random.default_rng(0)
    pools = jax.vmap(Motoneurons)(rng.random((3, 6)), np.full((3, 6), 30.0))
    more = with_new_unit(pools, 0.5)
    assert more.threshold.shape == (3, 7)
    np.testing.assert_array_equal(more.gain[:, 6], 0)
    np.testing.assert_array_equal(more.threshold[:, :6], np.float32(pools.threshold))
    loads = np.linspace(0, 1, 11)
    before, after = firing_probability(pools, loads).mean(-1), firing_probability(more, loads).mean(-1)
    np.testing.assert_allclose(after - before, (0.5 - before) / 7, atol=1e-6)


def effects(loads, thresholds, gains):
    before = 1 / (1 + np.exp(-300 * (loads[:, None] - thresholds)))
    new = 1 / (1 + np.exp(-np.asarray(gains)[:, None] * (loads - 0.5)))
    n = len(thresholds)
    change = np.abs((before.sum(1) + new) / (n + 1) - before.mean(1))
    return np.repeat(change[:, None], 24, axis=1)


def test_the_spread_is_the_distance_weighted_by_the_effect():
    loads = np.linspace(0, 1, 401)
    peak = np.exp(-0.5 * ((loads - 0.5) / 0.05) ** 2)
    values = {"load": loads, "threshold": np.array(0.5), "effect": np.stack([np.ones(401), peak])[:, None]}
    np.testing.assert_allclose(spread(values)[:, 0], [np.sqrt(1 / 12), 0.05], rtol=5e-3)


def test_the_claims_of_figure_4_10_are_true_of_ideal_pools_and_false_of_effects_that_stay():
    loads, gains = np.linspace(0, 1, 401), np.array([0.0, 5.0, 10.0, 20.0, 40.0, 80.0])
    effect = effects(loads, LinearRecruitment(units=6).ideal_thresholds(), gains)
    values = {"load": loads, "gain": gains, "threshold": np.array(0.5), "effect": effect}
    assert [claim.holds for claim in LocalEffect().claims(values)] == [True] * 5
    stays = values | {"effect": np.broadcast_to(effect[:1], effect.shape)}
    assert [claim.holds for claim in LocalEffect().claims(stays)] == [True, False, False, False, False]
    central = values | {"effect": np.broadcast_to(effect[-1:], effect.shape)}
    assert [claim.holds for claim in LocalEffect().claims(central)] == [False, False, False, True, True]


# --- section 4.4: growth ---


def test_new_units_have_gain_nought_and_thresholds_by_chance_that_are_the_same_each_time():
    pools = jax.vmap(Motoneurons)(np.zeros((20, 1)), np.ones((20, 1)))
    first, again, other = (with_new_unit(pools, new_thresholds(salt, 20)) for salt in (2, 2, 3))
    np.testing.assert_array_equal(first.threshold, again.threshold)
    assert not np.array_equal(first.threshold, other.threshold)
    assert len(np.unique(first.threshold[:, 1])) == 20
    np.testing.assert_array_equal(first.gain, np.stack([np.ones(20), np.zeros(20)], axis=1))


def test_the_least_move_that_makes_room_for_another_unit():
    # 1/2 → 1/4 or 3/4; 1/4, 3/4 → 1/6, 5/6 with the new one in the middle
    assert ideal_move(1) == pytest.approx(1 / 4)
    assert ideal_move(2) == pytest.approx(1 / 12)
    # seven: half a unit and more each, from the ends inwards: (½ + 1½ + 2½ + 3½ + 2½ + 1½ + ½)/7 in 1/(7 · 8)
    assert ideal_move(7) == pytest.approx(12.5 / 7 / 56)


def growth(grown, start, moves):
    """Values of an experiment in which these are the errors, spacings and moves."""
    noise = 0.01 * np.random.default_rng(0).random(24)[:, None]
    values = {}
    for name in ("ratio", "count", "plain"):
        values |= {
            f"{name} grown error": np.full((24, 10), grown) + noise,
            f"{name} start error": np.full((24, 10), start),
            f"{name} grown spacing": np.full((4, 24), grown) + noise[:, 0],
            f"{name} start spacing": np.full(24, start),
            f"{name} move": np.tile(moves[:, None], (1, 24)),
            f"{name} grown spaced": np.full((4, 24), grown < start),
            f"{name} grown from": np.full((4, 24), 1e5 * grown),
            f"{name} start from": np.full(24, 4e5 * start),
            f"{name} start decision": np.array([1e5, 8e5]),
        }
    return values


def test_the_claims_about_growth_can_come_out_either_way():
    better = [claim.holds for claim in Growth().claims(growth(0.1, 0.2, np.linspace(0.3, 0.1, 7)))]
    assert better == [True] * 13 + [False]  # the last is arithmetic: 1.79 for seven
    worse = [claim.holds for claim in Growth().claims(growth(0.3, 0.2, np.linspace(0.1, 0.3, 7)))]
    assert worse == [False] * 14


def test_a_phase_in_which_pools_do_not_converge_counts_as_a_whole():
    values = growth(0.1, 0.2, np.linspace(0.3, 0.1, 7))
    values["ratio grown from"][2, :20] = np.inf
    values["ratio grown spaced"][2, :20] = False
    claims = [claim for claim in Growth().claims(values) if "force as a ratio)" in claim.statement]
    converged, sooner = claims[2], claims[3]
    assert not converged.holds
    assert converged.measured.value == pytest.approx(4 / 24)
    assert "100%, 100%, 17%, 100%" in converged.note
    assert sooner.measured.value == pytest.approx(4 / 24)  # the others would be, after half the decisions
    assert not sooner.holds
    assert "20 of 96 phases, 0 of 24 complete" in sooner.note
    assert "0.5 [0.5 … 0.5] of the decisions, median of 4 (interval at 87.5 %)" in sooner.note
    values["ratio start from"][:] = np.inf
    values["ratio grown from"][2, :20] = 1e4
    assert list(Growth().claims(values))[3].holds  # complete pools are never there


def test_growth_by_the_natural_step_has_settings_that_scale_to_any_reward():
    ways = Growth().ways
    assert [dict(ways[name].changes) for name in ("ratio", "count", "plain")] == [NORMAL, NORMAL, {}]
    assert NORMAL["normalization"] == "root-mean-square"


@pytest.mark.slow
def test_grown_pools_go_on_from_each_other(done, out):
    with np.load(done("sec-4.4-growth").folder / "values.npz") as values:
        phase, units = Growth.quick().phase, Growth.quick().units
        for name in ("ratio", "count"):
            assert values[f"{name} grown decision"][-1] == units * phase == values[f"{name} start decision"][-1]
            assert (np.diff(values[f"{name} grown decision"]) > 0).all()
            assert values[f"{name} grown spacing"].shape == (units, 3)
            assert values[f"{name} move"].shape == (units - 1, 3)


# --- section 4.4.1: active learning ---


def test_the_error_over_all_loads_is_that_of_drawn_forces():
    task, rng = LinearRecruitment(units=3, size_ratio=2.0), np.random.default_rng(0)
    threshold, gain = np.array([0.2, 0.5, 0.7]), np.array([4.0, -3.0, 30.0])
    loads = rng.random(400_000)
    fires = rng.random((400_000, 3)) < 1 / (1 + np.exp(-gain * (loads[:, None] - threshold)))
    drawn = np.sqrt(np.mean(((fires * task.sizes).sum(1) - task.target(loads)) ** 2))
    found = force_error(np.stack([threshold] * 2)[None], np.stack([gain] * 2)[None], task)
    assert found.shape == (1, 2)
    np.testing.assert_allclose(found, drawn, rtol=5e-3)


def active(queried, error):
    values, chance = {}, np.random.default_rng(1).random(24)
    for name in ("plain", "natural"):
        values |= {
            f"{name} decision": np.array([1000, 2000]),
            f"{name} uniform from": 1000 + 100 * chance,
            f"{name} queried from": queried * (1000 + 100 * chance),
            f"{name} uniform error": np.full((24, 2), 0.1),
            f"{name} queried error": np.full((24, 2), error),
        }
    return values


def test_the_claims_about_active_learning_can_come_out_either_way():
    judged = ActiveLearning().claims
    assert [claim.holds for claim in judged(active(0.5, 0.1))] == [True] * 4
    assert [claim.holds for claim in judged(active(1.2, 0.2))] == [False] * 4
    never = active(0.5, 0.1) | {"plain queried from": np.full(24, np.inf)}
    assert [claim.holds for claim in judged(never)] == [False, True, True, True]
    assert "24 with queried ones" in next(judged(never)).note


@pytest.mark.slow
def test_both_kinds_of_loads_begin_with_the_same_pools(done):
    with np.load(done("sec-4.4.1-active-learning").folder / "values.npz") as values:
        for name in ("plain", "natural"):
            pairs = [values[f"{name} {loads} error"][:, 0] for loads in ("uniform", "queried")]
            np.testing.assert_allclose(*pairs, rtol=0.02)  # a record after the same start


# --- section 4.4.1: rate modulation ---


def test_the_least_error_of_units_that_fire_or_not():
    # one unit: |1.2 x − 0.1| below a half and its mirror image above, in closed form
    low = (0.1**2 / 2 + 0.5**2 / 2) / 1.2
    assert least_error(LinearRecruitment(units=1)) == pytest.approx(2 * low, rel=1e-3)


def rate(graded, sooner, deviation):
    chance, decision = 1 + 0.01 * np.random.default_rng(2).random(24), np.arange(1, 101) * 10
    values = {"units": np.array([1, 2, 4]), "least": np.array([0.2, 0.1, 0.05]), "decision": decision}
    for units, least in zip((1, 2, 4), values["least"], strict=True):
        for kind, when in (("binary", 500), ("graded", sooner)):
            values[f"{units} {kind} error"] = np.where(decision >= when, least, 3 * least) * np.ones((24, 1))
            values[f"{units} {kind} without noise"] = np.full(24, least)
        values[f"{units} graded end"] = graded * least * chance
        values[f"{units} deviation"] = deviation * chance[:, None, None] * np.ones((100, units))
    return values


def test_the_claims_about_graded_units_can_come_out_either_way():
    judged = RateModulation().claims
    assert all(claim.holds for claim in judged(rate(0.5, 200, 0.05)))
    assert not any(claim.holds for claim in judged(rate(1.1, 700, 0.3)))


@pytest.mark.slow
def test_graded_pools_keep_above_their_floor(done):
    quick = RateModulation.quick()
    with np.load(done("sec-4.4.1-rate-modulation").folder / "values.npz") as values:
        for units in quick.units:
            assert values[f"{units} deviation"].shape == (quick.seeds, len(values["decision"]), units)
            assert (values[f"{units} deviation"] > quick.floor).all()


@pytest.mark.slow
def test_the_logarithm_of_the_deviation_runs_away_without_damping():
    task = LinearRecruitment(units=1)
    least = {}
    for name, damping in (("damped", DAMPING), ("not", NATURAL["metric"]["damping"])):
        changes = NATURAL | {
            "policy": "graded-motoneurons",
            "learning_rate": 1e-2,
            "metric": {**NATURAL["metric"], "damping": damping},
        }
        run = mg.train(task, changes, steps=300_000, seeds=4, progress=False)
        least[name] = run.policies_at().log_deviation.swapaxes(0, 1)
        np.testing.assert_allclose(run.policies.threshold, 0.5, atol=0.01)  # the rest has learned all the same
    assert least["damped"].min() > -10
    assert (least["not"][:, -1] < -20).all()


@pytest.mark.slow
def test_only_graded_units_are_given_the_damping_of_the_deviation(done, out):
    done("sec-4.4.1-rate-modulation")
    found = [mg.load(path).config["agent"] for path in (out / "trained").glob("[!.]*")]
    graded = [agent["metric"]["damping"] for agent in found if agent["policy"]["kind"] == "graded-motoneurons"]
    assert graded == [DAMPING] * 3
