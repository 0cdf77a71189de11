"""The experiments on muscles and the hopper: each from end to end at its smoke size, and how claims are judged."""

import dataclasses
import tomllib

import numpy as np
import pytest

from motorgrad.bodies import Hopper, compile_model
from motorgrad.training import Evaluation
from motorgrad_thesis import EXPERIMENTS, Workspace
from motorgrad_thesis.appendix_a.figure_a_1 import deviations, first_touch, measure
from motorgrad_thesis.chapter_5._hopper_study import posture
from motorgrad_thesis.chapter_5._pushed_hops import landings, leaning_falls
from motorgrad_thesis.chapter_5.figure_5_4 import firing_shares, hop_events, median_hop
from motorgrad_thesis.chapter_5.section_5_1_3_motors import held_torques
from motorgrad_thesis.chapter_5.section_5_2_2 import ActionPeriod, behind_best

LEARNT = ["fig-5.3", "fig-5.4", "fig-5.5"]
COMPARED = ["sec-5.1.3-motors", "sec-5.2-penalty"]
CLAIMED = {
    "fig-5.1": 6,
    "sec-5.1.3-motors": 5,
    "fig-5.2": 0,
    "sec-5.2-penalty": 4,
    "fig-5.3": 4,
    "fig-5.4": 5,
    "fig-5.5": 7,
    "sec-5.2.2": 3,
    "sec-5.2.2-lean": 9,
    "fig-a.1": 6,
}
NAMES = list(CLAIMED)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.ci if n in ("fig-5.1", "fig-a.1") else ()) for n in NAMES]
)
def test_each_leaves_a_figure_and_its_claims(name, done, check_complete):
    found = done(name)
    check_complete(name, found)
    assert len(found.claims) == CLAIMED[name]


@pytest.mark.ci
@pytest.mark.parametrize("name", ["fig-5.1", "fig-a.1"])
def test_what_is_not_random_holds_at_any_size(name, done):
    assert [claim.statement for claim in done(name).claims if not claim.holds] == []


@pytest.mark.ci
def test_the_learned_ones_share_one_run(out, done):
    for name in LEARNT:
        done(name)
    configs = [tomllib.loads((folder / "config.toml").read_text())["run"] for folder in (out / "trained").glob("[!.]*")]
    study = EXPERIMENTS["fig-5.5"].quick()
    steps = round(study.seconds / study.task.period)
    assert [config["steps"] for config in configs].count(steps) == 1


def test_they_stand_in_the_order_of_the_source():
    assert [name for name in EXPERIMENTS if name in NAMES] == NAMES


def test_the_default_learner_is_the_thesis_s():
    for name in LEARNT:
        study = EXPERIMENTS[name]()
        agent = study.learner
        assert (agent.estimator.trace.decay, agent.optimizer.learning_rate) == (0.98, 5e-4)
        assert (study.task.period, study.task.reward_type) == (0.01, "apex")
        assert study.seeds == 16


@pytest.mark.parametrize("name", COMPARED)
def test_variants_differ_from_the_thesis_s_task_in_what_is_compared(name):
    study = EXPERIMENTS[name]()
    assert study.seeds >= 20
    tasks = list(study.variants.values())
    assert study.task in tasks
    assert len(set(tasks)) == len(tasks)
    changed = {"sec-5.1.3-motors": "body", "sec-5.2-penalty": "penalty"}[name]
    assert all(dataclasses.replace(task, **{changed: getattr(study.task, changed)}) == study.task for task in tasks)


def test_a_held_flexor_pulls_hardest_at_its_resting_length():
    found = held_torques(Hopper())
    length, force = found["length"][0], found["force"][0]
    assert length[np.argmax(force)] == pytest.approx(Hopper().flexor_rest_length, abs=2e-3)
    assert force.max() == pytest.approx(Hopper().flexor_strength, rel=1e-3)
    assert np.ptp(held_torques(Hopper(drive="motors"))["torque"], axis=1) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("name", "setting", "named"),
    [
        ("sec-5.1.3-motors", {"seeds": 1}, "seeds = 1"),
        ("sec-5.2-penalty", {"penalties": (0.0, 0.2, 1.0)}, "penalties = "),
        ("sec-5.2-penalty", {"penalties": (0.0, 1.0, 0.1)}, "penalties = "),
        ("fig-5.3", {"seconds": 0.0}, "seconds = 0"),
        ("fig-5.3", {"seeds": 0}, "seeds = 0"),
        ("fig-5.4", {"watched": 0.001}, "watched = 0.001"),
        ("fig-5.5", {"decay": 1.5}, "decay = 1.5"),
        ("fig-5.5", {"reward_type": "never"}, "unknown reward_type 'never'"),
        ("fig-5.1", {"angles": (5.0,)}, r"angles\[0\] = 5.0"),
        ("fig-5.2", {"angle": 30.0}, "angle = 30.0"),
        ("fig-a.1", {"radius": 0.2}, "origin_distance = 0.13"),
        ("sec-5.2.2", {"periods": (0.02, 0.01, 0.04)}, "periods = "),
        ("sec-5.2.2", {"periods": (0.01, 0.02, 0.0405)}, "action_period = 0.0405"),
        ("sec-5.2.2", {"seeds": 1}, "seeds = 1"),
        ("sec-5.2.2-lean", {"stiffnesses": (10.0, 100.0)}, "stiffnesses = "),
        ("sec-5.2.2", {"constant": "week"}, "unknown constant 'week'"),
    ],
)
def test_impossible_settings_are_refused_by_name(name, setting, named):
    with pytest.raises(ValueError, match=named):
        EXPERIMENTS[name](**setting)


def test_claims_about_learning_are_refuted_by_hoppers_that_learned_nothing():
    kind = EXPERIMENTS["fig-5.3"]()
    nothing = {"before": np.full(16, 0.1), "after": np.full(16, 0.1) + 1e-3 * np.arange(-8, 8)}
    nothing |= {"passed": np.full(16, 1500.0), "final": np.full(16, 0.1)}
    assert [claim.holds for claim in kind.claims(nothing)] == [False] * 4
    learned = {"before": np.full(16, 0.1), "after": np.linspace(0.7, 0.9, 16)}
    learned |= {"passed": np.linspace(200, 400, 16), "final": np.linspace(0.7, 0.9, 16)}
    assert [claim.holds for claim in kind.claims(learned)] == [True] * 4


def test_signs_count_when_most_seeds_have_them():
    kind = EXPERIMENTS["fig-5.5"]()
    weights = np.tile([[-1.0, 1.0, -0.5, -1.0], [4.0, -1.0, 1.0, 0.1]], (16, 1, 1))
    assert all(claim.holds for claim in kind.claims({"weights": weights}))
    half = weights * np.where(np.arange(16) < 8, 1, -1)[:, None, None]
    assert not any(claim.holds for claim in kind.claims({"weights": half}))
    kind.figure({"weights": half})


def test_inverted_signs_are_refuted():
    kind = EXPERIMENTS["fig-5.5"]()
    weights = np.tile([[-1.0, 1.0, -0.5, -1.0], [4.0, -1.0, 1.0, 0.1]], (16, 1, 1))
    assert [claim.verdict for claim in kind.claims({"weights": -weights})] == ["refuted"] * 7
    for sensor in range(3):
        for unit in range(2):
            one = weights.copy()
            one[:, unit, sensor] *= -1
            verdicts = [claim.verdict for claim in kind.claims({"weights": one})]
            assert sorted(verdicts) == ["holds"] * 5 + ["refuted"] * 2  # this sign, and all six at once


def test_firing_is_tied_to_the_contact_that_was_seen():
    contact = np.tile([1.0, 0.0, 0.0, 1.0, 0.0], (2, 40))[:, :200]
    # the action of a decision is that chosen on the contact before it
    extensor = np.concatenate([np.zeros((2, 1)), contact[:, :-1]], axis=1)
    sensors = {"foot_contact": contact, "load_height": np.cumsum(np.ones((2, 200)), axis=1)}
    control = np.stack([1 - extensor, extensor], axis=2)
    outcome = Evaluation(None, np.zeros(2), {}, np.arange(200), sensors=sensors, control=control)
    shares = firing_shares(outcome)
    np.testing.assert_array_equal(shares["ground"], [[0, 1], [0, 1]])
    np.testing.assert_array_equal(shares["air"], [[1, 0], [1, 0]])
    np.testing.assert_array_equal(shares["agrees"], 1)
    kind = EXPERIMENTS["fig-5.4"]()
    assert all(claim.holds for claim in kind.claims(shares))
    swapped = shares | {"ground": shares["air"], "air": shares["ground"], "agrees": np.zeros(2)}
    assert not any(claim.holds for claim in kind.claims(swapped))


def test_one_hop_is_the_one_of_middle_height():
    contact, height = np.ones(100, bool), np.zeros(100)
    for start, top in ((10, 0.2), (30, 0.9), (50, 0.5), (70, 0.3), (95, 2.0)):
        contact[start : start + 10] = False
        height[start : start + 10] = top * np.sin(np.pi * np.linspace(0.05, 0.95, 10))[: 100 - start]
    contact[85:88], height[85:88] = False, 0.01  # no hop
    hop = median_hop(contact, height, 0.03)
    assert hop == (40, 50, 60)
    values = {"angle": np.linspace(40, 150, 100), "rate": np.zeros(100), "height": height}
    told = hop_events(values, hop)
    assert list(told) == sorted(told)
    assert told[40] == "landing"
    assert told[49] == "take-off"
    assert all(hop[0] <= moment < hop[2] for moment in told)


def test_a_record_without_hops_can_be_drawn():
    assert median_hop(np.ones(20, bool), np.zeros(20), 0.03) == (0, 10, 20)


def test_the_best_period_is_chosen_by_the_other_seeds():
    values = np.array([[0.0, 0.0, 0.0], [5.0, 1.0, 1.0], [2.0, 2.0, 2.0], [1.0, 1.0, 1.0]])
    # without the first seed the third row is best; with it the second is
    np.testing.assert_array_equal(behind_best(values, 0), [2, 1, 1])
    np.testing.assert_array_equal(behind_best(values, -1), [1, 0, 0])


def test_the_period_s_claims_see_a_trade_off_and_its_absence():
    kind = ActionPeriod(periods=(0.01, 0.02, 0.04), seeds=8)
    noise = 0.01 * np.random.default_rng(0).normal(size=(3, 8, 4))
    bent = np.array([0.2, 0.9, 0.3])[:, None, None] + noise
    values = {"period": np.array(kind.periods), "practice": np.arange(4), "height": bent}
    late = values | {"passed": np.array([900.0, 100.0, 300.0])[:, None] + 100 * noise[:, :, 0]}
    assert [claim.holds for claim in kind.claims(late)] == [True] * 3
    rising = np.array([0.2, 0.3, 0.9])[:, None, None] + noise
    assert [claim.holds for claim in kind.claims(late | {"height": rising})] == [True, True, False]


def test_the_period_changes_the_numbers_per_decision_only_when_asked():
    plain, kept = ActionPeriod(), ActionPeriod(constant="second")
    assert [plain.task(period).penalty for period in (0.005, 0.04)] == [0.1, 0.1]
    np.testing.assert_allclose([kept.task(period).penalty for period in (0.005, 0.01, 0.04)], [0.05, 0.1, 0.4])


def test_geometry_is_seen_where_the_formulas_put_it():
    shape = (0.12, 0.09, 0.04)
    assert max(deviations(shape).values()) < 1e-8
    seen = measure(1.5, shape)
    np.testing.assert_allclose(seen[3:].sum(), 2 * np.pi - 1.5)
    np.testing.assert_allclose(first_touch(shape), 2 * np.pi - np.arccos(4 / 12) - np.arccos(4 / 9), atol=1e-9)


def test_the_posture_stands_on_the_floor():
    import mujoco

    body = Hopper()
    model = compile_model(body)
    data = mujoco.MjData(model)
    for angle in np.radians([45.0, 90.0, 140.0]):
        data.qpos[:] = posture(body, angle)
        mujoco.mj_forward(model, data)
        assert data.site("sole").xpos[2] == pytest.approx(0.0, abs=1e-9)
        assert np.abs(data.efc_pos[: data.ne]).max() < 1e-9  # the loop is closed


@pytest.mark.ci
def test_a_trained_run_is_taken_up_again(out, done):
    before = done("fig-5.5")
    run = before.experiment.trained(Workspace(out / "fig-5.5", out / "trained", progress=False))
    assert run.complete
    np.testing.assert_array_equal(run.policies.weights, np.load(before.folder / "values.npz")["weights"][:, :, :3])


def test_landings_are_those_of_hops():
    task = EXPERIMENTS["sec-5.2.2-lean"]().task
    # three hops and a bounce; the foot's angle when each lands, and the height that follows
    heights = [0, 0.5, 0, 0, 0.4, 0, 0.01, 0, 0.3, 0, 0]
    angles = [9, 1, 9, 9, 2, 9, 9, 9, 3, 9, 9]
    height = np.stack([heights, np.zeros(11)], axis=1)
    angle = np.stack([angles, np.zeros(11)], axis=1).astype(float)
    found = landings(angle, height, height == 0, task)
    np.testing.assert_allclose(found["angle"], [np.sqrt(14 / 3), 0.0])
    np.testing.assert_allclose(found["height"], [0.4, 0.0])
    np.testing.assert_allclose(found["loss"], [0.1, 0.0], atol=1e-9)  # 0.4 m after 1°, 0.3 m after 2°


def test_a_body_that_is_dropped_upright_and_unpushed_lands_level():
    body = EXPERIMENTS["sec-5.2.2-lean"]().leaning(30.0).body
    upright = leaning_falls(body, drop=0.1, lean=0.0, gust=0.0)
    assert np.nanmax(np.abs(upright["fall"])) < 0.3  # rounding alone makes a body lean a little, about 0.1°
    leaning = leaning_falls(body, drop=0.3, lean=5.0, gust=10.0)
    np.testing.assert_allclose(leaning["fall"][:, :, 0], [[5.0, 5.0], [0.0, 0.0]], atol=1e-6)
    # active flexors draw the foot up, so it lands later
    last = (~np.isnan(leaning["fall"])).sum(axis=2)
    assert (last[:, 1] > last[:, 0]).all()
    assert last[0, 0] * body.timestep == pytest.approx(np.sqrt(2 * 0.3 / 9.81), abs=0.01)
