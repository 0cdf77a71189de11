"""The panels in a browser: what is pressed and typed there happens in the run."""

import io
from pathlib import Path

import numpy as np
import pytest
from panel_studio import studio
from PIL import Image

from patience import PATIENCE, until
from timsim.scene import Scene

SMALL = {"width": 320, "height": 240}
# a press without waiting until the page stands still, which it may not for long
PRESS = """element => {
  for (const kind of ["pointerdown", "mousedown", "pointerup", "mouseup", "click"]) {
    const Kind = kind.startsWith("pointer") ? PointerEvent : MouseEvent;
    element.dispatchEvent(new Kind(kind, {bubbles: true, button: 0, pointerId: 1, isPrimary: true}));
  }
}"""


@pytest.fixture(scope="module")
def seen(browser, hopping):
    """A hopper's page in a browser, without the scene, which is another room's matter."""
    with studio(hopping) as place:
        page = browser.new_page(viewport={"width": 900, "height": 1000}, accept_downloads=True)
        page.set_default_timeout(1000 * PATIENCE)  # WebGL in software leaves a page little time for anything else
        page.faults = []
        page.on("pageerror", lambda error: page.faults.append(str(error)))
        page.goto(place.url)
        page.get_by_text("simulated time", exact=True).wait_for()
        yield page
        page.close()
    assert page.faults == []


def press(page, words):
    page.get_by_text(words, exact=True).first.evaluate(PRESS)


def press_button(page, words):
    page.get_by_role("button", name=words, exact=True).first.evaluate(PRESS)


def beside(page, label):
    """The input that stands beside a label; of a slider its number."""
    return page.get_by_text(label, exact=True).locator("xpath=ancestor::*[.//input][1]").locator("input").last


def write(page, label, text):
    """Type, and wait until the server must have heard of it: the page gathers what is typed for a moment."""
    place = beside(page, label)
    place.fill(text)
    page.wait_for_timeout(300)
    return place


def told(page, words):
    """Whether a notification says so, in one line."""
    page.locator(".mantine-Notification-root", has_text=words).first.wait_for()


@pytest.mark.journey
def test_the_page_shows_the_run_and_follows_it(seen, hopping):
    for title in ("Run", "Learning", "Muscles", "Policy", "Capture"):
        assert seen.get_by_text(title, exact=True).count() > 0
    count = seen.locator("tr", has_text="decisions").locator("td").nth(1)
    before = int(count.inner_text().replace(",", ""))
    assert until(lambda: int(count.inner_text().replace(",", "")) > before)


def test_pause_step_and_play(seen, hopping):
    press(seen, "Run")
    press_button(seen, "Pause")
    assert until(lambda: not hopping.snapshot().playing)
    before = hopping.snapshot().decision
    press_button(seen, "Step")
    assert until(lambda: hopping.snapshot().decision == before + 1)
    assert not hopping.snapshot().playing
    seen.locator("tr", has_text="state").get_by_text("paused").wait_for()
    press_button(seen, "Play")
    assert until(lambda: hopping.snapshot().playing and hopping.snapshot().decision > before + 1)


def test_keys_play_and_pause(seen, hopping):
    seen.locator("canvas").first.focus()
    seen.keyboard.press("Space")
    assert until(lambda: not hopping.snapshot().playing)
    before = hopping.snapshot().decision
    seen.keyboard.press("n")
    assert until(lambda: hopping.snapshot().decision == before + 1)
    seen.keyboard.press("Space")
    assert until(lambda: hopping.snapshot().playing)


@pytest.mark.journey
def test_scrub_back_and_continue(seen, hopping):
    press(seen, "Run")
    assert until(lambda: hopping.snapshot().newest - hopping.snapshot().oldest > 200)  # more than there is to go back
    press_button(seen, "Pause")
    assert until(lambda: not hopping.snapshot().playing)
    newest = hopping.snapshot().newest

    def went_back():  # again, if what the run had sent before it paused comes in between
        write(seen, "To (s)", "-1")
        return hopping.snapshot().decision == newest - 100  # decisions of ten milliseconds each

    assert until(went_back)
    back = hopping.snapshot()
    assert not back.playing
    assert back.newest == newest
    press_button(seen, "Continue from here")
    assert until(lambda: hopping.snapshot().playing and hopping.snapshot().decision > back.decision + 20)


def test_push(seen, hopping):
    from timsim.live import Scrub

    press(seen, "Run")
    press_button(seen, "Pause")
    assert until(lambda: not hopping.snapshot().playing)
    press_button(seen, "Step")
    assert until(lambda: not hopping.snapshot().playing)
    begin = hopping.snapshot().decision
    write(seen, "Force (N)", "200")
    heights = []
    for pushed in (False, True):
        hopping.order(Scrub(begin))
        assert until(lambda: hopping.snapshot().decision == begin)
        if pushed:
            press_button(seen, "Push")  # orders arrive in the order in which they are given
        for ahead in range(1, 6):
            press_button(seen, "Step")
            assert until(lambda ahead=ahead: hopping.snapshot().decision == begin + ahead)
        heights.append(hopping.snapshot().position[0])
    assert np.abs(heights[1] - heights[0]).max() > 1e-3  # with the same learner, and the same random numbers
    press_button(seen, "Play")
    assert until(lambda: hopping.snapshot().playing)


@pytest.mark.journey
def test_settings_are_edited_by_enter_and_nonsense_is_told(seen, hopping):
    press(seen, "Learning")
    rate = beside(seen, "learning rate")
    rate.fill("1.5e-4")
    rate.press("Enter")
    assert until(lambda: hopping.settings["agent.optimizer.learning_rate"] == pytest.approx(1.5e-4))
    assert until(lambda: rate.input_value() == "0.00015")  # as the run has it
    rate.fill("quick")
    rate.press("Enter")
    told(seen, "must be a number")
    assert until(lambda: rate.input_value() == "0.00015")
    assert hopping.settings["agent.optimizer.learning_rate"] == pytest.approx(1.5e-4)
    rate.fill("-1")
    rate.press("Enter")
    told(seen, "agent.optimizer.learning_rate")
    assert until(lambda: rate.input_value() == "0.00015")


def test_freeze_and_thaw(seen, hopping):
    press(seen, "Learning")
    press_button(seen, "Freeze")
    assert until(lambda: hopping.snapshot().frozen)
    frozen = hopping.snapshot()
    assert until(lambda: hopping.snapshot().decision > frozen.decision + 20)
    np.testing.assert_array_equal(hopping.snapshot().parameters, frozen.parameters)
    press_button(seen, "Thaw")
    assert until(lambda: not hopping.snapshot().frozen)
    assert until(lambda: np.any(hopping.snapshot().parameters != frozen.parameters))


def test_save_and_load(seen, hopping, tmp_path, monkeypatch):
    monkeypatch.setattr(hopping, "folders", [tmp_path])
    press(seen, "Learning")
    write(seen, "File", str(tmp_path / "good.npz"))
    press_button(seen, "Save")
    assert until((tmp_path / "good.npz").exists)
    told(seen, "good.npz")
    press_button(seen, "Load")
    seen.locator(".mantine-Notification-root", has_text="Loaded").first.wait_for()
    write(seen, "File", str(tmp_path / "missing.npz"))
    press_button(seen, "Load")
    told(seen, "missing.npz")
    write(seen, "File", "policy.txt")
    press_button(seen, "Save")
    told(seen, "a file ending in .npz")
    write(seen, "File", "../elsewhere.npz")
    press_button(seen, "Save")
    told(seen, f"must be within {tmp_path}")
    (tmp_path / "empty.npz").touch()
    write(seen, "File", "empty.npz")
    press_button(seen, "Load")
    told(seen, "empty.npz: not a saved policy")
    assert not hopping.ended


def test_before_and_after(seen, hopping):
    press(seen, "Learning")
    seen.get_by_role("checkbox").first.evaluate("element => element.click()")
    assert until(lambda: len(hopping.snapshot().position) == 2)
    seen.get_by_role("checkbox").first.evaluate("element => element.click()")
    assert until(lambda: len(hopping.snapshot().position) == 1)


@pytest.mark.parametrize("title", ["Run", "Learning", "Muscles", "Policy"])
def test_the_numbers_of_each_panel_can_be_had(seen, title):
    press(seen, title)
    with seen.expect_download() as download:
        shown = seen.get_by_role("button", name="Download numbers (CSV)")
        next(one for one in shown.all() if one.is_visible()).evaluate(PRESS)
    content = Path(download.value.path()).read_text().splitlines()
    assert download.value.suggested_filename == f"hopper-{title.lower()}.csv"
    assert content[0].startswith("decision,seconds,")
    assert len(content) > 3


def test_diagrams_are_drawn(seen):
    press(seen, "Muscles")
    seen.locator('svg[aria-label="activation of the muscles over time"]').wait_for()
    seen.locator('svg[aria-label="force against length and against velocity"]').wait_for()
    press(seen, "Policy")
    seen.locator('svg[aria-label="weights from observations to units"]').wait_for()
    seen.locator('svg[aria-label="phase portrait"]').wait_for()
    assert seen.get_by_text("foot contact").count() > 0


@pytest.mark.slow
def test_capture_a_picture_and_the_scene(browser, hopping, tmp_path):
    with studio(hopping, Scene()) as place:
        page = browser.new_page(viewport=SMALL, accept_downloads=True)
        page.set_default_timeout(1000 * PATIENCE)
        page.goto(place.url)
        page.get_by_text("Capture", exact=True).first.wait_for()
        press(page, "Capture")
        press_button(page, "Record scene (HTML)")
        page.get_by_role("button", name="Stop scene").wait_for()
        page.wait_for_timeout(1500)
        with page.expect_download() as download:
            press_button(page, "Stop scene")
        download.value.save_as(tmp_path / "scene.html")
        assert download.value.suggested_filename.startswith("hopper-")
        with page.expect_download() as download:
            press_button(page, "Snapshot (PNG)")
        picture = np.asarray(Image.open(io.BytesIO(Path(download.value.path()).read_bytes())))
        assert picture.shape[2] == 3
        assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 50
        page.close()
    # opened when the server is no more
    alone, faults = browser.new_page(viewport=SMALL), []
    alone.set_default_timeout(1000 * PATIENCE)
    alone.on("pageerror", lambda error: faults.append(str(error)))
    requests = []
    alone.on("request", lambda request: requests.append(request.url))
    alone.goto((tmp_path / "scene.html").as_uri())
    alone.locator("canvas").first.wait_for()
    alone.wait_for_timeout(2000)
    alone.screenshot(path=tmp_path / "scene.png")
    assert faults == []
    assert [url for url in requests if url.startswith(("http", "ws"))] == []
    assert len(np.unique(np.asarray(Image.open(tmp_path / "scene.png").convert("RGB")).reshape(-1, 3), axis=0)) > 50
    alone.close()
