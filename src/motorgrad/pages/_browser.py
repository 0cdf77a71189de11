"""Opening a page in the user's browser. Other users can read the arguments of a process, so that none holds a token."""

import atexit
import functools
import html
import os
import shutil
import tempfile
import webbrowser
from pathlib import Path

from motorgrad.pages._gate import Gate

REDIRECT = """<!doctype html>
<meta charset="utf-8">
<meta name="referrer" content="no-referrer">
<meta http-equiv="refresh" content="0; url={address}">
<title>motorgrad</title>
"""


def open_in_browser(gate: Gate, origin: str) -> bool:
    """Open the page behind a gate, at an `origin` such as `http://127.0.0.1:8080`, by a file that only the user can
    read, whose ticket serves once. The file is removed when the browser has come, when the page ends, and at exit.
    **Returns** whether a browser was opened."""
    folder = Path(tempfile.mkdtemp(prefix="motorgrad-"))  # its mode is 0700
    remove = functools.partial(shutil.rmtree, folder, ignore_errors=True)
    atexit.register(remove)
    file = folder / "open.html"
    address = f"{origin}/{gate.ticket(remove)}/"
    with os.fdopen(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8") as stream:
        stream.write(REDIRECT.format(address=html.escape(address)))
    opened = webbrowser.open(file.as_uri())
    if not opened:
        gate.end_tickets()
    return opened
