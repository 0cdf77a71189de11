"""The editor of diagrams: sessions, and the ways by which browsers and notebooks reach them.

A session holds a diagram, its history and its run; clients ask it to change them, and are told what changed: see
`_protocol`. It is loaded when first used: `import motorgrad.lab` needs none of what it is built on.
"""

from motorgrad.lab.editor._server import Server
from motorgrad.lab.editor._session import Session

__all__ = ["Server", "Session"]
