"""Decisions that nothing periodic follows: skipping what has nothing to do changes nothing that is learned."""

import copy
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from training_examples import assert_differ, assert_same

from motorgrad._compiler import in_one_piece
from motorgrad._packing import LARGE, Packing
from motorgrad.learning import (
    NEVER,
    SGD,
    Agent,
    Annealed,
    Estimator,
    Features,
    FisherMetric,
    Growth,
    LeastSquares,
    LinearCritic,
    PolyakAveraging,
    TemporalDifference,
    Transition,
    gae,
)
from motorgrad.policies import Hyperplanes, hyperplanes
from motorgrad.tasks import Hopper
from motorgrad.training import stepper_for
from motorgrad.training.engines._cycle import Cycle

UPDATE, INTERVAL = 20, 15
CRITIC = LinearCritic(Features(squares=True), 0.9, 0.8, LeastSquares(1e-2, interval=INTERVAL))


GATHERED = 9


def agent(task, update_every=UPDATE, interval=1):
    metric = FisherMetric(0.01, interval=interval, kl=Annealed(0.1, 0.01, 5))
    return Agent(hyperplanes(task), gae(CRITIC, 0.9, update_every), SGD(1.0), metric, averaging=PolyakAveraging(2))


def stepper(complete=False, mode: Any = "learn", interval=1):
    """An engine of two hoppers; `complete`, one that does after every decision everything that might be due."""
    found: Any = stepper_for(Hopper(), agent(Hopper(), interval=interval), [0, 7], mode, threads=1)
    if complete:
        found.program = copy.copy(found.program)  # engines share it
        found.program.learn_only = found.program.learn
    return found


def watched(found):
    """For every decision and seed, whether an update was due."""
    seen = []
    found.program = copy.copy(found.program)  # engines share it
    learn = found.program.learn_each

    def watch(cycles, due, row):
        seen.append(due.tolist())
        return learn(cycles, due, row)

    found.program.learn_each = watch
    return seen


@pytest.mark.ci
@pytest.mark.parametrize("interval", [1, pytest.param(GATHERED, marks=[pytest.mark.slow, pytest.mark.ci])])
def test_what_is_learned_is_the_same_with_and_without_waiting(interval):
    waiting, complete = stepper(interval=interval), stepper(complete=True, interval=interval)
    before = waiting.state
    seen = watched(waiting)
    for found in (waiting, complete):
        found.advance(130)
    due = [t % UPDATE == 0 or t % INTERVAL == 0 for t in range(1, 131)]
    if interval > 1:  # a step empties what has been gathered
        due = [each or t % UPDATE % interval == 0 for t, each in enumerate(due, 1)]
    assert seen == [[each] * 2 for each in due]
    one, other = waiting.state, complete.state
    assert_differ(one, before)
    assert int(one["cycle"].agent.steps[0]) == 130 // UPDATE
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-4, atol=1e-5), one, other)


def test_an_engine_restored_between_two_steps_waits_when_the_saved_one_does():
    saved, fresh = stepper(), stepper()
    saved.advance(UPDATE + 7)
    fresh.restore(saved.state)
    due = watched(saved), watched(fresh)
    for found in (saved, fresh):
        found.advance(2 * UPDATE)
    assert due[0] == due[1]
    assert {*map(tuple, due[0])} == {(True, True), (False, False)}
    assert_same(fresh.state, saved.state)


def test_a_decision_that_diverged_puts_off_the_step_of_its_own_seed_alone():
    found = stepper()
    seen = watched(found)
    found.advance(5)
    found._out = found._out.copy()
    found._out[0, 0] = np.nan  # a control with which the first diverges
    found.advance(1 + 3 * UPDATE)
    learners = found.state["cycle"].agent
    assert found.batch.diverged.tolist() == [1, 0]
    assert learners.steps.tolist() == [3, 3]
    assert learners.gradient.count.tolist() == [5, 6]
    own = {t for t in range(1, 67) if t % UPDATE == 0 or t % INTERVAL == 0}
    for seed, late in enumerate((1, 0)):
        assert {t for t, due in enumerate(seen, 1) if due[seed]} == {t + late for t in own}


def test_a_seed_that_diverged_changes_no_bit_of_another_however_the_two_decisions_round():
    healthy, hurt = stepper(), stepper()
    for found in (healthy, hurt):
        found.program = copy.copy(found.program)  # engines share it
        found.program.learn_only = rounded(found.program.learn_only)
    hurt._out = hurt._out.copy()
    hurt._out[0, 0] = np.nan
    for found in (healthy, hurt):
        found.advance(3 * UPDATE)
    assert hurt.batch.diverged.tolist() == [1, 0]
    one, other = (jax.tree.map(lambda leaf: leaf[1], found.state["cycle"]) for found in (healthy, hurt))
    assert_same(other, one)
    np.testing.assert_array_equal(hurt.batch.packed[1], healthy.batch.packed[1])


def rounded(learn):
    """A compiled decision whose controls are other than those of the other one in a late digit."""

    def call(*told):
        cycles, out = learn(*told)
        out = out.copy()
        out[:, 0] *= 1 - 1e-4
        return cycles, out

    return call


@pytest.mark.ci
def test_frozen_policies_always_wait():
    found = stepper(mode="sample")
    seen = watched(found)
    found.advance(50)
    assert seen == [[False, False]] * 50


def test_updates_wait_for_the_nearest_that_is_due():
    y, policy = jnp.array([0.5, -0.2]), Hyperplanes(np.zeros((3, 2)), np.zeros(3))
    learner = Agent(policy, gae(CRITIC, 0.9, UPDATE), SGD(1.0), FisherMetric())
    state = jax.jit(lambda key: learner.init(key))(jax.random.key(0))
    left = []
    update = jax.jit(lambda state: learner.update(state))
    until_due = jax.jit(lambda state: learner.decisions_until_due(state))

    @jax.jit
    def live(state):
        state, action = learner.act(state, y, jnp.full(3, 0.3))
        return learner.observe(state, Transition(y, action, jnp.sum(action), y))

    for t in range(1, 61):
        waits = int(until_due(state)) > 0
        state = live(state)
        after = update(state)
        same = jax.tree.map(lambda a, b: bool(np.array_equal(a, b)), after, state)
        assert jax.tree.all(same) == waits == (t % UPDATE != 0 and t % INTERVAL != 0)
        state = after
        left.append(int(until_due(state)))
    assert left[:16] == [*range(13, -1, -1), 4, 3]


@pytest.mark.parametrize(
    ("estimator", "waits", "left"),
    [
        (Estimator(update_every=1), False, 0),
        (Estimator(update_every="episode"), False, 0),
        (Estimator(update_every=5), True, 4),
        (Estimator(update_every="never"), True, NEVER),
        (gae(LinearCritic(fit=TemporalDifference()), update_every=9), True, 8),
        (gae(LinearCritic(fit=LeastSquares(interval=1)), update_every=9), True, 0),
    ],
)
def test_who_waits_and_for_how_long(estimator, waits, left):
    agent = Agent(Hyperplanes(np.zeros((3, 2)), np.zeros(3)), estimator)
    found = agent.decisions_until_due(agent.init(jax.random.key(0)))
    assert Cycle(Hopper(), agent).waits is waits is not isinstance(found, int)
    assert int(found) == left


def test_a_growing_learner_never_waits():
    from motorgrad.policies import LocalGaussians, Masked

    pool = LocalGaussians(np.zeros((3, 2)), np.zeros((3, 2)))
    growing = Agent(Masked(pool, np.array([True, False, False])), Estimator(update_every=5), growth=Growth())
    assert growing.decisions_until_due(growing.init(jax.random.key(0))) == 0


@pytest.mark.parametrize("still", [(), (0, 2, 3)])
def test_a_packed_tree_comes_back_bit_for_bit_and_what_is_still_stands_apart(still):
    large = jnp.arange(LARGE + 1, dtype=jnp.float32)
    tree = {
        "a": jnp.array([np.nan, -0.0]),
        "b": jnp.int32(-3),
        "c": jnp.ones((2, 3)),
        "d": large,
        "e": jnp.array([True]),
    }
    packing = Packing(tree, 1, still)
    packed = jax.jit(packing.pack)(tree)
    jax.tree.map(np.testing.assert_array_equal, jax.jit(packing.unpack)(packed), tree)
    assert set(packed) == {"uint32", "leaf 3"} | ({"still uint32"} if still else set())
    assert packing.still == ({"still uint32", "leaf 3"} if still else set())
    assert packed["uint32"].size == (2 if still else 10)
    assert "leaf 2" in Packing(tree, LARGE).pack(tree)  # six numbers of so many seeds


def test_one_piece_computes_the_same_and_is_compiled_as_one_call():
    def function(carry, x):
        carry = carry + jnp.sin(x) * x[::-1]
        return carry, jnp.sum(carry, keepdims=True) + jnp.concatenate([x, carry])

    x = jnp.linspace(0, 1, 300)
    whole: Any = in_one_piece(function)
    text = whole.lower(jnp.zeros(300), x).compile().as_text()
    main = text[text.index("ENTRY") :]
    assert "xla_cpu_small_call" in main
    assert main.count(" fusion(") <= 1  # the empty output that the loop begins with
    for found, wanted in zip(whole(jnp.zeros(300), x), function(jnp.zeros(300), x), strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-5, atol=1e-6)
