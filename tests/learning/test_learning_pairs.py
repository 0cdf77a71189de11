"""Any two parts of a learner work together, or are refused by name with what would fit."""

import itertools
import re

import jax
import jax.numpy as jnp
import pytest

from motorgrad.learning import Baseline, Centring, CriticFit, Metric, Optimizer, StepBound, Trace
from motorgrad.schema import PART_CLASSES
from motorgrad.tasks import ThreeState
from motorgrad.training import agent_for

TASK = ThreeState(time_limit=5)


def of(place, base, **more):
    """Every registered part of a kind, as a setting of a learner."""
    return [{place: {"kind": name}, **more} for name in PART_CLASSES[base]]


def critics(kind, field, base):
    return [{"baseline": {"kind": kind, field: {"kind": name}}} for name in PART_CLASSES[base]]


CHOICES = {
    "trace": of("trace", Trace),
    "baseline": [
        {"baseline": {"kind": "constant", "value": 0.5}},
        *({"baseline": name} for name in PART_CLASSES[Baseline] if name != "constant"),
        *critics("critic", "fit", CriticFit),
        *critics("network-critic", "fit", CriticFit),
        *critics("critic", "centring", Centring),
    ],
    "metric": of("metric", Metric),
    "update_every": [{"update_every": each} for each in (8, "episode", "never")],
    "optimizer": of("optimizer", Optimizer, update_every=8),
    "bound": of("estimator.bound", StepBound),
    "reuse": [{"estimator.reuse": {"kind": "clipped"}, "update_every": 8}],
    "entropy": [{"entropy": 0.1, "estimator.entropy_in": place} for place in ("sample", "trace")],
    "normalization": [{"normalization": "root-mean-square", "estimator.reward_scaling": "reward-scaling"}],
    "discount": [{"discount": 0.9}],
    "averaging": [{"averaging": {"kind": "polyak", "start": 1}}],
}
PAIRS = list(itertools.combinations(CHOICES, 2))
SHARE = {("metric", "reuse"), ("optimizer", "averaging")}


def decide(agent):
    """The shapes of a state before and after one decision, which is traced but not compiled."""

    def run():
        before = agent.init(jax.random.key(0))
        seen = jnp.zeros(TASK.observation_size)
        after, _ = agent.act(before, seen, jnp.full(before.policy.uniforms, 0.5))
        after = agent.improve(agent.reinforce(after, jnp.ones(()), seen))
        return before, agent.restart(after)

    return [jax.tree.map(lambda leaf: (leaf.shape, leaf.dtype), state) for state in jax.eval_shape(run)]


@pytest.mark.representatives("optimizer-averaging")
@pytest.mark.parametrize(
    ("one", "other"),
    [pytest.param(*pair, id="-".join(pair), marks=[pytest.mark.ci] * (pair in SHARE)) for pair in PAIRS],
)
def test_two_parts_decide_together_or_are_refused_by_name(one, other):
    fitting, refused = 0, []
    for first, second in itertools.product(CHOICES[one], CHOICES[other]):
        try:
            before, after = decide(agent_for(TASK, {**first, **second}))
        except ValueError as error:
            refused.append(str(error))
        else:
            assert before == after, (first, second)
            fitting += 1
    assert [words for words in refused if not re.search(r"\S+ = .+: must be .+", words)] == []
    assert (fitting > 0) == ({one, other} != {"bound", "reuse"})
