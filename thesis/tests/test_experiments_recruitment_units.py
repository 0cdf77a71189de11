"""The experiments on how and when the units of a pool learn: each from end to end at its smoke size, its measures
against other ways to the same number, and its judgements both ways."""

import numpy as np
import pytest

from motorgrad.bodies import POSTURES
from motorgrad.tasks import ArmRecruitment
from motorgrad_thesis import EXPERIMENTS
from motorgrad_thesis.chapter_4.section_4_4.updates import step

CLAIMED = {"sec-4.4-updates": 2 * 5}
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
    assert EXPERIMENTS[name]().seeds >= 20


@pytest.mark.parametrize(
    ("name", "setting", "named"),
    [
        ("sec-4.4-updates", {"factors": (4.0, 1.0)}, "factors = "),
        ("sec-4.4-updates", {"factors": (0.0, 1.0)}, r"factors\[0\] = 0.0"),
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
    assert step(1.0) == ArmRecruitment.learner["learning_rate"]
    assert step(80.0) == pytest.approx({"gain": 0.016, "threshold": 0.032})
