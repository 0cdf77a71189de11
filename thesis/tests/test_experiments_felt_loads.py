"""The experiment on loads that are felt: from end to end, its exact rewards against drawn lifts and sums by hand, and
its judgements both ways."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.policies import Hyperplanes, Motoneurons
from motorgrad.tasks import ArmRecruitment
from motorgrad.training import agent_for
from motorgrad_thesis import EXPERIMENTS
from motorgrad_thesis.chapter_4._felt import LOADS, best_of_lifts, blind, lifted, strained

NAME = "sec-4.3-felt-loads"
DRAWN = 100_000


def one(policy):
    """The pools of one seed."""
    return jax.tree.map(lambda leaf: leaf[None], policy)


def drawn(task, policy):
    """The mean reward and its error of one pool at drawn loads, attempt by attempt as the task has them."""
    generator = np.random.default_rng(0)
    load = jnp.asarray(generator.uniform(task.low, task.high, DRAWN), jnp.float32)
    chances = generator.random((task.attempts, DRAWN, task.units + 1)).astype(np.float32)
    world = task.dynamics
    memory = jax.vmap(lambda _: task.init(jnp.zeros(0)))(load)

    @jax.jit
    @jax.vmap
    def act(memory, load, attempt, chances):
        state = load
        if task.attempts > 1:
            state = world.reset(jnp.zeros(0))._replace(load=load, attempt=attempt)
        memory, seen = task.observe(memory, state, chances[-1:])
        return task.reward(memory, state, policy.sample(seen, chances[:-1]))[:2]

    paid = []
    for attempt, each in enumerate(chances):
        memory, reward = act(memory, load, jnp.full(DRAWN, attempt, jnp.int32), each)
        paid.append(np.asarray(reward, float))
    total = np.mean(paid, 0)
    return np.array([each.mean() for each in paid]), total.mean(), total.std() / np.sqrt(DRAWN)


def test_the_reward_of_pools_that_feel_strains_is_that_of_drawn_lifts():
    task = ArmRecruitment(senses="strain", noise=0.4, units=3)
    policy = Motoneurons(np.array([0.1, 2.0, 3.5]), np.array([6.0, 4.0, -2.0]))
    found = strained(task, one(policy))
    _, mean, error = drawn(task, policy)
    assert float(found["reward"][0]) == pytest.approx(mean, abs=4 * error)
    assert found["best"] > found["reward"][0]


def test_the_best_for_a_strain_is_earned_by_sharp_thresholds_where_it_changes():
    task = ArmRecruitment(senses="strain", noise=0.3)
    best = strained(task, one(Motoneurons(np.zeros(4), np.zeros(4))))
    sharp = Motoneurons(best["best threshold"] - 1e-3, np.full(4, 1e5))
    found = strained(task, one(sharp))
    assert float(found["reward"][0]) == pytest.approx(float(best["best"]), abs=1e-3)
    for shift in (-0.1, 0.1):  # and no other ones earn more
        moved = dataclasses.replace(sharp, threshold=sharp.threshold + shift)
        assert strained(task, one(moved))["reward"][0] < best["best"]


def test_less_noise_is_worth_more_and_much_noise_nothing():
    pools = one(Motoneurons(np.zeros(4), np.zeros(4)))
    quiet, loud, loudest = (
        float(strained(ArmRecruitment(senses="strain", noise=noise), pools)["best"]) for noise in (0.1, 1.0, 100.0)
    )
    none = float(blind(ArmRecruitment(senses="nothing"), pools)["best"])
    assert quiet > loud + 0.5
    assert loud > none + 0.5
    assert loudest == pytest.approx(none, abs=0.01)


def test_the_reward_of_pools_that_feel_lifts_is_that_of_drawn_attempts():
    task = ArmRecruitment(senses="lifts", attempts=3, units=3)
    policy = Hyperplanes(np.array([[-2.0, 3.0], [4.0, -3.0], [0.5, 1.0]]), np.array([0.5, 0.2, -1.0]))
    found = lifted(task, one(policy))
    by_attempt, mean, error = drawn(task, policy)
    assert float(found["reward"][0]) == pytest.approx(mean, abs=4 * error)
    np.testing.assert_allclose(found["by attempt"][0], by_attempt, atol=12 * error)
    assert np.ptp(by_attempt) > 20 * error  # attempts differ
    assert found["activation"].shape == (1, LOADS)


def test_the_best_attempts_are_those_of_a_sum_by_hand():
    # two loads, one of which is lifted by one unit and the other by two; no unit, one, two
    paid = np.array([[0.0, 5.0, 4.0], [0.0, -1.0, 4.0]])
    height = np.array([[0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
    assert best_of_lifts(paid, height, 1) == 4.0
    # one unit first tells which it is, and costs 4 of 8; two tell nothing; who knows earns 9 instead of 8
    assert best_of_lifts(paid, height, 2) == 4.0
    assert best_of_lifts(paid, height, 6) == pytest.approx((4 + 5 * 9) / 12)
    alike = np.ones_like(height)
    assert best_of_lifts(paid, alike, 6) == 4.0


def test_all_senses_have_the_same_loads_and_the_thesis_s_learner_where_they_have_one_number():
    study = EXPERIMENTS[NAME]()
    assert study.seeds >= 20
    for name, task in study.tasks.items():
        assert (task.low, task.high, task.units) == (-2.0, 14.0, 4), name
        assert agent_for(task).estimator.trace.decay == 0.0
        if name != "lifts":
            assert "metric" not in task.learner


@pytest.mark.parametrize(
    ("settings", "named"),
    [({"noises": (0.3, 0.1)}, "noises = "), ({"noises": (0.1,)}, "noises = "), ({"attempts": 1}, "attempts = 1")],
)
def test_settings_that_make_no_comparison_are_refused(settings, named):
    with pytest.raises(ValueError, match=named):
        EXPERIMENTS[NAME](**settings)


def values(better):
    """Results in which everything is as claimed, or as little as can be."""
    study = EXPERIMENTS[NAME]()
    wave = 0.01 * np.sin(np.arange(20))
    load = np.linspace(-2, 14, 17)
    found = {"nothing best": np.array(4.0), "lifts best": np.array(5.0)}
    found |= {"lifts reward": wave + (4.8 if better else 3.9)}
    found |= {"lifts by attempt": np.stack([wave + 4, wave * 0.5 + (5 if better else 3)], 1)}
    for row, name in enumerate(("told", *study.strains)):
        gain = 1 - 0.1 * row if better else 1 + 0.1 * row
        steep = 1 - 0.1 * row if better else 0.1 + 0.1 * row
        places = np.array([0.0, 1.0, 2.0, 3.0]) * (1 if better else 0.1) + (-0.1 if better else 0.1) * row
        found |= {
            f"{name} reward": wave + (5.99 - 0.04 * row if better else 3.0 + 0.3 * row),
            f"{name} best": np.array(6.0),
            f"{name} gain": gain + wave[:, None] * np.ones(4),
            f"{name} threshold": places + wave[:, None],
            f"{name} best threshold": np.array([0.0, 1.0, 2.0, 3.0]),
            f"{name} activation": steep * np.clip(load / 14, 0, 1) + 0.1 * wave[:, None] * load,
            f"{name} best activation": np.clip(load / 14, 0, 1),
        }
    return study, found | {"told load": load, "told best count": np.clip(load / 3.5, 0, 4)}


@pytest.mark.parametrize("better", [True, False])
def test_its_claims_follow_from_the_results(better):
    study, found = values(better)
    claims = list(study.claims(found))
    assert len(claims) == 3 + 4 + 3 + 3 + 1 + 2 + 3 + 1 + 3
    assert all(claim.kind == "extension" for claim in claims)
    # where telling is worth less than nothing, feeling is as good
    always = [claim for claim in claims if "positive" in claim.statement or "nearly as good" in claim.statement]
    assert all(claim.holds for claim in always)
    assert [each.statement for each in claims if each not in always and each.holds != better] == []


def test_thresholds_of_pools_with_a_negative_gain_are_not_judged():
    study, found = values(better=True)
    for name in study.strains:
        found[f"{name} gain"][:, 0] = -1
    said = [claim.statement for claim in study.claims(found)]
    assert len(said) == 23 - 3 - 1
    assert not any("spread" in each or "certain" in each for each in said)


@pytest.mark.slow
def test_it_leaves_a_figure_and_its_claims(done, check_complete):
    found = done(NAME)
    check_complete(NAME, found)
    assert len(found.claims) == 2 + 3 + 2 + 2 + 1 + 2 + 2 + 1 + 3
