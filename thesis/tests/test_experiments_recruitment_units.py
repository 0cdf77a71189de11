"""The experiments on how and when the units of a pool learn: each from end to end at its smoke size, its measures
against other ways to the same number, and its judgements both ways."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.bodies import POSTURES
from motorgrad.policies import Motoneurons
from motorgrad.tasks import ArmRecruitment, LinearRecruitment
from motorgrad.worlds import immediate_gradient
from motorgrad_thesis import EXPERIMENTS
from motorgrad_thesis.chapter_4._pools import LOADS
from motorgrad_thesis.chapter_4.section_4_1_2_sizes import DRAWS
from motorgrad_thesis.chapter_4.section_4_4.asynchronous import RESTS, WORDS, compared, moments
from motorgrad_thesis.chapter_4.section_4_4.large_loads import REWARD_TYPES
from motorgrad_thesis.chapter_4.section_4_4.tied_units import sampled
from motorgrad_thesis.chapter_4.section_4_4.updates import step

CLAIMED = {
    "sec-4.1.2-sizes": 6,
    "sec-4.4-updates": 2 * 5,
    "sec-4.4-asynchronous": 10,
    "sec-4.4-tied": 2 * 9,
}
SEEDS = 20


def twice(values):
    """The same values for both postures of the arm."""
    return {f"{posture} {name}": value for posture in POSTURES for name, value in values.items()}


@pytest.mark.slow
@pytest.mark.parametrize("name", CLAIMED)
def test_each_leaves_a_figure_and_its_claims(name, done, check_complete):
    found = done(name)
    check_complete(name, found)
    assert len(found.claims) == CLAIMED[name]


@pytest.mark.parametrize("name", CLAIMED)
def test_results_are_over_twenty_seeds_or_more(name):
    kind = EXPERIMENTS[name]()
    assert kind.seeds * getattr(kind, "draws", 1) >= 20


@pytest.mark.parametrize(
    ("name", "setting", "named"),
    [
        ("sec-4.4-updates", {"factors": (4.0, 1.0)}, "factors = "),
        ("sec-4.4-updates", {"factors": (0.0, 1.0)}, r"factors\[0\] = 0.0"),
        ("sec-4.4-asynchronous", {"shares": (1.0, 0.2)}, "shares = "),
        ("sec-4.4-asynchronous", {"shares": (0.2, 1.2)}, r"shares\[1\] = 1.2"),
        ("sec-4.4-tied", {"groups": (4, 2)}, "groups = "),
        ("sec-4.1.2-sizes", {"draws": 1}, "draws = 1"),
        ("sec-4.4-tied", {"groups": (2, 16)}, r"groups = .* rising to 32"),
    ],
)
def test_impossible_settings_are_refused_by_name(name, setting, named):
    with pytest.raises(ValueError, match=named):
        EXPERIMENTS[name](**setting)


def noise(size, seed=0):
    return 1e-3 * np.random.default_rng(seed).normal(size=size)


# when the parameters are updated


def updates(end, online, caught):
    """Values of pools that earn so much with either kind of update, of which so many have a unit of negative gain with
    updates after every decision, and none with updates at the end."""
    values = {"factor": np.array([1.0, 80.0]), "best": np.array(6.0), "decision": np.arange(1, 41) * 1000}
    for way, reward, many in (("end", end, 0), ("online", online, caught)):
        values |= {
            f"{way} curve": reward + noise((SEEDS, 40)),
            f"{way} reward": reward + noise((2, SEEDS), seed=len(way)),
            f"{way} caught": np.tile(np.arange(SEEDS) < many, (2, 1)),
        }
    return twice(values)


def test_claims_about_updates_go_both_ways():
    kind = EXPERIMENTS["sec-4.4-updates"](factors=(1.0, 80.0))
    helps = updates(5.8, 5.0, 15)
    assert [claim.holds for claim in kind.claims(helps)] == 2 * [True, True, True, True, False]
    kind.figure(helps)
    harms = updates(5.0, 5.8, 0)
    assert [claim.holds for claim in kind.claims(harms)] == [False] * 10
    alike = updates(5.8, 5.8, 0)
    assert [claim.holds for claim in kind.claims(alike)] == 2 * [False, False, False, False, True]


def test_a_step_of_one_is_that_of_the_task():
    assert step(1.0) == ArmRecruitment().learner["learning_rate"]
    assert step(80.0) == pytest.approx({"gain": 0.016, "threshold": 0.032})


# units in turn


POOLS = jax.vmap(Motoneurons)(jnp.array([[0.2, 0.5], [0.4, 0.6]]), jnp.array([[3.0, 9.0], [-2.0, 5.0]]))


def test_the_mean_of_gradient_samples_is_the_gradient_of_the_oracle():
    task = LinearRecruitment(units=2)
    mean, variance = moments(task, POOLS)
    loads = (np.arange(LOADS)[:, None] + 0.5) / LOADS
    exact = immediate_gradient(
        Motoneurons(POOLS.threshold[1], POOLS.gain[1]), loads, np.full(LOADS, 1 / LOADS), task.immediate
    )
    np.testing.assert_allclose(mean[1], np.concatenate([exact.threshold, exact.gain]), rtol=1e-4)
    assert (variance > 0).all()


def test_turns_among_noisy_units_follow_the_true_gradient_with_the_same_noise():
    found = compared(LinearRecruitment(units=2), POOLS)
    np.testing.assert_allclose(found["noisy cosine"], 1, atol=1e-5)
    np.testing.assert_allclose(found["noisy variance"], 1, atol=1e-3)
    assert (found["quiet cosine"] < 0.999).any()


def turns(cosine, variance, error):
    """Values of pools with so much error in turn, of 1 together, and with such directions of quiet turns."""
    values = {"share": np.array([0.02, 0.2, 1.0]), "decision": np.arange(1, 41) * 1000}
    values |= {f"{name} error": error + noise((SEEDS, 40)) for name in WORDS}
    values |= {f"together{kind} error": 1 + noise((SEEDS, 40)) for kind in ("", "-large")}
    for rest in RESTS:
        values |= {
            f"{rest} cosine": cosine - np.abs(noise((3, SEEDS))),
            f"{rest} variance": variance + noise((3, SEEDS)),
        }
    return values | {"noisy cosine": np.full((3, SEEDS), 1.0 if cosine < 0.9 else 0.5)}


def test_claims_about_turns_go_both_ways():
    kind = EXPERIMENTS["sec-4.4-asynchronous"]()
    quicker = turns(0.7, 0.5, 0.8)
    assert [claim.holds for claim in kind.claims(quicker)] == [True] * 10
    kind.figure(quicker)
    assert [claim.holds for claim in kind.claims(turns(1.1, 1.5, 1.2))] == [False] * 10


# tied units


def test_what_groups_draw_is_binomial():
    assert sampled(2, 0.86) == pytest.approx(0.25)
    assert sampled(8, 7 / 8) == pytest.approx(9 / 256)
    assert sampled(1, 0.5) == pytest.approx(0.5)


def tied(few, many, halved, apart=0.0):
    """Values of pools that fire so much at large loads: in few groups, as independent units, and after halving."""
    values = {"groups": np.array([2, 32]), "units": np.array(32), "sampled": np.array([0.25, 1e-5])}
    for reward_type in REWARD_TYPES:
        low = np.abs(noise(SEEDS))
        values |= {
            f"{reward_type} tied": np.stack([few + low, many + low]),
            f"{reward_type} few": few + low + apart,
            f"{reward_type} halved": np.stack([few + low, halved + low]),
        }
    return twice(values)


def test_claims_about_tied_units_go_both_ways():
    kind = EXPERIMENTS["sec-4.4-tied"](groups=(2, 32))
    useful = tied(0.9, 0.0, 0.9)
    assert [claim.holds for claim in kind.claims(useful)] == [True] * 18
    kind.figure(useful)
    useless = tied(0.0, 0.0, 0.0, apart=0.1)
    assert [claim.holds for claim in kind.claims(useless)] == 2 * ([True] + [False] * 8)


# units of random sizes


def sizes(rises, learned, predicted):
    values = {}
    for name in DRAWS:
        shape = (1 if name == "equal" else 10, 4)
        values |= {f"{name} {what}": at + noise(shape) for what, at in (("start", 1.0), ("error", learned))}
        values |= {f"{name} predicted": predicted + noise(shape), f"{name} ideal": np.full(shape[0], 0.1)}
        values |= {f"{name} rises": np.full(shape, rises), f"{name} force": np.zeros((*shape, 101))}
    return values


def test_claims_about_random_sizes_go_both_ways():
    kind = EXPERIMENTS["sec-4.1.2-sizes"]()
    learned = sizes(True, 0.5, 0.8)
    assert [claim.holds for claim in kind.claims(learned)] == [True] * 6
    kind.figure(learned)
    assert [claim.holds for claim in kind.claims(sizes(False, 1.2, 1.1))] == [False] * 6


def test_forces_are_drawn_once_for_all_who_have_them():
    kind = EXPERIMENTS["sec-4.1.2-sizes"]()
    first, again, other = kind.task("log-normal", 0), kind.task("log-normal", 0), kind.task("log-normal", 1)
    assert first == again != other
    assert np.mean(first.strengths) == pytest.approx(1, abs=1e-3)
    assert np.ptp(first.sizes) > 0.1
