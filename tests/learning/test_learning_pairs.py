"""Any two parts of a learner work together, or are refused by name with what would fit; for every kind of learner."""

import dataclasses
import itertools
import math
import re
from typing import Literal, get_args, get_origin

import jax
import jax.numpy as jnp
import pytest

from families import FAMILIES, compiled
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
from motorgrad.schema import PART_CLASSES, declared_by, default_of, fields_of, hints_of, options_of, parts_in
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
CRITERIA = [{"criterion": each} for each in ("maximum", "none")]  # a discount goes with none
AVERAGING = [{"averaging": {"kind": "polyak", "start": 1}}]
ANNEALED = {"kind": "annealed", "start": 0.1}
ENTROPY = [{"entropy": 0.1}, {"entropy": ANNEALED}]
SCALING = [{"reward_scaling": "reward-scaling"}]
SQUASHED = {"policy": "graded-motoneurons"}
# kind: (the task, settings of its policy, what there is to choose beyond its fields, or in place of one)
BY_HAND = {
    "policy-gradient": (
        DISCRETE,
        {},
        {
            "trace": of("trace", Trace),
            "baseline": BASELINES,
            "metric": of("metric", Metric),
            "update_every": [
                *({"update_every": each} for each in (8, "episode", "never")),
                {"update_every": 8, "estimator.accuracy": {"kind": "accuracy", "block": 2, "least": 2}},
            ],
            "criterion": CRITERIA,
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
            "criterion": CRITERIA,
            "discount": [{"discount": 0.9}],
            "normalization": [{"normalization": "root-mean-square"}],
            "learning_rate": [{"learning_rate": each} for each in (0.1, {"centre": 0.1, "log_width": 0.2})],
        },
    ),
}
ELSEWHERE = ("policy", "transformations", "growth")  # these fields have tests of their own


def numbers_in(declared, default):
    """Two numbers that a field allows, an end of its range if it has one."""
    low, high, open_low, open_high, _ = declared.range
    if declared.range.whole:
        return [low, min(high, max(low, default or low) + 1)]
    inside = 0.5 * (low + high) if math.isfinite(low + high) else low + 0.5
    ends = [(low, open_low), (high, open_high)]
    return [inside, *(end for end, is_open in ends if math.isfinite(end) and not is_open)][:2]


def plain_choices(field, hint):
    """Values of a field that are no parts: both of a switch, all words, two numbers."""
    words = [word for option in options_of(hint) if get_origin(option) is Literal for word in get_args(option)]
    declared = declared_by(field)
    return [
        *((True, False) if hint is bool else ()),
        *words,
        *(numbers_in(declared, default_of(field)) if declared.range is not None else ()),
    ]


def parts_for(hint):
    """Every registered part that a field of this type may hold, by name."""
    allowed = parts_in(hint)
    return {name: cls for kinds in PART_CLASSES.values() for name, cls in kinds.items() if issubclass(cls, allowed)}


def choices_of(learner):
    """What there is to choose for each field of a kind of learner: every registered part, or where there is but one the
    settings within; otherwise its values."""
    choices = {}
    for name, field in fields_of(learner).items():
        if name in ELSEWHERE:
            continue
        hint = hints_of(learner)[name]
        parts = parts_for(hint)
        found = [{name: value} for value in plain_choices(field, hint)]
        if len(parts) == 1 and type(None) not in options_of(hint):
            (cls,) = parts.values()
            for inner, own in fields_of(cls).items():
                found += [{f"{name}.{inner}": value} for value in plain_choices(own, hints_of(cls)[inner])]
        else:
            for kind, cls in parts.items():
                missing = {place for place, own in fields_of(cls).items() if default_of(own) is dataclasses.MISSING}
                found.append({name: {"kind": kind, **dict.fromkeys(missing, 0.5)}})
        if found:
            choices[name] = found
    return choices


def kind_with_choices(kind):
    task, settings, own = BY_HAND.get(kind, (*compiled(kind), {}))
    return task, settings, {**own, **choices_of(Learner.kinds()[kind]), **own}  # those by hand come first, and stay


KINDS = {kind: kind_with_choices(kind) for kind in FAMILIES}
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
