"""Orders, edits and the way back, in a worker without a page."""

import jax
import numpy as np
import pytest

import motorgrad as mg
from motorgrad.schema import with_number
from motorgrad.training import agent_for, stepper_for
from timsim import live
from ways_in import assert_short, calls_to

KEYS = ("position", "velocity", "control", "observation", "probability", "baseline", "parameters")


def same(a, b, keys=KEYS):
    return all(np.array_equal(a[key][: int(a["bodies"])], b[key][: int(b["bodies"])]) for key in keys)


def headless(task, seed, decisions):
    task = mg.make(task)
    stepper = stepper_for(task, agent_for(task), [seed])
    stepper.advance(decisions)
    return stepper


@pytest.mark.representatives("hopper")
@pytest.mark.parametrize("task", ["hopper", "particle"])
def test_a_watched_learner_learns_what_a_headless_one_does(task, driven):
    watched = driven(live.setup_of(task, seed=5))
    for decisions in (1, 400, 1, 350):  # with and without looking at each
        watched(live.Step(decisions))
    seen, alone = watched.seen(), headless(task, 5, 752)
    assert seen["decision"] == 752
    assert np.array_equal(seen["parameters"][0], alone.harvest()["parameters"][0])
    if task == "hopper":
        assert np.array_equal(seen["position"][0].astype(np.float32), alone.batch.packed[0, :6])


def test_a_policy_that_breaks_stops_the_run_and_has_no_rewards(driven):
    hopper = driven(live.setup_of("hopper", seed=3))
    hopper(live.Step(100), live.Edit("agent.optimizer.learning_rate", 3e38))
    hopper.worker.clock.play()
    said = [each for _ in range(10) for each in hopper(live.Step(50))]
    (broke,) = [text for kind, text in said if kind == "lost"]
    assert broke.startswith("parameters not finite by decision ")
    assert not hopper.worker.clock.playing
    assert not np.isfinite(hopper.seen()["parameters"][0]).all()
    hopper.worker.subject.tally()
    hopper(live.Step(50))
    (found,) = hopper.worker.subject.tally()
    assert np.isnan(found.values[0])
    assert found.counts[0] == 0


def test_going_back_and_on_again_is_the_same_to_the_last_bit(hopper):
    hopper(live.Reset(), live.Step(300))
    hopper.worker._keep()
    hopper(
        live.Step(150),
        live.Edit("agent.optimizer.learning_rate", 2e-3),
        live.Step(100),
        live.Push("load", (30.0, 0.0, 0.0), 0.2),
    )
    hopper(live.Step(100))
    end, trail = hopper.seen(), hopper.seen("trail")
    assert [kind for kind, _ in hopper(live.Scrub(10))] == ["change"]
    back = hopper.seen()
    assert back["decision"] == 10
    assert (back["oldest"], back["newest"]) == (0, 650)
    assert hopper.worker.subject.settings["agent.optimizer.learning_rate"] == 5e-4
    hopper(live.Scrub(650))
    assert same(hopper.seen(), end)
    assert hopper.worker.subject.settings["agent.optimizer.learning_rate"] == 2e-3
    hopper(live.Scrub(400), live.Step(1))  # what came after is forgotten with the first step
    assert hopper.seen()["newest"] == 401
    hopper(
        live.Step(49),
        live.Edit("agent.optimizer.learning_rate", 2e-3),
        live.Step(100),
        live.Push("load", (30.0, 0.0, 0.0), 0.2),
    )
    hopper(live.Step(100))
    assert same(hopper.seen(), end)
    again = hopper.seen("trail")
    last = [(t["decision"] == 650).nonzero()[0][0] for t in (trail, again)]
    assert trail["reward"][last[0]] == again["reward"][last[1]]


def test_a_push_moves_the_body_and_ends(hopper):
    def forces():
        return hopper.worker.subject.state["learner"]["physics"]["state"][0]

    hopper(live.Reset(), live.Step(100), live.Push("load", (0.0, 0.0, 43.0), 0.1), live.Step(9))
    assert 43.0 in forces()
    hopper(live.Step(1))
    assert 43.0 not in forces()
    pushed = hopper.seen()["position"][0].copy()
    hopper(live.Scrub(99), live.Step(11))
    assert np.abs(hopper.seen()["position"][0] - pushed).max() > 1e-3


def test_edits_take_effect_where_they_are_meant(hopper):
    hopper(live.Reset(), live.Step(50))
    said = hopper(
        live.Edit("agent.optimizer.learning_rate", 1e-3),
        live.Edit("body.extensor_left.strength", 500.0),
        live.Edit("exploration", 2.0),
    )
    assert ("change", "agent.optimizer.learning_rate: 0.0005 → 0.001") in said or (
        "change",
        "agent.optimizer.learning_rate: 0.002 → 0.001",
    ) in said
    model = hopper.worker.subject._stepper.batch.model  # of the engine in use
    assert model.actuator_gainprm[1, 0] == -500.0
    before = hopper.seen()
    hopper(live.Edit("exploration", 4.0))
    after = hopper.seen()
    np.testing.assert_allclose(after["parameters"][0], before["parameters"][0] / 2, rtol=1e-6)
    assert same(after, before, ("position", "velocity", "baseline"))
    rates = hopper.worker.subject._probe_bodies()["rates"]
    assert np.all(rates == np.float32(1e-3))
    hopper(live.Edit("body.extensor_left.strength", 400.0), live.Edit("agent.optimizer.learning_rate", 5e-4))


def test_what_is_told_of_muscles_is_true_of_the_engine_in_use(hopper):
    for decay in (0.5, 0.6, 0.7, 0.8):  # an engine for each, until the first is forgotten
        hopper(live.Edit("agent.estimator.trace.decay", decay))
    hopper(live.Edit("body.extensor_left.strength", 450.0))
    assert hopper.worker.subject._stepper.batch.model.actuator_gainprm[1, 0] == -450.0
    hopper(live.Edit("agent.estimator.trace.decay", 0.995), live.Edit("body.extensor_left.strength", 400.0))


@pytest.mark.ci
def test_decay_and_reward_go_on_from_the_same_state(hopper):
    hopper(live.Reset(), live.Step(50))
    before = hopper.seen()
    hopper(live.Edit("agent.estimator.trace.decay", 0.5), live.Edit("task.reward_scale", 7.0))
    assert same(hopper.seen(), before)
    task = mg.make("hopper", reward_scale=7.0)
    agent = agent_for(task, decay=0.5)
    stepper = stepper_for(task, agent, [3])
    stepper.restore(hopper.worker.subject.state["learner"])
    stepper.advance(80)
    hopper(live.Step(80))
    assert np.array_equal(hopper.seen()["parameters"][0], stepper.harvest()["parameters"][0])
    hopper(live.Edit("agent.estimator.trace.decay", 0.995), live.Edit("task.reward_scale", 100.0))


CRITIC = {"kind": "critic", "discount": 0.9, "decay": 0.5, "fit": {"kind": "td", "learning_rate": 0.05}}
RICH = {
    "metric": "fisher",
    "metric.damping": 0.05,
    "entropy": 0.01,
    "normalization": {"rate": 0.01},
    "weight_decay": 1e-4,
    "estimator.baseline": CRITIC,
}
"""A learner with many numbers: metric, entropy, critic, normalization, weight decay."""


@pytest.fixture
def compilations():
    """A list that grows with everything that is traced or compiled."""
    found, listening = [], [True]

    def note(event, seconds, **_):
        if listening and event.startswith("/jax/core/compile/"):
            found.append(event)

    jax.monitoring.register_event_duration_secs_listener(note)
    yield found
    listening.clear()


@pytest.mark.ci
@pytest.mark.parametrize(("task", "least"), [("chain", 8), ("hopper", 8)])
def test_any_number_of_a_learner_changes_live_without_compiling(task, least, driven, compilations):
    task = mg.make(task)
    agent = agent_for(task, RICH)
    watched = driven(live.setup_of(task, agent, seed=3))
    watched(live.Step(50), live.Edit("agent.optimizer.learning_rate", 1e-3), live.Step(1))
    watched.worker.subject.tally()  # compiles
    state = watched.worker.subject.state["learner"]
    settings = {name: x for name, x in watched.worker.subject.settings.items() if name.startswith("agent.")}
    paths = {name.removeprefix("agent.") for name in settings}
    assert len(paths) >= least
    assert {"metric.damping", "estimator.entropy", "estimator.baseline.fit.learning_rate"} <= paths
    changed = {name: 0.8 * value if value else 0.1 for name, value in settings.items()}
    compilations.clear()
    said = watched(*(live.Edit(name, value) for name, value in changed.items()), live.Step(60))
    assert [kind for kind, _ in said] == ["change"] * len(changed)
    assert compilations == []
    for name, value in changed.items():
        agent = with_number(agent, name.removeprefix("agent."), value)
    other = stepper_for(task, agent, [3])  # with these numbers from the start
    other.restore({**state, "cycle": state["cycle"]._replace(numbers=other.state["cycle"].numbers)})
    other.advance(60)
    assert np.array_equal(watched.seen()["parameters"][0], other.harvest()["parameters"][0])
    assert np.isfinite(watched.seen()["parameters"]).all()
    end = watched.seen()
    watched(live.Scrub(20), live.Scrub(111))  # going back repeats the changes
    assert same(watched.seen(), end)
    assert {name: watched.worker.subject.settings[name] for name in changed} == changed


@pytest.mark.parametrize(
    ("name", "value", "names"),
    [
        ("agent.estimator.trace.decay", 1.5, "decay = 1.5: must be in [0, 1]"),
        ("agent.optimizer.learning_rate", -1.0, "agent.optimizer.learning_rate = -1.0: must be"),
        ("task.penalty", -1.0, "penalty = -1.0: must be"),
        ("exploration", 0.0, "exploration = 0.0: must be above 0"),
        ("body.flexor_left.rest_length", 0.0, "body.flexor_left.rest_length = 0.0: must be above 0"),
    ],
)
def test_an_impossible_edit_changes_nothing(name, value, names, hopper):
    before, settings = hopper.seen(), dict(hopper.worker.subject.settings)
    ((kind, text),) = hopper(live.Edit(name, value))
    assert kind == "error"
    assert names in text
    assert hopper.worker.subject.settings == settings
    assert same(hopper.seen(), before)


def test_frozen_nothing_is_learned_and_thawed_it_goes_on(hopper):
    hopper(live.Reset(), live.Step(200), live.Freeze())
    before = hopper.seen()
    hopper(live.Step(100))
    frozen = hopper.seen()
    assert frozen["frozen"] == 1
    assert same(frozen, before, ("parameters", "baseline"))
    assert not same(frozen, before, ("position",))
    hopper(live.Thaw(), live.Step(100))
    assert not same(hopper.seen(), frozen, ("parameters",))


@pytest.mark.ci
def test_an_untrained_body_stands_beside(hopper):
    hopper(live.Reset(), live.Step(300), live.Compare(True), live.Step(20))
    seen = hopper.seen()
    assert seen["bodies"] == 2
    assert not seen["parameters"][1].any()  # hyperplanes begin at zero
    assert seen["parameters"][0].any()
    learned = seen["parameters"][0].copy()
    hopper(live.Scrub(300), live.Compare(False), live.Step(20))
    assert np.array_equal(hopper.seen()["parameters"][0], learned)
    assert hopper.seen()["bodies"] == 1


def test_policies_are_saved_and_loaded(hopper, tmp_path, driven):
    hopper(live.Reset(), live.Step(200))
    learned = hopper.seen()["parameters"][0].copy()
    file = str(tmp_path / "policy.npz")
    assert hopper(live.Save(file)) == [("saved", f"policy saved to {file}")]
    hopper(live.Reset(), live.Load(file))
    assert np.array_equal(hopper.seen()["parameters"][0], learned)
    other = driven(live.setup_of("particle"))
    ((kind, text),) = other(live.Load(file))
    assert (kind, text) == ("error", f"{file}: holds a policy of the task 'hopper', but this is 'particle'")
    (tmp_path / "broken.npz").write_bytes(b"no")
    ((kind, text),) = hopper(live.Load(str(tmp_path / "broken.npz")))
    assert kind == "error"
    assert "broken.npz: not a saved policy" in text


def test_the_curve_is_the_mean_of_the_rewards(hopper):
    hopper(live.Reset())
    hopper.worker.records._added = -np.inf
    rewards = []
    for _ in range(100):
        hopper.worker.records._added = -np.inf
        hopper(live.Step(1))
        rewards.append(float(hopper.seen()["reward"][0]))
    curve = hopper.seen("curve")
    assert int(curve["count"]) == 1
    assert curve["decision"][0] == 100
    assert curve["values"][0, 0] == pytest.approx(np.mean(rewards), abs=1e-5)


@pytest.mark.representatives("hopper")
@pytest.mark.parametrize("task", ["hopper", "particle"])
def test_it_goes_on_beyond_32_bits_of_decisions(task, driven):
    watched, late = driven(live.setup_of(task, seed=5)), 2**32 - 3
    watched(live.Step(2))
    subject = watched.worker.subject
    subject.restore({**subject.state, "learner": {**subject.state["learner"], "decision": np.array(late)}})
    watched.worker.playback.begin()
    for decisions in (1, 20):
        watched(live.Step(decisions))
    seen = watched.seen()
    assert int(seen["decision"]) == int(seen["newest"]) == late + 21
    assert watched.seen("trail")["decision"].max() == late + 21
    watched(live.Scrub(late + 10), live.Step(11))
    assert same(watched.seen(), seen)


def test_a_run_is_gone_on_with(tmp_path, driven):
    run = mg.train("hopper", steps=300, seeds=[2, 7], out=tmp_path / "run", progress=False)
    gone_on = driven(live.setup_of("hopper", seed=7, run=tmp_path / "run"))
    policy = run.policy(7)
    flat = np.concatenate([np.ravel(policy.weights), np.ravel(policy.bias)])
    assert np.array_equal(np.sort(gone_on.seen()["parameters"][0]), np.sort(flat))
    with pytest.raises(ValueError, match="holds a policy of the task 'hopper', but this is 'chain'"):
        live.setup_of("chain", run=tmp_path / "run", seed=7)
    with pytest.raises(ValueError, match="seed = 3: must be one of the run's seeds"):
        live.setup_of("hopper", run=tmp_path / "run", seed=3)


def test_a_push_that_throws_the_body_away_is_told_and_taken_back(hopper):
    watched = hopper
    watched(live.Reset(), live.Step(20))
    before = {name: watched.seen()[name].copy() for name in KEYS}
    watched(live.Push("load", (0.0, 0.0, 1e6), 5.0))
    said = watched(live.Step(300))
    assert [kind for kind, _ in said] == ["lost"]
    assert "after decision 20; Undo" in said[0][1]
    assert watched(live.Undo()) == [("change", "took back: push")]
    now = watched.seen()
    assert (now["decision"], now["newest"]) == (20, 20)
    for name in ("position", "velocity", "parameters"):
        np.testing.assert_array_equal(now[name][0], before[name][0])
    assert watched(live.Undo())[0] == ("error", "changes = 0: must be at least one to take back")


def test_an_edit_reaches_the_field_that_checks_it_in_few_calls(hopper):
    calls = calls_to("decay", 0.97, lambda: hopper(live.Edit("agent.estimator.trace.decay", 0.97)))
    assert_short(calls)
