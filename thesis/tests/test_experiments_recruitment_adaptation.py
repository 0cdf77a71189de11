"""The experiments on what recruitment learns amiss, and how it adapts: each from end to end at its smoke size, its
measures against other ways to the same number, and its judgements both ways."""

import math

import numpy as np
import pytest
from scipy import stats

import motorgrad as mg
from motorgrad.bodies import POSTURES
from motorgrad.policies import Motoneurons
from motorgrad.tasks import ArmRecruitment, LinearRecruitment
from motorgrad.worlds import immediate_reward
from motorgrad_thesis import EXPERIMENTS, reproduce
from motorgrad_thesis.chapter_4._pools import (
    NATURAL,
    entropy,
    firing_probability,
    least_error,
    parameter_history,
    thresholds_and_gains,
)
from motorgrad_thesis.chapter_4.section_4_4.forgetting_baseline import OF
from motorgrad_thesis.chapter_4.section_4_4.large_loads import PROBABILITY, REWARD_TYPES, common_pay
from motorgrad_thesis.chapter_4.section_4_4.negative_inputs import (
    LOADS,
    LOWS,
    always_firing,
    best_activation,
)
from motorgrad_thesis.chapter_4.section_4_4.size_principle import (
    MAPPING_LABELS,
    order,
    order_pay,
    orders_of,
    recruitment_loads,
)

CLAIMED = {
    "sec-4.4-negative-inputs": 2 * 8,
    "sec-4.4-large-loads": 2 * 9,
    "sec-4.4.1-baseline": 6,
    "sec-4.4.1-gain-decay": 9,
    "sec-4.4.1-size-principle": 10,
}
SEEDS = 40


def twice(values):
    """The same values for both postures of the arm."""
    return {f"{posture} {name}": value for posture in POSTURES for name, value in values.items()}


LONG = (
    "sec-4.4.1-size-principle",
    "sec-4.4-negative-inputs",
    "sec-4.4-large-loads",
    "sec-4.4.1-gain-decay",
    "sec-4.4.1-baseline",
)  # to compile


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name in LONG else ()) for name in CLAIMED]
)
def test_each_leaves_a_figure_and_its_claims(name, done, check_complete):
    found = done(name)
    check_complete(name, found)
    assert len(found.claims) == CLAIMED[name]


def test_they_stand_in_the_order_of_the_source():
    assert [name for name in EXPERIMENTS if name in CLAIMED] == list(CLAIMED)


@pytest.mark.parametrize("name", CLAIMED)
def test_results_are_over_twenty_seeds_or_more(name):
    assert EXPERIMENTS[name]().seeds >= 20


@pytest.mark.parametrize(
    ("name", "setting", "named"),
    [
        ("sec-4.4-negative-inputs", {"seeds": 1}, "seeds = 1"),
        ("sec-4.4-negative-inputs", {"steps": 10}, "steps = 10"),
        ("sec-4.4-negative-inputs", {"units": 0}, "units = 0"),
        ("sec-4.4-negative-inputs", {"decays": (0.1, 2.0)}, r"decays\[1\] = 2.0"),
        ("sec-4.4-large-loads", {"sizes": (8, 4)}, "sizes = "),
        ("sec-4.4-large-loads", {"least": 14.5}, "least = 14.5"),
        ("sec-4.4.1-baseline", {"steps": 1000}, "steps = 1000"),
        ("sec-4.4.1-baseline", {"rates": (2.0,)}, r"rates\[0\] = 2.0"),
        ("sec-4.4.1-baseline", {"rates": ()}, "rates = "),
        ("sec-4.4.1-baseline", {"amount": -1.5}, "amount = -1.5"),
        ("sec-4.4.1-baseline", {"added": 0.0}, "added = 0.0"),
        ("sec-4.4.1-gain-decay", {"decays": (1e-7, 1e-6)}, "decays = "),
        ("sec-4.4.1-gain-decay", {"decays": (0.1, 0.2, 2.0)}, r"decays\[2\] = 2.0"),
        ("sec-4.4.1-gain-decay", {"learned": 0}, "learned = 0"),
        ("sec-4.4.1-gain-decay", {"amount": 0.0}, "amount = 0"),
        ("sec-4.4.1-size-principle", {"size_ratio": 1.0}, "size_ratio = 1.0"),
        ("sec-4.4.1-size-principle", {"units": 2}, "units = 2"),
    ],
)
def test_impossible_settings_are_refused_by_name(name, setting, named):
    with pytest.raises(ValueError, match=named):
        EXPERIMENTS[name](**setting)


# what is asked of what was learned


@pytest.fixture(scope="module")
def run():
    return mg.train("linear-recruitment", steps=400, seeds=2, window=100, progress=False)


@pytest.mark.ci
def test_firing_is_the_sigmoid_of_each_unit(run):
    threshold, gain = thresholds_and_gains(run.policies)
    loads = np.array([0.0, 0.3, 1.0])
    expected = 1 / (1 + np.exp(-gain[:, None] * (loads[:, None] - threshold[:, None])))
    np.testing.assert_allclose(firing_probability(run.policies, loads), expected, atol=1e-6)


def test_entropy_is_that_of_coins():
    loads = np.array([0.0, 1.0])
    p = 1 / (1 + np.exp(-3.0 * (loads - 0.2)))
    bits = -(p * np.log2(p) + (1 - p) * np.log2(1 - p)).mean()
    found = entropy(np.array([[0.2, 0.2], [0.5, 0.5]]), np.array([[3.0, 3.0], [0.0, 1e4]]), loads)
    np.testing.assert_allclose(found, [bits, 0.5], atol=1e-5)


@pytest.mark.ci
def test_parameters_are_those_of_the_records(run):
    threshold, gain = parameter_history(run)
    assert threshold.shape == gain.shape == (2, 4, 4)
    np.testing.assert_array_equal([threshold[:, -1], gain[:, -1]], thresholds_and_gains(run.policies))
    np.testing.assert_allclose(run.final("error", 0.5), run.curve("error")[1][:, 2:].mean(axis=1))


# too few negative inputs


def test_a_stuck_unit_fires_at_all_loads_of_0_and_below():
    threshold, gain = np.array([[-5.0, 15.0, -0.5, 5.0]]), np.array([[2.0, -2.0, 9.0, 2.0]])
    p = 1 / (1 + np.exp(-gain[:, None] * (LOADS[:, None] - threshold[:, None])))
    np.testing.assert_array_equal(always_firing({"load": LOADS, "firing": p[None]}), [[[True, True, False, False]]])


def test_the_best_activation_pays_best():
    task = ArmRecruitment(units=4)
    best = best_activation(task, np.array([-1.0, 1.0, 14.0]))
    np.testing.assert_array_equal(best, [0.0, 0.25, 1.0])


STATES = [*LOWS, "decay-0", "decay-0.001"]


def inputs(caught, threshold=15.0, start=5.0, gain=-2.0):
    """Values of pools of two units, of which the second is stuck in so many pools of each state."""
    silent = np.where(LOADS > 1, 0.9, 0.01)
    fires = np.tile(silent[:, None], (len(STATES), SEEDS, 1, 2))
    for state, count in enumerate(caught):
        fires[state, :count, :, 1] = 0.99
    shape = (len(STATES), SEEDS, 2)
    stuck_ones = {"threshold": np.full(shape, threshold), "gain": np.full(shape, gain)}
    values = {"load": LOADS, "best": np.zeros(len(LOADS)), "firing": fires, "reward": np.ones(shape[:2]), **stuck_ones}
    noise = 0.001 * np.arange(SEEDS)[:, None, None] / SEEDS
    values["firing"][0] += noise
    return values | {
        "start": np.full(shape[1:], start),
        "decay": np.array([0.001]),
        "state": np.array(STATES),
    }


def test_claims_about_negative_inputs_see_a_trap_and_its_absence():
    kind = EXPERIMENTS["sec-4.4-negative-inputs"]()
    trap = twice(inputs([38, 36, 4, 2, 38, 2]))
    assert [claim.holds for claim in kind.claims(trap)] == [True] * 16
    kind.figure(trap)
    # those whose sample was enlarged after a first run say so
    assert ["In a first run" in claim.note for claim in kind.claims(trap)] == 2 * ([False, True] * 2 + [False] * 4)
    # as many pools are caught wherever sweeps begin; they are so by low thresholds; they come free without a decay
    harmless = inputs([12, 12, 12, 12, 1, 12], threshold=-6.0, gain=2.0)
    harmless["firing"][0] = harmless["firing"][2]
    holds = [claim.holds for claim in kind.claims(twice(harmless))]
    assert holds == [False] * 16
    nobody = twice(inputs([0] * 6))
    assert [claim.holds for claim in kind.claims(nobody)][1:8] == [False] * 7


# only large loads


@pytest.mark.ci
@pytest.mark.representatives("complete")
@pytest.mark.parametrize("reward_type", REWARD_TYPES)
def test_the_reward_of_a_common_probability_is_that_of_the_oracle(reward_type):
    task, loads = ArmRecruitment(units=3, reward_type=reward_type), np.array([3.0, 12.5])
    pay = common_pay(task, loads)
    for row in (20, 50, 90):
        p = PROBABILITY[row]
        pool = Motoneurons(np.full(3, -1e3 * math.log(p / (1 - p))), np.full(3, 1e-3))  # the same at every load
        exact = immediate_reward(
            pool, loads[:, None] * 1e-6, np.array([0.5, 0.5]), lambda y, a: task.immediate(y * 1e6, a)
        )
        assert pay[row] == pytest.approx(exact, rel=1e-4)


@pytest.mark.ci
def test_pools_that_are_paid_complete_lifts_can_be_loaded_and_evaluated(tmp_path):
    task = EXPERIMENTS["sec-4.4-large-loads"].quick().task("complete", "large", 2, "vertical")
    assert task == ArmRecruitment(units=2, reward_type="complete", low=12.0)
    mg.train(task, steps=200, seeds=2, out=tmp_path / "run", progress=False)
    again = mg.load(tmp_path / "run")
    assert again.task == task
    assert np.isfinite(mg.evaluate(again, 50).reward).all()


def loads_values(silent, slope):
    """Values of pools of 4 and 32 units, silent in so many of `SEEDS` for each payment and kind of loads."""
    active = {name: np.where(np.arange(SEEDS) < np.array(count)[:, None], 0.0, 0.9) for name, count in silent.items()}
    pay = {f"{reward_type} pay": np.stack([slope * PROBABILITY] * 2) for reward_type in REWARD_TYPES}
    return {"size": np.array([4, 32]), "probability": PROBABILITY, **active, **pay}


def test_claims_about_large_loads_see_a_collapse_and_its_absence():
    kind = EXPERIMENTS["sec-4.4-large-loads"]()
    collapse = {"height large": [0, 38], "complete large": [0, 38], "height all": [0, 0], "complete all": [0, 2]}
    values = twice(loads_values(collapse, -1.0))
    assert [claim.holds for claim in kind.claims(values)] == [True] * 18
    kind.figure(values)
    none = twice(loads_values({**collapse, "height large": [0, 0], "complete large": [0, 0]}, 1.0))
    assert [claim.holds for claim in kind.claims(none)] == 2 * ([False] * 8 + [True])
    whatever = twice(loads_values({**collapse, "complete large": [38, 38], "complete all": [0, 38]}, -1.0))
    assert [claim.holds for claim in kind.claims(whatever)][6:9] == [False] * 3
    # each posture is judged by its own pools
    mixed = values | {name: value for name, value in none.items() if name.startswith("horizontal")}
    assert [claim.holds for claim in kind.claims(mixed)] == [True] * 9 + [False] * 8 + [True]


# baselines and decays


def curves(*levels, seeds=20, records=40):
    """One line for each level, with a little noise that differs from seed to seed."""
    noise = 1e-3 * np.random.default_rng(0).normal(size=(len(levels), seeds, records))
    return np.broadcast_to(np.array(levels, float)[:, None, None], noise.shape) + noise


def baselines(behind, error):
    lines = ["mean of all", "γ = 0.01", "mean of all, natural gradient"]
    decision = np.arange(1, 41) * 100_000
    values = {"decision": decision, "line": np.array(lines), "changes": np.array([1_000_000, 2_000_000, 3_000_000])}
    for of in OF:
        values |= {f"behind {of}": np.abs(curves(*behind)), f"error {of}": curves(*error)}
        values |= {f"least {of}": np.array([0.1, 0.2])}
    return values


def test_claims_about_a_forgetting_baseline_go_both_ways():
    kind = EXPERIMENTS["sec-4.4.1-baseline"](rates=(0.01,))
    better = baselines((0.2, 0.1, 0.2), (0.3, 0.2, 0.1))
    assert [claim.holds for claim in kind.claims(better)] == [True] * 6
    kind.figure(better)
    same = baselines((0.1, 0.1, 0.2), (0.2, 0.2, 0.3))
    assert [claim.holds for claim in kind.claims(same)] == [False] * 6
    # what changes is judged by its own pools
    mixed = better | {f"{name} load": same[f"{name} load"] for name in ("behind", "error")}
    assert [claim.holds for claim in kind.claims(mixed)] == [True] * 3 + [False] * 3


def test_pools_with_another_load_learn_in_another_task():
    strength, load = map(EXPERIMENTS["sec-4.4.1-baseline"]().task, OF)
    assert (strength.drift.of, strength.drift.amount) == ("strength", -0.5)
    assert (load.drift.of, load.drift.amount) == ("load", 0.25)
    found = EXPERIMENTS["sec-4.4.1-baseline"]()._least("load")
    loads, parts = 0.25 + (np.arange(20_000) + 0.5) / 20_000, np.array([0, 0.5, 1.0])  # these hang in the hand
    assert found == pytest.approx(np.abs(parts - load.target(loads)[:, None]).min(1).mean(), rel=1e-5)


def test_what_came_before_the_first_change_does_not_count():
    kind = EXPERIMENTS["sec-4.4.1-baseline"](rates=(0.01,))
    values = baselines((0.2, 0.1, 0.2), (0.3, 0.2, 0.1))
    for name in ("behind strength", "error strength", "behind load", "error load"):
        values[name][1:, :, :10] += 100.0
    assert [claim.holds for claim in kind.claims(values)] == [True] * 6


def decays(first, still, drifting, plain, decaying):
    """Errors of all lines; how far entropy falls in the first practice, and how much higher a decay keeps it then."""
    decision = np.arange(1, 41) * 100_000
    spread = 1e-4 * curves(0.0, 0.0, 0.0, 0.0) + 1.0 - plain
    spread[1:] += decaying
    fading = 1e-4 * curves(0.0, 0.0) + np.linspace(1.0, 1.0 - plain, 40)
    return {
        "decay": np.array([0.0, 1e-7, 1e-6, 1e-5]), "decision": decision, "first decision": decision,
        "changes": np.array([1_000_000, 2_000_000, 3_000_000]), "first error": curves(*first), "first entropy": fading,
        "still error": curves(*still), "drifting error": curves(*drifting),
        "still entropy": spread, "drifting entropy": spread, "least": np.array([0.1, 0.2]),
    }  # fmt: skip


def test_claims_about_gain_decay_go_both_ways():
    kind = EXPERIMENTS["sec-4.4.1-gain-decay"]()
    useful = decays((0.1, 0.3), (0.1, 0.15, 0.15, 0.15), (0.3, 0.2, 0.2, 0.2), 0.8, 0.4)
    assert [claim.holds for claim in kind.claims(useful)] == [True] * 9
    kind.figure(useful)
    useless = decays((0.3, 0.1), (0.15, 0.1, 0.1, 0.1), (0.2, 0.3, 0.3, 0.3), 0.0, -0.1)
    assert [claim.holds for claim in kind.claims(useless)] == [False] * 9


def test_the_least_error_is_that_of_ideal_thresholds():
    task, loads = LinearRecruitment(units=4), np.linspace(0.0, 1.0, 2001)
    force = (loads[:, None] > task.ideal_thresholds()).mean(axis=1)
    assert least_error(task, 1.0) == pytest.approx(np.abs(force - task.target(loads)).mean(), rel=1e-3)
    silent = np.abs(task.target(loads)).mean()
    assert least_error(task, 1e-9) == pytest.approx(silent, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "further"),
    [pytest.param("sec-4.4-negative-inputs", 2, marks=pytest.mark.slow), ("sec-4.4.1-gain-decay", 8)],
)
@pytest.mark.slow
def test_pools_learn_on_from_what_they_had_learned(name, further, tmp_path):
    reproduce(EXPERIMENTS[name].quick(), tmp_path, progress=False)
    runs = [mg.load(path) for path in (tmp_path / "trained").glob("[!.]*")]
    going_on = [run for run in runs if "initial" in run.config["run"]]
    assert len(going_on) == further
    starts = [thresholds_and_gains(run.policies) for run in runs if run not in going_on]
    assert all(
        sum(np.array_equal(thresholds_and_gains(run.initial), start) for start in starts) == 1 for run in going_on
    )


# sizes


def test_a_sharp_unit_is_recruited_at_its_threshold():
    loads = np.linspace(0.0, 14.0, 201)
    threshold, gain = np.array([3.0, 9.5, -40.0, 40.0]), np.full(4, 50.0)
    with np.errstate(over="ignore"):
        p = 1 / (1 + np.exp(-gain * (loads[:, None] - threshold)))
    np.testing.assert_allclose(recruitment_loads(p[None], loads)[0], [3.0, 9.5, 0.0, 14.0], atol=0.04)


def test_order_is_one_where_small_units_come_first():
    values = {"size": np.array([0.1, 0.2, 0.3, 0.4]), "x load": np.array([[1, 2, 3, 4], [4, 3, 2, 1], [1, 3, 2, 4]])}
    np.testing.assert_allclose(order(values, "x"), [1.0, -1.0, 0.8])


@pytest.mark.slow
def test_orders_pay_alike_in_the_arm_where_units_are_equal():
    assert len(orders_of(3)) == 6
    assert orders_of(3)[0] == (0, 1, 2)
    np.testing.assert_allclose(order_pay(ArmRecruitment(units=3)), order_pay(ArmRecruitment(units=3))[0])
    pays = order_pay(ArmRecruitment(units=3, size_ratio=8.0))
    task = ArmRecruitment(units=3, size_ratio=8.0)
    load, (a, b, c) = np.linspace(task.low, task.high, 201), task.sizes
    least_last = np.max([task.pay(load, part, task.effect(load, part)) for part in (0.0, c, c + b, 1.0)], axis=0)
    assert pays[orders_of(3).index((2, 1, 0))] == pytest.approx(least_last.mean(), rel=1e-5)
    assert a < b < c


def sizes(loads, pay):
    rng = np.random.default_rng(0)
    values = {"size": np.array([1, 2, 4, 8]) / 15, "orders": np.array(orders_of(4))}
    values |= {f"{posture} order pay": np.array(pay) for posture in POSTURES}
    for name, high in ((name, 1 if name.startswith("linear") else 14) for name in MAPPING_LABELS):
        made = high * (np.array(loads) + 1e-4 * rng.normal(size=(SEEDS, 4)))
        values |= {f"{name} load": made, f"{name} gain": np.ones((SEEDS, 4)), f"{name} high": np.array(high)}
    return values


def test_claims_about_sizes_go_both_ways():
    kind = EXPERIMENTS["sec-4.4.1-size-principle"]()
    falling, rising = np.linspace(1, 0.9, 24), np.linspace(0.9, 1, 24)
    ordered = sizes([0.1, 0.2, 0.3, 0.45], falling)
    assert [claim.holds for claim in kind.claims(ordered)] == [True] * 10
    kind.figure(ordered)
    backwards = sizes([0.55, 0.4, 0.3, 0.05], rising)
    assert [claim.holds for claim in kind.claims(backwards)] == [False] * 10


def test_the_arm_s_damping_is_the_linear_one_in_its_units():
    study = EXPERIMENTS["sec-4.4.1-size-principle"]().studies()
    arm, linear = study["vertical arm natural"][1], study["linear natural"][1]
    assert linear == NATURAL
    assert arm["metric"]["damping"]["threshold"] * 14**2 == pytest.approx(linear["metric"]["damping"]["threshold"])
    assert stats.rankdata(study["horizontal arm natural"][0].sizes).tolist() == [1, 2, 3, 4]
