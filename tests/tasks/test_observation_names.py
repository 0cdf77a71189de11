"""Every task says what its observed numbers are."""

import dataclasses

import pytest

from motorgrad.tasks import TASKS, Hexapod, Hopper, make


@pytest.mark.parametrize("name", [name for name in TASKS if name != "gymnasium"])
def test_each_observed_number_has_a_name_of_its_own(name):
    task = make(name)
    assert len(task.observation_names) == task.observation_size
    assert len(set(task.observation_names)) == task.observation_size


def test_names_follow_what_is_observed():
    assert Hopper().observation_names == ("foot contact", "knee angle", "knee velocity")
    assert Hopper(observe_contact=False).observation_names == ("knee angle", "knee velocity")
    late = Hexapod(observes=("contact", "lateral", "yaw"), lag=1)
    assert late.observation_names[0] == "earlier angle left front"
    assert late.observation_names[6:8] == ("contact left front", "contact left middle")
    assert late.observation_names[-1] == "yaw"
    now = dataclasses.replace(late, observes=("lateral", "current"), lag=0)
    assert len(set(now.observation_names)) == 12
