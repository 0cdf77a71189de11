"""The editor in cells of JupyterLab and marimo."""

import contextlib
import json
import os
import socket
import subprocess
import sys
import time

import pytest
from editor_page import Editor, needs_pages, sync_api

import needed

CELL = """import timlab
diagram = timlab.Diagram()
diagram.add("sine", timlab.Sine())
diagram.add("scope", timlab.Scope())
diagram.connect("sine", "scope")
editor = timlab.edit(diagram)
editor"""
START = 600_000  # milliseconds: a kernel starts and imports JAX

pytestmark = [pytest.mark.slow, pytest.mark.needs("chromium")]


@contextlib.contextmanager
def started(command, folder):
    """A server of notebooks, on the port that it is told."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    process = subprocess.Popen(
        [sys.executable, "-m", *command, str(port)],
        cwd=folder,
        env={**os.environ, "JUPYTER_CONFIG_DIR": str(folder / "config"), "XDG_STATE_HOME": str(folder / "states")},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.STDOUT,
    )
    try:
        for _ in range(3000):
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 1):
                break
            time.sleep(0.2)
        yield f"http://127.0.0.1:{port}"
    finally:
        process.terminate()
        process.wait(600)


def driven(url, begin):
    """Open a notebook, and use the editor in it."""
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(needed.CHROMIUM), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1360, "height": 900})
        editor = Editor(page)
        page.goto(url)
        begin(page)
        sync_api.expect(editor.wire("sine.y", "scope.u")).to_be_attached(timeout=START)
        editor.block("sine").click()
        editor.page.get_by_role("textbox", name="amplitude").fill("2")
        editor.press("Enter")
        editor.play_until(20)
        editor.block("sine").click()
        editor.press("Delete")
        sync_api.expect(editor.block("sine")).to_have_count(0)
        editor.button("Undo").click()
        sync_api.expect(editor.wire("sine.y", "scope.u")).to_be_attached()
        sync_api.expect(editor.page.get_by_text("amplitude 2")).to_be_visible()
        browser.close()


def test_in_marimo(tmp_path):
    needs_pages()
    pytest.importorskip("marimo", reason="needs marimo")
    body = "\n".join(f"    {line}" for line in CELL.splitlines())
    (tmp_path / "notebook.py").write_text(
        f"import marimo\n\napp = marimo.App(width='full')\n\n\n@app.cell\ndef _():\n{body}\n    return\n"
    )
    command = ["marimo", "run", "notebook.py", "--headless", "--no-token", "--host", "127.0.0.1", "--port"]
    with started(command, tmp_path) as url:
        driven(url, lambda page: None)


def test_in_jupyterlab(tmp_path):
    needs_pages()
    pytest.importorskip("jupyterlab", reason="needs jupyterlab")
    cell = {"cell_type": "code", "id": "a", "metadata": {}, "execution_count": None, "outputs": [], "source": CELL}
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    notebook = {"cells": [cell], "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}
    (tmp_path / "notebook.ipynb").write_text(json.dumps(notebook))

    def begin(page):
        page.get_by_text("editor = lab").wait_for(timeout=START)
        page.locator(".jp-Notebook-ExecutionIndicator[data-status='idle']").wait_for(timeout=START)
        page.locator(".jp-Cell .cm-content").first.click()
        page.keyboard.press("Shift+Enter")

    options = ["--no-browser", "--allow-root", "--ip=127.0.0.1", "--IdentityProvider.token="]
    with started(["jupyterlab", *options, "--port"], tmp_path) as url:
        driven(f"{url}/lab/tree/notebook.ipynb", begin)
