"""Looking ahead without moving, and beginning again with other seeds."""

import numpy as np
import pytest

from timlab import Diagram, Integrator, NormalNoise, Outlet, Run


def wandering() -> Diagram:
    diagram = Diagram(tick=0.1)
    diagram.add("push", NormalNoise())
    diagram.add("place", Integrator())
    diagram.add("out", Outlet())
    diagram.connect("push", "place")
    diagram.connect("place", "out")
    return diagram


def test_a_look_shows_the_next_tick_and_moves_nothing():
    run = Run(wandering(), seeds=2)
    run.advance(5)
    ahead = run.peek()
    assert run.tick == 5
    assert ahead.first == 5
    np.testing.assert_array_equal(run.peek()["out.u"], ahead["out.u"])
    np.testing.assert_array_equal(run.advance(4)["out.u"][:, :1], ahead["out.u"])


def test_a_run_begins_again_with_other_seeds_as_if_made_of_them():
    run = Run(wandering(), seeds=[1, 2])
    first = run.advance(20)["out.u"]
    run.reset(seeds=[7, 1])
    again = run.advance(20)["out.u"]
    np.testing.assert_array_equal(again, Run(wandering(), seeds=[7, 1]).advance(20)["out.u"])
    np.testing.assert_array_equal(again[1], first[0])
    assert run.compilations == 1
    with pytest.raises(ValueError, match=r"seeds = 3: must be 2 of them"):
        run.reset(seeds=3)


def test_a_fork_keeps_its_seeds_when_the_other_begins_again():
    run = Run(wandering(), seeds=[1, 2])
    run.advance(3)
    other = run.fork()
    run.reset(seeds=[5, 6])
    run.advance(3)
    np.testing.assert_array_equal(
        other.advance(10)["out.u"], Run(wandering(), seeds=[1, 2]).advance(13)["out.u"][:, 3:]
    )
