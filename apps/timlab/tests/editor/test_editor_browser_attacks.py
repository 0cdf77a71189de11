"""The page under attack: markup in all that people name, signals that are NaN, a compilation without end."""

from editor_page import sync_api, wave
from test_lab_editor_faults import RELEASED, Slow, chain

import timlab

expect = sync_api.expect
NAMES = [
    "<img src=x onerror=hit=1>",
    "<svg onload=hit=1>",
    "<script>hit=1<!--",
    "{{constructor['constructor']('hit=1')()}}",
    "'\"><b onmouseover=hit=1 autofocus onfocus=hit=1>",
    "javascript:hit=1",
]
TEXTS = [
    *NAMES,
    "<script>hit=1</script>",
    "</title></style></textarea><img src=x onerror=hit=1>",
    "[a](javascript:hit=1)",
]


def marked() -> timlab.Diagram:
    """A diagram in which everything that people name is markup."""
    diagram = timlab.Diagram(0.01, title=TEXTS[7], comment=TEXTS[6])
    for name in NAMES:
        inner = timlab.Diagram(title=name, comment=name)
        inner.add(NAMES[0], timlab.Inlet(0.0))
        inner.add(NAMES[2], timlab.Outlet())
        inner.connect(f"{NAMES[0]}.y", f"{NAMES[2]}.u")
        diagram.add(name, inner)
    diagram.add("sine", timlab.Sine())
    diagram.add("scope", timlab.Scope(("a",)))
    diagram.connect("sine", "scope.a")
    diagram.connect("sine", f"{NAMES[0]}.{NAMES[0]}")
    comments = {str(n): {"text": text, "box": [40, 300 + 60 * n, 200, 40]} for n, text in enumerate(TEXTS)}
    diagram.layout = {"comments": comments, "positions": {}}
    return diagram


def test_markup_is_shown_as_text_and_never_runs(opened):
    editor = opened(marked())
    page = editor.page
    page.on("dialog", lambda dialog: editor.faults.append(dialog.message))

    def unhurt() -> None:
        assert page.evaluate("window.hit") is None
        for tag in ("img", "script[src='']", "b[onmouseover]", "svg[onload]"):
            assert page.locator(f"body {tag}").count() == 0

    for name in NAMES:
        expect(editor.block(name)).to_be_attached()
    unhurt()
    editor.button("Play").click()
    editor.wait(lambda: editor.tick > 3)
    editor.button("Pause").click()
    page.get_by_role("tab", name="Problems").click()  # unconnected inlets are listed by name
    page.get_by_role("tab", name="Form").click()
    unhurt()
    for name in NAMES[:3]:  # the form of a block, its subsystem, the way back
        editor.block(name).click()
        expect(editor.field("name")).to_have_value(name)
        editor.press("Enter")
        expect(editor.block(NAMES[2])).to_be_attached()
        unhurt()
        page.get_by_role("navigation").get_by_role("button").first.click()
        expect(editor.block("sine")).to_be_attached()
    editor.press("Control+f")
    page.keyboard.type("<")
    unhurt()
    editor.press("Escape")
    editor.server.session._emit({"event": "error", "message": TEXTS[6]})
    editor.told(TEXTS[6])
    unhurt()
    editor.press("Control+k")
    page.keyboard.type("Python")
    editor.press("Enter")
    expect(editor.dialog).to_contain_text(NAMES[0])
    unhurt()
    editor.press("Escape")


def test_the_python_text_of_a_diagram_with_markup_builds_it_again():
    scope: dict = {}
    diagram = marked()
    diagram.title = "'''\n\"\"\"; import os; os.abort() #"
    exec(timlab.to_python(diagram), scope)
    assert scope["diagram"] == diagram


def test_nan_is_named_in_the_page_where_the_run_goes_on(opened):
    diagram = timlab.Diagram(0.01, on_fault="warn")
    for name, block in {
        "ramp": timlab.Ramp(-1.0, initial=0.3),
        "root": timlab.Function("sqrt"),
        "scope": timlab.Scope(),
    }.items():
        diagram.add(name, block)
    diagram.connect("ramp", "root")
    diagram.connect("root", "scope")
    editor = opened(diagram)
    editor.play_until(60)
    editor.page.get_by_role("tab", name="Problems").click()
    expect(editor.page.get_by_role("list", name="problems")).to_contain_text("root.y")
    expect(editor.page.get_by_role("list", name="problems")).to_contain_text("becomes NaN at tick 31 (0.31 s)")
    expect(editor.page.get_by_text("No problems")).to_have_count(0)
    editor.told("root.y: becomes NaN at tick 31")


def test_no_line_is_drawn_where_a_signal_was_nan(opened):
    """From 0.2 s to 0.8 s there is no signal, and no line from its one end to the other."""
    diagram = timlab.Diagram(0.05, on_fault="warn")
    formula = "if((t < 0.2) + (t > 0.8) > 0, 1, sqrt(0 - 1))"
    diagram.add("source", timlab.Expression(formula, ()))
    diagram.add("scope", timlab.Scope(limits=(0.0, 2.0), window=1.0))
    diagram.connect("source", "scope")
    editor = opened(diagram)
    for _ in range(20):  # tick by tick, because a slow page pauses late and the window moves on
        editor.button("One tick").click()
    editor.wait(lambda: editor.tick == 20)
    assert _inked(editor) == [True, False, True]


def _inked(editor) -> list[bool]:
    """Whether the scope has a coloured line in the first, the middle and the last fifth."""
    editor.page.wait_for_timeout(300)
    return editor.page.evaluate(
        """() => {
        const canvas = document.querySelector("[aria-label='scope scope'] canvas");
        const { width, height } = canvas, data = canvas.getContext("2d").getImageData(0, 0, width, height).data;
        const left = 56 * devicePixelRatio, inner = width - left - 10;
        const coloured = (from, to) => {
          for (let x = Math.round(left + from * inner); x < left + to * inner; x += 1)
            for (let y = 0; y < height - 30; y += 1) {
              const i = 4 * (y * width + x), [r, g, b] = data.slice(i, i + 3);
              if (data[i + 3] > 100 && Math.max(r, g, b) - Math.min(r, g, b) > 60) return true;
            }
          return false;
        };
        return [coloured(0.02, 0.15), coloured(0.3, 0.7), coloured(0.9, 0.97)];
      }"""
    )


def test_a_healthy_scope_has_a_line_everywhere(opened):
    diagram = wave()
    diagram.replace("scope", timlab.Scope(limits=(-3.0, 3.0), window=1.0))
    editor = opened(diagram)
    editor.play_until(99)
    assert _inked(editor) == [True, True, True]


def test_a_compilation_is_stopped_from_the_page(opened):
    block = Slow()
    editor = opened(chain(block, timlab.Scope()))
    editor.button("Play").click()
    expect(editor.page.get_by_role("status").get_by_text("compiling")).to_be_visible()
    editor.block("scope").click()  # the page answers meanwhile
    expect(editor.field("name")).to_have_value("scope")
    editor.button("Pause").click()
    editor.told("compilation stopped after")
    expect(editor.button("Play")).to_be_visible()
    RELEASED[block.number].set()
    editor.button("One tick").click()
    editor.wait(lambda: editor.tick == 1)
