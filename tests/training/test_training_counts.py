"""Engines beyond 2³² decisions: they go on, with random numbers that were not drawn before."""

import numpy as np
import pytest
from training_examples import assert_differ, assert_same, learner, reborn

import motorgrad as mg
from motorgrad._random import BLOCK
from motorgrad.training import PolicyScore, agent_for
from motorgrad.training._arguments import check_training

SEEDS, LATE = [3, 0, 11], 2**32 - 5
LAST = 2**32 * BLOCK


def put(stepper, decision):
    """The engine in its present state, but after so many decisions."""
    stepper.restore({**stepper.state, "decision": np.array(decision)})
    return stepper


@pytest.mark.parametrize("name", ["chain", "hopper"])
def test_decisions_are_counted_on_beyond_32_bits(name):
    late = put(reborn(name, SEEDS), LATE)
    late.advance(150)
    at_once, drawn = late.state, {}
    late = put(reborn(name, SEEDS), LATE)
    for decisions in (4, 1, 1, 144):
        late.advance(decisions)
    assert late.decision == 2**32 + 145
    assert_same(late.state, at_once)
    for begun in (0, 2**32 // 2, 2**32):  # blocks of random numbers that are none of each other
        stepper = put(reborn(name, SEEDS), begun)
        stepper.advance(BLOCK)
        drawn[begun] = {**stepper.state, "decision": 0}
    assert_differ(drawn[0], drawn[2**32])
    assert_differ(drawn[2**31], drawn[2**32])


@pytest.mark.ci
def test_a_sparse_learner_counts_on_beyond_32_bits():
    late = put(learner("particle", SEEDS, kind="sparse"), LATE)
    late.advance(150)
    in_parts = put(learner("particle", SEEDS, kind="sparse"), LATE)
    for decisions in (4, 1, 1, 144):
        in_parts.advance(decisions)
    assert in_parts.decision == 2**32 + 145
    assert_same(in_parts.state, late.state)


@pytest.mark.parametrize("name", ["chain", "hopper"])
def test_no_random_numbers_are_drawn_twice(name):
    stepper = put(reborn(name, SEEDS), LAST - 2)
    stepper.advance(1)
    put(stepper, LAST)
    with pytest.raises(ValueError, match=r"549,755,813,888.*begin another run"):
        stepper.advance(1)


def test_one_record_holds_no_more_decisions_than_it_counts():
    with pytest.raises(ValueError, match="window = 2147483648: must be an integer from 1 to 2,147,483,647 decisions"):
        check_training("chain", steps=2**32 - 256, window=2**31)
    assert check_training("chain", steps=2**32 - 256, window=2**31 - 1).steps == 2**32 - 256
    with pytest.raises(ValueError, match="steps = 2147483648: must be an integer from 1 to 2,147,483,647 decisions"):
        mg.evaluate(mg.train("chain", steps=1, progress=False), steps=2**31)
    with pytest.raises(ValueError, match="steps = 2147483648: must be"):
        PolicyScore("chain", agent_for("chain").policy, steps=2**31)
