"""What is read and recorded is of the moment that is shown, also of a run that went back."""

import re
import types

import numpy as np
import pytest
import viser

from patience import until
from timsim.live import Curve, Pause, Play, Push, Reset, Scrub, Trail
from timsim.panels import Figures, Overlay, Panels, ReplayRecorder, TourStep, _motion_recorder
from timsim.panels._charts import smoothed, time_before
from timsim.panels._film_painting import CURVE, LiveStrip
from timsim.panels._motion_recorder import MotionRecorder, path_until
from timsim.panels._overlay import small_plot
from timsim.panels._panel import brief
from timsim.panels._tour import Waiting
from timsim.scene import Pose
from timsim.scene._beside import Readings


@pytest.fixture
def past(hopping):
    """The hopper's run, which went back to the middle of what it has made; its curve has what followed."""
    hopping.order(Pause())
    assert until(lambda: not hopping.snapshot().playing)
    curve, now = hopping.curve(), hopping.snapshot()
    apex = curve.values["apex"]
    known = np.flatnonzero(np.isfinite(apex))
    # where the last height known is another than at the end
    row = next(row for row in known[::-1] if apex[row] != apex[known[-1]])
    decision = int(curve.decision[row])
    assert now.oldest <= decision < curve.decision[known[-1]]
    hopping.order(Scrub(decision))
    assert until(lambda: hopping.snapshot().decision == decision)
    yield types.SimpleNamespace(session=hopping, curve=curve, row=row, decision=decision, apex=float(apex[row]))
    hopping.order(Scrub(now.newest))
    assert until(lambda: hopping.snapshot().decision == now.newest)


def test_a_curve_until_a_decision_has_what_was_known_then():
    column = np.array([1.0, 2.0, 3.0])
    curve = Curve(np.array([100, 200, 300]), column, column, {"reward": column, "apex": -column}, np.zeros(3, bool))
    assert [len(curve.until(decision).decision) for decision in (99, 100, 299, 300, 999)] == [0, 1, 2, 3, 3]
    early = curve.until(250)
    assert {len(each) for each in (early.seconds, early.reward, early.frozen, *early.values.values())} == {2}
    assert early.values["apex"][-1] == -2


def test_a_label_tells_the_reading_of_the_moment_shown(past):
    pose = Pose(past.session.model)
    pose.place(past.session.snapshot())
    assert Readings(past.session).words(pose)[0].startswith(f"apex {past.apex:.3g} m")


def lines_of(svg):
    return re.findall(r'points="([^"]+)"', svg)


def test_figures_and_overlay_end_at_the_moment_shown(past):
    end, snapshot = past.curve.seconds[past.row], past.session.snapshot()
    figures = Figures(past.session)
    figures.draw([0], 640, 240)
    seconds, values = figures.all[0].line(0)
    assert (seconds[-1], values[-1]) == (end, past.apex)
    overlay, server = Overlay(), viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        overlay.build(server, past.session)
        drawn = overlay._curve(snapshot)
        panels = Panels()
        panels.build(server, past.session)
        learning = panels.panels["Learning"]
        learning.show(snapshot, Pose(past.session.model))
        early = past.curve.until(past.decision).reward
        mean = float(np.mean(early[-max(1, len(early) // 20) :]))
        assert f">{brief(mean)}<" in learning._said.content
    finally:
        server.stop()
    known = np.isfinite(values)
    line = (seconds[known], smoothed(values[known]), "var(--line)")
    assert lines_of(drawn) == (lines_of(small_plot([line], "apex (m)")) if known.sum() > 2 else [])


def test_a_tour_and_a_film_s_plot_go_by_the_moment_shown(past):
    snapshot = past.session.snapshot()
    waiting = Waiting(TourStep(text="Wait.", wait="metric", metric="apex", amount=100.0), past.session, snapshot)
    assert waiting._value(snapshot) == past.apex
    (plot,) = LiveStrip(past.session, [CURVE], 240)._present(snapshot)
    assert (plot.time[-1], plot.values[-1, 0]) == (past.curve.seconds[past.row], past.apex)


def same_as_the_run(recorded, session):
    """Whether what was recorded is what the run's trail has, decision for decision."""
    trail = session.trail()
    _, here, there = np.intersect1d(np.round(recorded.seconds / session.period), trail.decision, return_indices=True)
    assert len(here) > 50
    assert (np.diff(recorded.seconds) > 0).all()
    np.testing.assert_array_equal(recorded.motion.position[here], trail.position[there])


def test_a_recording_drops_what_the_run_has_left_however_soon_it_goes_on(hopping):
    hopping.order(Play())
    recorder, begin = MotionRecorder(hopping), hopping.snapshot().decision
    assert until(lambda: recorder.seconds > 2.0)
    resets = hopping.snapshot().reset_count
    hopping.order(Scrub(begin + 100))
    hopping.order(Push("load", (0.0, 0.0, 60.0)))
    hopping.order(Play())
    assert until(lambda: hopping.snapshot().reset_count > resets and hopping.snapshot().decision > begin + 200)
    hopping.order(Pause())
    assert until(lambda: not hopping.snapshot().playing)
    recorded = recorder.stop()
    same_as_the_run(recorded, hopping)
    assert recorded.seconds[0] <= (begin + 1) * hopping.period
    assert np.diff(recorded.seconds).max() < 1.5 * hopping.period  # nothing is missing


def test_a_replay_has_the_length_that_was_asked_for_and_a_full_one_is_told(hopping, tmp_path, monkeypatch):
    hopping.order(Play())
    recorder = ReplayRecorder(hopping, tmp_path / "short.html", longest=0.5)
    assert until(lambda: not recorder.running)
    assert recorder.seconds == pytest.approx(0.5)
    recorder.stop()
    assert recorder.replay.seconds == pytest.approx(0.5, abs=1.5 * hopping.period)
    monkeypatch.setattr(_motion_recorder, "MAX_RECORDING_SECONDS", 0.3)
    full = MotionRecorder(hopping)
    assert until(lambda: not full.running)
    with pytest.warns(UserWarning, match=r"hopper: full after 0\.3 simulated seconds, at .* record it apart"):
        found = full.stop()
    assert len(found.seconds) == round(0.3 / hopping.period)
    with pytest.raises(ValueError, match="longest = 1"):
        MotionRecorder(hopping, 1.0)


def test_a_particle_s_path_ends_where_the_moment_shows_it(hopping):
    trail, snapshot = hopping.trail(), hopping.snapshot()
    for ahead in (-3, 0):  # a picture is of a moment that the run has left since
        moment = snapshot._replace(decision=int(trail.decision[-1]) + ahead, position=np.array([[7.0, 8.0]]))
        path = path_until(trail, moment)
        assert len(path) == len(trail.decision) + ahead
        np.testing.assert_array_equal(path[-1], [7.0, 8.0])
    late = snapshot._replace(decision=int(trail.decision[-1]) + 1_000, position=np.array([[7.0, 8.0]]))
    np.testing.assert_array_equal(path_until(trail, late)[-1], [7.0, 8.0])  # of a fast run no trail reaches it
    none = Trail(*(column[:0] for column in trail))
    assert path_until(none, late).tolist() == [[7.0, 8.0]]


def test_a_plot_that_a_program_adds_to_a_film_ends_with_the_film_s_own_moment(hopping):
    overlay, snapshot = Overlay(), hopping.snapshot()
    overlay("clock", plot=lambda moment: 10 * moment.seconds)
    (item,) = overlay._items.values()
    for late in (0.1, 0.2, 0.3):  # what the page has shown
        item.follow(snapshot._replace(seconds=late))
    for seconds in (0.25, 0.4):
        (curve,) = overlay.annotations(snapshot._replace(seconds=seconds)).cards
        assert (curve.x[-1], curve.y[-1]) == (seconds, 10 * seconds)
        assert (np.diff(curve.x) > 0).all()


def test_an_axis_says_so_if_the_last_decision_sampled_is_long_past():
    assert time_before(2.0, 2.0, 0.01) == "time before now (s)"
    assert time_before(2.0, 9.0, 0.01) == "time (s) before 2.00 s of the run"


def test_a_recording_of_nothing_says_why(hopping):
    hopping.order(Pause())
    hopping.order(Reset())
    assert until(lambda: hopping.snapshot().decision == 0 and not hopping.snapshot().playing)
    with pytest.raises(ValueError, match=r"nothing recorded.*the run is paused"):
        MotionRecorder(hopping).stop()
