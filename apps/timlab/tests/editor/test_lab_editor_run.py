"""The run of a session: retuned while it runs, taken back in time, forked, logged and replayed bit for bit."""

import time

import numpy as np
import pytest
from editor_clients import Client

import timlab
from timlab import gallery
from timlab.editor import Session
from timlab.editor._traces import FRAME, Traces
from timlab.engine import MAX_TICKS


def leaky():
    """Noise into a leaky integrator, of which a scope sees both: quick to compile, and with chance and state."""
    diagram = timlab.Diagram(tick=0.01)
    diagram.add("noise", timlab.UniformNoise())
    diagram.add("gain", timlab.Gain(2.0))
    diagram.add("level", timlab.Lag())
    diagram.add("scope", timlab.Scope(("u", "v")))
    for ends in ("noise gain", "gain level", "level scope.u", "noise scope.v"):
        diagram.connect(*ends.split())
    return diagram


@pytest.fixture
def open_session(tmp_path):
    """Sessions that are closed in the end."""
    opened = []

    def start(diagram):
        opened.append(Session(diagram, folder=tmp_path, states=tmp_path / "states"))
        return opened[-1]

    yield start
    for session in opened:
        session.close()


@pytest.fixture
def client(open_session):
    return Client(open_session(leaky()))


def traces(client):
    """What was seen, by branch and address, as `{tick: row}`."""
    client.last("samples")
    found = {}
    for event in client.seen:
        if event["event"] == "samples":
            if event["fresh"]:
                found = {key: rows for key, rows in found.items() if key[0] != event["branch"]}
            for address, signal in event["signals"].items():
                rows = dict(zip(signal["ticks"], signal["rows"], strict=True))
                found.setdefault((event["branch"], address), {}).update(rows)
    return found


def test_what_clients_see_is_what_a_run_gives(client):
    client.do("tick", n=37)
    client.do("parameter", address="gain.gain", value=3.0)
    client.do("tick", n=13)
    run = timlab.Run(leaky(), [0])
    first = run.advance(37)
    run["gain.gain"] = 3.0
    signal = timlab.join([first, run.advance(13)])["scope.u"][0]
    seen = traces(client)["main", "scope.u"]
    assert sorted(seen) == list(range(50))
    np.testing.assert_allclose([seen[tick][0] for tick in range(50)], signal, rtol=1e-5)
    assert client.run()["tick"] == client.run()["head"] == 50


def test_ticks_asked_for_at_once_are_all_made_and_before_what_follows_them(client):
    client.do("tick", n=1)  # compiled
    for _ in range(3):
        client.session.handle(client.message("tick", n=1), client.inbox.put)
    client.session.handle(client.message("parameter", address="gain.gain", value=3.0), client.inbox.put)
    for _ in range(2):
        client.session.handle(client.message("tick", n=200), client.inbox.put)
    client.do("tick", n=1)
    assert client.run()["tick"] == 1 + 3 + 2 * 200 + 1
    assert [change["tick"] for change in client.log()["parts"][0]["changes"]] == [4]


def test_a_parameter_is_set_while_it_plays_without_compiling_again(client):
    client.do("play", speed=None)
    client.until(lambda event: event["event"] == "run" and event["tick"] > 500)
    compiled = client.session._runner._tree.now.run.compilations
    for value in (0.5, 5.0, 50.0):
        client.do("parameter", address="gain.gain", value=value)
        client.until(lambda event: event["event"] == "samples")
    client.do("pause")
    stopped = client.run()["tick"]
    time.sleep(0.1)
    assert client.run()["tick"] == stopped
    assert client.session._runner._tree.now.run.compilations == compiled == 1
    (branch,) = client.run()["branches"]
    assert [change["value"] for change in branch["changes"]] == [0.5, 5.0, 50.0]
    assert client.session.diagram.nodes["gain"].block.gain == 50.0
    client.do("undo")  # quick changes of one parameter are one
    client.do("tick", n=1)
    assert client.session.diagram.nodes["gain"].block.gain == 2.0
    assert client.run()["branches"][0]["changes"][-1]["value"] == 2.0


def test_the_last_tick_of_a_run_is_made_and_told(client):
    client.do("tick", n=1)
    run = client.session._runner._tree.now.run
    run.restore({**run.state, "tick": MAX_TICKS - 5})
    client.session._runner._tree.now.timeline._playback.begin()
    for operation in ("play", "play"):
        client.do(operation, speed=None)
        client.until(lambda event: event["event"] == "error" and "is the last of a run; reset it" in event["message"])
        client.until(lambda event: event["event"] == "run" and event["state"] == "paused")
        assert client.run()["tick"] == MAX_TICKS
    client.do("tick", n=3)
    client.do("reset")
    client.do("tick", n=2)
    assert client.run()["tick"] == 2


class Clock:
    """The `time` module with a clock that is set by hand."""

    now = 0.0

    def __getattr__(self, name):
        return getattr(time, name)

    def perf_counter(self):
        return self.now


def test_speed_is_kept(client, monkeypatch):
    clock = Clock()
    monkeypatch.setattr("motorgrad.pages._playback.time", clock)
    client.do("tick", n=100)  # compiled
    client.do("play", speed=2.0)
    begun = client.run()["tick"]
    for part in range(1, 9):
        clock.now = 0.125 * part  # s, in each of which 200 ticks are due
        client.until(lambda event, due=25 * part: event["event"] == "run" and event["tick"] >= begun + due)
    client.do("pause")
    assert client.run()["tick"] == begun + 200


def test_going_back_and_on_is_what_it_was_bit_for_bit(client):
    for _ in range(6):
        client.do("tick", n=50)
    client.do("parameter", address="gain.gain", value=-1.0)
    client.do("tick", n=100)
    end = client.log()
    for tick in (0, 7, 299, 300, 301, 400):
        client.do("scrub", branch="main", tick=tick)
        assert client.run()["tick"] == tick
        assert client.run()["overrides"] == ({"gain.gain": 2.0} if tick < 300 else {})
    client.do("scrub", branch="main", tick=123)
    middle = client.log()
    client.do("play")
    client.until(lambda event: event["event"] == "run" and event["tick"] >= 400)
    client.do("scrub", branch="main", tick=400)
    assert client.log() == end
    assert middle["digest"] != end["digest"]
    assert client.run()["branches"][0]["head"] >= 400  # nothing was forgotten


def test_a_change_in_the_past_forks_and_the_past_stays(client):
    client.do("tick", n=200)
    client.do("scrub", branch="main", tick=80)
    client.do("parameter", address="gain.gain", value=9.0)
    client.do("tick", n=50)
    main, other = client.run()["branches"]
    assert (main["head"], main["changes"]) == (200, [])
    assert (other["parent"], other["start"], other["head"], len(other["changes"])) == ("main", 80, 130, 1)
    seen = traces(client)
    assert sorted(seen["main 2", "scope.v"]) == list(range(80, 130))
    for tick in range(80, 130):  # the random stream goes on as it did; the level does not
        assert seen["main 2", "scope.v"][tick] == seen["main", "scope.v"][tick]
    assert seen["main 2", "scope.u"][129] != seen["main", "scope.u"][129]
    client.do("fork", branch="main", tick=150, name="by hand")
    client.do("tick", n=10)
    client.do("scrub", branch="by hand", tick=100)  # before it began it is as the branch before
    assert client.run()["tick"] == 100
    assert client.ask("prune", branch="main")["message"].endswith("it has main 2, by hand")
    client.do("prune", branch="by hand")
    assert [branch["name"] for branch in client.run()["branches"]] == ["main", "main 2"]


def test_a_log_replays_bit_for_bit_in_another_session(client, open_session):
    """With changes of parameters, an edit of the structure while it runs, and a fork."""
    client.do("tick", n=30)
    client.do("parameter", address="gain.gain", value=4.0)
    client.do("tick", n=30)
    client.do("scrub", branch="main", tick=45)
    client.do("parameter", address="noise.high", value=3.0)
    client.do("tick", n=20)
    client.do("add", at=[], type="saturation", name="limit")
    client.do("connect", at=[], source="gain", target="limit")
    client.do("connect", at=[], source="limit", target="level")
    client.wait(lambda event: event.get("stale"))
    client.do("tick", n=25)
    client.do("parameter", address="limit.high", value=0.25)
    client.do("tick", n=25)
    log = client.log()
    assert (client.run()["branch"], log["tick"], len(log["parts"])) == ("edit", 115, 2)
    assert client.run()["fresh"] == []  # the limit has no state; all others went on
    other = Client(open_session(None))
    other.do("replay", log=log)
    assert other.last("replayed") == {"event": "replayed", "branch": "edit", "tick": 115, "matches": True}
    assert other.session.diagram == client.session.diagram
    assert traces(other)["edit", "scope.u"] == traces(client)["edit", "scope.u"]
    again = other.log()
    assert (again["digest"], again["parts"]) == (log["digest"], log["parts"])
    log["parts"][0]["changes"][0]["value"] = 4.5
    other.do("replay", log=log)
    assert other.last("replayed")["matches"] is False
    other.do("undo")  # the diagram that a log brought can be taken back too
    for spoilt in ({}, {**log, "version": 2}, {**log, "parts": []}, {**log, "tick": -1}, {**log, "seeds": [0, 0]}):
        assert other.ask("replay", log=spoilt)["event"] == "refused"


@pytest.mark.ci
def test_a_frozen_unit_keeps_its_parameters_and_the_others_learn(open_session):
    client = Client(open_session(gallery.example("motoneuron-pool")))
    client.do("watch", addresses=["policy.parameters"])
    client.do("tick", n=20)
    assert client.view["nodes"]["policy"]["frozen"] == [False] * 4  # each can be frozen singly, before any is
    client.do("freeze", address="policy", on=True, unit=1)
    assert client.view["nodes"]["policy"]["frozen"] == [False, True, False, False]
    client.do("tick", n=1)
    client.do("tick", n=200)
    seen = traces(client)["main", "policy.parameters"]
    before, after = np.reshape(seen[20], (-1, 4)), np.reshape(seen[max(seen)], (-1, 4))
    still = (before == after).all(axis=0)
    assert still.tolist() == [False, True, False, False]
    client.do("freeze", address="policy", on=False, unit=1)
    client.do("tick", n=200)
    seen = traces(client)["main", "policy.parameters"]
    assert not (np.reshape(seen[max(seen)], (-1, 4))[:, 1] == after[:, 1]).all()


@pytest.mark.slow
def test_a_number_of_a_learner_is_set_by_its_path_and_compiles_nothing(open_session):
    diagram = timlab.Diagram(tick=1.0)
    diagram.add("world", timlab.World("three-state"))
    diagram.add("policy", timlab.Learner(2, 2, "policy = 'softmax'\nlearning_rate = 0.1"))
    for port in ("observation", "reward", "terminated", "truncated", "valid"):
        diagram.connect(f"world.{port}", f"policy.{port}")
    diagram.connect("policy.action", "world.action")
    client = Client(open_session(diagram))
    client.do("watch", addresses=["policy.parameters"])
    client.do("tick", n=50)
    client.do("parameter", address="policy.optimizer.learning_rate", value=0.0)
    client.do("tick", n=50)
    seen = traces(client)["main", "policy.parameters"]
    assert sorted(seen) == list(range(100))
    assert seen[20] != seen[49]
    assert seen[50] == seen[99]
    node = client.view["nodes"]["policy"]
    assert node["fields"]["optimizer.learning_rate"] == 0.0
    assert "learning_rate = 0.0" in node["fields"]["settings"]
    assert not client.run()["stale"]
    assert client.run()["branch"] == "main"


def test_a_scope_shows_true_shapes_however_fast_the_run_is():
    """The last window of a long record is shown sample by sample, and what was before it by few stretches."""
    diagram = timlab.Diagram(tick=0.01)
    diagram.add("noise", timlab.UniformNoise())
    for name, sink in {"scope": timlab.Scope(window=1.0), "spikes": timlab.Raster(window=1.0)}.items():
        diagram.add(name, sink)
        diagram.connect("noise", name)
    record = timlab.Run(diagram).advance(20_000)
    shown = Traces(diagram, [0]).add(record)
    line, dashes = shown["scope.u"], shown["spikes.u"]
    np.testing.assert_array_equal(line["ticks"][-100:], np.arange(19_900, 20_000))
    np.testing.assert_allclose(line["rows"][-100:], record["scope.u"][0, -100:], rtol=1e-5)
    assert dashes["ticks"][-100:] == line["ticks"][-100:]
    assert (np.diff(line["ticks"]) >= 0).all()
    assert len(line["ticks"]) <= 2 * FRAME + 100


@pytest.mark.ci
def test_ensembles_have_a_median_and_a_band(client):
    client.do("seeds", n=9)
    client.do("tick", n=40)
    signal = client.last("samples")["signals"]["scope.u"]
    expected = timlab.Run(leaky(), 9).advance(40)["scope.u"]
    tick = signal["ticks"][-1]
    for name, part in (("low", 0.25), ("median", 0.5), ("high", 0.75)):
        assert signal[name][-1][0] == pytest.approx(np.quantile(expected[:, tick], part), rel=1e-5)
    assert client.ask("seeds", n=0)["message"].startswith("n = 0: must be")
    assert client.ask("seeds", n=[3, 3])["event"] == "refused"
    assert client.run()["seeds"] == list(range(9))


def test_a_broken_diagram_does_not_play_and_says_where(client):
    client.do("add", at=[], type="sum")
    answer = client.ask("play", speed=1.0)
    assert (answer["path"], answer["port"]) == ("sum", "u1")
    assert client.run()["state"] == "empty"
    client.wait(lambda event: event["event"] == "problems" and event["revision"] == 1)
    assert {(p["path"], p["port"]) for p in client.last("problems")["list"]} == {("sum", "u1"), ("sum", "u2")}
    client.do("undo")
    client.do("play", speed=1.0)
    client.do("disconnect", at=[], target="level.u")  # while it plays
    while client.run()["state"] != "paused":
        time.sleep(0.01)
    assert client.ask("tick", n=1)["path"] == "level"


@pytest.mark.parametrize(
    ("op", "fields", "message"),
    [
        ("scrub", {"branch": "main", "tick": 11}, "tick = 11: must be an integer from 0 to 10"),
        ("scrub", {"branch": "mian", "tick": 1}, "did you mean 'main'"),
        ("fork", {"branch": "main", "name": "main"}, "name = 'main': must be a new name"),
        ("watch", {"addresses": ["gain.z"]}, "unknown output 'gain.z'"),
        ("parameter", {"address": "gain.gian", "value": 1}, "did you mean 'gain'"),
        ("parameter", {"address": "gain.gain", "value": None}, "gain = None: must be a finite number"),
        ("play", {"speed": 0}, "speed = 0.0: must be a number above 0"),
        ("tick", {"n": 0}, "n = 0: must be an integer from 1"),
        ("prune", {"branch": "main"}, "must be one of several"),
        ("replay", {"log": {"format": "x"}}, "format = 'x': must be 'motorgrad log'"),
    ],
)
def test_the_run_refuses_by_name(open_session, op, fields, message):
    client = Client(open_session(leaky()))
    client.do("tick", n=10)
    before = client.log()
    assert message in client.ask(op, **fields)["message"]
    assert client.log() == before


def test_states_stay_within_bounds_and_all_of_the_past_in_reach(client, monkeypatch):
    monkeypatch.setattr("timlab.editor._branch.KEPT", 8)
    for _ in range(40):
        client.do("tick", n=5)
    assert len(client.session._runner._tree.now.timeline.snapshots) <= 8
    digests = {}
    for tick in (3, 77, 150, 199, 3, 77, 150, 199):
        client.do("scrub", branch="main", tick=tick)
        digests.setdefault(tick, set()).add(client.log()["digest"])
    assert all(len(each) == 1 for each in digests.values())
    assert len(set.union(*digests.values())) == 4
