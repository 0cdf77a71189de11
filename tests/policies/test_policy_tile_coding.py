"""Tile coding: which cells are active, what is shared with a neighbour, hashing, and ignored inputs."""

import itertools
import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from policy_examples import compiled

import motorgrad as mg
from motorgrad.export import read
from motorgrad.learning import Features, LinearCritic
from motorgrad.policies import FeatureMap, Hyperplanes, TileCoding, hyperplanes, softmax
from motorgrad.schema import table


@compiled
def expanded(features, observation):
    return features.expanded(observation)


def shared(features, one, other):
    """How many active cells two inputs have in common."""
    return float(expanded(features, np.float32(one)) @ expanded(features, np.float32(other)))


def test_the_cells_of_one_input_are_those_computed_by_hand():
    """Two tilings of four cells over [0, 1]: the second is shifted by half a cell."""
    features = TileCoding(tilings=2, cells=4, low=0.0, high=1.0)
    assert features.size(1) == 10
    for y, first, second in ((0.0, 0, 0), (0.12, 0, 0), (0.13, 0, 1), (0.3, 1, 1), (0.4, 1, 2), (0.99, 3, 4)):
        wanted = np.zeros(10)
        wanted[[first, 5 + second]] = 1
        np.testing.assert_array_equal(expanded(features, np.float32([y])), wanted)
    for beyond, inside in ((-9.0, 0.0), (9.0, 1.0)):
        np.testing.assert_array_equal(*(expanded(features, np.float32([y])) for y in (beyond, inside)))


def test_the_cells_of_two_inputs_are_those_computed_by_hand():
    """Four tilings of two cells over [-1, 1]: tiling k is shifted by k/4 and 3k/4 of a cell, without the whole ones."""
    features = TileCoding(tilings=4, cells=2)
    y = (-0.3, 0.4)  # 0.7 and 1.4 cells from the lower end
    places = [(0, 1), (0, 2), (1, 1), (1, 1)]  # 0.7 + (0, 1/4, 2/4, 3/4), 1.4 + (0, 3/4, 2/4, 1/4)
    wanted = [9 * tiling + 3 * first + second for tiling, (first, second) in enumerate(places)]
    np.testing.assert_array_equal(np.flatnonzero(expanded(features, np.float32(y))), wanted)


def test_what_is_learned_spreads_to_neighbours_and_no_farther_than_a_cell():
    features = TileCoding(tilings=8, cells=4, low=0.0, high=1.0)
    found = [shared(features, (0.5, 0.5), (0.5 + d / 4, 0.5)) for d in (0, 0.26, 0.51, 0.76, 1.01)]
    assert found[0] == 8
    assert found[-1] == 0
    assert np.all(np.diff(found) < 0)
    pool = Hyperplanes(np.zeros((1, features.size(2))), np.zeros(1))
    cell = expanded(features, np.float32([0.5, 0.5]))
    step = 0.1 * np.asarray(pool.score(cell, jnp.ones(1)).weights)  # a step of learning at one place
    near, far = ((step @ expanded(features, np.float32(y))).item() for y in ((0.55, 0.5), (0.9, 0.5)))
    assert near > 0.2
    assert far == 0


def test_tilings_of_the_same_inputs_differ_and_each_sees_so_many():
    features = TileCoding(tilings=6, cells=3, sees=1, low=0.0, high=1.0)
    assert features.size(3) == 6 * 4
    seen = np.float32([0.2, 0.5, 0.8])
    before = np.asarray(features.active(seen))
    for ignored in range(3):
        other = seen.copy()
        other[ignored] = 0.9 - 0.7 * (ignored == 2)
        changed = before != np.asarray(features.active(other))
        np.testing.assert_array_equal(changed, np.arange(6) % 3 == ignored)
    looks = np.repeat(np.linspace(0, 1, 200, dtype=np.float32)[:, None], 3, axis=1)
    cells = np.asarray(jax.vmap(features.active)(looks)) % 4
    assert (cells[:, 0] != cells[:, 3]).any()  # shifted against each other


def test_all_choices_of_inputs_take_turns():
    features = TileCoding(tilings=7, cells=2, sees=2)
    assert features.size(4) == 7 * 9
    which = mg.policies._tile_coding._tilings(7, 4, 2)[0]
    assert which[:6].tolist() == [list(each) for each in itertools.combinations(range(4), 2)]
    assert which[6].tolist() == [0, 1]


def test_hashed_cells_share_a_table_and_spread_over_it():
    features = TileCoding(tilings=8, cells=10, low=0.0, high=1.0, slots=64, seed=1)
    assert features.size(6) == 64  # instead of 8 * 11 ** 6
    looks = np.random.default_rng(0).random((4_000, 6), np.float32)
    found = np.asarray(jax.vmap(features.expanded)(looks))
    assert (found.sum(1) == 8).all()
    assert found.max() > 1  # two cells of an input in one slot count twice
    share = found.mean(0) / 8
    assert share.max() < 2 / 64
    assert share.min() > 0.5 / 64
    other = TileCoding(tilings=8, cells=10, low=0.0, high=1.0, slots=64, seed=2)
    assert not np.array_equal(other.active(looks[0]), features.active(looks[0]))


def test_the_hashing_of_a_seed_never_changes():
    """A stored policy of hashed features is worth nothing under others."""
    features = TileCoding(tilings=3, cells=4, slots=100, seed=1)
    assert np.asarray(features.active(np.float32([0.1, -0.4]))).tolist() == FROZEN


FROZEN = [68, 52, 87]


def test_actors_and_critics_see_tiles():
    tiles = TileCoding(tilings=2, cells=3, low=0.0, high=1.0)
    policy = hyperplanes(2, 4, features=FeatureMap(tiles=tiles, raw=False))
    assert policy.pool.inputs == 2 * 16
    assert softmax(2, 3, features=FeatureMap(tiles=tiles)).pool.inputs == 2 + 2 * 16
    critic = LinearCritic(Features(tiles=tiles, raw=False))
    assert critic.features(jnp.array([0.2, 0.9])).shape == (33,)
    assert float(jnp.sum(critic.features(jnp.array([0.2, 0.9])))) == 3
    task = mg.make("particle")
    agent = mg.agent_for(task, {"policy.kind": "hyperplanes", "policy.features.tiles.cells": 5}, learning_rate=0.01)
    assert agent.policy.features == FeatureMap(tiles=TileCoding(cells=5))
    assert json.loads(json.dumps(table(agent.policy)))["features"]["tiles"]["cells"] == 5


@pytest.mark.parametrize("slots", [None, 20])
@pytest.mark.parametrize("ending", ["c", "npz"])
def test_policies_of_tiles_are_exported(tmp_path, slots, ending):
    tiles = TileCoding(tilings=3, cells=2, slots=slots)
    policy = hyperplanes(2, 2, features=FeatureMap(tiles=tiles, raw=False))
    path = policy.export(tmp_path / f"policy.{ending}")
    if ending == "npz":
        weights = np.random.default_rng(0).normal(size=policy.pool.weights.shape)
        policy = mg.policies.Featured(Hyperplanes(weights, np.zeros(2)), policy.features, 2)
        found = read(policy.export(path))["prob"](observation=np.float32([0.3, -0.8]))
        np.testing.assert_allclose(found["prob"], policy.prob(np.float32([0.3, -0.8])), rtol=1e-5)


@pytest.mark.parametrize(
    ("build", "names"),
    [
        (lambda: TileCoding(low=1.0, high=0.0), "low, high = (1.0, 0.0)"),
        (lambda: TileCoding(tilings=0), "tilings = 0: must be"),
        (lambda: TileCoding(slots=70_000), "slots = 70"),
        (lambda: TileCoding(sees=3).size(2), "sees = 3: must be at most the 2 inputs"),
        (lambda: TileCoding(cells=9).size(8), "cells = 9: must be such that there are at most 100,000 features"),
        (lambda: FeatureMap(raw=False), "raw = False: must be True where there are no other features"),
    ],
)
def test_impossible_tilings_are_refused_by_name(build, names):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        build()
    assert names in str(error.value)
