"""Section 6.5: falls sampled at any period, and the claims about periods, robustness and greediness."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.policies import LocalGaussians
from motorgrad.tasks import FallingParticle, region_reward
from motorgrad.worlds import ParticlePhysics, ParticleStart
from motorgrad_thesis.chapter_6.section_6_5._falls import falls
from motorgrad_thesis.chapter_6.section_6_5.greediness import WAYS, Greediness
from motorgrad_thesis.chapter_6.section_6_5.period import PERIODS, RELEARNED, Period
from motorgrad_thesis.chapter_6.section_6_5.robustness import KINDS, LARGE, SMALL, Robustness

rng = np.random.default_rng(0)
STRAIGHT = FallingParticle(
    units=2,
    physics=ParticlePhysics(timestep=0.05, substeps=1),
    start=ParticleStart(x=(0.3, 0.3), y=(1.0, 1.0)),
)


def everywhere(*heights):
    """A policy of units that fire with these probabilities in the whole box, as the only one of a stack."""
    units = len(heights)
    pool = LocalGaussians(jnp.zeros((units, 2)), jnp.full((units, 2), 12.0), p_max=jnp.array(heights))
    return jax.tree.map(lambda leaf: leaf[None], pool)


def about(mean, seeds=24, spread=0.01):
    found = rng.normal(size=seeds)
    return mean + spread * (found - found.mean()) / found.std(ddof=1)


def held(experiment, values):
    return [claim.holds for claim in experiment.claims(values)]


def test_falls_pay_what_the_task_pays_along_the_path():
    world = STRAIGHT.dynamics
    step = jax.jit(world.step)
    state = world.reset(jnp.zeros(world.reset_uniforms))
    paid = []
    while not paid or not state.reached[1]:
        state = step(state, jnp.array([0.0, 1.0]), jnp.zeros(0))
        paid.append(float(region_reward(STRAIGHT.places, state.position)))
    found = falls(STRAIGHT, everywhere(1e-6, 1.0), hold=4, count=3)
    np.testing.assert_allclose(found.reward, np.mean(paid), rtol=1e-4)
    np.testing.assert_allclose(found.time, 0.05 * len(paid), rtol=1e-6)
    np.testing.assert_allclose(found.pushes[0, :, 1], found.time[0], rtol=1e-4)
    assert found.fired.tolist() == [[[False, True]] * 3]


@pytest.mark.parametrize("hold", [1, 3])
def test_an_action_is_held_between_decisions(hold):
    found = falls(STRAIGHT, everywhere(0.3, 0.5), hold, count=200)
    steps = np.rint(found.time / 0.05)
    decisions = np.ceil(steps / hold)
    np.testing.assert_allclose(found.silent[..., 0], 0.7**decisions, rtol=1e-3)
    np.testing.assert_allclose(found.peak, [[[0.3, 0.5]] * 200], rtol=1e-4)
    held_for = found.pushes[0] / (0.05 * steps[0, :, None])
    np.testing.assert_allclose(held_for.mean(0), [0.3, 0.5], atol=0.05)


def test_actions_are_held_only_in_single_time_steps():
    with pytest.raises(ValueError, match="substeps = 2"):
        falls(FallingParticle(units=2), everywhere(0.5, 0.5), hold=1, count=1)


def test_the_closed_form_of_acting_at_least_once():
    study = Period(crossings=1_500, speeds=(0.4, 0.8))
    found = study._crossed(0.8)
    measured = found["speed 0.8 fired"].mean(1)
    np.testing.assert_allclose(measured, found["speed 0.8 expected"], atol=4 * 0.5 / math.sqrt(1_500))
    # many decisions: the sum of the probabilities is an integral of the Gaussian
    assert study.at_least_once(0.4, 0.001) == pytest.approx(1 - math.exp(-0.05 * math.sqrt(2 * math.pi) * 0.16 / 4e-4))


def crossed(shares, time, spread):
    fired = np.array([np.arange(4_000) < share * 4_000 for share in shares])
    return {"fired": fired, "expected": fired.mean(1), "time": np.stack([about(time, 4_000, each) for each in spread])}


@pytest.mark.parametrize("depends", [True, False])
def test_claims_about_periods(depends):
    study = Period(layouts=("R1",))
    spread = 0.01 * np.sqrt(PERIODS) if depends else np.full(len(PERIODS), 0.01)
    values = {}
    for speed, low in zip(study.speeds, (0.9, 0.6, 0.3), strict=True):
        shares = np.linspace(1.0 if depends else low, low, len(PERIODS)) if depends else np.full(len(PERIODS), 0.5)
        values |= {f"speed {speed:g} {key}": each for key, each in crossed(shares, 0.2, spread).items()}
    level = np.linspace(0.31, 0.2, len(PERIODS)) if depends else np.full(len(PERIODS), 0.28)
    values["R1 learned reward"] = np.stack([about(each) for each in level])
    values |= {f"R1 again {period:g}": about(0.4 if depends else 0.2) for period in RELEARNED}
    assert held(study, values) == [depends] * 3 + [True, True] + [depends] * 5
    values["speed 0.1 expected"] = values["speed 0.1 expected"] - 0.1
    assert not held(study, values)[3]


@pytest.mark.parametrize(("stochastic", "hard"), [(1.0, 0.5), (0.5, 1.0)])
def test_claims_about_robustness(stochastic, hard):
    values = {}
    for name in KINDS:
        share = hard if name == "hard" else stochastic
        values[f"{name} same"] = about(0.3)
        values |= {f"{name} {way}": about(0.3 * share) for way in (*SMALL, "unit after")}
        values[f"{name} unit"] = about(0.1)
        values |= {f"{name} {way}": about(0.1) for way in LARGE}
        values |= {f"{name} {way} after": about(0.1 + 0.2 * (share - 0.5)) for way in LARGE}
    better = stochastic > hard
    assert held(Robustness(), values) == [better] * 14


@pytest.mark.parametrize("greedy", [True, False])
def test_claims_about_greediness(greedy):
    study = Greediness(penalties=(0.02,))
    values = {"decision": np.arange(1, 201) * study.decisions // 200}
    for penalty in study.costs:
        for way in WAYS:
            name = f"{penalty:g} {way}"
            values[f"{name} goal"] = about(0.0 if greedy and way == "grown" else 0.1)
            values[f"{name} firings"] = np.full((24, 4), 0.0 if greedy and penalty and way == "grown" else 10.0)
            values[f"{name} rate"] = values[f"{name} firings"] / 24.5
            values[f"{name} curve"] = np.tile(about(-0.02 if greedy else 0.02, spread=0.001)[:, None], (1, 200))
    # the firings cost 0.033
    assert held(study, values) == [greedy, greedy, greedy, True, greedy]
