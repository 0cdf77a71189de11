"""The documentation site builds without a warning, and says what the library's docstrings say."""

import importlib
import os
import subprocess
import sys
from inspect import ismodule
from pathlib import Path

import pytest

import motorgrad
import needed
from timlab import BLOCKS, parameters_of
from tools.block_pages import slug

pytestmark = [pytest.mark.slow, pytest.mark.ci, pytest.mark.needs("motorgrad[docs]")]

FOUND = {  # a page among the first that a search names
    "neural network": "own-network.html",
    "continuous actions": "policies.html#continuous-actions",
    "GPU": "performance.html",
    "export": "export.html",
}
ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", folder]
    done = subprocess.run(
        command, cwd=ROOT, env=os.environ | {"NO_MKDOCS_2_WARNING": "1"}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return folder


def test_every_page_is_there(site):
    for page in (ROOT / "docs").rglob("*.md"):
        assert (site / page.relative_to(ROOT / "docs").with_suffix(".html")).exists()
    for notebook in (ROOT / "docs").rglob("*.ipynb"):
        assert (site / notebook.relative_to(ROOT / "docs").with_suffix(".html")).exists()


def test_the_api_has_every_public_name(site):
    package = ROOT / "src" / "motorgrad"
    rooms = [room for room in motorgrad.__all__ if (package / room / "__init__.py").exists()]
    missing = []
    for name in (*(f"motorgrad.{room}" for room in rooms), "timsim", "timlab", "motorgrad_thesis"):
        page = (site / "api" / f"{name.removeprefix('motorgrad.')}.html").read_text(encoding="utf-8")
        module = importlib.import_module(name)
        public = [each for each in module.__all__ if not ismodule(getattr(module, each))]  # a module has its own page
        missing += [f"{name}.{each}" for each in public if f'id="{name}.{each}"' not in page]
    assert not missing


def test_every_block_has_a_page_with_its_parameters(site):
    pages = {path.stem: path.read_text(encoding="utf-8") for path in (site / "lab" / "blocks").glob("*.html")}
    for name, kind in BLOCKS.items():
        page = pages[slug(name)]
        assert all(f"<code>{parameter}</code>" in page for parameter in parameters_of(kind)), name
        assert f">{name}</a>" in pages["index"]


def test_formulas_are_drawn_without_a_script(site):
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert 'class="arithmatex"' not in text, page
    assert "<math" in (site / "concepts.html").read_text(encoding="utf-8")


def test_nothing_is_fetched_from_elsewhere(site):
    text = (site / "index.html").read_text(encoding="utf-8")
    assert 'src="http' not in text
    assert "fonts.g" not in text


@pytest.mark.needs("chromium")
def test_search_works_from_the_disk_and_fetches_nothing(site):
    from playwright import sync_api

    asked, faults = [], []
    with sync_api.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=str(needed.CHROMIUM), args=["--no-sandbox"])
        page = browser.new_page()
        page.on("request", lambda request: asked.append(request.url))
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.goto((site / "how-to" / "sweep.html").as_uri())
        for wanted, found in FOUND.items():
            field = page.locator("input.md-search__input")
            field.fill(wanted)
            field.press("End")  # the page listens to keys
            addresses = page.locator(".md-search-result__link").evaluate_all
            sync_api.expect(page.locator(f'.md-search-result__link[href*="{found}"]').first).to_be_attached(
                timeout=30_000
            )
            assert any(found in address for address in addresses("links => links.slice(0, 8).map(link => link.href)"))
        browser.close()
    assert not faults
    assert all(url.startswith(("file:", "data:", "about:")) for url in asked)


def test_the_api_starts_with_what_most_people_need(site):
    text = (site / "api" / "index.html").read_text(encoding="utf-8")
    for name in ("motorgrad.training.train", "motorgrad.learning.Agent", "timsim.write_film", "timlab.Diagram"):
        assert f'#{name}"' in text
