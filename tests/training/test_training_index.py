"""Sparse learners in training: resumed bit for bit, each seed by its own, read as others are, and refused by name."""

import dataclasses

import jax
import numpy as np
import pytest
from training_examples import assert_differ, assert_same, assert_same_run, columns

import motorgrad as mg
from motorgrad.learning import SparseLearner, SpatialIndex
from motorgrad.policies import LocalGaussians, tiles
from motorgrad.training import agent_for, evaluate, stepper_for

TASK = mg.make("particle", units=128)
CHANGES = {
    "kind": "sparse",
    "policy.width": 0.08,
    "learning_rate": {"centre": 1e-3, "log_width": 4e-3},
    "index.neglect": 0.01,
}


def go(out=None, steps=1500, seeds=(3, 0, 8), **options):
    return mg.train(TASK, CHANGES, steps, list(seeds), out, window=100, progress=False, **options)


def tables(stepper):
    """How many tables a stepper makes from now on, counted as it makes them."""
    made, refresh = [], stepper._refresh

    def count():
        made.append(int((np.asarray(stepper._carry[0].agent.index.moved) > 0.75).sum()))
        refresh()

    stepper._refresh = count
    return made


def engine(steps_at_a_time, steps=900, seeds=(3, 0, 8)):
    stepper = stepper_for(TASK, agent_for(TASK, CHANGES), seeds)
    made = tables(stepper)
    while stepper.decision < steps:
        stepper.advance(min(steps_at_a_time, steps - stepper.decision))
    return stepper, sum(made)


@pytest.mark.slow
def test_a_run_is_resumed_bit_for_bit(tmp_path):
    whole = go(tmp_path / "whole")
    go(tmp_path / "parts", steps=730)
    parts = go(tmp_path / "parts")
    assert_same_run(mg.load(parts.path), mg.load(whole.path))
    assert_differ(whole.policies, go(steps=730).policies)
    assert_same(mg.load(whole.path).policies, whole.policies)


@pytest.mark.slow
def test_what_is_learned_does_not_depend_on_how_many_decisions_are_asked_for_at_a_time():
    (whole, made), (parts, _) = engine(900), engine(77)
    assert made > 3 + 3  # beside the first of each seed
    assert_same(whole.state, parts.state)
    # where saved, there are no tables; put back, there are the same
    parts.restore(whole.state)
    parts.advance(300)
    whole.advance(300)
    assert_same(whole.state, parts.state)
    assert_same(whole._carry[0].agent.index.table, parts._carry[0].agent.index.table)


@pytest.mark.slow
def test_seeds_learn_each_by_itself():
    together, _ = engine(300, 300)
    for row, seed in enumerate((3, 0, 8)):
        alone, _ = engine(300, 300, [seed])
        # another number of lanes may round differently
        for mine, own in zip(*(jax.tree.leaves(each.policies()) for each in (together, alone)), strict=True):
            np.testing.assert_allclose(mine[row], own[0], rtol=1e-4, atol=1e-5)


@pytest.mark.slow
def test_a_run_is_read_as_any_other(tmp_path):
    run = go(tmp_path / "run")
    latest = columns(run.metrics)["parameters"][-3:]
    for row, parameters in enumerate(latest):
        policy = jax.tree.map(lambda leaf, row=row: leaf[row], run.policies)
        np.testing.assert_array_equal(parameters, np.concatenate([policy.centre.ravel(), policy.log_width.ravel()]))
    assert_differ(run.policies, run.initial)
    assert isinstance(run.policy(3), LocalGaussians)
    judged = evaluate(mg.load(run.path), 200)
    np.testing.assert_array_equal(judged.reward, evaluate(run, 200).reward)
    again = mg.train(TASK, CHANGES, 300, [3, 0, 8], initial=run.policies, progress=False)
    for mine, yours in zip(jax.tree.leaves(again.initial), jax.tree.leaves(run.policies), strict=True):
        np.testing.assert_array_equal(mine, yours)


@pytest.mark.ci
def test_policies_that_are_put_in_place_are_learned_from():
    stepper, _ = engine(200, 200)
    other = jax.tree.map(lambda leaf: np.asarray(leaf) + np.float32(0.01), stepper.policies())
    stepper.set_policies(other)
    stepper.advance(1)
    for mine, yours in zip(jax.tree.leaves(stepper.policies().centre), jax.tree.leaves(other.centre), strict=True):
        np.testing.assert_allclose(mine, yours, atol=1e-3)


@pytest.mark.slow
def test_a_table_that_gets_too_small_grows_and_gives_no_seed_other_numbers():
    task, start = mg.make("particle", units=64), tiles(2, 64, copies=2, width=0.01)
    wide = dataclasses.replace(start, log_width=start.log_width + 1.2)
    index = SpatialIndex(cells=4)
    agent = SparseLearner(start, decay=0.9, learning_rate=0.0, index=index)
    stepper = stepper_for(task, agent, [0, 1])
    stepper.advance(100)
    room = stepper._carry[0].agent.index.table.shape[-1]
    grown = jax.tree.map(lambda narrow, broad: np.stack([narrow, broad]), start, wide)
    stepper.set_policies(grown)
    stepper.advance(100)
    assert stepper._carry[0].agent.index.table.shape[-1] > room
    alone = stepper_for(task, agent, [0])
    alone.advance(200)
    for mine, own in zip(*(jax.tree.leaves(each.state["world"]) for each in (stepper, alone)), strict=True):
        np.testing.assert_allclose(mine[0], own[0], rtol=1e-5)


@pytest.mark.slow
def test_what_is_neglected_is_so_in_training_too():
    stepper = stepper_for(TASK, agent_for(TASK, CHANGES), [4, 5])
    worst = 0.0
    for _ in range(600):
        stepper.advance(1)
        stepper._refresh()
        cycle = stepper._carry[0]
        index = cycle.agent.index
        for row in range(2):
            look = np.asarray(cycle.observation[:, row])
            policy = jax.tree.map(lambda leaf, row=row: leaf[..., row], cycle.agent.policy)
            sides = round(index.table.shape[1] ** 0.5)
            place = np.clip(np.floor((look - index.low[row]) / index.size[row]), 0, sides - 1).astype(int)
            near = np.asarray(index.table[row, place[0] * sides + place[1]])
            worst = max(worst, np.asarray(policy.prob(look))[np.setdiff1d(np.arange(128), near)].max(initial=0))
    assert 0.0002 < worst <= 0.01 * (1 + 1e-4)


def test_settings_make_a_sparse_learner():
    agent = agent_for(TASK, CHANGES)
    assert isinstance(agent, SparseLearner)
    assert agent.index == SpatialIndex(0.01)
    assert not isinstance(agent_for(TASK), SparseLearner)


@pytest.mark.parametrize(
    ("task", "changes", "said"),
    [
        ("particle", {"index.neglect": 2.0}, "agent.index.neglect = 2.0: must be in"),
        ("particle", {"index.margin": -1.0}, "agent.index.margin = -1.0: must be"),
        ("particle", {"policy": "hyperplanes", "learning_rate": 1e-3}, "policy = 'Hyperplanes'"),
        ("particle", {"trace": "window"}, r"unknown setting of agent .trace.: known are"),
        ("particle", {"optimizer": "adam"}, r"unknown setting of agent .optimizer.: known are"),
        ("particle", {"metric": "fisher"}, r"unknown setting of agent .metric.: known are"),
        ("hopper", {"policy": "gaussians", "learning_rate": 1e-3}, "task = 'hopper': must be a task in a JAX world"),
    ],
)
def test_what_cannot_be_indexed_is_refused_before_any_work(task, changes, said):
    with pytest.raises(ValueError, match=said):
        mg.train(task, {"kind": "sparse", **changes}, 10, progress=False)


def test_a_plain_learner_has_no_index_to_change():
    with pytest.raises(ValueError, match=r"unknown setting of agent 'index'"):
        agent_for(TASK, {"index.neglect": 0.01})
