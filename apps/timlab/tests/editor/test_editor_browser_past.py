"""What was done before, in the editor in a browser: frozen units, logs, unsaved work; and the tour."""

import json
import re

from editor_page import Editor, served, sync_api, wave

import timlab
from timlab import gallery

expect = sync_api.expect


def test_single_units_are_frozen_and_thawed_while_it_plays(opened):
    editor = opened(gallery.example("motoneuron-pool"))

    def still():
        return list(editor.server.session.diagram.nodes["policy"].block.frozen)

    editor.block("policy").click()
    editor.button("Play").click()
    editor.wait(lambda: editor.tick > 0)
    editor.button("freeze unit 1").click()
    expect(editor.button("freeze unit 1")).to_have_attribute("aria-pressed", "true")
    assert still() == [False, True, False, False]
    frozen_all = editor.page.get_by_role("checkbox", name="freeze all")
    expect(frozen_all).not_to_be_checked()
    frozen_all.click()
    expect(editor.button("freeze unit 0")).to_have_attribute("aria-pressed", "true")
    editor.button("freeze unit 1").click()
    expect(editor.button("freeze unit 1")).to_have_attribute("aria-pressed", "false")
    expect(frozen_all).not_to_be_checked()
    assert still() == [True, False, True, True]
    before = editor.tick
    editor.wait(lambda: editor.tick > before)  # it has gone on all the while
    editor.button("Pause").click()
    editor.look("frozen units", panel="inspector")


def test_a_log_is_kept_and_replayed_bit_for_bit(opened, tmp_path):
    diagram = wave()
    diagram.add("delay", timlab.UnitDelay())
    diagram.connect("gain", "delay")
    editor = opened(diagram)
    for gain in ("3", "4.5"):
        editor.button("One tick").click()
        editor.block("gain").click()
        editor.field("gain").fill(gain)
        editor.field("gain").press("Enter")
    editor.button("One tick").click()
    editor.wait(lambda: editor.tick == 3)
    editor.page.get_by_role("tab", name="Log").click()
    entries = editor.page.get_by_role("list", name="log").get_by_role("listitem")
    expect(entries).to_have_count(2)
    editor.look("log", panel="inspector")
    with editor.page.expect_download() as kept:
        editor.button("Keep the log").click()
    kept.value.save_as(tmp_path / "kept.json")
    assert kept.value.suggested_filename == "main.log.json"
    replay = editor.page.get_by_label("log to replay")
    replay.set_input_files(tmp_path / "kept.json")
    editor.told("Replayed: identical bit for bit")
    log = json.loads((tmp_path / "kept.json").read_text())
    log["parts"][0]["changes"][-1]["value"] = 3.5
    (tmp_path / "other.json").write_text(json.dumps(log))
    replay.set_input_files(tmp_path / "other.json")
    editor.told("Replayed: the final state differs")
    (tmp_path / "none.json").write_text("[")
    replay.set_input_files(tmp_path / "none.json")
    editor.told("none.json: is not a log")
    editor.look("a log that is refused", panel="inspector")


def test_unsaved_work_is_offered_and_taken_up(chromium, tmp_path):
    page = chromium.new_page()
    with served(tmp_path) as server:
        editor = Editor(page, server).open(server.url)
        editor.drop("gain", 200, 150)
        editor.drop("sum", 400, 150)
    for way in ("on the empty canvas", "by the dialog"):
        with served(tmp_path) as server:
            editor = Editor(page, server).open(server.url)
            offered = page.get_by_role("region", name="unsaved work")
            expect(offered).to_contain_text(re.compile(r"\d changes?, the last on .*\d:\d\d"))
            editor.look(f"unsaved work taken up {way}")
            if way == "by the dialog":
                editor.button("Open").click()
                work = editor.dialog.get_by_role("list", name="unsaved work").get_by_role("button")
                work.click()
                expect(editor.dialog).to_have_count(0)
            else:
                offered.get_by_role("button", name=re.compile("^Take up")).click()
            expect(editor.block("gain")).to_be_visible()
            expect(editor.block("sum")).to_be_visible()
            assert editor.faults == []
    page.close()


def test_the_tour_leads_to_the_gallery(opened):
    editor = opened()
    editor.button("First steps").click()
    editor.look("first steps")
    for step in range(1, 6):
        expect(editor.dialog).to_contain_text(f"{step} of 6")
        editor.press("Enter")  # what leads on has the focus
    editor.dialog.get_by_role("button", name="Back").click()
    expect(editor.dialog).to_contain_text("5 of 6")
    editor.dialog.get_by_role("button", name="Next").click()
    editor.dialog.get_by_role("button", name="Open the gallery").click()
    expect(editor.page.get_by_role("dialog", name="Gallery")).to_be_visible()
    editor.press("Escape")
    expect(editor.dialog).to_have_count(0)
