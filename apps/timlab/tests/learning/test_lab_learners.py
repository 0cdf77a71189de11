"""Whole learners of every family as one block, which learns what the same learner does that is driven by hand."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree

import families
import timlab
from motorgrad import agent_for, learning, policies
from neighbours import registered
from timlab.blocks.learning._units import Sizes, key_from


@pytest.fixture
def neighbours():
    with registered():
        yield


TICKS = 60
LOST = 21
TRUNCATED = 37
TERMINATED = (12, 48)
FAMILIES = {
    **{kind: {"kind": kind, **family.settings} for kind, family in families.FAMILIES.items() if kind != "sparse"},
    "online": {"baseline": {"kind": "critic", "fit": "td"}},
    "neighbours": {"kind": "neighbours"},
}
QUICK = ("proximal", "neighbours")
DIFFERENT = pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.ci) for name in FAMILIES]
)


def settings_of(name):
    return {"policy": "bounded-hyperplanes", **FAMILIES[name]}


def signals():
    """What a world might show and pay at every tick."""
    draw = np.random.default_rng(5)
    tick = np.arange(TICKS)
    return {
        "observation": draw.normal(size=(TICKS, 2)).astype(np.float32),
        "reward": draw.normal(size=TICKS).astype(np.float32),
        "next_observation": draw.normal(size=(TICKS, 2)).astype(np.float32),
        "terminated": np.isin(tick, TERMINATED),
        "truncated": tick == TRUNCATED,
        "valid": tick != LOST,
        "uniforms": draw.uniform(size=(TICKS, 1)).astype(np.float32),
    }


def of_block(block, given, frozen=()):
    """Actions and parameters of a block, which is frozen at some ticks."""
    values = block.values()
    state = block.bound({name: jnp.asarray(value) for name, value in values.items()}).init(jnp.full(1, 0.3))

    @jax.jit
    def once(state, row, tick, frozen):
        bound = block.bound({name: jnp.asarray(value) for name, value in {**values, "frozen": frozen}.items()})
        row = dict(row)
        time = tick * jnp.ones(())
        now = timlab.Moment(tick, time, jnp.ones(()), row.pop("uniforms"), time)
        return bound.update(state, row, now), bound.output(state, row, now)

    actions, parameters = [], []
    for tick in range(TICKS):
        row = {name: values[tick] for name, values in given.items()}
        state, shown = once(state, row, np.uint32(tick), tick in frozen)
        actions.append(shown["action"])
        parameters.append(shown["parameters"])
    return np.array(actions), np.array(parameters)


def by_hand(agent, given):
    """Actions and parameters of a learner."""
    state = agent.init(key_from(jnp.full(1, 0.3)))

    @eqx.filter_jit
    def once(agent, state, before, action, row):
        flags = {"terminated": row["terminated"], "truncated": row["truncated"], "diverged": ~row["valid"]}
        after = learning.Transition(before, action, row["reward"], row["next_observation"], **flags)
        return agent.act(agent.update(agent.observe(state, after)), row["observation"], row["uniforms"])

    actions, parameters = [], []
    for tick in range(TICKS):
        row = {name: values[tick] for name, values in given.items()}
        if tick == 0:
            state, action = agent.act(state, jnp.asarray(row["observation"]), jnp.asarray(row["uniforms"]))
        else:
            state, action = once(agent, state, given["observation"][tick - 1], action, row)
        actions.append(action)
        parameters.append(ravel_pytree(policies.trainable(state.policy))[0])
    return np.array(actions), np.array(parameters)


@DIFFERENT
def test_a_block_learns_what_the_learner_does(name, neighbours):
    given = signals()
    block = timlab.Learner(2, 1, settings_of(name))
    assert timlab.loads(timlab.dumps(in_a_diagram(block))) == in_a_diagram(block)
    ours, learned = of_block(block, given)
    theirs, expected = by_hand(agent_for(Sizes(2, 1), settings_of(name)), given)
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-5)
    np.testing.assert_allclose(learned, expected, rtol=0, atol=1e-5)
    assert np.ptp(learned, axis=0).max() > 1e-3


@DIFFERENT
def test_a_frozen_block_learns_nothing_and_goes_on_when_thawed(name, neighbours):
    frozen = range(24, 44)  # in which an episode is cut
    learned = of_block(timlab.Learner(2, 1, settings_of(name)), signals(), frozen)[1]
    assert np.ptp(learned[23:44], axis=0).max() == 0
    assert np.ptp(learned[44:], axis=0).max() > 0
    assert np.isfinite(learned).all()


def in_a_diagram(block):
    made = timlab.Diagram(tick=1.0)
    made.add("world", timlab.Constant(0.5, (2,)))
    made.add("policy", block)
    made.connect("world", "policy.observation")
    made.add("reward", timlab.Constant(1.0))
    made.connect("reward", "policy.reward")
    return made


def test_a_number_of_any_learner_is_changed_while_it_runs(neighbours):
    run = timlab.Run(in_a_diagram(timlab.Learner(2, 1, settings_of("neighbours"))), 2, watch=["policy.parameters"])
    assert np.ptp(run.advance(20)["policy.parameters"], axis=1).max() > 0
    run["policy.spread"] = 0.0
    assert np.ptp(run.advance(30)["policy.parameters"][:, 10:], axis=1).max() == 0
    assert run["policy.spread"] == 0
    assert run.compilations == 1
    block = timlab.Learner(2, 1, settings_of("neighbours")).retuned({"spread": 0.5})
    assert timlab.Learner(2, 1, block.settings) == block
    assert "spread = 0.5" in block.settings


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"kind": "sparse"}, r"settings\.kind = 'sparse'"),
        ({**settings_of("soft-actor-critic"), "replay": {"hindsight": {}}}, r"settings\.replay\.hindsight = 'given'"),
        ({"kind": "action-value-gradient"}, "real-valued actions"),
        ({"kind": "neighbors"}, "unknown agent"),
    ],
)
def test_what_a_diagram_cannot_do_is_refused_by_name(settings, words):
    with pytest.raises(ValueError, match=words):
        timlab.Learner(2, 1, settings)
