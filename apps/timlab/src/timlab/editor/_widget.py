"""The editor in a notebook cell: anywidget carries the same messages as the WebSocket."""

import json
import queue
import sys
import threading
from collections.abc import Callable
from typing import Any

import anywidget

from timlab.diagram import Diagram
from timlab.editor._protocol import event_text
from timlab.editor._session import Session
from timlab.editor._static import NOT_BUILT, STATIC

BUILT = STATIC / "widget.js", STATIC / "widget.css"
_NOT_BUILT = f"export default {{ render({{ el }}) {{ el.textContent = {json.dumps(NOT_BUILT)}; }} }}"


class Editor(anywidget.AnyWidget):
    """A session in a notebook; several cells may show the same one.

    `diagram` is a copy of the current diagram.
    """

    _end: Callable[[], None] | None = None
    _esm = BUILT[0] if BUILT[0].exists() else _NOT_BUILT
    _css = BUILT[1] if BUILT[1].exists() else ""

    def __init__(self, session: Session):
        super().__init__()
        self.session = session
        self._events: queue.SimpleQueue[dict[str, Any] | None] = queue.SimpleQueue()
        self._end = session.listen(self._events.put)
        self.on_msg(self._receive)
        marimo = sys.modules.get("marimo")  # whose own threads alone may talk to a notebook
        kind = marimo.Thread if marimo is not None and marimo.running_in_notebook() else threading.Thread
        kind(target=self._send_events, name="motorgrad-lab-widget", daemon=True).start()

    @property
    def diagram(self) -> Diagram:
        """A copy of the current diagram."""
        return self.session.diagram

    def close(self) -> None:
        """End the session and empty the cell. Unsaved work is offered to the next session."""
        if self._end is not None:
            self._end()
            self.session.close()
            self._end = None
            self._events.put(None)
        super().close()

    def _send_events(self) -> None:
        """Send events in order, from any thread."""
        while (event := self._events.get()) is not None:
            self.send(event_text(event))

    def _receive(self, widget: anywidget.AnyWidget, content: object, buffers: object) -> None:
        if isinstance(content, str):
            self.session.handle(content, self._events.put)
