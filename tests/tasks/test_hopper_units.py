"""The hopper with any number of units, dealt out over its muscles."""

import gymnasium
import numpy as np
import pytest

import motorgrad as mg
from motorgrad.tasks import Hopper


def test_units_of_the_hopper_are_dealt_out_and_any_of_them_makes_its_muscles_active():
    task = Hopper(units=5)
    assert task.action_size == 5
    actions = np.array(
        [[1, 0, 0, 0, 0], [0, 1, 0, 1, 0], [0, 0, 1, 0, 1], [0, 0, 0, 0, 0], [0, 0, 0, 1, 1]], np.float32
    )
    np.testing.assert_array_equal(task.control(actions), [[1, 0], [0, 1], [1, 0], [0, 0], [1, 1]])
    assert Hopper().control(actions) is actions
    np.testing.assert_array_equal(Hopper(units=2).control(actions[:, :2]), actions[:, :2])
    with pytest.raises(ValueError, match="units = 1"):
        Hopper(units=1)


@pytest.mark.ci
def test_two_units_of_the_hopper_are_what_it_has_without_the_setting():
    ends = [mg.train(Hopper(units=units), None, 60, 2, progress=False) for units in (None, 2)]
    np.testing.assert_array_equal(ends[0].policies.weights, ends[1].policies.weights)
    np.testing.assert_array_equal(ends[0].curve()[1], ends[1].curve()[1])


def test_the_hopper_as_an_environment_takes_all_its_units():
    environment = gymnasium.make("motorgrad/Hopper-v0", disable_env_checker=True, units=6)
    assert environment.action_space.shape == (6,)
    environment.reset(seed=0)
    silent, extended = np.zeros(6, np.int8), np.array([0, 0, 0, 1, 0, 0], np.int8)
    costs = [environment.step(action)[1] for action in (silent, extended)]
    np.testing.assert_allclose(costs, [0.0, -0.2], atol=1e-6)  # two active muscles
    environment.close()


def test_the_range_of_what_the_hopper_observes_is_that_of_its_knee():
    (contact, angle, velocity) = Hopper(centre=60.0).observation_range
    assert contact == (-1.0, 1.0)
    np.testing.assert_allclose(np.rad2deg(angle), [-20.0, 90.0])
    np.testing.assert_allclose(velocity, [-1.0, 1.0])
