"""Guided tours: what a step may be, what it waits for, and what a browser shows of it."""

import re

import pytest
from page_clients import client, update
from test_page_browser import opened

from patience import until
from timsim import live
from timsim._commands.sim import prepared
from timsim.panels import TourStep, read_tour
from timsim.panels._tour import Waiting
from timsim.panels._tours import GENERIC, TOURS


@pytest.mark.parametrize(
    ("row", "told"),
    [
        ({"text": " "}, r"tour\[0\]\.text = ' ': must be 1 to 600 characters"),
        ({"text": "x", "wait": "jump"}, r"tour\[0\]\.wait"),
        ({"text": "x", "wait": "seconds"}, r"tour\[0\]\.amount = None: must be a number of seconds above 0"),
        ({"text": "x", "wait": "play", "amount": 3}, r"amount = 3.0: must be left out where the step waits for 'play'"),
        ({"text": "x", "wait": "metric", "amount": 3}, r"metric = None: must be the name of a metric"),
        ({"text": "x", "camra": "side"}, r"camra.*camera"),
        ("x", r"tour\[0\] = 'x': must be a step"),
    ],
)
def test_a_step_that_cannot_be_is_refused(row, told):
    with pytest.raises(ValueError, match=told):
        read_tour([row])


@pytest.mark.ci
def test_a_page_refuses_what_it_does_not_have(page):
    before = page.tour.steps
    good = {"text": "x"}
    for wrong, told in (
        ({"tab": "Cook"}, r"tour\[1\]: .*tab 'Cook'"),
        ({"camera": "moon"}, r"tour\[1\]: .*moon"),
        ({"wait": "metric", "metric": "apex", "amount": 1}, r"tour\[1\]: .*apex"),
        ({"wait": "push"}, r"tour\[1\]: wait = 'push': must be another: there is no body here"),
    ):
        with pytest.raises(ValueError, match=told):
            page.tour([good, {**good, **wrong}])
    assert page.tour.steps is before
    # the general tour without the steps that this page cannot take
    assert 2 <= len(before) < len(GENERIC)
    assert all(step in GENERIC for step in before)


def test_a_scene_file_has_a_tour(tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text('task.name = "chain"\n[[tour]]\ntext = "Look."\n[[tour]]\ntext = "Play."\nwait = "play"\n')
    _, options = prepared(["--config", str(scene)])
    assert read_tour(options.scene["tour"]) == (TourStep("Look."), TourStep("Play.", wait="play"))
    scene.write_text('task.name = "chain"\n[[tour]]\ntext = "Look."\nwait = "jump"\n')
    with pytest.raises(ValueError, match=r"scene\.toml: unknown tour\[0\]\.wait 'jump'"):
        prepared(["--config", str(scene)])


@pytest.mark.ci
def test_steps_wait_for_what_happens_in_a_run(page):
    session = page.session

    def waits(step):
        return Waiting(step, session, session.snapshot())

    def over(waiting):
        return until(lambda: waiting.over(session.snapshot()))

    play, edit = waits(TourStep("x", wait="play")), waits(TourStep("x", wait="edit"))
    few, long = (waits(TourStep("x", wait=kind, amount=4)) for kind in ("decisions", "seconds"))
    reward = waits(TourStep("x", wait="metric", metric="reward", amount=-1e9))
    everything = (play, edit, few, long)
    assert not any(each.open or each.over(session.snapshot()) for each in everything)
    assert waits(TourStep("x", wait="pause")).open  # it is paused already
    assert "The run is paused." in few.words(session.snapshot())
    session.order(live.Freeze())
    assert over(edit)
    session.order(live.Thaw())
    for _ in range(4):
        assert not few.over(session.snapshot())
        before = session.snapshot().decision
        session.order(live.Step())
        assert until(lambda before=before: session.snapshot().decision > before)
    assert over(few)
    session.order(live.Play())
    assert over(play)
    assert over(reward)
    session.order(live.Pause())
    assert until(lambda: not session.snapshot().playing)


def test_a_push_is_told_from_other_changes(page):
    words = ("push of (1, 0, 0) N at load for 0.1 s", "agent.decay: 0.9 → 0.8")
    push, edit = (Waiting(TourStep("x", wait=kind), page.session, page.session.snapshot()) for kind in ("push", "edit"))
    for text, true in zip(words, ((True, False), (True, True)), strict=True):
        page.session.log.append(live.Event(push._begun + 60, 0, text, "change"))
        now = page.session.snapshot()
        assert (push.over(now), edit.over(now)) == true
    page.session.log.clear()


def test_each_browser_takes_its_own_tour(page):
    page.tour([{"text": "One <b>", "tab": "Run"}, {"text": "Two", "wait": "play"}, {"text": "Three"}])
    with client(page, url=page.read_only_url) as first, client(page):  # watching is enough
        assert until(lambda: len(page.tour._guides) == 2)
        ours, other = (page.tour._guides[number] for number in sorted(page.tour._guides))
        page.tour._asked.append((ours.client.client_id, "begin"))
        assert until(lambda: ours._shown)
        assert "One &lt;b&gt;" in ours._shown
        assert "1 of 3" in ours._shown
        assert other._shown == ""
        update(first, ours.field, "1:next")
        assert until(lambda: "2 of 3" in ours._shown)
        assert "Continues when the run plays." in ours._shown
        page.session.order(live.Play())
        assert until(lambda: "3 of 3" in ours._shown)
        page.session.order(live.Pause())
        update(first, ours.field, "2:nonsense")
        update(first, ours.field, "3:back")
        assert until(lambda: "2 of 3" in ours._shown)
        update(first, ours.field, "4:end")
        assert until(lambda: ours._shown == "")
    assert until(lambda: not page.tour._guides)


def test_texts_are_short_enough_for_a_telephone():
    for steps in (GENERIC, *TOURS.values()):
        assert max(len(step.text) for step in steps) < 260


@pytest.mark.ci
def test_a_tour_on_screen(browser, page):
    page.tour([{"text": "Here it runs.", "tab": "Learning"}, {"text": "Press Play.", "tab": "Run", "wait": "play"}])
    with opened(browser) as (seen, _):
        seen.set_viewport_size({"width": 390, "height": 844})
        seen.goto(page.url)
        seen.locator("#motorgrad-cover").wait_for(state="detached")
        seen.get_by_role("tab", name="View").click()
        seen.get_by_role("button", name="Tour").click()
        card = seen.locator(".motorgrad-tour")
        card.get_by_text("1 of 2").wait_for()
        seen.get_by_role("tab", name="Learning", selected=True).wait_for()
        box = card.bounding_box()
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= 390
        seen.keyboard.press("PageDown")
        card.get_by_text("Continues when the run plays.").wait_for()
        seen.get_by_role("tab", name="Run", selected=True).wait_for()
        assert card.get_by_role("button", name=re.compile("Done")).is_visible()
        seen.get_by_role("button", name="Play").first.click()
        card.wait_for(state="detached")  # the last step is over by itself
    page.session.order(live.Pause())
