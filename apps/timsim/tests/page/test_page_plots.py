"""The page and the strip of plots: figures of one's choice, behind the same gate, on screen in a browser."""

import io
import json
from pathlib import Path

import numpy as np
import pytest
from page_clients import get
from PIL import Image
from test_page_browser import opened

import timsim
from motorgrad.pages import COOKIE
from patience import until
from timsim import live
from timsim.panels import Figures
from timsim.panels._figures import POINTS, thinned

LEG = Path(__file__).parents[1] / "leg.xml"


def known(page):
    return {"Cookie": f"{COOKIE}={page._gate.token}"}


@pytest.mark.ci
def test_figures_are_listed_and_drawn_behind_the_gate(page):
    place, cookie = f"/{page._gate.place}/plots", known(page)
    for path in (place, f"{place}/list", f"{place}/figures/400x200/0"):
        assert get(page, path)[0] == 403
    status, headers, text = get(page, place, **cookie)
    assert (status, headers["content-type"]) == (200, "text/html; charset=utf-8")
    assert "frame-ancestors 'none'" in headers["content-security-policy"]
    assert page.plots_url.endswith(place)
    about = json.loads(get(page, f"{place}/list", **cookie)[2])
    names = [figure["name"] for figure in about["figures"]]
    assert about["title"] == "chain"
    assert "reward of each decision" in names
    found = json.loads(get(page, f"{place}/figures/400x200/0,1", **cookie)[2])
    assert set(found["drawn"]) == {"0", "1"}
    assert 'width="400" height="200"' in found["drawn"]["0"]
    assert [body["label"] for body in found["bodies"]] == ["learning"]
    for wrong, says in (
        ("figures/400x200/999", "figure = 999: must be from 0 to"),
        ("figures/9x200/0", "width = 9: must be from 120 to 4000"),
        ("figures/400x200/" + ",".join(["0"] * 30), "number of figures = 30: must be at most 24"),
    ):
        status, _, text = get(page, f"{place}/{wrong}", **cookie)
        assert (status, says in text) == (400, True), text
    for wrong in ("figures/axb/0", "figures/400x200/../../x", "other"):
        assert get(page, f"{place}/{wrong}", **cookie)[0] == 404


def test_a_thinned_line_keeps_its_extremes():
    x = np.arange(20_000.0)
    y = np.sin(x / 50)
    y[7_777], y[12_345] = 5.0, -4.0
    few = thinned(x, y)
    assert len(few[0]) <= 2 * POINTS
    assert few[1].max() == 5.0
    assert few[1].min() == -4.0
    assert np.all(np.diff(few[0]) > 0)


def coloured(picture, colour, close=40):
    """The number of pixels of about a colour."""
    wanted = np.array([*bytes.fromhex(colour[1:])], int)
    return int(np.sum(np.abs(picture.astype(int) - wanted).max(axis=-1) < close))


def seen_picture(seen, clip=None):
    return np.asarray(Image.open(io.BytesIO(seen.screenshot(clip=clip))).convert("RGB"))


@pytest.mark.slow
@pytest.mark.ci
def test_two_branches_stand_beside_each_other_and_share_their_plots(browser):
    """In the scene the second body is tinted; below it, and in a window of their own, the plots have a line of each."""
    with timsim.view(LEG, playing=False) as page, opened(browser) as (seen, _):
        session = page.session
        session.order(live.Step(200))
        assert until(lambda: session.snapshot().decision == 200)
        session.order(live.Fork(decision=100))
        session.order(live.Control(0, 1.0))
        session.order(live.Step(100))
        assert until(lambda: session.snapshot().decision == 200 and len(session.branches) == 2)
        seen.goto(page.url)
        seen.locator("#motorgrad-cover").wait_for(state="detached")
        seen.get_by_text("from A at", exact=False).first.wait_for()
        scene = seen.locator("canvas").first.bounding_box()

        def tinted():
            picture = seen_picture(seen, scene).astype(int)
            red, green, blue = picture[..., 0], picture[..., 1], picture[..., 2]
            return int(np.sum((red - blue > 55) & (red > 110) & (green < red - 20)))

        before = tinted()
        session.order(live.Alongside("A"))
        assert until(lambda: session.snapshot().labels == ("B", "A"))
        assert until(lambda: tinted() > before + 150)
        seen.get_by_role("button", name="Plots", exact=True).click()
        strip = seen.get_by_role("region", name="Plots")
        strip.locator("svg polyline").nth(1).wait_for(state="attached")
        assert strip.locator("figure").first.bounding_box()["height"] > 120
        assert strip.bounding_box()["y"] >= scene["y"] + seen.locator("canvas").first.bounding_box()["height"] - 2
        assert strip.locator(".bodies span").all_inner_texts() == ["B", "A"]
        clip = strip.bounding_box()
        assert until(lambda: coloured(seen_picture(seen, clip), "#d9730d") > 40)
        strip.get_by_role("button", name="Close").click()
        assert until(lambda: seen.locator("canvas").first.bounding_box()["height"] == scene["height"])
        for wide, high in ((1280, 720), (390, 844)):
            seen.set_viewport_size({"width": wide, "height": high})
            seen.goto(page.plots_url)
            seen.locator("figure svg").first.wait_for()
            box = seen.locator("figure svg").first.bounding_box()
            assert box["width"] > (390 if wide > 400 else 340)
            assert seen.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
            assert until(lambda: coloured(seen_picture(seen), "#d9730d") > 40)
        seen.get_by_role("button", name="Choose").click()
        seen.get_by_label("Search the plots").fill("control")
        names = [figure.name for figure in Figures(session).all if "control" in figure.name]
        assert seen.locator(".list label:visible").count() == len(names)
        seen.get_by_text(names[0], exact=True).click()
        seen.locator(f'svg[aria-label="{names[0]}"]').wait_for()
        session.order(live.Alongside(None))
        assert until(lambda: coloured(seen_picture(seen), "#d9730d") < 10)
        assert page.failures == 0
