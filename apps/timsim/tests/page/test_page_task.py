"""A page of a body alone becomes that of a learner: what is observed and rewarded is chosen there, and it learns."""

import dataclasses
from pathlib import Path

import pytest

import motorgrad as mg
import timsim
from patience import PATIENCE, until
from timsim import live

LEG = Path(__file__).parents[1] / "leg.xml"
PRESS = """element => {
  for (const kind of ["pointerdown", "mousedown", "pointerup", "mouseup", "click"]) {
    const Kind = kind.startsWith("pointer") ? PointerEvent : MouseEvent;
    element.dispatchEvent(new Kind(kind, {bubbles: true, button: 0, pointerId: 1, isPrimary: true}));
  }
}"""


def press(place, words):
    place.get_by_text(words, exact=True).first.evaluate(PRESS)


def press_button(place, words):
    shown = place.get_by_role("button", name=words, exact=True)
    next(each for each in shown.all() if each.is_visible()).evaluate(PRESS)


def write(place, label, text):
    place.get_by_label(label, exact=True).first.fill(text)
    place.wait_for_timeout(300)  # the page gathers what is typed for a moment


def choose(place, label, option):
    place.get_by_label(label, exact=True).first.click()
    place.get_by_role("option", name=option, exact=True).click()


@pytest.mark.ci
def test_senses_and_reward_are_chosen_on_the_page_and_it_learns(browser, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with timsim.view(str(LEG), speed=float("inf")) as page:
        bare = page.session
        seen = browser.new_context(viewport={"width": 1280, "height": 900}).new_page()
        seen.set_default_timeout(1000 * PATIENCE)
        faults = []
        seen.on("pageerror", lambda error: faults.append(str(error)))
        seen.goto(page.url)
        seen.get_by_text("simulated time", exact=True).wait_for()
        press(seen, "Task")
        choose(seen, "Goal", "reach a place")
        seen.get_by_text("preset 'sac', because its actions are real numbers and it has a goal").wait_for()
        choose(seen, "Add to observe", "muscle-lengths")
        choose(seen, "Add to reward", "alive")

        write(seen, "Muscles", "nothing*")  # what is wrong is told in its place, and the page stays
        press_button(seen, "Learn")
        seen.get_by_text("unknown actuator 'nothing*'").wait_for()
        assert page.session is bare

        write(seen, "Muscles", "*")
        write(seen, "Save as", "leg.toml")
        press_button(seen, "Save as TOML")
        seen.get_by_text("motorgrad train leg.toml").wait_for()
        saved = mg.tasks.load(tmp_path / "leg.toml")
        assert [type(term).__name__ for term in saved.rewards] == ["Distance", "Closeness", "Effort", "Alive"]
        assert "MuscleLengths" in [type(term).__name__ for term in saved.observations]

        press_button(seen, "Learn")
        assert until(lambda: page.session is not bare)
        assert until(lambda: bare.ended)
        learner = page.session
        assert learner.task == saved  # the page and its file describe the same task
        seen.locator("tr", has_text="reward, lately").wait_for()  # its tab is in front
        assert until(lambda: len(learner.curve().reward) > 2)
        assert learner.snapshot().decision > 100
        assert learner.snapshot().marks.shape == (1, 4)  # the place to reach is marked
        assert page.failures == 0
        assert faults == []


@pytest.mark.ci
def test_edits_of_the_body_go_with_it():
    with live.Session(live.setup_of(LEG), playing=False) as first:
        name = next(each for each in first.settings if each.endswith(".mass"))
        first.order(live.Edit(name, 2 * first.started[name]))
        assert until(lambda: first.settings[name] != first.started[name])
        setup = dataclasses.replace(first.setup, name="again")
        second = live.succeed(first, setup)
        try:
            assert first.successor is second
            assert until(lambda: second.settings[name] == first.settings[name])
        finally:
            second.close()
