"""Synergies: by name, and found again in activations that were made of them."""

import numpy as np
import pytest

from motorgrad.bodies import Hexapod
from motorgrad.tasks import TRIPOD_SYNERGIES, Hopper, find_synergies, synergy_matrix

GROUPS = Hexapod().groups


def made_of(matrix, decisions=400, seed=0, noise=0.0):
    """Activations of units that fire one by one and together, through a matrix, from 0 to 1."""
    random = np.random.default_rng(seed)
    strength = random.random((decisions, len(matrix))) * random.integers(0, 2, (decisions, len(matrix)))
    return np.clip(strength @ matrix + noise * random.random((decisions, matrix.shape[1])), 0.0, None)


def test_names_and_patterns_make_a_binary_matrix():
    matrix = synergy_matrix(["levator_left_rear", "depressor_right_* levator_left_rear"], GROUPS)
    assert matrix.dtype == np.float32
    assert [np.flatnonzero(row).tolist() for row in matrix] == [
        [GROUPS.index("levator_left_rear")],
        sorted([GROUPS.index("levator_left_rear"), *(n for n, g in enumerate(GROUPS) if g.startswith("depressor_r"))]),
    ]
    assert set(np.unique(matrix)) == {0.0, 1.0}


def test_every_muscle_is_in_one_tripod_synergy():
    np.testing.assert_array_equal(synergy_matrix(TRIPOD_SYNERGIES, GROUPS).sum(0), np.ones(24))


def test_the_hoppers_units_drive_flexors_and_extensors_in_turn():
    task = Hopper(units=5)
    np.testing.assert_array_equal(task.drives, [[1, 0], [0, 1], [1, 0], [0, 1], [1, 0]])
    np.testing.assert_array_equal(task.control(np.array([1, 0, 1, 0, 0])), [1, 0])
    assert Hopper().drives is None


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_the_synergies_that_made_the_activations_are_found(noise):
    matrix = synergy_matrix(TRIPOD_SYNERGIES, GROUPS)
    found = find_synergies(made_of(matrix, noise=noise), 4)
    assert set(found.names(GROUPS)) == {
        " ".join(group for group in GROUPS if group in words.split()) for words in TRIPOD_SYNERGIES
    }
    assert found.explained > 0.97
    np.testing.assert_allclose(found.weights.max(1), 1.0)
    assert (found.weights >= 0).all()
    assert (found.strength >= 0).all()


def test_strengths_times_weights_are_the_activations_and_the_explained_part_is_what_it_says():
    activation = made_of(synergy_matrix(TRIPOD_SYNERGIES, GROUPS), noise=0.2)
    shares = []
    for units in (1, 2, 4, 24):
        found = find_synergies(activation, units, restarts=2)
        left = activation - found.strength @ found.weights
        assert found.explained == pytest.approx(1.0 - (left**2).sum() / (activation**2).sum(), abs=1e-9)
        shares.append(found.explained)
    assert shares == sorted(shares)
    assert shares[0] < 0.9 < shares[2]


def test_the_order_is_that_of_their_share():
    matrix = synergy_matrix(["levator_*", "depressor_*"], GROUPS)
    activation = np.concatenate([np.tile(matrix[0], (30, 1)), np.tile(matrix[1], (90, 1))])
    assert [words.split()[0] for words in find_synergies(activation, 2).names(GROUPS)] == [
        "depressor_left_front",
        "levator_left_front",
    ]


def test_leading_axes_are_decisions_and_the_same_seed_finds_the_same():
    activation = made_of(synergy_matrix(TRIPOD_SYNERGIES, GROUPS))
    one = find_synergies(activation, 3, seed=5, restarts=1, iterations=20)
    same = find_synergies(activation.reshape(4, 100, 24), 3, seed=5, restarts=1, iterations=20)
    other = find_synergies(activation, 3, seed=6, restarts=1, iterations=20)
    np.testing.assert_array_equal(one.weights, same.weights)
    assert not np.array_equal(one.weights, other.weights)


def test_silent_muscles_belong_to_no_synergy():
    activation = made_of(synergy_matrix(["levator_*", "depressor_left_*"], GROUPS))
    words = " ".join(find_synergies(activation, 2).names(GROUPS))
    assert "levator" in words
    assert "tractor" not in words
    assert "right" not in words.replace("levator_right", "")


@pytest.mark.parametrize(
    ("activation", "settings", "message"),
    [
        (np.zeros((5, 3)), {}, "activation = .*not all of them 0"),
        (-np.ones((5, 3)), {}, "activation = .*at least 0"),
        (np.full((5, 3), np.nan), {}, "activation = .*finite"),
        (np.zeros((0, 3)), {}, "activation"),
        (np.ones((5, 3)), {"units": 4}, "units = 4: must be at most the number of groups, 3"),
        (np.ones((5, 3)), {"units": 0}, "units = 0"),
        (np.ones((5, 3)), {"restarts": 0}, "restarts = 0"),
        (np.ones((5, 3)), {"iterations": 1.5}, "iterations = 1.5"),
    ],
)
def test_impossible_factorisations_are_refused_by_name(activation, settings, message):
    with pytest.raises(ValueError, match=message):
        find_synergies(activation, **{"units": 2, **settings})


def test_words_need_a_threshold_and_the_names_of_all_groups():
    found = find_synergies(np.ones((5, 3)), 1)
    assert found.names("abc") == ("a b c",)
    for arguments, message in ((("abc", 0.0), "least = 0.0"), (("ab",), "groups = 2: must be 3 names")):
        with pytest.raises(ValueError, match=message):
            found.names(*arguments)
