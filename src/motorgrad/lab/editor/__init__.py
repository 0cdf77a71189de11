"""The diagram editor: sessions, and how browsers and notebooks connect to them.

A session holds a diagram, its history and its run. Clients send operations and receive events; see `_protocol`. The
editor is imported on first use: `import motorgrad.lab` needs none of its dependencies.
"""

# ruff: noqa: E402
from motorgrad._extras import require as _require

for _package in ("starlette", "uvicorn", "platformdirs"):
    _require("TimLab's editor needs", _package, "lab")  # before anything imports it

from motorgrad.lab.editor._server import Server
from motorgrad.lab.editor._session import Session
from motorgrad.lab.editor._static import NOT_BUILT

__all__ = ["NOT_BUILT", "Server", "Session"]
