"""Counts at the end of their numbers: they stand still, or begin again where that means nothing."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad._running import RunningMean, add_sample, counted_on, counted_round, running_mean
from motorgrad.learning import (
    SGD,
    Adam,
    Agent,
    Annealed,
    BinnedBaseline,
    Estimator,
    Plateau,
    PolyakAveraging,
    Replay,
    ValueBasedCentring,
    Visited,
)
from motorgrad.learning._schedules import at
from motorgrad.policies import Hyperplanes, trainable

LAST = {np.dtype(np.int32): 2**31 - 1, np.dtype(np.uint32): 2**32 - 1}


def at_end(count, before=1):
    """An array of this type and shape, that many counts before its last number."""
    return jnp.full(jnp.shape(count), LAST[np.dtype(count.dtype)] - before, count.dtype)


def end(count):
    return np.all(np.asarray(count) == LAST[np.dtype(count.dtype)])


@pytest.fixture(scope="module")
def policy():
    return Hyperplanes([[0.0, 0.0]], [0.0])


@pytest.mark.parametrize("dtype", LAST)
def test_a_count_stands_still_at_its_last_number(dtype):
    last = LAST[dtype]
    counts = jnp.asarray([0, 2**30, last - 500, last - 499, last - 1, last], dtype)
    wanted = np.minimum(np.asarray(counts, np.int64) + 500, last)
    np.testing.assert_array_equal(counted_on(counts, 500), wanted)
    assert counted_on(counts).dtype == dtype


@pytest.mark.parametrize("size", [1, 7, 2**30 - 1])
def test_a_round_keeps_its_place_and_that_it_was_made(size):
    count = jnp.uint32(2 * size - 1)
    for made in range(2 * size - 1, 2 * size + 20):
        assert int(count) % size == made % size
        assert size <= int(count) < 2 * size
        count = counted_round(count + 1, size)


@pytest.mark.parametrize("rate", [None, 0.25])
def test_a_mean_goes_on_with_the_weight_of_its_last_count(rate):
    full = running_mean(jnp.zeros(2))
    full = full._replace(mean=jnp.full(2, 3.0), count=at_end(full.count))
    after = full
    for _ in range(3):
        after = add_sample(after, jnp.full(2, 7.0), rate)
    moved = np.asarray(after.mean, float) + np.asarray(after.carry, float)
    wanted = 3 + 4 * 3 / (2**32 - 1) if rate is None else 7 - 4 * 0.75**3
    np.testing.assert_allclose(moved, wanted, rtol=1e-9)
    assert end(after.count)
    assert end(add_sample(full, jnp.zeros(2), None, 500).count)


def test_a_mean_of_rewards_that_follows_errors_counts_to_the_end():
    level = running_mean(jnp.zeros(()))
    level = level._replace(count=at_end(level.count))
    for _ in range(3):
        level = ValueBasedCentring(0.5).follow(level, jnp.ones(()), jnp.ones(()), 0.0)
    assert end(level.count)
    assert level.mean == 1.5


def test_the_bins_of_a_baseline_go_on_learning(policy):
    baseline = BinnedBaseline(bins=2, rate=0.5)
    state = baseline.init(policy, jnp.float32)
    state = state._replace(count=at_end(state.count))
    for _ in range(3):
        state = baseline.learn(state, jnp.asarray([0.2, 0.0]), jnp.asarray(8.0))
    assert baseline.value_at(state, jnp.asarray([0.2, 0.0])) == 7.0
    assert baseline.value_at(state, jnp.asarray([0.7, 0.0])) == 0.0
    np.testing.assert_array_equal(state.count, [2**32 - 1, 2**32 - 2, 2**32 - 1])


def test_an_annealed_rate_stays_at_its_end_and_averaging_goes_on(policy):
    rate = Annealed(1.0, 0.25, 1000)
    agent = Agent(policy, Estimator(), SGD(rate), averaging=PolyakAveraging(2**31 - 2))
    state = agent.init(jax.random.key(0))
    (empty,) = (each for each in state.chain if isinstance(each, RunningMean))
    state = state._replace(steps=at_end(state.steps))
    ones = jax.tree.map(jnp.ones_like, trainable(policy))
    step = eqx.filter_jit(lambda agent, state, ones: agent.chain.step(state, ones))
    for made in range(1, 5):
        if made == 3:  # the mean is as old as it can be
            state = state._replace(chain=(state.chain[0], state.chain[1]._replace(count=at_end(empty.count, 0))))
        state = step(agent, state, ones)
        np.testing.assert_allclose(state.policy.bias, 0.25 * made, rtol=1e-6)
        assert end(state.steps)
    assert at(rate, state.steps) == 0.25
    assert end(state.chain[1].count)
    np.testing.assert_allclose(state.chain[1].mean.bias, 0.375)  # of the first two steps, within 1e-9


def test_optax_counts_to_its_end(policy):
    adam = Adam(1.0)
    state = adam.init(policy)
    (count,) = (leaf for leaf in jax.tree.leaves(state) if leaf.dtype == np.int32)
    state = jax.tree.map(lambda leaf: at_end(leaf) if leaf.dtype == np.int32 else leaf, state)
    for _ in range(3):
        moves, state = adam.update(jax.tree.map(jnp.ones_like, trainable(policy)), state, policy, None, True)
        assert np.isfinite(moves.bias).all()
    (count,) = (leaf for leaf in jax.tree.leaves(state) if leaf.dtype == np.int32)
    assert end(count)


def test_a_memory_of_observations_stays_full():
    visited = Visited(slots=3, every=1)
    state = visited.init(1, jnp.float32)
    state = state._replace(seen=at_end(state.seen), kept=at_end(state.kept))
    for value in (1.0, 2.0, 3.0, 4.0):
        state = visited.observe(state, jnp.asarray([value]), jnp.uint32(5))
        assert 3 <= int(state.kept) < 2**32 - 2
    np.testing.assert_array_equal(np.sort(state.looks[:, 0]), [2, 3, 4])
    assert visited.draw(state, jnp.uint32(5), jnp.zeros(1))[0] in (2, 3, 4)


def test_a_plateau_has_had_windows_for_good():
    criterion = Plateau(window=40)
    state = criterion.init(jnp.float32)
    state = state._replace(windows=at_end(state.windows))
    judge = jax.jit(criterion._judge)
    for _ in range(3):
        state = judge(state)
    assert end(state.windows)


def test_episodes_are_numbered_anew_without_meeting_old_ones():
    replay = Replay(capacity=6, start=2, batch=2)
    kept = replay.init(jnp.zeros(1), jnp.zeros(1), jax.random.key(0))
    kept = kept._replace(present=at_end(kept.present))
    add = jax.jit(replay.add)
    for look in range(3):
        kept = replay.restart(add(kept, jnp.full(1, float(look)), jnp.zeros(1), 0.0, jnp.zeros(1), True, False))
    np.testing.assert_array_equal(kept.episode, np.repeat([2**31 - 2, 2**31 - 1, 0], 2))
    assert kept.present == 1
