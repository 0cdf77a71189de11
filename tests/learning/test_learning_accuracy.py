"""Batches that end by their accuracy: when they end, that they are as accurate as they say, and what a run says."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.learning import SGD, Accuracy, Agent, Estimator, Exponential, MeanReward, Transition
from motorgrad.policies import Softmax, softmax
from motorgrad.tasks import ThreeState
from motorgrad.training import stepper_for

POLICY = softmax(2, 2)
POINT = Softmax([[1.0, 1.0], [-1.0, -1.0]])


def lengths_and_means(part, samples, longest):
    """The lengths of the batches of every row of samples, `(rows, samples, 4)`, and their means."""

    def one(state, sample):
        accuracy, total, size = state
        accuracy = part.add(accuracy, sample.reshape(2, 2))
        total, size = total + sample, size + 1
        due = part.reached(accuracy) | (size >= longest)
        out = due, size, total / size
        fresh = part.restart(accuracy), jnp.zeros_like(total), jnp.zeros_like(size)
        return jax.tree.map(lambda a, b: jnp.where(due, a, b), fresh, (accuracy, total, size)), out

    first = part.init(POLICY), jnp.zeros(4), jnp.zeros((), jnp.int32)
    run = jax.jit(jax.vmap(lambda rows: jax.lax.scan(one, first, rows)))
    (accuracy, *_), (due, size, mean) = run(jnp.asarray(samples, jnp.float32))
    due = np.asarray(due)
    return np.asarray(size)[due], np.asarray(mean)[due], accuracy


@pytest.mark.parametrize(("error", "kept"), [(0.4, 0.0), (0.2, 0.0), (0.5, 0.9)])
def test_a_batch_is_as_long_as_its_noise_demands_and_as_accurate_as_it_says(error, kept):
    rng = np.random.default_rng(0)
    noise = rng.normal(size=(40, 30_000, 4))
    for row in range(1, noise.shape[1]):  # neighbours are correlated as by a trace
        noise[:, row] = kept * noise[:, row - 1] + np.sqrt(1 - kept**2) * noise[:, row]
    truth = np.array([0.3, -0.2, 0.1, 0.4])
    part = Accuracy(error, block=50 if kept else 5, least=10)
    length, mean, accuracy = lengths_and_means(part, truth + noise, 10**6)
    needed = 4 / (truth @ truth) / error**2 * (1 + kept) / (1 - kept)
    assert length.mean() == pytest.approx(needed, rel=0.35)
    off = np.sqrt(np.square(mean - truth).sum(1).mean() / (truth @ truth))
    assert off == pytest.approx(error, rel=0.35)
    assert int(accuracy.unsure.sum()) == 0
    assert int(accuracy.steps.sum()) == len(length)


def test_a_batch_without_a_gradient_ends_at_its_greatest_length_and_says_so():
    noise = np.random.default_rng(1).normal(size=(2, 900, 4))
    length, _, accuracy = lengths_and_means(Accuracy(0.1, block=5), noise, 90)
    assert (length == 90).all()
    np.testing.assert_array_equal(accuracy.unsure, accuracy.steps)
    none, _, _ = lengths_and_means(Accuracy(1.0, block=5), np.zeros((1, 300, 4)), 90)
    assert (none == 25).all()  # without noise, nothing is as certain


def agent(learning_rate=0.0, **settings):
    estimator = Estimator(Exponential(0.8), MeanReward(), update_every=2_000, accuracy=Accuracy(**settings))
    return Agent(POINT, estimator, SGD(learning_rate))


def test_an_agent_moves_where_a_block_ends_and_a_run_says_how_often_it_was_unsure():
    stepper = stepper_for(ThreeState(), agent(error=1.0, block=40, least=3), range(8))
    stepper.advance(1_200)
    state = stepper.state["cycle"].agent
    assert (np.asarray(state.accuracy.steps) > 0).all()
    held = 40 * np.asarray(state.accuracy.mean.count) + np.asarray(state.accuracy.waiting)
    np.testing.assert_array_equal(state.gradient.count, held)
    share = np.asarray(agent(error=1.0, block=40).readings(jax.tree.map(lambda x: x[0], state))["unsure"])
    assert share == 0


def test_leaving_updates_out_until_one_may_be_due_changes_nothing():
    learner = agent(0.5, error=3.0, block=7, least=2)
    decide = jax.jit(lambda s, y, u, r: _decide(learner, s, y, u, r))
    update = jax.jit(lambda s: learner.update(s))
    states = []
    for every in (True, False):
        state = learner.init(jax.random.key(0))
        rng = np.random.default_rng(2)
        rest = 0
        for _ in range(60):
            look, uniform, reward = rng.uniform(size=2), rng.uniform(size=1), rng.normal() + 1
            state = decide(state, *map(jnp.float32, (look, uniform, reward)))
            if every or rest <= 0:
                state = update(state)
                rest = int(learner.decisions_until_due(state))
            else:
                rest -= 1
        states.append(state)
    assert int(states[0].accuracy.steps) > 0
    jax.tree.map(np.testing.assert_array_equal, *states)


def _decide(learner, state, look, uniform, reward):
    state, action = learner.act(state, look, uniform)
    return learner.observe(state, Transition(look, action, reward, look))


def test_a_batch_without_room_for_its_blocks_is_refused():
    with pytest.raises(ValueError, match=r"^update_every = 99: must be a number of at least 100 samples"):
        Estimator(update_every=99, accuracy=Accuracy())
    with pytest.raises(ValueError, match=r"^update_every = 'episode'"):
        Estimator(update_every="episode", accuracy=Accuracy())
