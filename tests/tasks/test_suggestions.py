"""Tasks that are suggested for a body: each can be composed, and begins with what the body can do."""

from pathlib import Path

import pytest

import motorgrad as mg
from motorgrad.tasks import compose, suggestions

LEG = Path(__file__).parents[2] / "apps" / "timsim" / "tests" / "leg.xml"
STANDING, MOVING = ["keep upright", "move along x"], ["reach a place", "hold a pose"]


@pytest.mark.parametrize(
    ("body", "goals"),
    [
        (mg.bodies.Mjcf("arm6"), MOVING),
        (mg.bodies.Mjcf(LEG), STANDING + MOVING),
        (mg.bodies.Arm(), MOVING),
        (mg.bodies.Hopper(), STANDING + MOVING),
        (mg.bodies.Hexapod(), STANDING + MOVING),
    ],
    ids=["arm6", "leg", "arm", "hopper", "hexapod"],
)
def test_every_suggestion_makes_a_task(body, goals):
    found = suggestions(body)
    assert list(found) == goals
    for settings in found.values():
        task = compose(body, **settings)
        assert task.action_size >= 1
        assert len(task.observation_names) == task.observation_size > 1


def test_the_tip_is_at_the_end_of_the_longest_chain_and_no_place_of_a_muscle():
    assert suggestions(mg.bodies.Mjcf("arm6"))["reach a place"]["targets"][0]["parts"] == "hand"
    assert suggestions(mg.bodies.Mjcf(LEG))["reach a place"]["targets"][0]["parts"] == "foot"
    assert suggestions(mg.bodies.Mjcf(LEG))["reach a place"]["targets"][0]["joints"] == ["hip", "knee"]


def test_a_body_that_has_fallen_ends_the_episode():
    settings = suggestions(mg.bodies.Mjcf(LEG))["keep upright"]
    assert settings["terminate"][0]["below"] == pytest.approx(0.6 * 0.78, abs=1e-3)
