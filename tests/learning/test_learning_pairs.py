"""Any two parts of a learner work together, or are refused by name with what would fit; for every kind of learner."""

import itertools
import re

import jax
import jax.numpy as jnp
import pytest

from motorgrad.learning import (
    Baseline,
    Centring,
    CriticFit,
    FixedStep,
    Learner,
    MeanReward,
    Metric,
    Optimizer,
    SparseLearner,
    StepBound,
    Trace,
    Transition,
)
from motorgrad.schema import PART_CLASSES
from motorgrad.tasks import LinearRecruitment, ThreeState
from motorgrad.training import agent_for

DISCRETE = ThreeState(time_limit=5)
POOL = LinearRecruitment(units=3, time_limit=5)


def of(place, base, **more):
    """Every registered part of a kind, as a setting of a learner."""
    return [{place: {"kind": name}, **more} for name in PART_CLASSES[base]]


def critics(kind, field, base):
    return [{"baseline": {"kind": kind, field: {"kind": name}}} for name in PART_CLASSES[base]]


BASELINES = [
    {"baseline": {"kind": "constant", "value": 0.5}},
    *({"baseline": name} for name in PART_CLASSES[Baseline] if name != "constant"),
    *critics("critic", "fit", CriticFit),
    *critics("network-critic", "fit", CriticFit),
    *critics("critic", "centring", Centring),
]
SCALARS = [
    {"baseline": {"kind": "constant", "value": 0.5}},
    *({"baseline": name} for name, cls in PART_CLASSES[Baseline].items() if issubclass(cls, FixedStep | MeanReward)),
]
AVERAGING = [{"averaging": {"kind": "polyak", "start": 1}}]
ANNEALED = {"kind": "annealed", "start": 0.1}
ENTROPY = [{"entropy": 0.1}, {"entropy": ANNEALED}]
SCALING = [{"reward_scaling": "reward-scaling"}]
SQUASHED = {"policy": "graded-motoneurons"}
# kind: (the task, settings of its policy, what there is to choose)
KINDS = {
    "policy-gradient": (
        DISCRETE,
        {},
        {
            "trace": of("trace", Trace),
            "baseline": BASELINES,
            "metric": of("metric", Metric),
            "update_every": [{"update_every": each} for each in (8, "episode", "never")],
            "optimizer": of("optimizer", Optimizer, update_every=8),
            "bound": of("estimator.bound", StepBound),
            "entropy": [{"entropy": 0.1, "estimator.entropy_in": place} for place in ("sample", "trace")],
            "normalization": [{"normalization": "root-mean-square", "estimator.reward_scaling": "reward-scaling"}],
            "discount": [{"discount": 0.9}],
            "averaging": AVERAGING,
        },
    ),
    "proximal": (
        DISCRETE,
        {"update_every": 8},
        {
            "decay": [{"decay": each} for each in (0.0, 0.9, 1.0)],
            "baseline": BASELINES,
            "metric": of("metric", Metric),
            "minibatches": [{"minibatches": each} for each in (1, 3, 4)],
            "standardise": [{"standardise": each} for each in (True, False)],
            "optimizer": of("optimizer", Optimizer),
            "entropy": ENTROPY,
            "normalization": [{"normalization": "root-mean-square", **SCALING[0]}],
            "averaging": AVERAGING,
        },
    ),
    "action-value-gradient": (
        POOL,
        SQUASHED,
        {
            "network": [{"values.network.layer_norm": each} for each in (True, False)],
            "optimizer": of("optimizer", Optimizer),
            "entropy": ENTROPY,
            "reward_scaling": SCALING,
            "averaging": AVERAGING,
        },
    ),
    "soft-actor-critic": (
        POOL,
        {**SQUASHED, "replay.capacity": 40, "replay.start": 4, "replay.batch": 3},
        {
            "values": [{"values.members": 1}, {"values.learning_rate": ANNEALED}],
            "update_every": [{"update_every": each} for each in (1, 3)],
            "optimizer": of("optimizer", Optimizer),
            "entropy": [*ENTROPY, {"entropy_target": "entropy-target"}],
            "reward_scaling": SCALING,
            "averaging": AVERAGING,
        },
    ),
    "sparse": (
        POOL,
        {"policy": "gaussians"},
        {
            "decay": [{"decay": each} for each in (0.0, 0.9, 1.0)],
            "baseline": SCALARS,
            "discount": [{"discount": 0.9}],
            "normalization": [{"normalization": "root-mean-square"}],
            "learning_rate": [{"learning_rate": each} for each in (0.1, {"centre": 0.1, "log_width": 0.2})],
        },
    ),
}
PAIRS = [(kind, *pair) for kind, (*_, choices) in KINDS.items() for pair in itertools.combinations(choices, 2)]
SHARE = {("proximal", "baseline", "metric"), ("policy-gradient", "optimizer", "averaging")}


def decide(task, agent):
    """The shapes of a state before and after one decision, which is traced but not compiled."""

    def run():
        before = agent.init(jax.random.key(0))
        units = before.policy.uniforms
        if isinstance(agent, SparseLearner):  # its tables are made outside compiled code
            index = before.index
            before = before._replace(index=index._replace(table=jnp.zeros((len(index.table), units), jnp.int32)))
        seen = jnp.zeros(task.observation_size)
        after, action = agent.act(before, seen, jnp.full(units, 0.5))
        ended = jnp.ones((), bool)
        after = agent.observe(after, Transition(seen, action, jnp.ones(()), seen, ended))
        return before, agent.update(after)

    return [jax.tree.map(lambda leaf: (leaf.shape, leaf.dtype), state) for state in jax.eval_shape(run)]


def test_every_kind_of_learner_has_pairs():
    assert set(KINDS) == set(Learner.kinds())


@pytest.mark.representatives("policy-gradient-optimizer-averaging", "sparse-decay-baseline")
@pytest.mark.parametrize(
    ("kind", "one", "other"),
    [pytest.param(*pair, id="-".join(pair), marks=[pytest.mark.ci] * (pair in SHARE)) for pair in PAIRS],
)
def test_two_parts_decide_together_or_are_refused_by_name(kind, one, other):
    task, settings, choices = KINDS[kind]
    fitting, refused = 0, []
    for first, second in itertools.product(choices[one], choices[other]):
        try:
            before, after = decide(task, agent_for(task, {"kind": kind, **settings, **first, **second}))
        except ValueError as error:
            refused.append(str(error))
        else:
            assert before == after, (first, second)
            fitting += 1
    assert [words for words in refused if not re.search(r"\S+ = .+: must be .+", words)] == []
    assert fitting > 0
