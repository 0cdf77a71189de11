"""The overlay on the scene: what it says, what programs add, and what it refuses."""

import numpy as np
import pytest

import motorgrad as mg
from patience import until
from timsim.panels._overlay import goal_of
from timsim.scene import Pose


def content(page):
    """What stands on the scene."""
    overlay = page.overlay
    return overlay._html(dict(overlay._items), page.session.snapshot(), Pose(None))


@pytest.mark.ci
def test_it_tells_the_task_its_goal_and_the_state_of_the_run(page):
    said = content(page)
    assert "chain" in said
    assert goal_of(page.session.task) in said
    assert "paused" in said


@pytest.mark.parametrize(
    ("name", "goal"),
    [
        ("hopper", "Hop as high as possible"),
        ("particle", "Steer a falling particle through rewarded regions and around penalised ones"),
    ],
)
def test_goals_are_one_sentence(name, goal):
    assert goal_of(mg.make(name)) == goal


@pytest.mark.ci
def test_programs_add_texts_and_plots_and_remove_them(page):
    page.overlay("decision", text=lambda moment: f"decision {moment.decision:,} < 7")
    page.overlay("sine", plot=(np.arange(9), np.sin(np.arange(9))), unit="m")
    said = content(page)
    assert f"decision {page.session.snapshot().decision:,} &lt; 7" in said
    assert ">sine (m)<" in said
    page.overlay("decision")
    page.overlay("sine")
    assert "sine" not in content(page)


def test_a_function_that_fails_is_told_and_hinders_no_other(page):
    page.overlay("bad", plot=lambda moment: 1 / 0)
    page.overlay("good", text="well", arrow=((0, 0, 1), (0, 0, 2)), colour="#d9730d")
    assert until(lambda: page.overlay._arrows and "bad: ZeroDivisionError" in content(page))  # as the page itself draws
    assert "well" in content(page)
    ((_, (arrow, label)),) = page.overlay._arrows.values()
    np.testing.assert_array_equal(arrow.points, [[(0, 0, 1), (0, 0, 3)]])
    np.testing.assert_array_equal(label.position, (0, 0, 3))
    page.overlay("bad")
    page.overlay("good")
    assert until(lambda: not page.overlay._arrows)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"text": 3}, "text = 3"),
        ({"plot": ([1, 2], [1])}, "plot = "),
        ({"arrow": ((0, 0, 0), (0, 0, float("nan")))}, "arrow = "),
        ({"text": "x", "colour": "red"}, "colour = 'red'"),
    ],
)
def test_nonsense_is_refused(page, given, told):
    with pytest.raises(ValueError, match=told):
        page.overlay("x", **given)
