"""A browser for the tests of the editor, loaded with the first test that asks for it, which skips aloud without one."""

import contextlib

import pytest

import needed


@pytest.fixture(scope="module")
def chromium():
    from editor_page import needs_pages, sync_api

    needs_pages()
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(needed.CHROMIUM), args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture
def opened(chromium, tmp_path):
    """A page on a diagram: `opened(diagram)`."""
    from editor_page import WAIT, Editor, served

    with contextlib.ExitStack() as stack:
        used = []

        def open(diagram=None, before=lambda page: None):
            server = stack.enter_context(served(tmp_path, diagram))
            context = chromium.new_context(viewport={"width": 1360, "height": 860})
            stack.callback(context.close)
            context.set_default_timeout(WAIT)
            page = context.new_page()
            before(page)
            editor = Editor(page, server).open(server.url)
            used.append(editor)
            return editor

        yield open
        faults = [fault for editor in used for fault in editor.faults]
        assert not faults, "\n".join(faults)
