"""Going back in time, other futures, and logs that replay."""

import numpy as np
import pytest

from lab_examples import Ticker
from test_lab_engine_run import hosted, mixed
from timlab import Change, Interpreter, Run, Timeline, replay


def changed(timeline: Timeline) -> np.ndarray:
    """Thirty ticks in which something is set twice."""
    signals = [timeline.advance(7)["level.u"]]
    timeline["gain.gain"] = 0.2
    signals.append(timeline.advance(10)["level.u"])
    timeline["leak/rate.gain"] = 1.5
    timeline["gain.gain"] = 0.9
    signals.append(timeline.advance(13)["level.u"])
    return np.concatenate(signals, axis=1)


def test_the_past_comes_again_bit_for_bit():
    timeline = Timeline(Run(mixed(), seeds=2), every=5)
    levels = changed(timeline)
    for tick in (0, 7, 12, 17, 3):
        timeline.seek(tick)
        assert timeline.tick == tick
        np.testing.assert_array_equal(timeline.advance(30 - tick)["level.u"], levels[:, tick:])
    assert timeline["gain.gain"] == 0.9
    assert timeline.log == (
        Change(7, "gain.gain", 0.2),
        Change(17, "leak/rate.gain", 1.5),
        Change(17, "gain.gain", 0.9),
    )
    timeline.seek(8)
    assert (timeline["gain.gain"], timeline["leak/rate.gain"]) == (0.2, 2.0)
    assert timeline.end == 30
    assert timeline.run.compilations == 1


def test_a_change_in_the_past_begins_another_future():
    timeline = Timeline(Run(mixed(), seeds=2), every=4)
    levels = changed(timeline)
    kept = timeline.fork()
    timeline.seek(10)
    timeline["gain.gain"] = -1.0
    assert (timeline.end, timeline.snapshots) == (10, (0, 4, 8))
    assert [change.tick for change in timeline.log] == [7, 10]
    other = timeline.advance(20)["level.u"]
    assert not np.array_equal(other[:, -1], levels[:, -1])
    kept.seek(0)
    np.testing.assert_array_equal(kept.advance(30)["level.u"], levels)
    timeline.seek(12)
    np.testing.assert_array_equal(timeline.advance(18)["level.u"], other[:, 2:])


def test_a_log_replays_in_another_run():
    timeline = Timeline(Run(mixed(), seeds=2))
    levels = changed(timeline)
    np.testing.assert_array_equal(replay(Run(mixed(), seeds=2), timeline.log, 30)["level.u"], levels)


def test_snapshots_are_thinned():
    timeline = Timeline(Run(mixed(), seeds=2), every=2, keep=8)
    levels = timeline.advance(101)["level.u"]
    assert len(timeline.snapshots) <= 8
    assert timeline.snapshots == tuple(range(0, 101, 16))
    timeline.seek(77)
    np.testing.assert_array_equal(timeline.advance(24)["level.u"], levels[:, 77:])


def test_hosts_go_back_too():
    timeline = Timeline(Run(hosted(), seeds=2), every=10)
    levels = timeline.advance(33)["level.u"]
    timeline.seek(15)
    np.testing.assert_array_equal(timeline.advance(18)["level.u"], levels[:, 15:])


def test_an_interpreter_goes_back_too():
    timeline = Timeline(Interpreter(mixed(), 1), every=3)
    levels = timeline.advance(8)["level.u"]
    timeline.seek(4)
    np.testing.assert_array_equal(timeline.advance(4)["level.u"], levels[:, 4:])


def test_what_cannot_be_saved_has_no_past():
    diagram = hosted()
    diagram.replace("host", Ticker(saved=False))
    with pytest.raises(ValueError, match="host: cannot be saved: it is made so"):
        Timeline(Run(diagram))


@pytest.mark.parametrize("tick", [-1, 1.0, True])
def test_impossible_times_are_refused(tick):
    with pytest.raises(ValueError, match="tick"):
        Timeline(Run(mixed(), seeds=2)).seek(tick)
