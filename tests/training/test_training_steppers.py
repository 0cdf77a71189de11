"""Both engines, over every registered task: what they compute depends on nothing but the seed and the decision."""

import jax
import numpy as np
import pytest
from training_examples import assert_differ, assert_same, learner, one_of_each_kind, reborn

from motorgrad._random import BLOCK, draw_block, key_of
from motorgrad.tasks import TASKS
from motorgrad.training import agent_for, stepper_for

SEEDS = [3, 0, 11]
MORE, AMONG = [5, 3, 11, 8, 0], [1, 4, 2]  # others with them, and where they are then
DECISIONS = 300

assert BLOCK < DECISIONS  # or nothing here would cross a block's border


def numbers(stepper):
    """The state without the count of decisions."""
    return {name: part for name, part in stepper.state.items() if name != "decision"}


def row_of(tree, rows):
    return {name: leaf[rows] for name, leaf in flat(tree).items()}


def flat(tree):
    return {jax.tree_util.keystr(path): leaf for path, leaf in jax.tree_util.tree_leaves_with_path(tree)}


@pytest.mark.representatives("chain", "hopper")
@pytest.mark.parametrize("name", one_of_each_kind())
def test_neither_chunks_nor_another_engine_change_a_bit(name):
    at_once = learner(name, SEEDS)
    begun = at_once.state
    at_once.advance(DECISIONS)
    for chunks in ([100, 100, 100], [1, 7, DECISIONS - 8]):
        in_parts = learner(name, SEEDS)
        for chunk in chunks:
            in_parts.advance(chunk)
        assert_same(in_parts.state, at_once.state)
    assert at_once.decision == DECISIONS
    assert_differ(at_once.state, begun)


@pytest.mark.representatives("chain", "hopper")
@pytest.mark.parametrize("name", one_of_each_kind())
def test_a_restored_stepper_goes_on_exactly_as_the_one_that_was_saved(name):
    saved, fresh = learner(name, SEEDS), learner(name, SEEDS)
    saved.advance(BLOCK - 5)
    state = saved.state
    saved.advance(50)
    assert_differ(saved.state, state)
    fresh.advance(10)  # it need not be new
    fresh.restore(state)
    assert fresh.decision == BLOCK - 5
    assert_same(fresh.state, state)
    fresh.advance(50)
    assert_same(fresh.state, saved.state)


@pytest.mark.representatives("chain", "hopper")
@pytest.mark.parametrize("name", one_of_each_kind())
def test_a_state_is_a_copy_that_later_decisions_leave_alone(name):
    stepper = reborn(name, SEEDS)
    stepper.advance(20)
    state = stepper.state
    kept = {name: np.array(leaf) for name, leaf in flat(state).items()}
    stepper.advance(20)
    assert_same(flat(state), kept)


@pytest.mark.representatives("chain", "hopper")
@pytest.mark.parametrize("name", one_of_each_kind())
def test_seeds_lead_every_array_of_the_state(name):
    stepper = reborn(name, SEEDS)
    assert {leaf.shape[0] for leaf in flat(numbers(stepper)).values()} == {len(SEEDS)}


@pytest.mark.representatives("chain", "hopper")
@pytest.mark.parametrize("name", one_of_each_kind())
def test_a_harvest_disturbs_nothing_but_its_own_tallies(name):
    def untallied(stepper):
        return {name: leaf for name, leaf in flat(stepper.state).items() if "tally" not in name}

    left_alone = reborn(name, SEEDS)
    left_alone.advance(120)
    wanted, reward = untallied(left_alone), left_alone.harvest()["reward"]
    looked_at, totals = reborn(name, SEEDS), 0.0
    for _ in range(3):
        looked_at.advance(40)
        totals = totals + looked_at.harvest()["reward"].astype(float)
    assert_same(untallied(looked_at), wanted)
    np.testing.assert_allclose(totals, reward, rtol=1e-5, atol=1e-4)
    assert not looked_at.harvest()["reward"].any()


@pytest.mark.parametrize("purpose", ["policy", "world", "observe"])
def test_a_seeds_random_numbers_depend_on_no_other_seed(purpose):
    few, many = draw_block([3, 0], purpose, 7, 4), draw_block([0, 5, 3, 11], purpose, 7, 4)
    np.testing.assert_array_equal(many[..., [2, 0]], few)


def test_random_numbers_differ_between_seeds_purposes_and_blocks():
    drawn = [draw_block([seed], purpose, block, 4) for seed in (0, 1) for purpose in "ab" for block in (0, 1)]
    assert len({np.asarray(numbers).tobytes() for numbers in drawn}) == 8


@pytest.mark.parametrize("precise", [False, True])
def test_random_numbers_are_those_of_jax(precise):
    with jax.enable_x64(precise):
        for seed, block in ((0, 0), (3, 2**32 - 1)):
            drawn = draw_block([1, seed], "policy", np.uint32(block), 3)[..., 1]
            key = jax.random.fold_in(key_of(seed, "policy"), np.uint32(block))
            np.testing.assert_array_equal(drawn, jax.random.uniform(key, (BLOCK, 3)))


@pytest.mark.ci
@pytest.mark.representatives("hopper")  # of worlds, and of what is learned there: below
@pytest.mark.parametrize("name", one_of_each_kind())
def test_another_seed_changes_no_bit_of_an_untrained_agents_life(name):
    # Nothing is learned, so the actions are the random numbers': world, physics and what is seen are equal in every
    # bit.
    few, many = (reborn(name, seeds, mode="sample") for seeds in (SEEDS, MORE))
    for _ in range(3):
        few.advance(50)
        many.advance(50)
        assert_same(row_of(numbers(many), AMONG), row_of(numbers(few), [0, 1, 2]))
    assert_differ(row_of(numbers(many), [0]), row_of(numbers(many), [1]))


@pytest.mark.ci
@pytest.mark.representatives("chain")  # of bodies: test_training_side_by_side.py
@pytest.mark.parametrize("name", one_of_each_kind())
def test_another_seed_changes_a_learner_by_no_more_than_rounding(name):
    few, many = (reborn(name, seeds) for seeds in (SEEDS, MORE))
    few.advance(30)
    many.advance(30)
    for place, leaf in row_of(numbers(few), [0, 1, 2]).items():
        other = row_of(numbers(many), AMONG)[place]
        if leaf.dtype.kind == "f":
            np.testing.assert_allclose(other, leaf, rtol=1e-4, atol=1e-6, err_msg=place)
        else:
            np.testing.assert_array_equal(other, leaf, err_msg=place)


def test_the_number_of_threads_changes_no_bit():
    task = TASKS["hopper"]()
    agent = agent_for(task)
    one, three = (stepper_for(task, agent, SEEDS, threads=threads) for threads in (1, 3))
    one.advance(40)
    three.advance(40)
    assert_same(one.state, three.state)


@pytest.mark.representatives("chain", "hopper")
@pytest.mark.parametrize("name", one_of_each_kind())
def test_frozen_policies_act_and_do_not_learn(name):
    stepper = reborn(name, SEEDS, mode="sample")
    before = stepper.policies()
    stepper.advance(60)
    assert_same(stepper.policies(), before)


@pytest.mark.representatives("chain", "hopper")
@pytest.mark.parametrize("name", one_of_each_kind())
def test_used_policies_are_those_that_act(name):
    taught, frozen = reborn(name, SEEDS), reborn(name, SEEDS, mode="sample")
    taught.advance(200)
    assert_differ(taught.policies(), frozen.policies())
    frozen.set_policies(taught.policies())
    assert_same(frozen.policies(), taught.policies())
    frozen.advance(20)
    assert_same(frozen.policies(), taught.policies())


def test_a_policy_that_does_not_fit_the_task_is_refused_by_name():
    agents = {name: learner(name, [0]).cycle.agent for name in ("hopper", "three-state")}
    for name, other in (("hopper", "three-state"), ("three-state", "hopper")):
        with pytest.raises(ValueError, match=rf"policy \w+: inputs = \d, but the task '{name}' has"):
            stepper_for(TASKS[name](), agents[other], [0])
