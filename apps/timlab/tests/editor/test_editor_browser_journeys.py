"""What people do with the editor, each from beginning to end in a real browser, and how it looks on the way."""

import csv
import random
import re

import pytest
from editor_page import WAIT, Editor, served, sync_api, wave

import timlab
from timlab.diagram import from_a_file
from timlab.diagram._faces import face_of
from timlab.editor import Server, Session

expect = sync_api.expect


def wired(diagram: timlab.Diagram, *wires: tuple[str, str]) -> timlab.Diagram:
    for source, target in wires:
        diagram.connect(source, target)
    return diagram


def falling() -> timlab.Diagram:
    """A ramp that falls below 0, where its root is NaN; and a filter that is faster than the tick."""
    diagram = timlab.Diagram(0.01)
    diagram.add("ramp", timlab.Ramp(-1.0, initial=0.055))
    diagram.add("root", timlab.Function("sqrt"))
    diagram.add("scope", timlab.Scope())
    diagram.add("fast", timlab.Lag(0.004))
    return wired(diagram, ("ramp", "root"), ("root", "scope"), ("ramp", "fast"))


def test_nan_is_seen_with_where_it_began_and_a_fast_filter_is_warned_of(opened):
    editor = opened(falling())
    warning = editor.block("fast").get_by_label(re.compile("problem: is faster than the tick"))
    expect(warning).to_have_class(re.compile("warning"), timeout=WAIT)
    editor.button("Play").click()
    began = "becomes NaN at tick 6 (0.06 s). It begins here: its input u = -0.005"
    editor.told(f"root.y: {began}")
    expect(editor.button("Play")).to_be_visible()
    editor.wait(lambda: editor.tick == 6)  # it stops there
    expect(editor.block("root").locator(".block")).to_have_class(re.compile("faulty"))
    expect(editor.block("ramp").locator(".block")).not_to_have_class(re.compile("faulty"))
    editor.page.get_by_role("tab", name="Problems").click()
    problems = editor.page.get_by_role("list", name="problems")
    expect(problems).to_contain_text(began)
    expect(problems).to_contain_text("Warning. is faster than the tick")
    editor.look("NaN and a warning", panel="inspector")


def test_a_diagram_goes_on_after_a_fault_where_its_form_says_so(opened):
    editor = opened(falling())
    form = editor.page.get_by_role("form", name="form of the diagram")
    expect(form.get_by_label("on_fault")).to_have_value("stop")
    form.get_by_label("on_fault").select_option("warn")
    editor.play_until(30)  # it would stop at tick 6
    editor.told("root.y: becomes NaN at tick 6")
    plot = editor.scope("scope").locator(".u-over")
    end = 0.25 / 10 * plot.bounding_box()["width"]  # at 0.25 s of the ten that are shown
    plot.hover(position={"x": end, "y": 20})
    expect(editor.page.get_by_label("cursor of scope")).to_contain_text("root –")  # a gap


def faces() -> timlab.Diagram:
    diagram = timlab.Diagram(0.01)
    diagram.add("wanted", timlab.Step())
    diagram.add("error", timlab.Sum("+-"))
    diagram.add("speed", timlab.Gain(-2.5))
    diagram.add("level", timlab.Integrator())
    diagram.add("power", timlab.Expression("-0.5*v^2", ("v",)))
    diagram.add("scope", timlab.Scope(("level", "power")))
    return wired(
        diagram,
        ("wanted", "error.u1"),
        ("level", "error.u2"),
        ("error", "speed"),
        ("speed", "level"),
        ("level", "power.v"),
        ("level", "scope.level"),
        ("power", "scope.power"),
    )


CROSSED = """() => {
  const boxes = [...document.querySelectorAll('.react-flow__node')].map((n) => n.getBoundingClientRect());
  const found = [];
  for (const path of document.querySelectorAll('.react-flow__edge-path')) {
    const length = path.getTotalLength(), matrix = path.getScreenCTM();
    for (let at = 0; at <= length; at += 4) {
      const { x, y } = path.getPointAtLength(at).matrixTransform(matrix);
      if (boxes.some((b) => x > b.left + 3 && x < b.right - 3 && y > b.top + 3 && y < b.bottom - 3))
        found.push([path.closest('.react-flow__edge').dataset.id, at]);
    }
  }
  return found;
}"""


def test_blocks_have_faces_and_wires_go_round_them(opened):
    editor = opened(faces())
    expect(editor.block("speed").locator(".triangle .inside")).to_have_text("−2.5")
    expect(editor.block("error").locator(".port-name.sign")).to_have_text(["+", "−"])
    expect(editor.block("power")).to_contain_text("−0.5·v^2")
    assert editor.page.locator(".block .block-icon").count() == 5  # all but the gain
    for name in faces().nodes:  # as pictures without an editor draw them
        assert editor.block(name).evaluate("block => block.offsetWidth") == face_of(faces(), name).width, name
    assert editor.page.evaluate(CROSSED) == []
    assert editor.page.locator(".wire .joint").count() >= 2  # the level goes to three blocks
    editor.press("p")
    expect(editor.block("scope").locator(".picture canvas")).to_be_visible()
    editor.play_until(20)
    assert editor.page.evaluate(CROSSED) == []
    editor.look("faces and pictures of blocks")


def vehicle() -> timlab.Diagram:
    """A subsystem behind a gate, whose signal of three numbers has a name."""
    inner = timlab.Diagram()
    blocks = {"go": timlab.Enable(), "u": timlab.Inlet(), "weight": timlab.Gain(2.0), "named": timlab.Goto("pull")}
    for name, block in {**blocks, "again": timlab.From("pull"), "y": timlab.Outlet()}.items():
        inner.add(name, block)
    diagram = timlab.Diagram(0.01)
    diagram.add("three", timlab.Constant((1.0, 2.0, 3.0), (3,)))
    diagram.add("vehicle", wired(inner, ("u", "weight"), ("weight", "named"), ("again", "y")))
    diagram.add("scope", timlab.Scope())
    return wired(diagram, ("vehicle.y", "scope"))


def test_a_subsystem_gets_parameters_and_wires_say_their_shapes(opened):
    editor = opened(vehicle())
    page, session = editor.page, editor.server.session
    editor.drag(editor.port("output", "y", "three"), editor.port("input", "u", "vehicle"))  # of another shape
    expect(editor.block("vehicle")).to_contain_text("y[3]")
    expect(editor.block("scope").locator(".port-name").first).to_contain_text("[3]")
    editor.block("vehicle").dblclick()
    expect(editor.block("named")).to_contain_text("[pull]")
    editor.block("weight").click()
    page.get_by_text("Parameters of the subsystem").click()
    page.get_by_label("gain comes from").select_option("a new parameter")
    expect(editor.block("weight").locator(".inside")).to_have_text("gain")
    editor.press("Control+d")  # a copy uses it too
    expect(editor.block("weight 2").locator(".inside")).to_have_text("gain")
    page.locator(".react-flow__pane").click(position={"x": 5, "y": 5})
    page.get_by_label("name of parameter gain").fill("mass")
    page.get_by_label("name of parameter gain").press("Enter")
    expect(editor.block("weight 2").locator(".inside")).to_have_text("mass")
    editor.look("within a subsystem", panel="inspector")
    editor.press("u")
    editor.block("vehicle").click()
    editor.field("mass").fill("4")
    editor.field("mass").press("Enter")
    editor.wait(lambda: session.diagram.nodes["vehicle"].block.parameters == {"mass": 4.0})
    editor.look("shapes at ports, and a parameter of a subsystem", panel="inspector")
    assert session.diagram.nodes["vehicle"].block.uses == {"weight.gain": "mass", "weight 2.gain": "mass"}


def test_code_that_a_file_brings_is_read_before_it_runs(opened, tmp_path):
    with from_a_file(trust=False):
        source = "def step(u, memory, time): return 7 * u  # theirs\n"
        strange = timlab.Diagram(0.01)
        strange.add("one", timlab.Constant(1.0))
        strange.add("theirs", timlab.PythonFunction(source))
        strange.add("scope", timlab.Scope())
    timlab.save(wired(strange, ("one", "theirs"), ("theirs", "scope")), tmp_path / "strange.json")
    editor = opened()
    editor.press("Control+o")
    editor.dialog.get_by_text("strange.json").click()
    brought = editor.page.get_by_role("region", name="code of the diagram")
    expect(brought).to_contain_text("The diagram brings code of its own (theirs). Nothing of it was run.", timeout=WAIT)
    editor.look("a diagram that brings code")
    brought.get_by_role("button", name="Read it").click()
    expect(editor.dialog).to_contain_text(source.strip())
    assert editor.dialog.locator("pre").evaluate("code => code.scrollWidth <= code.clientWidth")  # nothing is hidden
    editor.look("code to be read")
    editor.dialog.get_by_role("button", name="Trust and run").click()
    editor.wait(lambda: editor.tick > 2)
    expect(brought).to_have_count(0)
    # what is dropped on the page can be read, and does not run
    text = (tmp_path / "strange.json").read_text().replace("7 * u", "8 * u")
    editor.press("Control+o")
    editor.page.get_by_label("file to open").set_input_files(
        [{"name": "dropped.json", "mimeType": "application/json", "buffer": text.encode()}]
    )
    brought.get_by_role("button", name="Read it").click()
    expect(editor.dialog).to_contain_text("return 8 * u")
    expect(editor.dialog).to_contain_text("motorgrad lab FILE --trust")
    expect(editor.dialog.get_by_role("button", name="Trust and run")).to_have_count(0)


def hundreds(count: int = 200) -> timlab.Diagram:
    """Blocks that each read from some of the dozen before them."""
    chance, names, diagram = random.Random(1), ["source"], timlab.Diagram(0.01)
    diagram.add("source", timlab.Sine())
    for number in range(1, count):
        name, before = f"block {number}", [chance.choice(names[-12:]) for _ in range(2)]
        two = number % 2
        diagram.add(name, timlab.Sum("+-") if two else timlab.Gain(0.5))
        for port, source in zip(("u1", "u2") if two else ("u",), before, strict=False):
            diagram.connect(source, f"{name}.{port}")
        names.append(name)
    return diagram


def test_two_hundred_blocks_lie_in_layers_and_all_are_shown(opened):
    editor = opened(hundreds())
    session = editor.server.session
    editor.press("l")
    editor.wait(lambda: len(session.diagram.layout.get("positions", {})) == 200)
    places = session.diagram.layout["positions"]
    forward = [places[source][0] < places[target][0] for (target, _), (source, _) in session.diagram.wires.items()]
    assert all(forward)  # from left to right, layer by layer
    editor.press("f")
    inside = """() => { const pane = document.querySelector('.react-flow').getBoundingClientRect();
      return [...document.querySelectorAll('.react-flow__node')].filter((n) => { const b = n.getBoundingClientRect();
        return b.left >= pane.left && b.right <= pane.right && b.top >= pane.top && b.bottom <= pane.bottom;
      }).length }"""
    editor.wait(lambda: editor.page.evaluate(inside) == 200)
    editor.look("two hundred blocks", axe=False)  # which would take long, and they are like others


def test_a_diagram_of_the_gallery_learns_as_fast_as_possible_when_played(opened):
    editor = opened()
    editor.press("g")
    editor.dialog.get_by_role("button", name="Open Motoneuron pool").click()
    expect(editor.page.get_by_label("speed")).to_have_value("null")
    editor.play_until(5_000)  # ticks of a second each
    editor.press("g")
    others = editor.dialog.get_by_role("region", name="Dynamics and control").get_by_role("button")
    expect(others).to_have_count(5)
    expect(editor.dialog.locator(".card .thumbnail")).to_have_count(len(timlab.GALLERY))
    editor.look("gallery")
    editor.dialog.get_by_role("button", name="Open Lorenz attractor").click()
    expect(editor.page.get_by_label("speed")).to_have_value("1")
    editor.button("One tick").click()
    editor.wait(lambda: editor.tick == 1)
    expect(editor.page.get_by_label("speed")).to_have_value("1")  # which a tick leaves alone
    editor.look("a diagram of the gallery")
    with editor.page.expect_download() as download:
        editor.button("Keep over time as SVG").click()
    numbers = re.findall(r">(1\.0\d+)</text>", download.value.path().read_text())
    assert len(set(numbers)) == len(numbers) > 2  # between 1 and 1.001: as many digits as tell one from the other


def test_a_formula_and_its_inputs_are_edited_as_one(opened):
    diagram = wave()
    diagram.add("law", timlab.Expression("u", ("u",)))
    diagram.connect("gain", "law.u")
    editor = opened(diagram)
    session = editor.server.session
    editor.block("law").click()
    editor.field("expression").fill("k * max(u, v) + 1e-3 * t")
    editor.field("expression").press("Enter")
    expect(editor.port("input", "v", "law")).to_be_attached()
    editor.page.get_by_label("k is").select_option("constant")
    editor.field("k").fill("2.5")
    editor.field("k").press("Enter")
    editor.wait(lambda: session.diagram.nodes["law"].block.numbers == (2.5,))
    law = session.diagram.nodes["law"].block
    assert (law.reads, law.constants) == (("u", "v"), ("k",))
    assert session.diagram.wires["law", "u"] == ("gain", "y")  # what stays keeps its wire
    editor.look("a formula", panel="inspector")
    editor.field("expression").fill("k * v")
    editor.field("expression").press("Enter")
    expect(editor.port("input", "u", "law")).to_have_count(0)
    editor.press("Escape")
    editor.field("expression").fill("k * (v")
    editor.field("expression").press("Enter")
    editor.told("column 7")
    editor.look("a formula with a mistake", panel="inspector")


def test_shift_adds_quick_add_is_empty_and_nothing_is_told_twice(opened):
    editor = opened(wave())
    editor.block("sine").click()
    editor.block("scope").click(modifiers=["Shift"])
    expect(editor.page.get_by_text("2 blocks", exact=True)).to_be_visible()
    gain = editor.block("gain").bounding_box()
    mouse = editor.page.mouse
    editor.page.keyboard.down("Shift")
    mouse.move(gain["x"] - 10, gain["y"] - 20)
    mouse.down()
    mouse.move(gain["x"] + gain["width"] + 5, gain["y"] + gain["height"] + 10, steps=5)
    mouse.up()
    editor.page.keyboard.up("Shift")
    expect(editor.page.get_by_text("3 blocks", exact=True)).to_be_visible()
    editor.look("three blocks selected", panel="inspector")
    editor.press("/")
    search = editor.page.get_by_role("searchbox", name="Search blocks")
    search.fill("lag")
    editor.look("palette sought", widths=[1440])
    editor.page.locator(".react-flow__pane").click(position={"x": 40, "y": 400})  # nothing is selected any more
    editor.block("gain").click()
    editor.press("/")
    expect(search).to_have_value("")
    editor.press("Escape")
    for _ in range(3):
        editor.block("gain").click()
        editor.press("Alt+ArrowLeft")  # one block cannot be aligned
    expect(editor.page.get_by_role("log", name="messages").get_by_role("alert")).to_have_count(1)


def test_play_keeps_its_word_after_the_seeds_change(opened):
    editor = opened(wave())
    editor.button("One tick").click()
    editor.wait(lambda: editor.tick == 1)
    editor.page.get_by_role("textbox", name="seeds").fill("5")
    editor.button("Play").click()  # which leaves the field first
    editor.wait(lambda: len(editor.server.session._runner.status["seeds"]) == 5 and editor.tick > 5)
    editor.page.get_by_role("textbox", name="seeds").fill("3")
    editor.page.get_by_role("textbox", name="seeds").press("Enter")
    editor.wait(lambda: len(editor.server.session._runner.status["seeds"]) == 3)
    editor.wait(lambda: editor.tick > 5)  # it goes on
    editor.button("Pause").click()
    editor.look("several seeds")


def test_saving_shows_and_work_is_recovered_under_its_last_name(chromium, tmp_path):
    page = chromium.new_page()
    with served(tmp_path) as server:
        editor = Editor(page, server).open(server.url)
        editor.drop("gain", 200, 150)
        page.locator(".react-flow__pane").click(position={"x": 300, "y": 400})
        editor.field("title").fill("An arm")
        editor.field("title").press("Enter")
        editor.press("Escape")
        editor.press("Control+s")
        editor.dialog.get_by_label("file name").fill("arm")
        editor.press("Enter")
        editor.told("Saved as arm.json")
        state = page.get_by_label("state of the file")
        expect(state).to_have_text("arm.json, saved")
        editor.field("title").fill("A longer arm")
        editor.field("title").press("Enter")
        expect(state).to_have_text("arm.json, changed")
    session = Session(file=tmp_path / "arm.json", states=tmp_path / "states")
    server = Server(session)
    server.start()
    try:
        page.goto(server.url)
        page.get_by_role("button", name="Open", exact=True).click()
        work = page.get_by_role("list", name="unsaved work")
        expect(work).to_contain_text("A longer arm")
        again = Editor(page)
        again.look("open, and unsaved work")
        assert again.faults == []
        work.get_by_role("button").click()
        expect(page.get_by_label("state of the file")).to_have_text("arm.json, changed")
        expect(page.locator(".title strong")).to_have_text("A longer arm")
    finally:
        server.stop()
        session.close()
        page.close()


def test_a_scope_is_read_by_cursor_and_kept_as_numbers_and_pictures(opened, tmp_path):
    diagram = wave()
    diagram.replace("scope", timlab.Scope(unit="m"))
    editor = opened(diagram)
    editor.play_until(200)
    scope = editor.scope("scope")
    plot = scope.locator(".u-over")
    wide = plot.bounding_box()["width"]
    plot.click(position={"x": 0.05 * wide, "y": 30})  # a mark at 0.5 s
    plot.hover(position={"x": 0.15 * wide, "y": 30})
    expect(editor.page.get_by_label("cursor of scope")).to_have_text(
        re.compile(r"t 1\.\d+ s \(Δ (1|0\.9|1\.0)\d*\).*gain .*\(Δ .*\)")
    )

    editor.look("cursor of a scope")

    def kept(button, name):
        with editor.page.expect_download() as download:
            button()
        download.value.save_as(tmp_path / name)
        return (tmp_path / name).read_bytes()

    def keep(kind):
        return kept(scope.get_by_role("button", name=f"Keep scope as {kind}").click, f"scope.{kind.lower()}")

    rows = list(csv.reader(keep("CSV").decode().splitlines()))
    assert rows[0] == ["time (s)", "gain"]
    table = {float(time): float(value) for time, value in rows[1:]}
    record = timlab.Run(diagram).advance(200)
    exact = dict(zip(record.times("scope.u").round(6), record["scope.u"][0], strict=True))
    assert len(table) >= 100
    for time, value in table.items():
        if time in exact:
            assert value == pytest.approx(exact[time], abs=1e-4)
    assert keep("PNG").startswith(b"\x89PNG")
    picture = keep("SVG").decode()
    assert "time (s)" in picture
    assert "gain (m)" in picture

    def command(label):
        editor.press("Control+k")
        editor.page.keyboard.type(label)
        editor.press("Enter")

    drawing = kept(lambda: command("Download as SVG"), "diagram.svg").decode()
    assert all(f">{name}</text>" in drawing for name in diagram.nodes)
    shown = editor.page.context.new_page()
    shown.goto((tmp_path / "diagram.svg").as_uri())
    expect(shown.locator("svg path").first).to_be_attached()
    shown.close()


@pytest.mark.journey
def test_a_diagram_is_one_page_with_its_run_that_anyone_opens(chromium, tmp_path):
    diagram = wave()
    (tmp_path / "wave.html").write_text(timlab.to_html(diagram, timlab.Run(diagram).advance(500)), encoding="utf-8")
    page, asked = chromium.new_page(), []
    page.on("request", lambda request: asked.append(request.url))
    editor = Editor(page)
    page.goto((tmp_path / "wave.html").as_uri())
    expect(editor.block("gain")).to_be_visible(timeout=WAIT)
    assert editor.tick == 500
    page.get_by_role("slider", name="time travel").fill("120")
    editor.wait(lambda: editor.tick == 120)
    expect(editor.scope("scope").locator("canvas")).to_be_visible()
    editor.play_until(130)
    editor.block("gain").click()
    editor.field("gain").fill("3")
    editor.field("gain").press("Enter")
    editor.told("This page is a recording")
    editor.look("a page with its run")
    assert editor.faults == []
    assert [url for url in asked if url.startswith("http")] == []
    page.close()


def test_the_editor_makes_the_same_page_from_its_own_run(opened, tmp_path):
    editor = opened(wave())
    editor.play_until(50)
    with editor.page.expect_download() as download:
        editor.press("Control+k")
        editor.page.keyboard.type("as a page")
        editor.press("Enter")
    download.value.save_as(tmp_path / "run.html")
    tick, page = editor.tick, editor.page.context.new_page()
    page.goto((tmp_path / "run.html").as_uri())
    other = Editor(page)
    expect(other.block("gain")).to_be_visible(timeout=WAIT)
    assert other.tick == tick
    assert other.faults == []
    page.close()
