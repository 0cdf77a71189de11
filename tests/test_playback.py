"""The playback of live runs: what is due, the states that are kept, and the way back."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from motorgrad.pages import Change, Clock, History, Playback


class Map:
    """A chaotic map with a parameter: any tick or change that is left out or made twice shows at once."""

    def __init__(self):
        self.tick, self.x, self.gain, self.made = 0, 0.3, 3.9, 0

    def advance(self, ticks):
        for _ in range(ticks):
            self.x = self.gain * self.x * (1 - self.x)
        self.tick, self.made = self.tick + ticks, self.made + ticks
        return ticks

    @property
    def state(self):
        return {"tick": np.array(self.tick), "x": np.array(self.x), "gain": np.array(self.gain)}

    def restore(self, state):
        self.tick, self.x, self.gain = int(state["tick"]), float(state["x"]), float(state["gain"])


def set_gain(run, gain):
    if not 0 <= gain <= 4:
        raise ValueError(f"gain = {gain}")
    run.gain = gain


def replayed(changes, tick):
    """The map after so many ticks, with the changes made at theirs."""
    run = Map()
    for change in changes:
        if change.tick <= tick:
            run.advance(change.tick - run.tick)
            set_gain(run, change.what)
    run.advance(tick - run.tick)
    return run.x, run.gain


def test_the_speed_is_kept_and_delays_are_not_made_up_for(monkeypatch):
    now = [50.0]
    monkeypatch.setattr("motorgrad.pages._playback.time", SimpleNamespace(perf_counter=lambda: now[0]))
    clock = Clock(0.01, 2.0)
    assert (clock.due(), clock.wait(), clock.achieved(0)) == (0, math.inf, 0.0)
    clock.play()
    for _ in range(100):
        clock.record(1, 1e-6)
    made, start = 0, now[0]
    while now[0] - start < 0.3:
        made += clock.due()
        clock.achieved(made)
        now[0] += 0.002
    made += clock.due()
    took = now[0] - start
    assert took * 200 - 1 <= made <= took * 200 + 1
    assert clock.achieved(made) == pytest.approx(2.0, rel=0.05)
    now[0] += 1.0
    assert sum(clock.due() for _ in range(100)) < 0.4 * 200
    clock.speed = math.inf
    assert clock.due() >= 1
    assert clock.wait() == 0.0
    clock.pause()
    assert clock.due() == 0


def test_a_tick_that_waited_for_compilation_is_soon_forgotten():
    clock = Clock(0.01, math.inf, slice=0.02)
    clock.play()
    clock.record(1, 10.0)
    assert clock.due() == 1
    for _ in range(12):
        clock.record(100, 100 * 1e-5)
    assert clock.due() == pytest.approx(2000, rel=0.01)


def test_a_history_is_bounded_in_number_and_in_bytes_and_keeps_its_first_state():
    for history in (History(most=8), History(most_bytes=8 * 800)):
        thinned = [tick for tick in range(0, 400, 10) if history.keep(tick, {"x": np.zeros(100)})]
        assert len(history.ticks) <= 8
        assert (history.oldest, history.newest) == (0, 390)
        assert thinned[0] == 80
        steps = np.diff(history.ticks)
        assert np.all(steps[1:] <= steps[:-1])  # older states lie farther apart
    assert history.before(395).tick == 390
    history.drop_after(200)
    assert history.newest <= 200
    history.keep(200, "a", 1)
    history.keep(200, "b", 2)  # takes the place of the other
    assert (history.before(300).state, history.before(300).changes) == ("b", 2)
    with pytest.raises(ValueError, match="tick = -1: must be at least 0"):
        history.before(-1)


@pytest.mark.parametrize("every", [None, 3, 50])
@pytest.mark.parametrize("seed", range(3))
def test_going_anywhere_is_the_same_to_the_last_bit(every, seed):
    rng = np.random.default_rng(seed)
    playback = Playback(Map(), set_gain, every, History(most=6))
    for _ in range(200):
        match rng.integers(5):
            case 0:
                playback.advance(int(rng.integers(60)))
            case 1:
                playback.seek(int(rng.integers(playback.end + 1)))
            case 2:
                playback.change(float(rng.uniform(3.6, 4)))
            case 3:
                playback.keep()
            case 4 if playback.end > 500:
                playback.seek(int(rng.integers(100)))
                playback.forget()
        run = playback.run
        assert (run.x, run.gain) == replayed(playback.changes, run.tick)
        assert len(playback.history.ticks) <= 6
        assert playback.tick <= playback.end


def test_a_change_in_the_past_begins_another_future():
    playback = Playback(Map(), set_gain, 10)
    playback.advance(25)
    playback.change(3.7)
    playback.advance(75)
    end = playback.run.x
    playback.seek(60)
    with pytest.raises(ValueError, match="gain = 5"):
        playback.change(5.0)
    assert (playback.tick, playback.end) == (60, 100)  # refused, so nothing is forgotten
    other = playback.fork(Map())
    other.run.restore(playback.run.state)
    playback.change(3.8)
    assert (playback.end, len(playback.changes)) == (60, 2)
    playback.advance(40)
    assert playback.run.x != end
    assert (other.end, len(other.changes)) == (100, 1)
    other.seek(100)
    assert other.run.x == end
    with pytest.raises(ValueError, match="tick = -5"):
        playback.seek(-5)
    playback.begin()
    assert (playback.changes, playback.history.ticks) == ((), (100,))


def test_the_nearest_state_is_restored_and_states_lie_farther_apart_as_the_run_goes_on():
    playback = Playback(Map(), set_gain, 2, History(most=8))
    assert playback.advance(100)[0] == 2
    assert playback.every == 16
    assert playback.history.ticks[:3] == (0, 16, 32)
    playback.run.made = 0
    playback.seek(37)
    assert playback.run.made == 5
    playback.seek(40)
    assert playback.run.made == 8


def test_the_last_change_is_taken_back_with_what_followed():
    playback = Playback(Map(), set_gain, every=7)
    playback.advance(20)
    playback.change(3.7)
    playback.advance(5)
    playback.change(3.2)
    playback.advance(10)
    assert playback.undo() == 3.2
    assert (playback.tick, playback.end) == (25, 25)
    playback.advance(10)
    assert (playback.run.x, playback.run.gain) == replayed([Change(20, 3.7)], 35)
    playback.undo()
    playback.advance(15)
    assert (playback.run.x, playback.run.gain) == replayed([], 35)
    with pytest.raises(ValueError, match="changes = 0: must be at least one"):
        playback.undo()
