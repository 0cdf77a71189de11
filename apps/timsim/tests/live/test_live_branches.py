"""Branches: what followed a past moment is kept, can be returned to bit for bit, and runs beside another in step."""

import numpy as np
import pytest

from timsim import live
from timsim.live._branches import MAX_BRANCHES

KEYS = ("position", "velocity", "control", "observation", "probability", "baseline", "parameters")
RATE = "agent.optimizer.learning_rate"


def same(a, b, rows=(0, 0)):
    return all(np.array_equal(a[key][rows[0]], b[key][rows[1]]) for key in KEYS)


def names(watched):
    return [course.name for course in watched.worker.branches._courses]


def about(watched):
    worker = watched.worker
    beside = worker.beside
    found = worker.branches.about(*((None, None) if beside is None else (beside.course, beside.playback)))
    return {branch.name: branch for branch in found}


@pytest.fixture
def forked(hopper):
    """A hopper with two branches: A was edited at 120, B pushed at 60; B is present, at 200. And both ends."""
    hopper(live.Reset())
    for name in names(hopper)[:-1]:
        hopper(live.Delete(name))
    hopper(live.Rename(names(hopper)[0], "A"))
    hopper(live.Step(120), live.Edit(RATE, 2e-3), live.Step(80))
    first, curve = hopper.seen(), hopper.seen("curve")
    hopper(live.Scrub(60), live.Push("load", (30.0, 0.0, 0.0), 0.2), live.Step(140))
    yield hopper, first, hopper.seen(), curve
    hopper(live.Alongside(None), live.Edit(RATE, 5e-4))


def test_a_change_in_the_past_keeps_what_followed_as_a_branch(forked):
    watched, first, second, curve = forked
    branches = about(watched)
    assert list(branches) == ["A", "B"]
    a, b = branches["A"], branches["B"]
    assert (a.parent, a.start, a.end, a.present) == ("", 0, 200, False)
    assert a.edits == ((120, f"{RATE}: 0.0005 → 0.002"),)
    assert (b.parent, b.start, b.end, b.present) == ("A", 60, 200, True)
    assert [decision for decision, _ in b.edits] == [60]
    assert "push of (30, 0, 0) N at load" in b.edits[0][1]
    assert not same(first, second)
    assert watched(live.Switch("A"))[-1] == ("change", "went to branch 'A'")
    now = watched.seen()
    assert (now["decision"], now["newest"], now["playing"]) == (200, 200, 0)
    assert same(now, first)
    assert watched.worker.subject.settings[RATE] == 2e-3
    again = watched.seen("curve")
    count = int(curve["count"])
    assert int(again["count"]) == count
    np.testing.assert_array_equal(again["values"][:, :count], curve["values"][:, :count])
    trail = watched.seen("trail")
    assert trail["decision"][int(trail["next"]) - 1] == 200
    np.testing.assert_array_equal(trail["position"][int(trail["next"]) - 1], first["position"][0])
    watched(live.Scrub(130), live.Scrub(200))
    assert same(watched.seen(), first)
    watched(live.Switch("B"))
    assert same(watched.seen(), second)
    assert watched.worker.subject.settings[RATE] == 5e-4
    watched(live.Scrub(61), live.Scrub(200))
    assert same(watched.seen(), second)


@pytest.mark.ci
def test_going_on_from_the_past_follows_what_is_known_until_something_was_changed(forked):
    watched, first, second, _ = forked
    watched(live.Scrub(100), live.Step(40))  # nothing was changed after the push: the same moments come again
    assert names(watched) == ["A", "B"]
    assert watched.seen()["newest"] == 200
    watched(live.Step(60))
    assert same(watched.seen(), second)
    watched(live.Switch("A"), live.Scrub(119), live.Step(1))  # without the edit that came at 120
    assert names(watched) == ["A", "B", "C"]
    assert watched.seen()["newest"] == 120
    assert about(watched)["C"].edits == ()
    watched(live.Edit(RATE, 2e-3), live.Step(80))  # the same edit again
    assert same(watched.seen(), first)
    watched(live.Switch("A"))
    assert same(watched.seen(), first)


def test_a_refused_change_in_the_past_begins_no_branch(forked):
    watched, _, second, _ = forked
    watched(live.Scrub(100))
    assert watched(live.Edit(RATE, -1.0))[0][0] == "error"
    assert names(watched) == ["A", "B"]
    watched(live.Scrub(200))
    assert same(watched.seen(), second)


def test_two_branches_run_side_by_side_in_step(forked):
    watched, first, second, curve = forked
    watched(live.Scrub(80), live.Alongside("A"))
    seen = watched.seen()
    assert seen["bodies"] == 2
    assert watched.worker.records.labels == ["B", "A"]
    watched(live.Step(120))
    seen = watched.seen()
    assert same(seen, second)
    assert same(seen, first, rows=(1, 0))  # with the edit at 120
    trail = watched.seen("trail 1")
    last = int(trail["next"]) - 1
    assert trail["decision"][last] == 200
    np.testing.assert_array_equal(trail["position"][last], first["position"][0])
    beside, count = watched.seen("curve 1"), int(curve["count"])
    np.testing.assert_array_equal(beside["values"][:, :count], curve["values"][:, :count])
    watched(live.Step(50))  # both go on
    ahead = watched.seen()
    watched(live.Scrub(130))
    assert watched.worker.beside.subject.tick == 130
    watched(live.Scrub(250))
    assert same(watched.seen(), ahead)
    assert same(watched.seen(), ahead, rows=(1, 1))
    watched(live.Alongside(None))
    assert watched.seen()["bodies"] == 1
    assert about(watched)["A"].end == 250
    watched(live.Switch("A"))
    assert same(watched.seen(), ahead, rows=(0, 1))
    watched(live.Alongside("B"))  # the other way round
    assert same(watched.seen(), ahead, rows=(1, 0))
    said = watched(live.Alongside("A"))
    assert said[0][0] == "error"
    assert "another than the present one" in said[0][1]


def test_branches_are_forked_named_and_deleted_by_order(forked):
    watched, _, second, _ = forked
    assert watched(live.Fork("idea", 150))[-1] == ("change", "branch 'idea' begun at decision 150")
    assert (watched.seen()["decision"], watched.seen()["newest"]) == (150, 150)
    watched(live.Step(50))
    assert same(watched.seen(), second)  # nothing was changed
    watched(live.Rename("B", "pushed"))
    assert about(watched)["idea"].parent == "pushed"
    assert watched(live.Rename("A", "idea"))[0][0] == "error"
    assert watched(live.Delete("idea"))[0] == (
        "error",
        "branch = 'idea': must be another than the present one: switch first",
    )
    watched(live.Switch("pushed"))
    assert same(watched.seen(), second)
    watched(live.Delete("idea"))
    assert names(watched) == ["A", "pushed"]
    assert watched(live.Switch("idea"))[0][0] == "error"


@pytest.mark.ci
def test_their_number_and_their_memory_are_bounded(forked):
    watched = forked[0]
    watched(live.Rename("A", "kept"))
    for decision in range(1, MAX_BRANCHES + 4):
        watched(live.Fork(decision=decision), live.Step(10))
    assert len(names(watched)) == MAX_BRANCHES
    assert "kept" in names(watched)
    worker = watched.worker
    histories = [worker.playback.history, *(c.line.history for c in worker.branches._courses if c.line)]
    assert len(histories) == MAX_BRANCHES
    assert sum(history.most for history in histories) <= 900
    assert sum(history.most_bytes for history in histories) <= 256 * 2**20


def test_a_model_without_a_learner_branches_too(driven):
    watched = driven(live.setup_of("arm"))
    watched(live.Step(20), live.Control(0, 1.0), live.Step(30))
    first = watched.seen()
    watched(live.Scrub(10), live.Control(0, 0.3), live.Step(40), live.Alongside("A"))
    seen = watched.seen()
    np.testing.assert_array_equal(seen["position"][1], first["position"][0])
    assert not np.array_equal(seen["position"][0], first["position"][0])
