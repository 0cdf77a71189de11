"""Batches that are learned from at once give what one decision after the other gives, for seeds alone and together."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad._linear_algebra import _libraries, linear_solve, one_thread, positive_solve
from motorgrad.learning import (
    SGD,
    Agent,
    Estimator,
    Exponential,
    Features,
    FisherMetric,
    LeastSquares,
    LinearCritic,
    MeanReward,
    RewardScaling,
    RootMeanSquare,
    Transition,
    Window,
)
from motorgrad.policies import FeatureMap, bounded_hyperplanes, hyperplanes, recurrent, softmax, trainable

BATCH = 11
DIVERGED = [0, 5, BATCH]
"""Decisions that diverge: the first of the stream, one in the first batch, and one at its end."""
DECISIONS = 3 * BATCH + len(DIVERGED)
FEATURES = FeatureMap(nonlinear=4)
POLICIES = {
    "binary": lambda: hyperplanes(3, 2, features=FEATURES),
    "graded": lambda: bounded_hyperplanes(3, 2, density="squashed", features=FEATURES),
    "alternatives": lambda: softmax(3, 3, features=FEATURES),
}


def made(kind, gather=True, **changes):
    critic = LinearCritic(
        Features(squares=True, actions=True), 0.9, 0.8, LeastSquares(0.02, damping=0.1, interval=BATCH)
    )
    given = {
        "trace": Exponential(0.7),
        "baseline": critic,
        "update_every": BATCH,
        "normalization": RootMeanSquare(0.05),
        "entropy": 0.1,
        "reward_scaling": RewardScaling(0.9),
    }
    return Agent(
        POLICIES[kind](),
        Estimator(**{**given, **changes}),
        SGD(0.5),
        FisherMetric(0.02, 0.1, 0.5, kl=0.05),
        gather=gather,
    )


def stream(seed):
    """What a world showed and paid, with ends of both kinds, and decisions that diverged."""
    random = np.random.default_rng(seed)
    looks = random.normal(size=(DECISIONS + 1, 3)).astype(np.float32)
    flags = {
        "terminated": random.random(DECISIONS) < 0.1,
        "truncated": random.random(DECISIONS) < 0.1,
        "diverged": np.isin(np.arange(DECISIONS), DIVERGED),
    }
    rewards = random.normal(size=DECISIONS).astype(np.float32)
    uniforms = random.random((DECISIONS, 2)).astype(np.float32)
    return looks[:-1], looks[1:], rewards, uniforms, flags


@functools.partial(jax.jit, static_argnums=0)
def learned(learner, streams):
    """The states of seeds after their streams of decisions."""

    def one(stream):
        def decide(state, decision):
            look, after, reward, uniforms, flags = decision
            state, action = learner.act(state, look, uniforms[: learner.first_policy(jax.random.key(0)).uniforms])
            transition = Transition(look, action, reward, after, **flags)
            return learner.update(learner.observe(state, transition)), None

        return jax.lax.scan(decide, learner.init(jax.random.key(0)), stream)[0]

    return jax.vmap(one)(streams)


class Static:
    """A learner as a static argument."""

    def __init__(self, agent):
        self.agent = agent

    def __getattr__(self, name):
        return getattr(self.agent, name)


@pytest.mark.parametrize("kind", POLICIES)
def test_a_batch_at_once_is_one_decision_after_the_other_but_for_rounding(kind):
    streams = jax.tree.map(lambda *seeds: np.stack(seeds), *(stream(seed) for seed in range(3)))
    at_once, in_turn = (learned(Static(made(kind, gather)), streams) for gather in (True, False))
    assert at_once.gathered is not None
    assert in_turn.gathered is None
    for part in ("policy", "chain"):
        pairs = [jax.tree.leaves(trainable(s.policy) if part == "policy" else s.chain) for s in (at_once, in_turn)]
        for one, other in zip(*pairs, strict=True):
            np.testing.assert_allclose(one, other, rtol=2e-4, atol=2e-5, err_msg=part)
    for path in (lambda s: s.estimator.baseline.weights, lambda s: s.estimator.baseline.fit.means.mean):
        for one, other in zip(jax.tree.leaves(path(at_once)), jax.tree.leaves(path(in_turn)), strict=True):
            np.testing.assert_allclose(one, other, rtol=2e-3, atol=2e-4)
    moved = [np.abs(leaf).max() for leaf in jax.tree.leaves(trainable(at_once.policy))]
    assert max(moved) > 0.05


def test_seeds_alone_learn_the_same_bit_for_bit_as_together():
    learner = Static(made("graded"))
    streams = jax.tree.map(lambda *seeds: np.stack(seeds), *(stream(seed) for seed in range(3)))
    together = learned(learner, streams)
    alone = learned(learner, jax.tree.map(lambda part: part[1:2], streams))
    pairs = zip(jax.tree.leaves(alone.policy), jax.tree.leaves(together.policy), strict=True)
    assert all(np.array_equal(one[0], other[1]) for one, other in pairs)


@pytest.mark.parametrize(
    "changes",
    [
        {"baseline": MeanReward()},
        {"update_every": 1},
        {"update_every": BATCH + 1},
        {"entropy_in": "trace"},
        {"trace": Window(3)},
    ],
)
def test_what_cannot_be_learned_at_once_is_learned_in_turn(changes):
    assert made("binary", **changes).init(jax.random.key(0)).gathered is None


def test_a_policy_that_remembers_and_several_environments_learn_in_turn():
    agent = made("binary")
    assert agent.init(jax.random.key(0)).gathered is not None
    assert agent.fed_by_several().init(jax.random.key(0)).gathered is None
    remembering = dataclasses.replace(agent, policy=recurrent(3, 2), metric=None)
    assert remembering.init(jax.random.key(0)).gathered is None


def test_another_policy_drops_the_decisions_of_the_one_before():
    agent = made("binary")
    state = agent.init(jax.random.key(0))
    state = state._replace(gathered=state.gathered._replace(waiting=state.gathered.waiting + 5))
    after = agent.set_policy(state, POLICIES["binary"]()).gathered
    assert (int(after.waiting), bool(after.fresh)) == (0, True)


def test_solvers_of_an_update_have_one_thread_and_others_as_many_as_before():
    libraries = _libraries()
    before = [library["num_threads"] for library in libraries.info()]
    with one_thread():
        assert {library["num_threads"] for library in libraries.select(user_api="blas").info()} == {1}
    assert [library["num_threads"] for library in libraries.info()] == before


@pytest.mark.parametrize("solver", [linear_solve, positive_solve])
def test_solvers_take_one_matrix_at_a_time(solver):
    """Two that share several matrices among XLA's threads may wait for each other for ever."""
    matrices = jnp.stack([jnp.eye(40) * (1 + i) for i in range(6)]).reshape(2, 3, 40, 40)
    right = jnp.ones((2, 3, 40))
    compiled = jax.jit(jax.vmap(jax.vmap(solver))).lower(matrices, right).compile()
    calls = [line for line in compiled.as_text().splitlines() if "custom_call_target=" in line]
    assert calls
    assert not any("f32[2,3,40,40]" in line or "f32[6,40,40]" in line or "f32[3,40,40]" in line for line in calls)
    found = compiled(matrices, right)
    np.testing.assert_allclose(found[..., 0], 1 / jnp.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]), rtol=1e-6)
