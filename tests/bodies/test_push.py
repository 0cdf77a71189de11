"""A body that is pushed to the side."""

import numpy as np
import pytest

from motorgrad.bodies import BodyBatch, Hopper, PushBatch

LEANING = Hopper(lateral="spring", lateral_stiffness=30.0)


def lean_of(batch):
    """The angle of each foot about y, in rad."""
    return batch.unpack(batch.packed).position[:, 1:4].sum(axis=1)


def test_a_force_of_nothing_is_none_to_the_last_bit():
    plain, pushed = BodyBatch(LEANING, 2, 4, 1), PushBatch(LEANING, 2, 4, 1, part="foot")
    random = np.random.default_rng(0)
    for _ in range(20):
        activation = random.random((2, 2)).round()
        plain.step(activation)
        pushed.step(np.concatenate([activation, np.zeros((2, 1))], axis=1))
        np.testing.assert_array_equal(pushed.packed, plain.packed)


def test_every_seed_has_a_force_of_its_own_that_lasts_for_a_decision():
    batch = PushBatch(LEANING, 3, 10, 1, part="foot")
    lifted = batch.unpack(batch.packed).position.copy()
    lifted[:, 0] = 5.0
    batch.reset(position=lifted)
    for _ in range(30):
        batch.step(np.array([[0.0, 0.0, force] for force in (-4.0, 0.0, 4.0)]))
    left, still, right = lean_of(batch)
    assert still == pytest.approx(0.0, abs=1e-6)
    assert left == pytest.approx(-right, rel=1e-3)
    assert abs(right) == pytest.approx(4.0 * 0.37 / 30.0, rel=0.3)  # force × arm ÷ stiffness
    for _ in range(50):
        batch.step(np.zeros((3, 3)))
    assert np.abs(lean_of(batch)).max() < 0.1 * abs(right)


def test_the_part_is_named_and_the_command_has_a_force():
    with pytest.raises(ValueError, match=r"unknown part 'fot': did you mean 'foot'"):
        PushBatch(LEANING, 1, part="fot")
    with pytest.raises(ValueError, match=r"control.shape = \(1, 2\): must be \(seeds, groups \+ 1\) = \(1, 3\)"):
        PushBatch(LEANING, 1, part="foot").step(np.zeros((1, 2)))
