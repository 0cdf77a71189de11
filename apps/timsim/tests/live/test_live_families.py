"""Learners of every family, and one of a stranger's own, in a run that is watched."""

import numpy as np
import pytest

import families
import motorgrad as mg
from motorgrad import learning
from motorgrad.schema import fields_of
from motorgrad.training import agent_for, stepper_for
from neighbours import registered
from timsim import live


@pytest.fixture
def neighbours():
    with registered():
        yield


FAMILIES = {
    **{kind: families.compiled(kind)[1] for kind in families.FAMILIES},
    "neighbours": {"kind": "neighbours"},
}
QUICK = ("proximal", "neighbours")


def of(names):
    marked = [pytest.param(name, marks=() if name in QUICK else pytest.mark.ci) for name in names]
    return pytest.mark.parametrize("name", marked)


@of(FAMILIES)
def test_it_is_shown_and_learns_what_an_unwatched_one_does(name, driven, neighbours):
    task = mg.make("linear-recruitment")
    agent = agent_for(task, FAMILIES[name])
    watched = driven(live.setup_of(task, agent, seed=3))
    watched(live.Step(1), live.Step(60), live.Step(1))
    alone = stepper_for(task, agent, [3])
    before = alone.harvest()["parameters"][0]
    alone.advance(62)
    seen = watched.seen()
    np.testing.assert_array_equal(seen["parameters"][0], alone.harvest()["parameters"][0])
    assert np.ptp([seen["parameters"][0], before], axis=0).max() > 0
    assert np.isfinite(seen["probability"][0]).all()
    assert np.isfinite(seen["reward"][0])
    assert np.isfinite(seen["baseline"][0]) == (learning.Learner.kinds()[name].critic is not None)
    assert np.isfinite(seen["gradient_norm"][0]) == ("optimizer" in fields_of(learning.Learner.kinds()[name]))


@of(name for name in FAMILIES if name != "sparse")  # which is refused by name
def test_it_is_frozen_compared_and_taken_back(name, driven, neighbours, tmp_path):
    watched = driven(live.setup_of("linear-recruitment", FAMILIES[name], seed=3))
    subject = watched.worker.subject
    number, value = next((n, x) for n, x in subject.settings.items() if n.startswith("agent."))
    assert [kind for kind, _ in watched(live.Edit(number, 0.5 * value))] == ["change"]
    watched(live.Step(50), live.Freeze())
    frozen = watched.seen()
    watched(live.Step(30), live.Compare(True), live.Step(1))
    seen = watched.seen()
    for shown in ("parameters", "baseline"):
        np.testing.assert_array_equal(seen[shown][0], frozen[shown][0])
    assert np.isnan(seen["baseline"][1])
    watched(live.Thaw(), live.Step(60))
    end = watched.seen()
    assert np.any(end["parameters"][0] != frozen["parameters"][0])
    watched(live.Scrub(70))
    assert subject.frozen
    watched(live.Scrub(int(end["decision"])))
    np.testing.assert_array_equal(watched.seen()["parameters"][0], end["parameters"][0])
    file = str(tmp_path / "policy.npz")
    watched(live.Save(file), live.Freeze(), live.Reset())
    assert subject.frozen
    watched(live.Load(file), live.Step(5))
    np.testing.assert_array_equal(watched.seen()["parameters"][0], end["parameters"][0])
    watched(live.Thaw(), live.Step(1), live.Step(60))
    assert np.any(watched.seen()["parameters"][0] != end["parameters"][0])


@pytest.mark.ci
def test_a_task_with_a_goal_that_scales_is_frozen_and_learns_on(driven):
    """The replay keeps the task's own units; what is lost at the freeze must not put scaled numbers among them."""
    small = {"hidden": [8]}
    changes = {"policy.network": small, "values.network": small, "replay.start": 20, "replay.batch": 8}
    agent = agent_for("composed", changes, preset="sac", steps=4_000)
    watched = driven(live.setup_of("composed", agent, seed=3))
    watched(live.Step(50), live.Freeze(), live.Step(10))
    frozen = watched.seen()
    watched(live.Thaw(), live.Step(50))
    assert np.any(watched.seen()["parameters"][0] != frozen["parameters"][0])
    experience = watched.worker.subject._stepper.state["cycle"].agent.experience
    rows = np.asarray(experience.observations[0])[np.asarray(experience.episode[0]) >= 0]
    height = rows[:, mg.make("composed").observation_names.index("target y")]
    assert len(height) > 90
    assert height.min() >= 0.25  # the box from which targets are drawn, in m
    assert height.max() <= 0.45


def test_it_begins_frozen_and_learns_when_thawed(driven, neighbours):
    watched = driven(live.setup_of("linear-recruitment", FAMILIES["neighbours"], seed=3, frozen=True))
    start = watched.seen()["parameters"][0].copy()
    watched(live.Step(20))
    np.testing.assert_array_equal(watched.seen()["parameters"][0], start)
    watched(live.Thaw(), live.Step(20))
    assert np.any(watched.seen()["parameters"][0] != start)
