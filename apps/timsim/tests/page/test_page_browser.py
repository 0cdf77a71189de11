"""The gated page in a real browser: shown to its owner and in a notebook, closed to pages of others, deaf to markup."""

import contextlib
import html
import http.server
import io
import os
import re
import signal
import threading
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import motorgrad as mg
import timsim
from patience import PATIENCE, until
from pictured import Lamp
from timsim import live


@contextlib.contextmanager
def opened(browser):
    """An empty page of a browser that has been nowhere, and what it asked the network for."""
    context = browser.new_context(viewport={"width": 900, "height": 900})
    page, asked, faults = context.new_page(), [], []
    page.set_default_timeout(1000 * PATIENCE)  # WebGL in software leaves a page little time for anything else
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: faults.append(str(error)))
    try:
        yield page, asked
    finally:
        context.close()
    assert faults == []


@contextlib.contextmanager
def site(text):
    """Another server on this machine with one page; its address at localhost is of another site."""

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.end_headers()
            self.wfile.write(text.encode())
            heard.append(dict(self.headers))

        def log_message(self, *_):
            pass

    heard = []
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield server.server_port, heard
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def shown(place):
    place.get_by_text("simulated time", exact=True).wait_for()


def as_a_demanding_user(seen, page):
    """Tabs in one row, a name on every input of the page, Escape for dialogs, and the overlay over the picture."""
    tabs = seen.get_by_role("tab").all()
    assert len({round(tab.bounding_box()["y"]) for tab in tabs}) == 1
    unnamed = """() => [...document.querySelectorAll("[role=tabpanel] :is(input:not([type=hidden]), [role=slider])")]
      .filter(each => !each.getAttribute("aria-label") && !(each.labels && each.labels.length)).length"""
    assert until(lambda: seen.evaluate(unnamed) == 0)
    seen.keyboard.press("Shift+?")
    seen.get_by_role("dialog").wait_for()
    seen.keyboard.press("Escape")
    seen.get_by_role("dialog").wait_for(state="detached")
    page.overlay("note", text="<b>from</b> Python")
    overlay = seen.locator(".motorgrad-overlay")
    overlay.get_by_text("<b>from</b> Python", exact=True).wait_for()
    box, canvas = overlay.bounding_box(), seen.locator("canvas").first.bounding_box()
    assert box == canvas
    page.overlay("note")


@pytest.mark.journey
def test_the_owner_sees_the_page_and_no_token_in_its_address(browser, page):
    token = page._gate.token
    with opened(browser) as (seen, asked):
        seen.goto(page.url)
        assert seen.locator("#motorgrad-cover").get_by_text("chain", exact=True).is_visible()  # at once
        shown(seen)
        assert token not in seen.url
        seen.locator("#motorgrad-cover").wait_for(state="detached")
        # rendered in software: a coarser picture, and no notice before it
        assert "fixedDpr" in seen.url
        assert seen.get_by_text("Software WebGL").count() == 0
        seen.reload()
        shown(seen)
        assert token not in seen.url
        as_a_demanding_user(seen, page)
        assert token not in seen.evaluate("document.cookie + JSON.stringify(localStorage)")  # no script may read it
        ours = tuple(f"{kind}127.0.0.1:{page.server.get_port()}/" for kind in ("http://", "blob:http://"))
        assert [url for url in asked if not url.startswith((*ours, "data:"))] == []
        # another server on this machine, to which browsers send the cookies of every port
        with site("hello") as (port, heard):
            seen.goto(f"http://127.0.0.1:{port}/")
            assert token not in str(heard)


def test_the_page_opens_at_once_and_says_what_is_done_and_what_went_wrong(browser):
    """A worker that stands still before it is ready, and then is killed."""
    page = timsim.view("chain", wait=False)
    try:
        os.kill(page.session._process.pid, signal.SIGSTOP)
        with opened(browser) as (seen, _):
            seen.goto(page.url)
            cover = seen.locator("#motorgrad-cover")
            cover.get_by_text("starting a process for the simulation").wait_for()
            assert cover.bounding_box() == {"x": 0, "y": 0, "width": 900, "height": 900}  # over viser's empty page
            os.kill(page.session._process.pid, signal.SIGKILL)
            with pytest.raises(RuntimeError, match="chain: the simulation did not start"):
                page.ready()
            cover.get_by_text("could not start: chain: the simulation did not start").wait_for()
    finally:
        page.close()


def on_screen(page, seen, point):
    """Where a point of the world `(3,)` is in the browser's window, in pixels."""
    (client,) = page.server.get_clients().values()
    camera, box = client.camera, seen.locator("canvas").first.bounding_box()
    w, x, y, z = np.array(camera.wxyz) * (1, -1, -1, -1)  # from the world to the camera, whose z is forwards
    away = np.subtract(point, camera.position)
    away = away + 2 * w * np.cross((x, y, z), away) + 2 * np.cross((x, y, z), np.cross((x, y, z), away))
    across, down = away[:2] / away[2] / np.tan(camera.fov / 2) * box["height"] / 2
    return box["x"] + box["width"] / 2 + across, box["y"] + box["height"] / 2 + down


def orange(seen):
    """The number of pixels of the picture that have the colour of a chosen part."""
    picture = np.asarray(Image.open(io.BytesIO(seen.screenshot())).convert("RGB")).astype(int)
    red, green, blue = picture[..., 0], picture[..., 1], picture[..., 2]
    return int(np.sum((red > 110) & (red - blue > 70) & (np.abs(green - 0.68 * red) < 0.17 * red)))


@pytest.mark.slow
@pytest.mark.ci
def test_a_part_that_is_clicked_is_shown_and_can_be_edited(browser):
    with timsim.view(Path(__file__).parents[1] / "leg.xml", playing=False) as page, opened(browser) as (seen, _):
        seen.goto(page.url)
        seen.locator("#motorgrad-cover").wait_for(state="detached")
        trunk = page.session.model.body("trunk").id
        assert until(lambda: page._pose.bodies and page.server.get_clients())
        seen.wait_for_timeout(500)  # until the camera stands still
        before, panel = orange(seen), page.panels.panels["Body"]

        def clicked():
            seen.mouse.click(
                *on_screen(page, seen, page._pose.bodies[0].geom_xpos[page.session.model.body_geomadr[trunk]])
            )
            return until(lambda: panel.chosen == trunk, 3.0)

        assert until(clicked)
        tab = seen.get_by_role("tab", name="Body")
        assert until(lambda: tab.get_attribute("aria-selected") == "true")
        seen.locator("tr", has_text="mass").get_by_text("kg, ").wait_for()
        seen.mouse.move(5, 400)  # what the pointer is on is marked
        assert until(lambda: orange(seen) > before + 200)
        chosen = orange(seen)
        mass = seen.get_by_label("mass (kg)", exact=True)
        mass.fill("7.5")
        mass.press("Enter")
        assert until(lambda: page.session.settings["body.trunk.mass"] == 7.5)
        seen.locator("tr", has_text="mass").get_by_text("7.50 kg, ").wait_for()
        sizes = [name for name in page.session.settings if name.startswith(("body.trunk.radius", "body.trunk.half"))]
        for name in sizes:
            page.session.order(live.Edit(name, 1.6 * page.session.settings[name]))
        assert until(lambda: orange(seen) > 1.5 * chosen)  # drawn anew, though the run stands still
        for _ in sizes:
            page.session.order(live.Undo())
        assert until(lambda: orange(seen) < 1.2 * chosen)
        assert page.failures == 0


@pytest.mark.slow
@pytest.mark.ci
def test_a_notebook_at_another_address_shows_the_page_below_its_cell(browser, page):
    with site(f"<p>In [1]:</p>{page._repr_html_()}") as (port, _), opened(browser) as (seen, _):
        seen.goto(f"http://localhost:{port}/")
        shown(seen.frames[1])
        assert page._gate.token not in seen.url


@pytest.mark.slow
@pytest.mark.ci
def test_pages_of_others_reach_nothing_in_a_browser_that_has_been_let_in(browser, page):
    """By a socket, by fetching, in a frame, and by a link that names their own server."""
    port, place = page.server.get_port(), page._gate.place
    attack = """async ([port, path]) => {
      const tried = [];
      for (const host of ["localhost", "127.0.0.1"]) {
        tried.push(await new Promise(done => {
          const socket = new WebSocket(`ws://${host}:${port}${path}`);
          socket.onopen = () => done("open"); socket.onerror = () => done("refused");
        }));
        tried.push(await fetch(`http://${host}:${port}${path}`, {credentials: "include"}).then(
          answer => answer.text().then(text => text.includes("Viser") ? "open" : "refused"), () => "refused"));
      }
      return tried;
    }"""
    with opened(browser) as (seen, _), site("evil") as (other, heard):
        seen.goto(page.url)
        shown(seen)
        for path in ("/", f"/{place}", f"/{place}/"):
            for host in ("localhost", "127.0.0.1"):
                seen.goto(f"http://{host}:{other}/")
                assert seen.evaluate(attack, [port, path]) == ["refused"] * 4, (path, host)
        framed = f"http://127.0.0.1:{port}/{place}/"
        seen.set_content(f'<iframe src="{framed}"></iframe>')
        seen.wait_for_timeout(500)
        assert all("Viser" not in frame.content() for frame in seen.frames[1:])
        visits = len(heard)
        seen.goto(f"{framed}?websocket=ws://localhost:{other}/")
        shown(seen)
        assert f"localhost:{other}" not in seen.url
        assert len(heard) == visits


MARKUP = "<img src=x onerror=window.pwned=1>{}<script>window.pwned=1</script>"


def spoilt_model(folder):
    """The file of a leg whose every name is markup, its own included."""
    text = (Path(__file__).parents[1] / "leg.xml").read_text()
    for number, name in enumerate(sorted(set(re.findall(r'name="([^"]+)"', text)))):
        text = text.replace(f'"{name}"', f'"{html.escape(MARKUP.format(number))}"')
    file = folder / "<img src=x onerror=window.pwned=1>.xml"
    file.write_text(text)
    return file


@pytest.mark.slow
@pytest.mark.ci
def test_names_with_markup_are_shown_as_they_are(browser, tmp_path):
    with timsim.view(spoilt_model(tmp_path), playing=False) as page, opened(browser) as (seen, asked):
        model = page.session.model
        names = [model.body(1).name, model.actuator(0).name, model.joint(0).name]
        assert all("onerror" in name for name in names)
        seen.goto(page.url)
        assert until(lambda: page.server.get_clients())
        page.session.order(live.Step(3))
        shown(seen)
        for tab in ("Muscles", "Capture", "View", "Run"):
            seen.get_by_text(tab, exact=True).first.dispatch_event("click")
            seen.wait_for_timeout(500)
        page.session.order(live.Push(names[0], (1.0, 0.0, 0.0)))
        assert until(lambda: page.session.log)
        seen.wait_for_timeout(500)
        assert "onerror" in seen.content()
        assert seen.evaluate("window.pwned") is None
        assert seen.locator("img[onerror], script:text('pwned')").count() == 0
        assert not any(url.endswith("/x") for url in asked)
        assert page.failures == 0


@pytest.mark.slow
@pytest.mark.ci
def test_an_environment_s_picture_stands_upright_on_screen(browser):
    """Its red corner above on the left, its blue one below on the right; and who watches sees no button."""
    with timsim.view(mg.tasks.from_gymnasium(Lamp), playing=False) as page, opened(browser) as (seen, _):
        seen.goto(page.read_only_url)
        seen.locator("#motorgrad-cover").wait_for(state="detached")

        def corner(channel):
            picture = np.asarray(Image.open(io.BytesIO(seen.screenshot())).convert("RGB")).astype(int)
            rest = picture.sum(axis=2) - picture[..., channel]
            rows, columns = np.nonzero((picture[..., channel] > 120) & (rest < 120))
            return (np.mean(columns), np.mean(rows)) if len(rows) > 30 else None

        assert until(lambda: corner(0) is not None and corner(2) is not None)
        (left, above), (right, below) = corner(0), corner(2)
        assert left < right - 50
        assert above < below - 50
        seen.get_by_text("watching only").wait_for()
        seen.get_by_text("simulated time", exact=True).wait_for()
        assert seen.get_by_role("button", name="Play").count() == 0
        assert page.failures == 0
