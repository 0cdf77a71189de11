"""The diagram editor: sessions, and how browsers and notebooks connect to them.

A session holds a diagram, its history and its run. Clients send operations and receive events; see `_protocol`. The
editor is imported on first use: `import timlab` loads none of what it depends on.
"""

from timlab.editor._server import Server
from timlab.editor._session import Session
from timlab.editor._static import NOT_BUILT

__all__ = ["NOT_BUILT", "Server", "Session"]
